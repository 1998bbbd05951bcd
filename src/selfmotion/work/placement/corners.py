"""How far a part or base may be displaced if the motion is planned again for its new place.

An estimate from the distance of the joints to their limits, and a confirmed size: motions are
planned again for displacements in all directions, each with the present plan as warm start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    ProblemError,
    Progress,
    as_called,
    as_choice,
    as_number,
    as_numbers,
    shown,
    silent,
)
from selfmotion.model.path import spread_along
from selfmotion.planning.result import Plan
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.work.placement.places import COORDINATES, Places, Tried, places_of

# Two motions are near each other while no joint differs by more than this [rad or m].
NEAR = 0.5
# Times at which motions are compared, and joint limits evaluated.
_SAMPLES = 60
# Directions: the axes, and the diagonals of their octants.
_DIRECTIONS = np.vstack(
    [np.eye(3), -np.eye(3), np.array(list(product((1.0, -1.0), repeat=3))) / 3**0.5]
)
# Radius of the largest ball within the hull of these unit vectors. A face of the hull is spanned by
# an axis and the two diagonals beside it; its normal is (1, √3 - 1, 0).
_INSCRIBED = 1.0 / math.hypot(1.0, math.sqrt(3.0) - 1.0)
# Factor to the next size after one that is confirmed in all directions.
_GROWTH = 4.0
# Bisections between the largest confirmed size and the smallest refused one.
_HALVINGS = 5
# Sizes below this share of the largest one count as none.
_LEAST = 1e-3


@dataclass(frozen=True)
class Corner:
    """A displacement for which a motion was planned again, with the result.

    Attributes
    ----------
    name : str
        Such as "+x", "-yaw", or "+x-y+z" for the diagonal of an octant.
    size : float
        Length or angle of the displacement [m or rad].
    reason : str
        Why the motion is not verified, or not near the plan; "" where it is both.
    """

    name: str
    size: float
    reason: str


@dataclass(frozen=True)
class CorrectionSide:
    """How far something may be moved, or turned, if it is planned again.

    Attributes
    ----------
    size : float
        Displacements up to this, in any direction, are in the hull of the corners [m or rad]:
        0.807 of how far these are.
    corners : tuple of Corner
        Where motions were verified, in 14 directions; empty where none was confirmed.
    estimate : float
        By the distance of the joints to their limits, to first order [m or rad].
    stops : str
        What fails at the next larger size that was tried; "" where nothing fails in the range.
    """

    size: float
    corners: tuple[Corner, ...]
    estimate: float
    stops: str


@dataclass(frozen=True)
class Correction:
    """How far a part or base may be displaced if the motion is planned again.

    Attributes
    ----------
    of : str
    translation, rotation : CorrectionSide
    motion, problem : str
        Digests of the motion and of the problem that it is of.
    """

    of: str
    translation: CorrectionSide
    rotation: CorrectionSide
    motion: str
    problem: str

    def __str__(self) -> str:
        """Return both sides in words: what is confirmed, in how many directions, what limits it."""
        sides = (("moved", self.translation), ("turned", self.rotation))
        count = sum(len(side.corners) for _, side in sides)
        lines = [f"planned again, the {self.of} may be (confirmed at {count} corners)"]
        for what, side in sides:
            where = "nowhere"
            if side.corners:
                farthest = _size_text(what, side.corners[0].size)
                where = f"in {len(side.corners)} directions by {farthest}"
            stops = side.stops or "nothing in the range that was searched"
            lines.append(
                f"{what} by {_size_text(what, side.size)}: verified {where}; estimate "
                f"{_size_text(what, side.estimate)}; stops: {stops}"
            )
        return "\n".join(lines)


def correction(
    plan: Plan,
    *,
    of: str = "part",
    part: Sequence[str] | None = None,
    center: npt.ArrayLike | None = None,
    farthest: float = 0.1,
    most_turned: float = 0.3,
    progress: Progress = silent,
) -> Correction:
    """Return how far a part or base may be displaced if the motion is planned again for that.

    A size is confirmed by planning: in 14 directions, along all axes and into all octants, a
    verified motion was found none of whose joints differs by more than 0.5 rad or m from the plan.
    The size is the radius of the largest ball within these corners, 0.807 of their distance.
    Between corners nothing is proved; `make bench NAME=corrections` plans again there.

    Parameters
    ----------
    plan : Plan
        A verified one.
    of : {"part", "base"}
        What is displaced.
    part : sequence of str, optional
        The obstacles that move with the path; by default all that are fixed in the world.
    center : (3,), optional
        Centre of rotations, in world axes [m]; by default the middle of the path, or the base.
    farthest, most_turned : float
        Largest displacements that are tried [m], [rad].
    progress : callable, optional
        Called with ``("corners", done, 0)``.

    Raises
    ------
    PlanError
        The plan is not verified.
    ProblemError
        An argument is not what it should be, or the path is given in a frame that moves.
    KeyboardInterrupt
        It was interrupted.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"correction: plan is {shown(plan)}, expected a Plan")
    plan.require()
    as_choice(of, "correction: of", ("part", "base"))
    as_called(progress, "progress")
    about = None if center is None else as_numbers(center, "correction: center", "(3,)", (3,))
    bodies = part
    if of == "part" and part is None:
        bodies = _fixed_obstacles(plan)
    places = places_of([plan.problem], of, bodies, about, COORDINATES)
    limits = (
        as_number(farthest, "correction: farthest", above=0.0),
        as_number(most_turned, "correction: most_turned", above=0.0),
    )
    corners = _Corners(places, plan, progress)
    translation = corners.side(range(3), limits[0])
    rotation = corners.side(range(3, 6), limits[1])
    return Correction(of, translation, rotation, plan.trajectory.digest, plan.problem.digest)


