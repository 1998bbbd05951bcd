"""How smoothly a tool, and the arm with it, begins and ends."""

from collections.abc import Sequence

import numpy as np

from selfmotion.constraints import Constraint
from selfmotion.follow import Follows
from selfmotion.path import STILL, Path
from selfmotion.task import Task

# Speeds are compared this share of the duration from an end, and twice as far from it.
_NEAR_END = 1e-4
# Speed that grows with at least this power of the time has no acceleration at the end.
_SMOOTH = 1.5


def arm_rest_orders(follows: Follows, constraints: Sequence[Constraint]) -> tuple[int, int]:
    """Return how smoothly an arm comes to rest with all its tips, unless constraints say how fast.

    Of each end, as in `rest_orders`.
    """
    orders = [rest_orders(item.path, item.task) for item in follows.items]
    start, end = (_allowed(min(order[k] for order in orders), constraints, k) for k in (0, 1))
    return start, end


def _allowed(order: int, constraints: Sequence[Constraint], end: int) -> int:
    if any(item.sets_velocity[end] for item in constraints):
        return 0
    accelerates = any(item.sets_acceleration[end] for item in constraints)
    return min(order, 1) if accelerates else order


def rest_orders(path: Path, task: Task) -> tuple[int, int]:
    """Return how smoothly the prescribed rows begin and end.

    Of each end: 0 where the tool moves, 1 where it rests, 2 where it rests and does not accelerate
    either, so that a motion from standstill is smooth there.
    """
    step = _NEAR_END * path.duration
    t = np.array([0.0, step, 2.0 * step])
    first, last = (_speeds(path, task, times) for times in (t, path.duration - t))
    return _order(first), _order(last)


def _speeds(path: Path, task: Task, t: np.ndarray) -> list[float]:
    samples = path.samples(t)
    rows = task.select_along(samples.twist[:, :, None], samples.rotation)[:, :, 0]
    return [float(speed) for speed in np.abs(rows).max(axis=1)]


def _order(speeds: list[float]) -> int:
    at, near, far = speeds
    if at > STILL:
        return 0
    return 2 if far == 0.0 or near <= far * 0.5**_SMOOTH else 1
