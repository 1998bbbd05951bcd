"""Other motions to begin from, where the optimum near a guess violates conditions."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from selfmotion.model.motion import Grid
from selfmotion.planning.formulation import BoundConditions
from selfmotion.planning.nodes import (
    NodeGrid,
    NodeMotion,
    by_kind,
    centred,
    minimise,
    on_grid,
)
from selfmotion.planning.planner.outcomes import is_kept, rank_of
from selfmotion.planning.planner.recorder import Recorder
from selfmotion.problem.costs import Cost, JointAcceleration, JointJerk

# Newton iterations from each of several initial guesses: longer ones mostly fail.
FEWER_ITERATIONS = 25
# Penalty of the use of limits of q̈ or jerk where these are violated, in multiples of the cost.
_SMOOTHING = 1e3
# Refinement rounds of that: with few nodes the Bernstein bound is loose.
_SMOOTHING_ROUNDS = 3
# Cost by order of the limit.
_SMOOTHING_COSTS = {2: JointAcceleration, 3: JointJerk}
# Where x = 0 fails, the self-motion goes towards the middle of the limits in these shares of the
# duration …
_TOWARDS_MIDDLE = (1.0 / 16.0, 1.0 / 64.0, 1.0 / 4.0)
# … and to either side of the start by these distances along its self-motion [rad or m] …
_SIDEWAYS = (0.4, -0.4, 0.8, -0.8)
# … after this share of the duration …
_SIDEWAYS_AFTER = 1.0 / 4.0
# … of which this number is tried at most.
_MAX_SIDEWAYS = 4


def smoothest(begun: NodeMotion, recorder: Recorder) -> Iterator[NodeMotion]:
    """Yield the motion that uses least of the limits that one violates, by squares."""
    costs = _costs_of_limits(begun)
    if not costs:
        return
    formulation, motion = replace(begun.grid.formulation, costs=tuple(costs)), begun
    for number in range(_SMOOTHING_ROUNDS):
        ends = BoundConditions(ends=motion.grid.conditions.ends)
        counts, free = begun.grid.counts, begun.grid.free
        grid = NodeGrid(formulation, motion.grid.t, ends, free=free, counts=counts)
        found = minimise(
            grid.at(centred(motion)), recorder.note, roughly=True, max_iterations=FEWER_ITERATIONS
        )
        motion = motion.grid.at(centred(found.motion))
        if is_kept(motion) or number == _SMOOTHING_ROUNDS - 1:
            yield motion
            return
        finer = on_grid(motion, motion.grid.on(Grid(motion.grid.t).halved().nodes))
        if finer is None:
            return
        motion = finer


def _costs_of_limits(begun: NodeMotion) -> tuple[Cost, ...]:
    """Return what uses of the limits of q̈ and jerk that a motion violates cost; none for none."""
    grid, formulation = begun.grid, begun.grid.formulation
    found, most = list[Cost](), _SMOOTHING * abs(begun.objective) / formulation.path.duration
    residuals = by_kind(grid.rows, begun.h)[0]
    for item, h in zip(grid.conditions.limits, residuals, strict=True):
        if item.order in _SMOOTHING_COSTS and (h > 0.0).any():
            weight = np.zeros(formulation.robot.dof)
            weight[item.joints] = most / (0.5 * (item.upper - item.lower)) ** 2
            found.append(_SMOOTHING_COSTS[item.order](weight, name=item.name))
    return (*formulation.costs, *found) if found else ()


def towards_ends_and_middle(begun: NodeMotion) -> Iterator[NodeMotion | None]:
    """Yield motions that go to where they have to end, and towards the middle of the limits."""
    grid, start = begun.grid, begun.place.q[0]
    if grid.ends.last is not None:
        yield grid.motion_towards(start, grid.ends.last)
    if grid.free:
        return
    own = grid.formulation.coordinates
    limited = np.isfinite(own.lower) & np.isfinite(own.upper)
    middle = start.copy()
    middle[limited] = 0.5 * (own.lower[limited] + own.upper[limited])
    for share in _TOWARDS_MIDDLE:
        yield grid.motion_towards(start, middle, share * grid.formulation.path.duration)


def sideways(begun: NodeMotion) -> Iterator[NodeMotion]:
    """Yield motions that go to either side along their self-motion, what breaks least first.

    Past bodies there are several ways, and no step leads from one to another.
    """
    grid, start = begun.grid, begun.place.q[0]
    if grid.free:
        return
    time = _SIDEWAYS_AFTER * grid.formulation.path.duration
    goals = [start + far * way for way in begun.charts.bases[0].T for far in _SIDEWAYS]
    found = [grid.motion_towards(start, goal, time) for goal in goals]
    rank = partial(rank_of, begun=begun)
    yield from sorted((motion for motion in found if motion), key=rank)[:_MAX_SIDEWAYS]
