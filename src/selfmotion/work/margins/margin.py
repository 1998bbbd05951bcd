"""By how much part, tool and base may be displaced before a program fails that runs unchanged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, as_number, as_numbers, shown
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import CollisionModel, DisplacedBodies
from selfmotion.planning.result import Plan
from selfmotion.work.margins.found import Displacement, Margins, SubjectMargin
from selfmotion.work.margins.least import Least, Size, least_scale
from selfmotion.work.margins.subjects import (
    Subject,
    base_of,
    models_of,
    part_of,
    relaxes_rotation,
    tool_of,
)

# The largest shift that is considered [m].
_FARTHEST = 1.0
# The largest rotation that is considered [rad].
_MOST_TURNED = 0.5


def margin(
    plan: Plan,
    tolerance: Tolerance | None = None,
    *,
    clearance: float = 0.0,
    part: Sequence[str] | None = None,
    tool: Sequence[str] | None = None,
    center: npt.ArrayLike | None = None,
) -> Margins:
    """Return by how much part, tool and base may be displaced while the joint motion stays.

    A displacement is a translation d and a rotation by an angle θ, in any direction, which do not
    change while the motion runs. Within a margin, all of them are proved to leave the bodies apart
    and, where a tolerance is given, the tool on its path, at all times.

    Parameters
    ----------
    plan : Plan
        A verified one.
    tolerance : Tolerance, optional
        What the process lets the tool miss its path by; in the rows that the task prescribes, and
        beyond what is relaxed. By default only clearances are judged.
    clearance : float
        What has to be left between bodies [m]; by default they may come near but not meet.
    part : sequence of str, optional
        What belongs to the part. By default all obstacles that stand, or are carried, where the
        path is: never less than those that do.
    tool : sequence of str, optional
        What is displaced with the tool tip. By default all that the tool's joint carries; of a
        tool that stands in the world, the links there that carry no joint.
    center : (3,), optional
        What the part turns about, in the frame of the path [m]; by default the middle of the path.
        The base turns about its own origin, the tool about that of the joint that carries it.

    Returns
    -------
    Margins

    Raises
    ------
    PlanError
        The plan is not verified.
    ProblemError
        An argument does not fit the plan; there is neither a body to meet nor a tolerance; or the
        tolerance is asked for where the orientation is relaxed.

    Notes
    -----
    With a lever ρ, the distance of what may touch from the centre, a displacement takes
    |d| + ρ θ off a distance at most; planes between the bodies make that sharp (see
    `collision.displaced`). Pairs of bodies that the certificate does not look at, such as the part
    and the immovable base, are not judged here either.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"margin: plan is {shown(plan)}, expected a Plan")
    plan.require()
    left = as_number(clearance, "margin: clearance", least=0.0, most=1e6)
    allowed = _checked(plan, tolerance)
    middle = None if center is None else as_numbers(center, "margin: center", "(3,) [m]", (3,))
    models = models_of(plan)
    if not models and allowed is None:
        raise ProblemError(
            f"{plan.robot.name}: a margin is asked for, but the plan keeps no bodies apart and no "
            f"tolerance is given; plan with a Clearance, or give tolerance="
        )
    of_part, of_tool, of_base = (
        _margin_of(plan, models, item, allowed, left)
        for item in (part_of(plan, part, middle), tool_of(plan, tool), base_of(plan))
    )
    judged, made_of = _judged(plan, allowed, left), (plan.trajectory.digest, plan.problem.digest)
    return Margins(plan.robot.name, of_part, of_tool, of_base, judged, *made_of)


def _checked(plan: Plan, tolerance: Tolerance | None) -> Tolerance | None:
    if tolerance is None:
        return None
    if not isinstance(tolerance, Tolerance):
        raise ProblemError(f"margin: tolerance is {shown(tolerance)}, expected a Tolerance")
    if relaxes_rotation(plan):
        raise ProblemError(
            "margin: a tolerance is given, but rows of the orientation are relaxed, and what a "
            "rotation leaves of these is not known; leave the tolerance out"
        )
    return tolerance


def _judged(plan: Plan, tolerance: Tolerance | None, left: float) -> str:
    bodies = [what for what in plan.certificate.covers if what in ("self-collision", "obstacles")]
    apart = f" ({left * 1e3:.3g} mm are left)" if left else " (bodies do not meet)"
    told = [" and ".join(bodies) + apart] if bodies else []
    if tolerance is None:
        told.append("not the tool's distance from its path, for which no tolerance is given")
    else:
        told.append(
            f"the tool within {tolerance.position * 1e3:.3g} mm and "
            f"{np.degrees(tolerance.rotation):.3g}° of its path"
        )
    return "; ".join(told)


def _margin_of(
    plan: Plan,
    models: Sequence[CollisionModel],
    subject: Subject,
    tolerance: Tolerance | None,
    left: float,
) -> SubjectMargin:
    bodies = [
        DisplacedBodies(model, subject.bodies, subject.joint, subject.center) for model in models
    ]

    def most(size: Size, limit: float) -> Displacement:
        stop = _of_tolerance(subject, tolerance, size, limit)
        for each in bodies:
            found = least_scale(each, plan.trajectory, size, left, stop[0].scale)
            if found.pair:
                stop = found, _met(found, left)
            elif found.scale < stop[0].scale:
                # Nothing is met, but less is proved.
                stop = Least(found.scale, time=stop[0].time), stop[1]
        return _displacement(subject, size, *stop)

    translation = most(Size(1.0, 0.0), _FARTHEST)
    rotation = most(Size(0.0, 1.0), _MOST_TURNED)
    both = most(Size(translation.position, rotation.rotation), 1.0)
    return SubjectMargin(
        subject.name, subject.bodies, subject.about, subject.center, translation, rotation, both
    )


def _of_tolerance(
    subject: Subject, tolerance: Tolerance | None, size: Size, limit: float
) -> tuple[Least, str]:
    """Return the displacement that the process allows, up to a limit, and what limits it."""
    found = limit, ""
    if tolerance is None:
        return Least(limit), ""
    for miss in subject.misses:
        moved = size.position + size.rotation * miss.lever
        room = tolerance.position - miss.position
        text = f"'{miss.tip}' is {tolerance.position * 1e3:.3g} mm off its path"
        if moved * found[0] > room:
            # A tool that already is at its tolerance allows no displacement.
            found = (room / moved if room > 0.0 else 0.0), text
        room = tolerance.rotation - miss.rotation
        text = f"'{miss.tip}' is {np.degrees(tolerance.rotation):.3g}° off its path"
        if miss.angular and size.rotation * found[0] > room:
            found = (room / size.rotation if room > 0.0 else 0.0), text
    return Least(found[0]), found[1]


def _met(found: Least, left: float) -> str:
    first, second = (f"'{name}'" for name in found.pair)
    return (
        f"{first} meets {second}" if not left else f"{first} is {left * 1e3:.3g} mm from {second}"
    )


def _displacement(subject: Subject, size: Size, found: Least, stops: str) -> Displacement:
    """Return a displacement in words, of what is displaced, whichever body is counted as it."""
    direction = found.normal if size.position else found.moment
    if direction is not None:
        length = float(np.linalg.norm(direction))
        direction = subject.sign * direction / length if length > 0.0 else None
    return Displacement(
        size.position * found.scale,
        size.rotation * found.scale,
        stops,
        found.time,
        _read_only(direction),
    )


def _read_only(direction: Array | None) -> Array | None:
    if direction is not None:
        direction.setflags(write=False)
    return direction
