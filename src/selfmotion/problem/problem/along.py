"""Derived quantities of a path: smoothness, rest at ends, length, and constraints of parts."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import reduce
from operator import and_
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, ProblemError, read_only
from selfmotion.certificate import Requirement, arm_limits
from selfmotion.model.follow import Follows
from selfmotion.model.path import REST_SPEED, Path, Retimed, edges_of, spread_along
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.problem.constraints import Constraint, Envelope

if TYPE_CHECKING:
    from selfmotion.problem.problem.problem import Problem


def smooth_knots(follows: Follows, relaxations: Sequence[Relaxation]) -> Array:
    """Return the knots of all paths, and the ends of the windows of tolerances, [s] (K,)."""
    duration, first = follows.duration, follows.items[0]
    knots = list(first.path.knots)
    for other in follows.items[1:]:
        knots = _with_times(knots, other.path.knots, duration)
    for item in relaxations:
        knots = _with_times(knots, item.window(duration), duration)
    return read_only(sorted(knots))


def _with_times(knots: list[float], times: Iterable[float], duration: float) -> list[float]:
    """Return knots and times; times nearer to each other than rounding are merged."""
    found = list(knots)
    for time in times:
        if np.abs(np.array(found) - time).min() > 1e-9 * duration:
            found.append(float(time))
    return found


# Speeds are compared at this share of the path's first or last segment from an end, and at twice
# that: a later segment is independent of them.
_NEAR_END = 1e-4
# Speed that grows with at least this power of time starts without acceleration.
_SMOOTH = 1.5


def arm_rest_orders(follows: Follows, constraints: Sequence[Constraint]) -> tuple[int, int]:
    """Return the orders of rest of an arm at both ends, unless constraints give its speed.

    Of each end, as in `rest_orders`.
    """
    orders = [rest_orders(item.path, item.task) for item in follows.items]
    start, end = (_allowed(min(order[k] for order in orders), constraints, k) for k in (0, 1))
    return start, end


def _allowed(order: int, constraints: Sequence[Constraint], end: int) -> int:
    if any(item.ends.velocity[end] for item in constraints):
        return 0
    accelerates = any(item.ends.acceleration[end] for item in constraints)
    return min(order, 1) if accelerates else order


def rest_orders(path: Path, task: Task) -> tuple[int, int]:
    """Return the orders up to which the prescribed rows rest at start and end.

    Of each end: 0 where the tool moves, 1 where it rests, 2 where it rests and does not accelerate
    either, so that a motion from standstill is smooth there.
    """
    sections, away = np.diff(edges_of(path.knots)), np.arange(3.0)
    first = _speeds(path, task, _NEAR_END * sections[0] * away)
    last = _speeds(path, task, path.duration - _NEAR_END * sections[-1] * away)
    return _order(first), _order(last)


def _speeds(path: Path, task: Task, t: np.ndarray) -> list[float]:
    samples = path.samples(t)
    rows = task.select_along(samples.twist[:, :, None], samples.rotation)[:, :, 0]
    return [float(speed) for speed in np.abs(rows).max(axis=1)]


def _order(speeds: list[float]) -> int:
    at, near, far = speeds
    if at > REST_SPEED:
        return 0
    return 2 if far == 0.0 or near <= far * 0.5**_SMOOTH else 1


# Samples of a path's length at the start …
_SAMPLES = 101
# … and at most …
_MOST_SAMPLES = 100_000
# … which are doubled while the length grows by this factor.
_GROWS = 1.05


def length_of(path: Path) -> float:
    """Return the path length of the tool [m], by samples that are refined until it converges."""
    length, before, samples = 0.0, -1.0, _SAMPLES
    # Loops may be few or many: each refinement has no time in common with the one before.
    while length > _GROWS * before and samples < _MOST_SAMPLES:
        places = path.samples(spread_along(path, samples)).translation
        before, length = length, float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
        samples = 2 * samples + 1
    return length


def envelope_of(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return the envelope of constraints and of the arm's own limits."""
    requirements = [item.requirement(robot) for item in constraints]
    return with_own_limits(robot, requirements, envelope_without_arm(robot, constraints))


def envelope_without_arm(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return the envelope of constraints, without the arm's own limits."""
    free = Envelope.unbounded(robot.dof)
    return reduce(and_, (item.envelope(robot) for item in constraints), free)


def with_own_limits(
    robot: RobotModel, requirements: Sequence[Requirement], given: Envelope
) -> Envelope:
    """Return an envelope with the arm's own limits where the certificate judges these."""
    own = (Envelope.of_limits(item) for item in arm_limits(robot, requirements))
    return reduce(and_, own, given)


def given_end(robot: RobotModel, constraints: Sequence[Constraint]) -> Array | None:
    """Return the configuration (n,) that motions have to end in; None where none is given."""
    for item in constraints:
        if item.ends.pins[1] and item.applies(robot):
            for end in item.conditions(robot).ends:
                if end.orders == (0,) and not end.at_start:
                    return end.target
    return None


# Shortest window on a part, as a share of the part and of the window: shorter ones are dropped.
_SHORTEST_WINDOW = 1e-2


def constraints_of_part(problem: "Problem", is_first: bool, is_last: bool) -> Iterator[Constraint]:
    """Yield the constraints for a part that is the first or the last one, or neither."""
    for item in problem.constraints:
        elsewhere = (item.ends.is_about(0) and not is_first, item.ends.is_about(1) and not is_last)
        if not (item.ends.closes or any(elsewhere)):
            yield item


def at_all_times(constraints: Sequence[Constraint]) -> list[Constraint]:
    """Return the conditions of constraints at all times, without those at an end."""
    return [item for item in constraints if not (item.ends.is_about(0) or item.ends.is_about(1))]


def check_all_times(constraints: Sequence[Constraint], remedy: str) -> None:
    """Raise ProblemError, with a remedy, where a constraint is on an end alone."""
    for item in constraints:
        if item.ends.is_about(0) or item.ends.is_about(1):
            raise ProblemError(
                f"constraints: {type(item).__name__} asks something of an end alone: {remedy}"
            )


def times_along(path: Retimed, ends: tuple[float, float]) -> Callable[[Array], Array]:
    """Return the map from windows of the whole path (first, last) to those on a part of it.

    As (0, 0) where that is hardly at all.
    """

    def when(window: Array) -> Array:
        first, last = path.when(np.clip(window, *ends) - ends[0]).tolist()
        # A ramp hardly moves at its end, so that its end time has few digits.
        first = 0.0 if window[0] <= ends[0] else first
        last = path.duration if window[1] >= ends[1] else last
        least = _SHORTEST_WINDOW * min(path.duration, float(window[1] - window[0]))
        is_open = last - first > least
        return np.array([first, last]) if is_open else np.zeros(2)

    return when
