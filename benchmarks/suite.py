"""Scores path problems made elsewhere: `python benchmarks/suite.py`.

Every folder of the form of `data/*` (path.csv, problem.json) is planned from a cold start, with
nothing tuned per problem, and judged at the waypoints by the folder's own criteria.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich import box as boxes
from rich.console import Console
from rich.table import Table

import selfmotion as sm
from selfmotion.basics import Array, write_atomically, write_csv

DATA = Path(__file__).parent / "data"

# Distance planned for, so that the last digits of the check do not decide [m].
CLEARANCE = 5e-4
# Share of the largest joint step that is planned for: it must stay strictly below.
STEP_SHARE = 0.995


@dataclass(frozen=True)
class PathProblem:
    """A folder of the suite."""

    name: str
    robot: sm.RobotModel
    path: sm.Waypoints
    obstacles: tuple[sm.Box, ...]
    criteria: dict[str, Any]
    reference: float | None
    has_meshes: bool


@dataclass(frozen=True)
class Score:
    """What the checks of a folder say about a motion at the waypoints."""

    name: str
    valid: bool
    length: float
    position_error: float
    rotation_error_deg: float
    joint_step_deg: float
    limit_margin: float
    clearance: float | None
    seconds: float
    reason: str
    reference: float | None


def load(folder: Path) -> PathProblem:
    """Read a folder."""
    description = json.loads((folder / "problem.json").read_text())
    urdf = str(description["urdf"])
    has_meshes = urdf.startswith("example-robot-data")
    source = _named(urdf) if has_meshes else _beside(folder, urdf.split(" ")[0])
    locked = description["locked_joints"]
    robot = sm.load_robot(
        source,
        tool=description["tip_frame"],
        lock=locked if isinstance(locked, dict) else _all_but(source, description),
    )
    obstacles = tuple(
        sm.Box(
            f"box{k}",
            _pose(item),
            item["size_m"],
        )
        for k, item in enumerate(description["boxes"])
    )
    return PathProblem(
        description["name"],
        robot,
        sm.Waypoints.from_csv(folder / "path.csv"),
        obstacles,
        description["criteria"],
        description.get("reference_path_length_rad"),
        has_meshes,
    )


def _pose(item: dict[str, Any]) -> Any:
    import pinocchio as pin

    return pin.SE3(pin.rpy.rpyToMatrix(np.array(item["rpy_rad"])), np.array(item["center_m"]))


def _all_but(source: str | Path, description: dict[str, Any]) -> dict[str, float]:
    """Return the joints that a sentence like "every joint but a, b, each at 0" locks."""
    text = str(description["locked_joints"])
    free = {name.strip() for name in text.split("but", 1)[1].split("each")[0].split(",")}
    chain = sm.load_robot(source, tool=description["tip_frame"]).joint_names
    return {name: 0.0 for name in chain if not {name, name.removesuffix("_joint")} & free}


def _named(urdf: str) -> str:
    """Return the name of the arm whose file in example-robot-data is given."""
    file = urdf.split(":", 1)[1].strip()
    return next(name for name, arm in sm.NAMED_ARMS.items() if arm.urdf == file)


def _beside(folder: Path, name: str) -> Path:
    places = (folder, folder.parent, DATA)
    return next(place / name for place in places if (place / name).is_file())


def plan(problem: PathProblem, seed: int) -> sm.Plan:
    """Plan a short joint path that keeps the folder's criteria."""
    step = np.diff(problem.path.waypoint_times).min()
    largest = STEP_SHARE * np.radians(problem.criteria["joint_step_deg"]) / step
    limit = np.minimum(problem.robot.velocity_limit, np.inf)
    constraints: list[sm.Constraint] = [
        sm.JointPositionLimits(),
        # The suite times its paths arbitrarily: what counts is the step between waypoints.
        sm.JointVelocityLimits(np.full_like(limit, largest)),
    ]
    if problem.has_meshes and problem.criteria["collision_free"]:
        constraints.append(sm.Clearance(problem.obstacles, CLEARANCE))
    found = sm.plan(
        sm.Problem(
            problem.robot,
            problem.path,
            null_motion=sm.BSplineNullMotion(40),
            costs=[sm.PathLength(smoothing=0.005)],
            constraints=constraints,
        ),
        search=sm.Search(mode="global", rng=seed),
    )
    # A motion along a part of the path is none along the path.
    return found.require() if found.report.ending else found


