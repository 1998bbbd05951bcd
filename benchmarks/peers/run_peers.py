"""Measures other tools on the same path, each in its own environment: `make bench NAME=peers`."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

import selfmotion as sm

HERE = Path(__file__).parent
OUT = HERE.parent.parent / "out" / "peers"
# Each in an environment of its own: placo and Drake want other versions of what we use.
PEERS = {
    "casadi_whole_path.py": ["casadi==3.8.2", "numpy==2.4.6"],
    "drake_whole_path.py": ["drake==1.51.1"],
    "tesseract_waypoints.py": ["tesseract-robotics==0.5.1", "numpy==2.4.6"],
    "placo_tracker.py": ["placo==0.10.2"],
    "pink_tracker.py": ["pin-pink==4.4.0", "daqp==0.11.0"],
    "mplib_waypoints.py": ["mplib==0.2.1", "numpy==1.26.4"],
}
# Looks between two waypoints.
LOOKS = 20


def main() -> int:
    """Run ours and every peer, one after the other, on one machine."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    robot = sm.load_robot("panda", tool="panda_hand")
    path = sm.paths.Waypoints.from_csv(HERE.parent / "data" / "panda__1cube" / "path.csv")
    start = robot.inverse_kinematics(path.pose(0.0), seed=[0, -0.5, 0, -2, 0, 1.6, 0.8])
    given = OUT / "given.json"
    given.write_text(json.dumps({"start": start.tolist(), "urdf": robot.urdf.source}))
    whole = sm.Problem(robot, path, start=start)
    # As the peers have it: no bodies, no rest, the URDF's limits of position alone.
    bare = replace(
        whole, constraints=(sm.constraints.JointPositionLimits(),), rest=False, clearance=None
    )
    rows = [
        *ours(bare, "default, limits of position only"),
        *ours(whole, "default, maker's limits, rest, self-collision"),
    ]
    for program, packages in PEERS.items():
        python = environment(program.split("_")[0], packages)
        command = [str(python), str(HERE / program), str(given)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.stderr.write(done.stderr)
            return done.returncode
        found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        rows += [judged(robot, path, item) for item in found]
    (OUT / "peers.json").write_text(json.dumps(rows, indent=1))
    table = Table(box=box.SIMPLE_HEAD, title="200 waypoints, Panda, obstacles ignored, same start")
    for name in ("tool", "settings"):
        table.add_column(name)
    for name in ("waypoints", "time", "cost", "at waypoints", "turned", "between"):
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(
            row["name"],
            row["settings"],
            str(row["waypoints"]),
            f"{row['seconds'] * 1e3:.0f} ms",
            f"{row['cost']:.5f}",
            f"{row['at_waypoints'] * 1e6:.2g} µm",
            f"{np.degrees(row['turned']):.1g}°",
            f"{row['between'] * 1e6:.2g} µm",
        )
    Console(width=140).print(table)
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
    motion = {"q": plan.trajectory(t).tolist(), "name": "selfmotion"}
    proved = {"between": plan.certificate.position_error.value}
    rows = (("before the proof", to_proof), ("verified at all times", whole))
    return [
        judged(problem.robot, problem.path,
               {**motion, "settings": f"{settings}; {what}", "seconds": min(seconds)}) | proved
        for what, seconds in rows
    ]  # fmt: skip


def judged(
    robot: sm.RobotModel, path: sm.paths.Waypoints, item: dict[str, Any]
) -> dict[str, object]:
    """Measure a motion by its joints at the waypoints, and straight lines of them in between.

    The cost is Σ ½ |Δq|²/Δt [rad²/s]; how far the hand is off the path is told at the waypoints
    [m, rad], and between them [m].
    """
    q = np.array(item["q"])
    t = path.waypoint_times[: len(q)]
    looks = np.linspace(t[0], t[-1], LOOKS * (len(q) - 1) + 1)
    joined = np.column_stack([np.interp(looks, t, joint) for joint in q.T])
    _, turns, places = robot.chain.along(joined)
    target = path.samples(looks)
    off = np.linalg.norm(places - target.translation, axis=1)
    turned = Rotation.from_matrix(np.einsum("kji,kjl->kil", target.rotation, turns)).magnitude()
    steps = np.diff(q, axis=0)
    return {
        "name": item["name"],
        "settings": item["settings"],
        "seconds": item["seconds"],
        "waypoints": len(q),
        "cost": float(np.sum(0.5 * np.sum(steps**2, axis=1) / np.diff(t))),
        "at_waypoints": float(off[::LOOKS].max()),
        "turned": float(turned[::LOOKS].max()),
        "between": float(off.max()),
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
