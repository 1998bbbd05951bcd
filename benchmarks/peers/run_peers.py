"""Measures other tools on the same path, each in its own environment: `make bench-peers`."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
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
    "casadi_whole_path.py": ["casadi==3.8.2", "numpy==2.4.6"],
    "drake_whole_path.py": ["drake==1.51.1"],
}


def main() -> int:
    """Run ours and every peer, one after the other, on one machine."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.Waypoints.from_csv(HERE.parent / "data" / "panda__1cube" / "path.csv")
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    given = OUT / "given.json"
    given.write_text(json.dumps({"start": start.tolist(), "urdf": robot.urdf.source}))
    whole = sm.Problem(robot, path, start=start)
    # As the peers have it: no bodies, no rest, the URDF's limits of position alone.
    bare = replace(whole, constraints=(sm.JointPositionLimits(),), rest=False, collision=None)
    rows = [
        *ours(bare, "default, limits of position only"),
        *ours(whole, "default, maker's limits, rest, self-collision"),
        ours(replace(whole, null_motion=sm.BSplineNullMotion(24)), "spline of 24 intervals")[1],
    ]
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
            f"{row['cost']:.5f}",
            f"{row['position_error'] * 1e3:.1e} mm",
            f"{np.degrees(row['rotation_error']):.1e}°",
        )
    Console().print(table)
    return 0


def ours(problem: sm.Problem, settings: str) -> list[dict[str, object]]:
    """Plan and measure as the peers are measured: without the proof, and with it."""
    sm.plan(problem)
    to_proof, whole = [], []
    for _ in range(5):
        times = [time.perf_counter()]

        def note(stage: str, done: int, total: int, times: list[float] = times) -> None:
            if stage == "checking" and len(times) == 1:
                times.append(time.perf_counter())

        plan = sm.plan(problem, progress=note)
        to_proof.append(times[1] - times[0])
        whole.append(time.perf_counter() - times[0])
    plan.require()
    t = problem.path.waypoint_times
    steps = np.diff(plan.trajectory(t), axis=0)
    cost = float(np.sum(0.5 * np.sum(steps**2, axis=1) / np.diff(t)))
    errors = {
        "position_error": plan.certificate.position_error.value,
        "rotation_error": plan.certificate.rotation_error.value,
    }
    rows = (("before the proof", to_proof), ("verified at all times", whole))
    return [
        {"name": "selfmotion", "settings": f"{settings}; {what}", "seconds": min(seconds),
         "cost": cost, **errors}
        for what, seconds in rows
    ]  # fmt: skip


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