def judge(problem: PathProblem, q: Array, seconds: float) -> Score:
    """Check joint configurations at the waypoints (W, n) by the folder's criteria."""
    robot, criteria = problem.robot, problem.criteria
    poses = [problem.path.pose(float(t)) for t in problem.path.waypoint_times]
    misses = np.array(
        [sm.Task.POSE.miss(pose, robot.pose(x)) for pose, x in zip(poses, q, strict=True)]
    )
    steps = np.abs((np.diff(q, axis=0) + np.pi) % (2 * np.pi) - np.pi)
    margin = float(np.minimum(q - robot.lower, robot.upper - q).min())
    clearance = None
    if problem.has_meshes:
        clearance = sm.CollisionModel(robot, problem.obstacles).worst(q).value
    position, rotation = misses.max(axis=0)
    checks = {
        f"{position * 1e3:.3f} mm off the path": position < criteria["position_m"],
        f"{np.degrees(rotation):.3f}° off the path": np.degrees(rotation)
        < criteria["rotation_deg"],
        f"a joint step of {np.degrees(steps.max()):.2f}°": np.degrees(steps.max())
        < criteria["joint_step_deg"],
        f"{-margin:.3g} rad beyond a joint limit": margin >= 0.0,
        "a collision": clearance is None or clearance > 0.0,
    }
    failed = [text for text, kept in checks.items() if not kept]
    return Score(
        problem.name,
        not failed,
        float(steps.sum()),
        float(position),
        float(np.degrees(rotation)),
        float(np.degrees(steps.max())),
        margin,
        clearance,
        seconds,
        "; ".join(failed),
        problem.reference,
    )


def main(
    folder: Annotated[Path, typer.Option(help="Folder of problem folders, or one of them.")] = DATA,
    out: Annotated[Path, typer.Option(help="Where NAME.csv and suite.json go.")] = Path(
        "out/suite"
    ),
    seed: Annotated[int, typer.Option(help="Of the search's random numbers.")] = 0,
) -> None:
    """Plan and score every problem; write the motions, a table and a JSON."""
    folders = [folder] if (folder / "problem.json").is_file() else sorted(folder.glob("*/"))
    scores = []
    console = Console()
    for place in folders:
        if not (place / "problem.json").is_file():
            continue
        problem = load(place)
        began = time.perf_counter()
        try:
            result = plan(problem, seed)
        except sm.SelfmotionError as error:
            console.print(f"{problem.name}: no motion found: {error}", markup=False)
            nothing = float("nan")
            seconds = time.perf_counter() - began
            empty = (nothing,) * 5
            scores.append(
                Score(problem.name, False, *empty, None, seconds, str(error), problem.reference)
            )
            continue
        q = result.trajectory(problem.path.waypoint_times)
        score = judge(problem, q, time.perf_counter() - began)
        scores.append(score)
        if not score.valid:
            console.print(f"{problem.name}: {result.report.message}", markup=False)
        table = np.column_stack([problem.path.waypoint_times, q])
        write_csv(out / f"{problem.name}.csv", ["t", *problem.robot.joint_names], table)
    text = json.dumps([vars(score) for score in scores], indent=1)
    write_atomically(out / "suite.json", lambda stream: stream.write(text.encode()) and None)
    console.print(_table(scores))
    sys.exit(0 if all(score.valid for score in scores) else 1)


def _table(scores: list[Score]) -> Table:
    table = Table(box=boxes.SIMPLE_HEAD)
    for name in ("problem", "valid", "length", "reference", "clearance", "step", "time"):
        table.add_column(name, justify="left" if name in ("problem", "valid") else "right")
    for score in scores:
        table.add_row(
            score.name,
            "yes" if score.valid else f"no: {score.reason}",
            f"{score.length:.3f} rad",
            "failed" if score.reference is None else f"{score.reference:.2f} rad",
            "" if score.clearance is None else f"{score.clearance * 1e3:.2f} mm",
            f"{score.joint_step_deg:.2f}°",
            f"{score.seconds:.1f} s",
        )
    return table


if __name__ == "__main__":
    typer.run(main)
