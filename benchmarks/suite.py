"""Scores path problems made elsewhere: `python benchmarks/suite.py`.

Every folder of the form of `data/*` (path.csv, problem.json) is planned from a cold start, with
nothing tuned per problem, and judged at the waypoints by the folder's own criteria.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
import typer
from rich import box as tables
from rich.table import Table
from suite_judge import Judged, SuiteJudge

import selfmotion as sm
from selfmotion.basics import Array, Progress, write_atomically, write_csv
from selfmotion.problem.constraints import NO_OVERLAP
from selfmotion.shell.cli.tables import console

DATA = Path(__file__).parent / "data"

# Distance planned for [m]: the planner's own margin is beyond it, and the tool of some paths is
# nearer to something than any other would be.
CLEARANCE = 0.0
# Distance planned for from limits, so that the last digits of the check do not decide [rad or m].
EDGE = 5e-4
# Share of the largest joint step that is planned for: it must stay strictly below.
STEP_SHARE = 0.995
# What a metre of a prismatic joint counts [rad]; the suite states no exchange rate, but its largest
# steps (7° or 2 cm) make it 6.1, and the published motion has 44 rad to the metre.
METRE = 10.0
# Evaluations of the cost that are spent on one motion: more would gain tenths of a percent.
EVALUATIONS = 40


@dataclass(frozen=True)
class PathProblem:
    """A folder of the suite."""

    name: str
    robot: sm.RobotModel
    path: sm.paths.Waypoints
    task: str
    obstacles: tuple[sm.obstacles.Box, ...]
    disabled: tuple[tuple[str, str], ...]
    criteria: dict[str, Any]
    reference: tuple[float | None, float | None]
    judge: SuiteJudge


@dataclass(frozen=True)
class Score:
    """What came of a folder: how long it took, and what its criteria say of the motion.

    Attributes
    ----------
    first_seconds : float
        When the first motion was known that keeps the criteria, processor time; NaN where there was
        none.
    seconds : float
        Until the plan was returned, likewise.
    """

    name: str
    first_seconds: float
    seconds: float
    judged: Judged
    reference: tuple[float | None, float | None]


def load(folder: Path) -> PathProblem:
    """Read a folder."""
    description = json.loads((folder / "problem.json").read_text())
    urdf = str(description["urdf"])
    source = _named(urdf) if urdf.startswith("example-robot-data") else _beside(folder, urdf)
    locked = description["locked_joints"]
    robot = sm.load_robot(
        source,
        tool=description["tip_frame"],
        lock=locked if isinstance(locked, dict) else _all_but(source, description),
        reference=description["base_frame"] if description.get("base_moves") else None,
    )
    free_axis = description.get("free_axis")
    if free_axis not in (None, "z"):
        raise ValueError(f"{folder}: free_axis is {free_axis!r}, expected 'z' or none")
    boxes = [(np.array(item["size_m"]), _pose(item)) for item in description["boxes"]]
    disabled = tuple((first, second) for first, second in description.get("disabled_pairs", ()))
    left_out = {frozenset(pair) for pair in (*disabled, *robot.touching)}
    criteria = description["criteria"]
    judge = SuiteJudge(robot, boxes, left_out, criteria, free_axis)
    return PathProblem(
        description["name"],
        robot,
        sm.paths.Waypoints.from_csv(folder / "path.csv"),
        "pose" if free_axis is None else "pointing",
        tuple(sm.obstacles.Box(f"box{k}", pose, size) for k, (size, pose) in enumerate(boxes)),
        tuple((a, b) for a, b in (*disabled, *judge.neighbours) if a != b),
        criteria,
        tuple(description.get(f"reference_path_length_{unit}") for unit in ("rad", "m")),
        judge,
    )


def _pose(item: dict[str, Any]) -> Any:
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


def plan(
    problem: PathProblem, seed: int, progress: Progress, metre: float = METRE
) -> tuple[sm.Plan, Array]:
    """Plan a short joint path that keeps the folder's criteria; return it at the waypoints, too.

    A metre of a prismatic joint counts `metre` [rad].

    The suite times its paths arbitrarily: what counts is the step from waypoint to waypoint. So the
    path is slowed down until steps say more than the arm's limits of speed.
    """
    robot, criteria, path = problem.robot, problem.criteria, problem.path
    revolute = np.radians(criteria["joint_step_deg"])
    prismatic = criteria.get("prismatic_step_m", revolute)
    largest = STEP_SHARE * np.array(
        [prismatic if robot.is_prismatic(name) else revolute for name in robot.joint_names]
    )
    step = np.diff(path.waypoint_times).min()
    slower = max(1.0, float((largest / step / robot.velocity_limit).max()))
    times = slower * path.waypoint_times
    poses = [path.pose(float(t)) for t in path.waypoint_times]
    constraints: list[sm.constraints.Constraint] = [
        sm.constraints.JointPositionLimits(robot.lower + EDGE, robot.upper - EDGE),
        sm.constraints.JointVelocityLimits(largest / (slower * step)),
    ]
    apart = NO_OVERLAP
    if criteria["collision_free"]:
        apart = sm.constraints.Clearance(problem.obstacles, CLEARANCE, disabled=problem.disabled)
    weights = [metre if robot.is_prismatic(name) else 1.0 for name in robot.joint_names]
    length = sm.costs.PathLength(smoothing=0.005 / slower, joint_weights=weights)
    asked = sm.Problem(
        robot,
        sm.paths.Waypoints.from_poses(times, poses),
        problem.task,
        costs=[length],
        constraints=constraints,
        clearance=apart,
    )
    found = sm.plan(
        asked,
        search=sm.Search(mode="global", rng=seed),
        max_evaluations=EVALUATIONS,
        progress=progress,
    )
    # A motion along a part of the path is none along the path.
    found = found.require() if found.report.ending else found
    return found, found.trajectory(times)


class _Clock:
    """Notes when the first motion was optimised: when the search turns to what follows."""

    def __init__(self) -> None:
        self.began, self.first = time.process_time(), float("nan")
        self._refining = False

    @property
    def elapsed(self) -> float:
        return time.process_time() - self.began

    def __call__(self, stage: str, done: int, total: int) -> None:
        if self._refining and np.isnan(self.first):
            self.first = self.elapsed
        self._refining = self._refining or stage in ("refining sequence", "optimising start")


def score(problem: PathProblem, seed: int, out: Path) -> Score:
    """Plan a problem, write its motion, and judge it."""
    clock = _Clock()
    times = problem.path.waypoint_times
    try:
        _, q = plan(problem, seed, clock)
    except sm.SelfmotionError as error:
        nothing = (float("nan"),) * 7
        judged = Judged(f"no motion found: {error}", *nothing)
        return Score(problem.name, clock.first, clock.elapsed, judged, problem.reference)
    seconds = clock.elapsed
    judged = problem.judge.judge([problem.path.pose(float(t)) for t in times], q)
    header = ["t", *problem.robot.joint_names]
    write_csv(out / f"{problem.name}.csv", header, np.column_stack([times, q]))
    first = clock.first if not judged.reason else float("nan")
    return Score(problem.name, first, seconds, judged, problem.reference)


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
    for place in folders:
        if (place / "problem.json").is_file():
            scores.append(score(load(place), seed, out))
            item = scores[-1]
            print(item.name, f"{item.seconds:.1f} s", item.judged.reason or "valid", flush=True)
    text = json.dumps([asdict(item) for item in scores], indent=1)
    write_atomically(out / "suite.json", lambda stream: stream.write(text.encode()) and None)
    console().print(_table(scores))
    sys.exit(0 if all(not item.judged.reason for item in scores) else 1)


def _length(rad: float | None, metres: float | None) -> str:
    if rad is None:
        return "none"
    return f"{rad:.2f} rad" + (f" + {metres:.3f} m" if metres else "")


def _table(scores: list[Score]) -> Table:
    table = Table(box=tables.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("problem", "valid", "length", "published", "step", "first", "end"):
        side: Literal["left", "right"] = "left" if name in ("problem", "valid") else "right"
        table.add_column(name, justify=side, overflow="fold")
    for item in scores:
        judged = item.judged
        table.add_row(
            item.name,
            "no" if judged.reason else "yes",
            _length(judged.length_rad, judged.length_m),
            _length(*item.reference),
            f"{judged.step_deg:.2f}°"
            + (f", {1e3 * judged.step_m:.1f} mm" if judged.step_m else ""),
            f"{item.first_seconds:.1f} s",
            f"{item.seconds:.1f} s",
        )
    return table


if __name__ == "__main__":
    typer.run(main)
