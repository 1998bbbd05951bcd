"""Whether what a problem was given is of the right kind, and agrees with the rest."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from selfmotion.basics import Array, ProblemError, StartError, shown
from selfmotion.certificate import Requirement
from selfmotion.constraints import (
    Clearance,
    Constraint,
    JointAccelerationLimits,
    JointJerkLimits,
    JointVelocityLimits,
    ToolLimits,
)
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
    "collision": Clearance | None,
}
_EXAMPLES = {
    "robot": "RobotModel (load_robot)",
    "path": "Path (Line, Circle, Waypoints, TwistPath, …, or a class derived from Path)",
    "null_motion": "NullMotion (PolynomialNullMotion, BSplineNullMotion, or a class derived "
    "from NullMotion)",
    "damping": "Damping or None",
    "collision": "Clearance or None",
}
# Limits so many times the arm's own are in other units, and so are those that no arm has: of joints
# by order, and of the tool's speed [m/s].
_FAR_ABOVE = 10.0
_RATES = {1: ("rad/s", 50.0), 2: ("rad/s²", 200.0), 3: ("rad/s³", 5e4)}
_FASTEST_TOOL = 50.0
# A start nearer to the path than this is on it: far above rounding, far below any tolerance.
_ON_PATH = 1e-7


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


def unit_remarks(robot: RobotModel, constraints: Sequence[Constraint]) -> Iterator[str]:
    """Yield limits so far above the arm's own, or any arm's, that they may be in other units."""
    for item in constraints:
        if isinstance(item, ToolLimits) and _FASTEST_TOOL < item.speed < np.inf:
            yield f"ToolLimits: a speed of {item.speed:g} m/s is no limit; in mm/s? speed_mm"
        limits = JointVelocityLimits | JointAccelerationLimits | JointJerkLimits
        if not isinstance(item, limits) or item.limit is None:
            continue
        kind, (unit, most) = type(item).__name__, _RATES[item.order]
        own, published = replace(item, replace=True).of(robot), item.published(robot)
        for k, name in enumerate(robot.joint_names):
            if robot.is_prismatic(name) or not np.isfinite(own[k]):
                continue
            told = ""
            if not item.replace and own[k] > _FAR_ABOVE * published[k]:
                told = f"has no effect, the arm's own limit is {published[k]:.4g} {unit}"
            elif own[k] > most:
                told = f"is more than arms do (above {most:g} {unit})"
            if told:
                yield f"{kind}: {own[k]:g} {unit} for '{name}' {told}; in degrees? limit_deg"
                break


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
