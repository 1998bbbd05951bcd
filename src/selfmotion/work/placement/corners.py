"""How far the part, or the arm, may stand elsewhere when the motion is planned again for that.

An estimate from the room that the joints have, and what is confirmed: motions planned again at
places all around, each from the one that there is.
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
from selfmotion.work.placement.places import COORDINATES, Places, Tried, places_of

# A motion is near another one while no joint is farther from it than this [rad or m].
NEAR = 0.5
# Times at which the room of the joints is looked at.
_LOOKS = 60
# Directions all around: the axes, and the diagonals of their octants.
_AROUND = np.vstack(
    [np.eye(3), -np.eye(3), np.array(list(product((1.0, -1.0), repeat=3))) / 3**0.5]
)
# The largest ball within the hull of these, of length 1: a face of it is spanned by an axis and two
# diagonals beside it, all at this distance from its plane's normal (1, √3 - 1, 0).
_WITHIN = 1.0 / math.hypot(1.0, math.sqrt(3.0) - 1.0)
# Growth of a size that is confirmed in all directions.
_GROWTH = 1.6
# Bisections between the largest confirmed size and the smallest refused one.
_HALVINGS = 5
# Sizes below this share of the largest one that is looked at are none.
_LEAST = 1e-3


@dataclass(frozen=True)
class Corner:
    """A place at which a motion was planned again, and what came of it.

    Attributes
    ----------
    name : str
        Such as "+x", "-yaw", or "+x-y+z" for the diagonal of an octant.
    size : float
        How far it is moved or turned [m or rad].
    reason : str
        Why it is not verified, or not near; "" where it is both.
    """

    name: str
    size: float
    reason: str


@dataclass(frozen=True)
class CorrectionSide:
    """How far something may be moved, or turned.

    Attributes
    ----------
    size : float
        Displacements up to this, in any direction, are in the hull of the corners [m or rad]:
        0.807 of how far these are.
    corners : tuple of Corner
        Where motions were verified, in 14 directions; empty where none was confirmed.
    estimate : float
        What the room of the joints at the planned motion gives, to first order [m or rad].
    stops : str
        What is in the way at the next larger size that was tried; "" where nothing is as far as
        was looked.
    """

    size: float
    corners: tuple[Corner, ...]
    estimate: float
    stops: str


@dataclass(frozen=True)
class Correction:
    """How far part or base may stand elsewhere when it is planned again.

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
        """Return both in words: what is confirmed, where, and what stops more."""
        sides = (("moved", self.translation), ("turned", self.rotation))
        count = sum(len(side.corners) for _, side in sides)
        lines = [f"planned again, the {self.of} may be (confirmed at {count} corners)"]
        for what, side in sides:
            told = "nowhere"
            if side.corners:
                farthest = _told(what, side.corners[0].size)
                told = f"in {len(side.corners)} directions by {farthest}"
            stops = side.stops or "nothing in the range that was searched"
            lines.append(
                f"{what} by {_told(what, side.size)}: verified {told}; estimate "
                f"{_told(what, side.estimate)}; stops: {stops}"
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
    """Return how far part or base may stand elsewhere when the motion is planned again for that.

    What is claimed was planned again: in 14 directions, along all axes and into all octants, a
    verified motion was found no joint of which is farther than 0.5 rad or m from the plan's. The
    size is that of the largest ball within these corners: 0.807 of their distance. Between corners
    nothing is proved; `make bench NAME=corrections` plans again there.

    Parameters
    ----------
    plan : Plan
        A verified one.
    of : {"part", "base"}
        What stands elsewhere.
    part : sequence of str, optional
        The obstacles that move along with the path; by default all that stand in the world.
    center : (3,), optional
        What it is turned about, in world axes [m]; by default the middle of the path, or the base.
    farthest, most_turned : float
        No corners farther away are looked at [m], [rad].
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
        bodies = _standing(plan)
    places = places_of([plan.problem], of, bodies, about, COORDINATES)
    limits = (
        as_number(farthest, "correction: farthest", above=0.0),
        as_number(most_turned, "correction: most_turned", above=0.0),
    )
    corners = _Corners(places, plan, progress)
    translation = corners.side(range(3), limits[0])
    rotation = corners.side(range(3, 6), limits[1])
    return Correction(of, translation, rotation, plan.trajectory.digest, plan.problem.digest)


def _standing(plan: Plan) -> tuple[str, ...]:
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
        ways = [np.eye(6)[:, list(axes)] @ way for way in _AROUND]
        names = [_named([COORDINATES[k] for k in axes], way) for way in _AROUND]
        estimate = min(_room(self._places, self._plan, way) for way in ways)
        size = min(max(estimate, _LEAST * most), most)
        low, high, stops = 0.0, math.inf, ""
        confirmed: tuple[Corner, ...] = ()
        what = "moved" if axes.start == 0 else "turned"
        for _ in range(_HALVINGS + 12):
            tried = self._at(ways, names, size)
            worst = tried[-1]
            if worst.reason:
                high, stops = size, f"{worst.name} by {_told(what, size)}: {worst.reason}"
                # The corner that failed last is tried first: usually it fails again.
                first = names.index(worst.name)
                names.insert(0, names.pop(first))
                ways.insert(0, ways.pop(first))
            else:
                low, confirmed = size, tuple(tried)
            if low >= most or high <= _LEAST * most or high - low <= high / 2**_HALVINGS:
                break
            size = min(_GROWTH * low, most) if math.isinf(high) else 0.5 * (low + high)
        return CorrectionSide(_WITHIN * low, confirmed, estimate, stops)

    def _at(self, ways: Sequence[Array], names: Sequence[str], size: float) -> list[Corner]:
        """Plan at corners of a size, until one fails."""
        found = []
        for way, name in zip(ways, names, strict=True):
            tried = self._places.corrected(size * way, (self._plan,))
            self._done += 1
            self._progress("corners", self._done, 0)
            found.append(Corner(name, size, tried.reason or _far(self._plan, tried)))
            if found[-1].reason:
                break
        return found


def _named(axes: Sequence[str], way: Array) -> str:
    """Return a direction (3,) in words."""
    return "".join(
        f"{'+' if share > 0.0 else '-'}{axis}"
        for axis, share in zip(axes, way.tolist(), strict=True)
        if share
    )


def _far(plan: Plan, tried: Tried) -> str:
    """Return which joint is farther from a plan than what counts as near; "" for none."""
    t = np.linspace(plan.trajectory.t[0], plan.trajectory.t[-1], _LOOKS)
    apart = np.abs(tried.plans[0].trajectory(t) - plan.trajectory(t))
    row, joint = np.unravel_index(int(np.argmax(apart)), apart.shape)
    if apart[row, joint] <= NEAR:
        return ""
    name = plan.robot.joint_names[int(joint)]
    return f"joint '{name}' is {apart[row, joint]:.2g} {plan.robot.unit_of(name)} from the plan"


def _room(places: Places, plan: Plan, way: Array) -> float:
    """Return how far the joints' limits let the target go along a way, to first order.

    For a target moved by δx, Δq = J⁺ δx is the least change of the joints.
    """
    follows, t = plan.problem.follows, spread_along(plan.path, _LOOKS)
    small = 1e-6
    by = places.displacement(small * way)
    if places.of == "base":
        by = by.inverse()
    frame = follows.items[0].chain.base_placement
    by = frame.inverse() * by * frame
    item, room = follows.items[0], math.inf
    envelope = plan.problem.envelope
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


def _told(what: str, size: float) -> str:
    if math.isinf(size):
        return "any"
    return f"{1e3 * size:.3g} mm" if what == "moved" else f"{math.degrees(size):.3g}°"
