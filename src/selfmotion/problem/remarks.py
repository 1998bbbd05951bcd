"""What to know of a problem before planning: limits, bodies or places that look wrong."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.certificate import Requirement
from selfmotion.constraints import (
    Constraint,
    Envelope,
    JointAccelerationLimits,
    JointJerkLimits,
    JointVelocityLimits,
    ToolLimits,
)
from selfmotion.follow import Follows
from selfmotion.problem.defaults import KEPT
from selfmotion.problem.inside import inside_remarks
from selfmotion.robot import RobotModel

# Limits so many times the arm's own are in other units, and so are those that no arm has: of joints
# by order, and of the tool's speed [m/s].
_FAR_ABOVE = 10.0
_RATES = {1: ("rad/s", 50.0), 2: ("rad/s²", 200.0), 3: ("rad/s³", 5e4)}
_FASTEST_TOOL = 50.0


def remarks_on(
    robot: RobotModel,
    follows: Follows,
    constraints: Sequence[Constraint],
    requirements: Sequence[Requirement],
    envelope: Envelope,
) -> Iterator[str]:
    """Yield what is to be known: links that overlap, limits in other units or of nothing known.

    And what of its file is left out, and places inside what the tool works on.
    """
    yield from robot.urdf.notes
    for followed in follows.items:
        yield from followed.path.notes
    for model, _ in envelope.bodies:
        for pair in model.overlapping:
            if pair.is_checked:
                yield f"{pair.first} - {pair.second}: {pair.remedy}"
    yield from _unit_remarks(robot, constraints)
    for item in constraints:
        # What nobody asked for by name is not missed.
        if not item.applies(robot) and not any(item is usual for usual in KEPT):
            option = "--acceleration, " * isinstance(item, JointAccelerationLimits)
            yield (
                f"{item.requirement(robot).name}: none are known of {robot.name}, so none are "
                f"kept; give {option}limit = …"
            )
    bodies = [body for item in requirements for body in item.obstacles]
    yield from inside_remarks(robot, follows, bodies)


def _unit_remarks(robot: RobotModel, constraints: Sequence[Constraint]) -> Iterator[str]:
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
