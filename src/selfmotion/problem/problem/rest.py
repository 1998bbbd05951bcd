"""Rest at the ends of a path: up to which derivative tool and arm are at rest."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import Follows
from selfmotion.model.path import REST_SPEED, Path, edges_of
from selfmotion.model.task import Task
from selfmotion.problem.constraints import Constraint

# Times from an end at which speeds are compared, this one and twice it, as a share of the first or
# last segment of the path: small, so that they depend on that segment alone.
_NEAR_END = 1e-4
# Smallest power of time with which the speed grows where the acceleration at rest is zero: between
# 1, of a constant acceleration, and 2, of a constant jerk.
_SMOOTH_EXPONENT = 1.5


def arm_rest_orders(follows: Follows, constraints: Sequence[Constraint]) -> tuple[int, int]:
    """Return the orders of rest of the arm at start and end; see `rest_orders`.

    0 where a constraint prescribes the velocity, at most 1 where one prescribes the acceleration.
    """
    orders = [rest_orders(item.path, item.task) for item in follows.items]
    start, end = (_allowed(min(order[k] for order in orders), constraints, k) for k in (0, 1))
    return start, end


def _allowed(order: int, constraints: Sequence[Constraint], end: int) -> int:
    """Return an order of rest, lowered to what constraints on the end allow."""
    if any(item.ends.velocity[end] for item in constraints):
        return 0
    accelerates = any(item.ends.acceleration[end] for item in constraints)
    return min(order, 1) if accelerates else order


def rest_orders(path: Path, task: Task) -> tuple[int, int]:
    """Return the orders of rest of the prescribed rows at start and end.

    0 where they move, 1 where they are at rest, 2 where their acceleration is zero too, so that a
    motion from standstill is smooth there.
    """
    segments, steps = np.diff(edges_of(path.knots)), np.arange(3.0)
    first = _speeds(path, task, _NEAR_END * segments[0] * steps)
    last = _speeds(path, task, path.duration - _NEAR_END * segments[-1] * steps)
    return _order(first), _order(last)


def _speeds(path: Path, task: Task, t: Array) -> list[float]:
    """Return the largest prescribed row of the twist at times t (K,) [m/s or rad/s]."""
    samples = path.samples(t)
    rows = task.select_along(samples.twist[:, :, None], samples.rotation)[:, :, 0]
    return [float(speed) for speed in np.abs(rows).max(axis=1)]


def _order(speeds: list[float]) -> int:
    """Return the order of rest from the speeds at an end, near it, and at twice that distance."""
    at_end, near, twice_as_far = speeds
    if at_end > REST_SPEED:
        return 0
    is_smooth = twice_as_far == 0.0 or near <= twice_as_far * 0.5**_SMOOTH_EXPONENT
    return 2 if is_smooth else 1
