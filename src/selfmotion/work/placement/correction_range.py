"""Correction range: how far a part or base may be displaced if the motion is replanned.

`estimate` is a first-order bound from joint limits. `size` is confirmed: motions are replanned for
displacements in 14 directions, with the plan as warm start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

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

# Largest difference of a joint between a plan and its replanned motion [rad or m]: a larger one is
# another branch.
_MAX_JOINT_CHANGE = 0.5
# Times at which motions are compared, and joint limits evaluated.
_SAMPLES = 60
# Unit vectors: the six axis directions and the eight diagonals of the octants.
_DIRECTIONS = np.vstack(
    [np.eye(3), -np.eye(3), np.array(list(product((1.0, -1.0), repeat=3))) / 3**0.5]
)
# Radius of the largest ball within the hull of these unit vectors. A face of the hull is spanned by
# an axis and the two diagonals beside it; its normal is (1, √3 - 1, 0).
_INSCRIBED = 1.0 / math.hypot(1.0, math.sqrt(3.0) - 1.0)
# Factor from a confirmed size to the next.
_GROWTH = 4.0
# Bisections between the largest confirmed size and the smallest refused one.
_HALVINGS = 5
# Largest number of sizes that are tried: 12 to bracket the range, the others bisect.
_MAX_SIZES = 12 + _HALVINGS
# Size, as a share of the largest, below which the range counts as zero.
_MIN_SHARE = 1e-3
# Displacement of the finite difference [m or rad].
_DIFFERENCE_STEP = 1e-6
# Joint rate per displacement below which a joint does not move.
_IMMOBILE = 1e-9

_Unit = Literal["m", "rad"]


@dataclass(frozen=True)
class Corner:
    """A displacement for which a motion was replanned, with the result.

    Attributes
    ----------
    name : str
        Direction: "+x", "-yaw", or "+x-y+z" for the diagonal of an octant.
    size : float
        Length or angle of the displacement [m or rad].
    reason : str
        Why the motion is not verified, or not near the plan; "" if it is both.
    """

    name: str
    size: float
    reason: str


@dataclass(frozen=True)
class CorrectionSide:
    """How far something may be moved, or turned, if the motion is replanned.

    Attributes
    ----------
    size : float
        Radius of the ball of displacements within the hull of the confirmed corners [m or rad]:
        0.807 of the distance of the corners.
    corners : tuple of Corner
        Confirmed corners, in 14 directions; empty if none.
    estimate : float
        First-order estimate from joint limits [m or rad].
    stops : str
        Failure at the smallest size that failed; "" if none did.
    """

    size: float
    corners: tuple[Corner, ...]
    estimate: float
    stops: str


@dataclass(frozen=True)
class Correction:
    """How far a part or base may be displaced if the motion is replanned.

    Attributes
    ----------
    of : str
        What is displaced: "part" or "base".
    translation, rotation : CorrectionSide
        Ranges of displacement and of rotation.
    motion, problem : str
        Digests of the plan's trajectory and of its problem.
    """

    of: str
    translation: CorrectionSide
    rotation: CorrectionSide
    motion: str
    problem: str

    def __str__(self) -> str:
        """Return both ranges in words: what is confirmed, in how many directions, and its limit."""
        count = len(self.translation.corners) + len(self.rotation.corners)
        heading = f"if replanned, the {self.of} may be (confirmed at {count} corners)"
        moved, turned = _range_text(self.translation, "m"), _range_text(self.rotation, "rad")
        return f"{heading}\nmoved by {moved}\nturned by {turned}"


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
    """Return how far a part or base may be displaced if the motion is replanned.

    A size is confirmed by planning: in 14 directions, along all axes and into all octants, a
    verified motion was found none of whose joints differs by more than 0.5 rad or m from the plan.
    The size is the radius of the largest ball within these corners, 0.807 of their distance.
    Between corners nothing is proved; `make bench NAME=corrections` replans there.

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
    ranges = _RangeSearch(places, plan, progress)
    translation = ranges.search(range(3), "m", limits[0])
    rotation = ranges.search(range(3, 6), "rad", limits[1])
    return Correction(of, translation, rotation, plan.trajectory.digest, plan.problem.digest)


def _fixed_obstacles(plan: Plan) -> tuple[str, ...]:
    return tuple(
        body.name
        for item in plan.problem.clearances
        for body in item.obstacles
        if body.frame is None
    )


