"""Whether what a problem was given is of the right kind, and agrees with the rest."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from selfmotion.basics import Array, ProblemError, StartError, shown
from selfmotion.certificate import Requirement
from selfmotion.constraints import Clearance, Constraint
from selfmotion.costs import Cost
from selfmotion.follow import Follow, Follows
from selfmotion.motion import NullMotion
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import Damping, Relaxation

# The parameters of a problem that are sequences, and what of.
SEQUENCES = {
    "costs": Cost,
    "constraints": Constraint,
    "relaxations": Relaxation,
    "also": Follow,
}
_KINDS: dict[str, Any] = {
    "robot": RobotModel,
    "path": Path,
    "null_motion": NullMotion,
    "damping": Damping | None,
    "clearance": Clearance | None,
}
_EXAMPLES = {
    "robot": "RobotModel (load_robot)",
    "path": "Path (Line, Circle, Waypoints, TwistPath, …, or a class derived from Path)",
    "null_motion": "NullMotion (PolynomialNullMotion, BSplineNullMotion, or a class derived "
    "from NullMotion)",
    "damping": "Damping or None",
    "clearance": "Clearance or None",
}
# A start nearer to the path than this is on it: far above rounding, far below any tolerance.
_ON_PATH = 1e-7
# It is put onto it by as much at most [rad or m].
START_MISS = 1e-5


def check_kinds(problem: object) -> None:
    """Raise ProblemError where a single parameter is of another kind."""
    for name, kind in _KINDS.items():
        found = getattr(problem, name)
        if not isinstance(found, kind):
            raise ProblemError(f"{name} is {shown(found)}, expected a {_EXAMPLES[name]}")


def check_costs(follows: Follows, given: Sequence[Cost], every: Sequence[Cost]) -> None:
    """Raise ProblemError where nothing is to be minimised, or two costs share a name."""
    if not given:
        raise ProblemError("no cost is given, so that nothing tells one motion from another")
    names = [cost.name for cost in every]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ProblemError(f"two costs are called '{twice[0]}'; give one another name=")
    for cost in given:
        cost.check(follows)


def check_judged(constraints: Sequence[Constraint], found: Sequence[Requirement]) -> None:
    """Raise ProblemError where a constraint has no requirement."""
    for item, requirement in zip(constraints, found, strict=True):
        if not isinstance(requirement, Requirement):
            raise ProblemError(
                f"constraint {type(item).__name__}: requirement() returned {requirement!r}, "
                f"expected a Requirement; without one nothing judges whether a motion keeps it"
            )


def _beyond(robot: RobotModel, start: Array) -> str:
    """Return which joint of a configuration (n,) is beyond its limits, "" for none."""
    for k, name in enumerate(robot.joint_names):
        low, high = robot.lower[k], robot.upper[k]
        if not low <= start[k] <= high:
            unit, asked = ("m", "") if robot.is_prismatic(name) else ("rad", "; in degrees?")
            return (
                f"has joint '{name}' at {start[k]:g} {unit}, beyond its limits of {low:.4g} to "
                f"{high:.4g} {unit}{asked}, and "
            )
    return ""


def check_start(follows: Follows, start: Array) -> None:
    """Raise StartError where a start (n,) is off one of the paths."""
    for item in follows.items:
        position, rotation = item.miss(item.path.pose(0.0), start)
        if max(position, rotation) > _ON_PATH:
            beyond = _beyond(follows.robot, start)
            raise StartError(
                f"{follows.robot.name}: the start configuration {beyond}puts "
                f"'{item.chain.tip_name}' {position:.3g} m and {rotation:.3g} rad off the start of "
                f"the path; leave it out, or take "
                f"robot.inverse_kinematics(path.pose(0.0), task, seed=start)",
                position_miss=position,
                rotation_miss=rotation,
            )


def first_tool(several: Sequence[Follow], robot: RobotModel) -> tuple[Follow, RobotModel]:
    """Return the first of several that follow a path, and the arm with its tool.

    Raises
    ------
    ProblemError
        There is none, or it is at a pose.
    """
    if not several:
        raise ProblemError("path is an empty list, expected a Path, or what follows one")
    first = several[0]
    if not isinstance(first.path, Path):
        raise ProblemError(
            "the first Follow is at a pose, which does not tell how long the motion lasts; "
            "begin with one that has a path, or take Dwell(pose, seconds)"
        )
    if isinstance(robot, RobotModel) and (first.tool or first.reference):
        tool = first.tool or robot.tool
        tools = (tool, *(name for name in robot.tools if name != tool))
        own = robot.reference if tool == robot.tool else None
        reference = own if first.reference is None else first.reference
        robot = replace(robot, tools=tools, reference=reference)
        robot.chain_to(tool, reference)
    return first, robot
