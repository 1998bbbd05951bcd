"""By how much part, tool and base may be displaced while the joint motion stays the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, as_number, as_numbers, shown
from selfmotion.certificate import Tolerance
from selfmotion.model.collision import CollisionModel, DisplacedBodies
from selfmotion.planning.result import Plan
from selfmotion.work.margins.least import Least, Size, least_scale
from selfmotion.work.margins.results import Displacement, Margins, SubjectMargin
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
_MAX_TURNED = 0.5


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
        Deviation of the tool from its path that the process allows, in the rows that the task
        prescribes, and in addition to relaxations. By default only clearances are judged.
    clearance : float
        Distance that has to remain between bodies [m]; by default they must not meet.
    part : sequence of str, optional
        The obstacles of the part. By default all that are fixed, or are carried, in the frame of
        the path; others may be added, not left out.
    tool : sequence of str, optional
        Links that are displaced with the tool tip. By default all that the tool's joint carries; of
        a tool that is fixed in the world, the links there that carry no joint.
    center : (3,), optional
        Centre of the part's rotations, in the frame of the path [m]; by default the middle of the
        path. The base turns about its own origin, the tool about that of the joint that carries it.

    Returns
    -------
    Margins

    Raises
    ------
    PlanError
        The plan is not verified.
    ProblemError
        An argument does not fit the plan; there is neither a clearance nor a tolerance; or a
        tolerance is given where the orientation is relaxed.

    Notes
    -----
    A displacement lowers a distance by at most |d| + ρ θ, with the lever arm ρ of the body about
    the centre; separating planes give a sharp bound (see `collision.displaced`). Pairs of bodies
    that the certificate does not check, such as the part and the fixed base, are not judged here
    either.
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
    judged, digests = _judged(plan, allowed, left), (plan.trajectory.digest, plan.problem.digest)
    return Margins(plan.robot.name, of_part, of_tool, of_base, judged, *digests)


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
    distance = f" ({left * 1e3:.3g} mm are left)" if left else " (bodies do not meet)"
    judged = [" and ".join(bodies) + distance] if bodies else []
    if tolerance is None:
        judged.append("not the tool's distance from its path, for which no tolerance is given")
    else:
        judged.append(
            f"the tool within {tolerance.position * 1e3:.3g} mm and "
            f"{np.degrees(tolerance.rotation):.3g}° of its path"
        )
    return "; ".join(judged)


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
                # No collision was found, but less is proved.
                stop = Least(found.scale, time=stop[0].time), stop[1]
        return _displacement(subject, size, *stop)

    translation = most(Size(1.0, 0.0), _FARTHEST)
    rotation = most(Size(0.0, 1.0), _MAX_TURNED)
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
