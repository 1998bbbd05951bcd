"""Measures other tools on the same path, each in its own environment: `make bench-peers`."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

import selfmotion as sm

HERE = Path(__file__).parent
OUT = HERE.parent.parent / "out" / "peers"
# Each in an environment of its own: placo and Drake want other versions of what we use.
PEERS = {
    "placo_tracker.py": ["placo==0.10.2"],
    "drake_whole_path.py": ["drake==1.51.1"],
}


def main() -> int:
    """Run ours and every peer, one after the other, on one machine."""
    OUT.mkdir(parents=True, exist_ok=True)
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.Waypoints.from_csv(HERE.parent / "data" / "panda__1cube" / "path.csv")
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    given = OUT / "given.json"
    given.write_text(json.dumps({"start": start.tolist(), "urdf": robot.urdf.source}))
    default = ours(robot, path, start, sm.RefinedNullMotion(), "default")
    coarse = ours(robot, path, start, sm.BSplineNullMotion(24), "24 intervals, cubic")
    fine = ours(robot, path, start, sm.BSplineNullMotion(120, degree=1), "120 intervals, linear")
    finest = ours(robot, path, start, sm.BSplineNullMotion(256), "256 intervals, cubic")
    rows = [default, coarse, fine, finest]
    for program, packages in PEERS.items():
        python = environment(program.split("_")[0], packages)
        command = [str(python), str(HERE / program), str(given)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.stderr.write(done.stderr)
            return done.returncode
        rows += [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    (OUT / "peers.json").write_text(json.dumps(rows, indent=1))
    table = Table(box=box.SIMPLE_HEAD, title="200 waypoints, Panda, obstacles ignored, same start")
    for name in ("tool", "settings", "time", "cost", "position error", "rotation error"):
        table.add_column(name, justify="left" if name in ("tool", "settings") else "right")
    for row in rows:
        table.add_row(
            row["name"],
            row["settings"],
            f"{row['seconds'] * 1e3:.0f} ms",
            f"{row['cost']:.4f}",
            f"{row['position_error'] * 1e3:.1e} mm",
            f"{np.degrees(row['rotation_error']):.1e}°",
        )
    Console().print(table)
    return 0


def ours(
    robot: sm.RobotModel,
    path: sm.Waypoints,
    start: np.ndarray,
    null_motion: sm.NullMotion,
    settings: str,
) -> dict[str, object]:
    """Plan to convergence and measure as the peers are measured."""
    problem = sm.Problem(robot, path, start=start, null_motion=null_motion)
    sm.plan(problem)
    seconds = []
    for _ in range(3):
        began = time.perf_counter()
        plan = sm.plan(problem)
        seconds.append(time.perf_counter() - began)
    t = path.waypoint_times
    steps = np.diff(plan.trajectory(t), axis=0)
    return {
        "name": "selfmotion",
        "settings": f"{settings}, converged, certified between waypoints",
        "seconds": min(seconds),
        "cost": float(np.sum(0.5 * np.sum(steps**2, axis=1) / np.diff(t))),
        "position_error": plan.certificate.position_error.value,
        "rotation_error": plan.certificate.rotation_error.value,
    }


def environment(name: str, packages: list[str]) -> Path:
    """Return the Python of a virtual environment with `packages`, made when it is missing."""
    folder = OUT / f"venv-{name}"
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "-q", *packages], check=True)
    return python


if __name__ == "__main__":
    sys.exit(main())