def _fixed_obstacles(plan: Plan) -> tuple[str, ...]:
    return tuple(
        body.name
        for item in plan.problem.clearances
        for body in item.obstacles
        if body.frame is None
    )


class _Corners:
    """Search for the largest size at which motions are verified in all directions."""

    def __init__(self, places: Places, plan: Plan, progress: Progress) -> None:
        self._places, self._plan, self._progress, self._done = places, plan, progress, 0

    def side(self, axes: range, most: float) -> CorrectionSide:
        """Return the largest size that is confirmed at the corners around."""
        directions = [np.eye(6)[:, list(axes)] @ each for each in _DIRECTIONS]
        names = [_name_of([COORDINATES[k] for k in axes], each) for each in _DIRECTIONS]
        estimate = min(_room(self._places, self._plan, each) for each in directions)
        size = min(max(estimate, _LEAST * most), most)
        low, high, stops = 0.0, math.inf, ""
        confirmed: tuple[Corner, ...] = ()
        what = "moved" if axes.start == 0 else "turned"
        for _ in range(_HALVINGS + 12):
            tried = self._at(directions, names, size)
            worst = tried[-1]
            if worst.reason:
                high, stops = size, f"{worst.name} by {_size_text(what, size)}: {worst.reason}"
                # The corner that failed last is tried first: usually it fails again.
                first = names.index(worst.name)
                names.insert(0, names.pop(first))
                directions.insert(0, directions.pop(first))
            else:
                low, confirmed = size, tuple(tried)
            if low >= most or high <= _LEAST * most or low >= (1.0 - 0.5**_HALVINGS) * high:
                break
            size = min(_GROWTH * low, most) if math.isinf(high) else 0.5 * (low + high)
        return CorrectionSide(_INSCRIBED * low, confirmed, estimate, stops)

    def _at(self, directions: Sequence[Array], names: Sequence[str], size: float) -> list[Corner]:
        """Plan at corners of a size, until one fails."""
        found = []
        for direction, name in zip(directions, names, strict=True):
            tried = self._places.corrected(size * direction, (self._plan,))
            self._done += 1
            self._progress("corners", self._done, 0)
            found.append(Corner(name, size, tried.reason or _difference(self._plan, tried)))
            if found[-1].reason:
                break
        return found


def _name_of(axes: Sequence[str], direction: Array) -> str:
    """Return a direction (3,) in words."""
    return "".join(
        f"{'+' if share > 0.0 else '-'}{axis}"
        for axis, share in zip(axes, direction.tolist(), strict=True)
        if share
    )


def _difference(plan: Plan, tried: Tried) -> str:
    """Return which joint differs from a plan by more than `NEAR`, in words; "" for none."""
    t = np.linspace(plan.trajectory.t[0], plan.trajectory.t[-1], _SAMPLES)
    difference = np.abs(tried.plans[0].trajectory(t) - plan.trajectory(t))
    row, joint = np.unravel_index(int(np.argmax(difference)), difference.shape)
    largest = difference[row, joint]
    if largest <= NEAR:
        return ""
    name = plan.robot.joint_names[int(joint)]
    return f"joint '{name}' is {largest:.2g} {plan.robot.unit_of(name)} from the plan"


def _room(places: Places, plan: Plan, direction: Array) -> float:
    """Return how far joint limits allow a displacement in a direction (6,), to first order.

    For a target moved by δx, Δq = J⁺ δx is the least change of the joints.
    """
    follows, t = plan.problem.follows, spread_along(plan.path, _SAMPLES)
    small = 1e-6
    by = places.displacement(small * direction)
    if places.of == "base":
        by = by.inverse()
    frame = follows.items[0].chain.base_placement
    by = frame.inverse() * by * frame
    item, room = follows.items[0], math.inf
    envelope = envelope_of_problem(plan.problem)
    for q in plan.trajectory(np.minimum(t, plan.trajectory.t[-1])):
        pose = item.chain.place(q)
        twist = item.task.twist_error(by * pose, pose)
        wanted = item.task.select(twist[:, None], pose.rotation)[:, 0] / small
        jacobian = item.jacobian(q)
        step = np.linalg.pinv(jacobian) @ wanted
        slack = np.where(step > 0.0, envelope.upper - q, q - envelope.lower)
        moving = np.abs(step) > 1e-9
        if moving.any():
            room = min(room, float((slack[moving] / np.abs(step[moving])).min()))
    return max(room, 0.0)


def _size_text(what: str, size: float) -> str:
    if math.isinf(size):
        return "any"
    return f"{1e3 * size:.3g} mm" if what == "moved" else f"{math.degrees(size):.3g}°"