class _RangeSearch:
    """Search for the largest size at which motions are verified in all directions."""

    def __init__(self, places: Places, plan: Plan, progress: Progress) -> None:
        self._places, self._plan, self._progress, self._done = places, plan, progress, 0

    def search(self, axes: range, unit: _Unit, largest: float) -> CorrectionSide:
        """Return the largest size confirmed in all directions of some axes."""
        names = [COORDINATES[k] for k in axes]
        directions = [
            (_name_of(names, each), np.eye(6)[:, list(axes)] @ each) for each in _DIRECTIONS
        ]
        estimate = min(_first_order_range(self._places, self._plan, each) for _, each in directions)
        size = min(max(estimate, _MIN_SHARE * largest), largest)
        low, high, stops = 0.0, math.inf, ""
        confirmed: tuple[Corner, ...] = ()
        for _ in range(_MAX_SIZES):
            corners = self._corners_at(size, directions)
            last = corners[-1]
            if last.reason:
                high, stops = size, f"{last.name} by {_size_text(size, unit)}: {last.reason}"
                # The corner that failed last is tried first: usually it fails again.
                directions.insert(0, directions.pop(len(corners) - 1))
            else:
                low, confirmed = size, tuple(corners)
            is_largest, is_none = low >= largest, high <= _MIN_SHARE * largest
            is_bracketed = low >= (1.0 - 0.5**_HALVINGS) * high
            if is_largest or is_none or is_bracketed:
                break
            size = min(_GROWTH * low, largest) if math.isinf(high) else 0.5 * (low + high)
        return CorrectionSide(_INSCRIBED * low, confirmed, estimate, stops)

    def _corners_at(self, size: float, directions: Sequence[tuple[str, Array]]) -> list[Corner]:
        """Replan at the corners of a size, until one fails."""
        corners = []
        for name, direction in directions:
            result = self._places.corrected(size * direction, (self._plan,))
            self._done += 1
            self._progress("corners", self._done, 0)
            reason = result.reason or _difference(self._plan, result)
            corners.append(Corner(name, size, reason))
            if reason:
                break
        return corners


def _name_of(axes: Sequence[str], direction: Array) -> str:
    """Return a direction (3,) in words."""
    return "".join(
        f"{'+' if share > 0.0 else '-'}{axis}"
        for axis, share in zip(axes, direction.tolist(), strict=True)
        if share
    )


def _difference(plan: Plan, tried: Tried) -> str:
    """Return which joint differs from a plan by too much, in words; "" for none."""
    t = np.linspace(plan.trajectory.t[0], plan.trajectory.t[-1], _SAMPLES)
    difference = np.abs(tried.plans[0].trajectory(t) - plan.trajectory(t))
    row, joint = np.unravel_index(int(np.argmax(difference)), difference.shape)
    largest = difference[row, joint]
    if largest <= _MAX_JOINT_CHANGE:
        return ""
    name = plan.robot.joint_names[int(joint)]
    return f"joint '{name}' is {largest:.2g} {plan.robot.unit_of(name)} from the plan"


def _first_order_range(places: Places, plan: Plan, direction: Array) -> float:
    """Return the largest displacement in a direction (6,) that joint limits allow to first order.

    For a target moved by δx, Δq = J⁺ δx is the least change of the joints.
    """
    item, largest = plan.problem.follows.items[0], math.inf
    displacement = places.displacement(_DIFFERENCE_STEP * direction)
    if places.of == "base":
        displacement = displacement.inverse()
    frame = item.chain.base_placement
    displacement = frame.inverse() * displacement * frame
    envelope = envelope_of_problem(plan.problem)
    t = np.minimum(spread_along(plan.path, _SAMPLES), plan.trajectory.t[-1])
    for q in plan.trajectory(t):
        pose = item.chain.place(q)
        twist = item.task.twist_error(displacement * pose, pose)
        rows = item.task.select(twist[:, None], pose.rotation)[:, 0] / _DIFFERENCE_STEP
        rate = np.linalg.pinv(item.jacobian(q)) @ rows
        distance_to_limit = np.where(rate > 0.0, envelope.upper - q, q - envelope.lower)
        moving = np.abs(rate) > _IMMOBILE
        if moving.any():
            largest = min(largest, float((distance_to_limit[moving] / np.abs(rate[moving])).min()))
    return max(largest, 0.0)


def _range_text(side: CorrectionSide, unit: _Unit) -> str:
    """Return in words what is confirmed on one side, the estimate, and what limits it."""
    where = "nowhere"
    if side.corners:
        where = f"in {len(side.corners)} directions by {_size_text(side.corners[0].size, unit)}"
    limit = side.stops or "nothing in the range that was searched"
    return (
        f"{_size_text(side.size, unit)}: verified {where}; estimate "
        f"{_size_text(side.estimate, unit)}; limited by: {limit}"
    )


def _size_text(size: float, unit: _Unit) -> str:
    if math.isinf(size):
        return "any"
    return f"{1e3 * size:.3g} mm" if unit == "m" else f"{math.degrees(size):.3g}°"
