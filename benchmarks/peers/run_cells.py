"""Cells side by side with other tools: `make bench NAME=peers`, after `run_peers.py`.

A puzzle piece held by an arm against a grinder on two axes, and two arms that carry a bar. What the
others return is judged as ours is, between waypoints with joints that go straight from one to the
next, as controllers take them. Times are those of the processor.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from rich import box
from rich.console import Console
from rich.table import Table
from run_peers import OUT, environment

import selfmotion as sm
from selfmotion.basics import Array

sys.path.insert(0, str(Path(__file__).parents[1]))

import suite

HERE = Path(__file__).parent
HANDS = "left/panda_hand_tcp", "right/panda_hand_tcp"
# Looks between two waypoints, and at the bar's circle.
LOOKS, BAR_LOOKS = 20, 6001


def main() -> int:
    """Run ours and both peers; print two tables."""
    OUT.mkdir(parents=True, exist_ok=True)
    rows = puzzle()
    bars = bar()
    (OUT / "cells.json").write_text(json.dumps([*rows, *bars], indent=1))
    titles = ("Σ|Δq|", "at waypoints", "between", "valid", "time")
    show("437 poses in the frame of the part, 9 joints", rows, titles)
    show("two Pandas carry a bar, 14 joints", bars, ("∫ ½|q̇|² dt", "hand", "bar", "time"))
    return 0


def show(title: str, rows: list[dict[str, str]], columns: tuple[str, ...]) -> None:
    table = Table(box=box.SIMPLE_HEAD, title=title)
    for name in ("tool", "settings", *columns):
        table.add_column(name, justify="left" if name in ("tool", "settings") else "right")
    for row in rows:
        table.add_row(*(row[name] for name in ("tool", "settings", *columns)))
    Console(width=140).print(table)


def peer(program: str, packages: list[str], given: Path) -> list[dict[str, Any]]:
    """Return what a program prints that runs in an environment of its own."""
    python = environment(program.split("_")[0], packages)
    command = [str(python), str(HERE / program), str(given)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def puzzle() -> list[dict[str, str]]:
    """Return the rows of the puzzle."""
    problem = suite.load(suite.DATA / "puzzle_cell__part")
    t, names = problem.path.waypoint_times, list(problem.robot.joint_names)
    began = time.process_time()
    plan, q = suite.plan(problem, 0, lambda *_: None)
    seconds = time.process_time() - began
    looks = np.linspace(0.0, plan.trajectory.t[-1], LOOKS * (len(t) - 1) + 1)
    slower = plan.trajectory.t[-1] / t[-1]
    dense = plan.trajectory(looks)
    # The planned path: it is smooth between waypoints, whose poses others go through, too.
    smooth = [plan.problem.path.pose(float(at)) for at in looks]
    said = f"shortest, collisions on; {plan.certificate.verdict.split(' (')[0]}"
    rows = [puzzle_row("selfmotion", said, problem, q, off(problem, dense, smooth), seconds)]
    for item in peer(
        "tesseract_whole_path.py", ["tesseract-robotics==0.5.1", "numpy==2.4.6"], OUT / "given.json"
    ):
        order = [item["joints"].index(name) for name in names]
        q = np.array(item["q"])[:, order]
        dense = np.column_stack([np.interp(looks, slower * t, joint) for joint in q.T])
        between = off(problem, dense, smooth)
        rows.append(
            puzzle_row(item["name"], item["settings"], problem, q, between, item["seconds"])
        )
    return rows


def off(problem: suite.PathProblem, q: Array, poses: list[Any]) -> float:
    """Return the largest distance of the tip from poses in its reference frame [m]."""
    position, _ = problem.judge._misses(poses, q)
    return position


def puzzle_row(
    tool: str, settings: str, problem: suite.PathProblem, q: Array, between: float, seconds: float
) -> dict[str, str]:
    poses = [problem.path.pose(float(at)) for at in problem.path.waypoint_times]
    judged = problem.judge.judge(poses, q)
    return {
        "tool": tool,
        "settings": settings,
        "Σ|Δq|": f"{judged.length_rad:.2f} rad",
        "at waypoints": f"{judged.position_error * 1e6:.2g} µm",
        "between": f"{between * 1e6:.2g} µm",
        "valid": f"no: {judged.reason}" if judged.reason else "yes",
        "time": f"{seconds:.1f} s",
    }


def bar() -> list[dict[str, str]]:
    """Return the rows of the two arms."""
    stands = {side: pin.SE3(np.eye(3), np.array([0.0, y, 0.0]))
              for side, y in (("left", 0.45), ("right", -0.45))}  # fmt: skip
    cell = sm.load_robot({"left": "panda", "right": "panda"}, base=stands, tool=HANDS)
    first = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.45, 0.2, 0.3]))
    grasp = pin.SE3(np.eye(3), np.array([0.0, 0.4, 0.0]))
    circle = sm.paths.Circle.around(first, radius=0.15, duration=6.0, normal=(0, 1, 0))
    follows = [
        sm.Follow(circle, tool=HANDS[0]),
        sm.Follow(grasp, tool=HANDS[1], reference=HANDS[0]),
    ]
    free = sm.plan(sm.Problem(cell, follows)).require()
    problem = sm.Problem(cell, follows, start=free.trajectory.q[0])
    began = time.process_time()
    plan = sm.plan(problem).require()
    seconds = time.process_time() - began
    t = np.linspace(0.0, circle.duration, BAR_LOOKS)
    rows = [bar_row("selfmotion", f"{plan.certificate.verdict.split(' (')[0]}; start given",
            cell, circle, grasp, t, plan.trajectory(t), seconds)]  # fmt: skip
    still = plan.initial_trajectory(t)
    rows.append(bar_row("pseudo-inverse of all rows", "same start, exact", cell, circle, grasp, t,
            still, float("nan")))  # fmt: skip
    given = OUT / "bar.json"
    path = [pin.SE3ToXYZQUAT(circle.pose(float(at))).tolist() for at in t]
    start = free.trajectory.q[0].tolist()
    given.write_text(json.dumps({
        "urdf": cell.urdf.text, "joints": list(cell.joint_names), "start": start, "t": t.tolist(),
        "path": path, "grasp": pin.SE3ToXYZQUAT(grasp).tolist(), "duration": circle.duration,
    }))  # fmt: skip
    for item in peer("pink_two_arms.py", ["pin-pink==4.4.0", "daqp==0.11.0"], given):
        q = np.array(item["q"])
        dense = np.column_stack([np.interp(t, item["t"], joint) for joint in q.T])
        rows.append(bar_row(item["name"], item["settings"], cell, circle, grasp, t, dense,
                item["seconds"]))  # fmt: skip
    return rows


def bar_row(
    tool: str,
    settings: str,
    cell: sm.RobotModel,
    circle: sm.paths.Path,
    grasp: Any,
    t: Array,
    q: Array,
    seconds: float,
) -> dict[str, str]:
    left, right = cell.chain_to(HANDS[0], None), cell.chain_to(HANDS[1], HANDS[0])
    pairs = list(zip(t, q, strict=True))
    hand = max(np.linalg.norm(left.place(x).translation - circle.pose(float(at)).translation)
               for at, x in pairs)  # fmt: skip
    held = max(np.linalg.norm(right.place(x).translation - grasp.translation) for x in q)
    cost = 0.5 * np.sum(np.diff(q, axis=0) ** 2 / np.diff(t)[:, None])
    return {
        "tool": tool,
        "settings": settings,
        "∫ ½|q̇|² dt": f"{cost:.4f}",
        "hand": f"{hand * 1e6:.2g} µm",
        "bar": f"{held * 1e6:.2g} µm",
        "time": "" if np.isnan(seconds) else f"{seconds:.2f} s",
    }


if __name__ == "__main__":
    sys.exit(main())
