"""Rough motions from many starts, and which of them are worth more: on nodes, all at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Flags, Ints, Progress
from selfmotion.motion import Grid, Trajectory
from selfmotion.nodes import NodeGrid, NodeMotion, Together
from selfmotion.planning.apart import apart_of, unlike
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import resolves, takes
from selfmotion.planning.settings import (
    ABOUT_AS_GOOD,
    HEATS,
    ONE_VALLEY,
    ROUGH_AGREEMENT,
    ROUGH_ROUNDS,
    ROUGH_STEPS,
    SAME_OPTIMUM,
    SAME_TO_DIGITS,
)
from selfmotion.problem import Problem
from selfmotion.search import carried


@dataclass(frozen=True, eq=False)
class RoughMotion:
    """A rough motion from a start.

    Attributes
    ----------
    trajectory : Trajectory
    cost : float or None
        F, where it is about what is best near by; None where it is farther from there.
    """

    trajectory: Trajectory
    cost: float | None = None


class Ranking(Protocol):
    """Ranks starts by what becomes of them."""

    @property
    def ranked(self) -> list[RoughMotion]:
        """The motions that were found so far, the best first."""

    def run(self, starts: Sequence[Array], finalists: int) -> bool:
        """Leave the best `finalists` of the starts (n,), or fewer where they became the same.

        Returns whether that tells which starts are best.
        """


def rough_grid(problem: Problem) -> Grid:
    """Return the grid of rough motions."""
    steps = max(ROUGH_STEPS, problem.null_motion.rough.fewest_steps)
    # A path of many waypoints is crossed in strides: what is rough needs not stop at each.
    knots = problem.knots if len(problem.knots) <= steps else problem.knots[[0, -1]]
    return Grid.aligned(knots, steps)


class OnNodes:
    """Ranks starts by rough optima on nodes, of all of them at once.

    Conditions do not count in these: what keeps them all the same is as good as what is dearer, and
    what does not becomes dearer. Where none of the cheapest keeps them, that says nothing, and
    nothing is ranked.

    Parameters
    ----------
    problem : Problem
    effort : Effort
    progress : Progress
    """

    def __init__(self, problem: Problem, effort: Effort, progress: Progress) -> None:
        self._problem, self._effort, self._progress = problem, effort, progress
        self._apart = apart_of(problem.robot)
        self._found: Together | None = None
        self._ranked: list[RoughMotion] = []

    @staticmethod
    def takes(problem: Problem, effort: Effort, start: Array) -> bool:
        """Whether problems are for nodes, side by side, and nothing is asked of ends.

        Not where accelerations cost: cubics on few nodes say little of them.
        """
        costs, dof = problem.all_costs, problem.robot.dof
        if not all(cost.is_pointwise and max(cost.curvature(dof), default=0) < 2 for cost in costs):
            return False
        bound = problem.bind_constraints(start, start, apart=effort.apart)
        return not any(item.equality for item in bound) and takes(problem, effort, bound)

    @property
    def ranked(self) -> list[RoughMotion]:
        """See `Ranking`."""
        if self._ranked or self._found is None:
            return self._ranked
        # Interrupted, or none is the best for sure: the cheapest one that keeps all will do.
        near = (self._motion(self._found, k) for k in _cheapest(self._found))
        motions = [motion for motion in near if motion is not None]
        kept = (one for one in motions if one.violation <= 0.0)
        best = next((one for one in kept if self._clear(one)), next(iter(motions), None))
        return [] if best is None else [_rough(best)]

    def run(self, starts: Sequence[Array], finalists: int) -> bool:
        """See `Ranking`."""
        grid, problem = rough_grid(self._problem), self._problem
        motions, arrived = carried(problem.follows, np.array(starts), grid.nodes)
        if not arrived.any():
            return False
        nodes = self._grid(problem, grid)
        total = 1 + ROUGH_ROUNDS
        self._progress("rough motions", 1, total)
        found = self._found = Together.near(nodes, motions[arrived])
        soft = problem.softened(float(found.costs.min()))
        if soft is not problem:
            nodes = self._grid(soft, grid)
            found = self._found = Together.near(nodes, motions[arrived])
        alone, near = unlike(found.q, _cheapest(found), self._apart, ONE_VALLEY)
        which = [*alone, *near][: max(HEATS[0][0], finalists)]
        if not which or nodes.cost.depends_on_errors(found.motion.partials):
            return False
        found = self._found = found.picked(np.array(which, dtype=np.int64))
        for number in range(2, total + 1):
            self._progress("rough motions", number, total)
            if _hopeful(found).any():
                found = self._found = found.advanced()
        self._ranked = self._decisive(found, finalists)
        return bool(self._ranked)

    def _grid(self, problem: Problem, grid: Grid) -> NodeGrid:
        counts = self._effort.counts
        return NodeGrid(problem, grid.nodes, (), free=True, counts=counts, calm=True)

    def _decisive(self, found: Together, finalists: int) -> list[RoughMotion]:
        """Return the cheapest motion that keeps all, then others about as cheap; or none.

        None is the cheapest for sure where it is not at its optimum yet, or the nodes are too few.
        """
        kept: list[RoughMotion] = []
        others: list[RoughMotion] = []
        dearest = np.inf
        for k in unlike(found.q, _cheapest(found), self._apart, SAME_OPTIMUM)[0]:
            if found.costs[k] > dearest or len(kept) + len(others) == finalists:
                break
            motion = self._motion(found, k)
            # What costs the same to the last digits is one of the arm's mirror images.
            if motion is None or any(_same(motion.cost, one.cost) for one in kept):
                continue
            if found.going[k] or not resolves(motion, ROUGH_AGREEMENT):
                return []
            # What got stuck may become better as well.
            stuck = found.promised[k] > ABOUT_AS_GOOD * abs(motion.cost)
            if stuck or motion.breaks_hard():
                others.append(_rough(motion))
            elif self._clear(motion):
                kept.append(_rough(motion))
            else:
                # An optimum that takes the arm into itself goes on doing that.
                continue
            cost = float(found.costs[k])
            dearest = min(dearest, cost + ABOUT_AS_GOOD * abs(cost))
        return [*kept, *others] if kept and not _hopeful(found).any() else []

    def _motion(self, found: Together, k: int) -> NodeMotion | None:
        """Return one of the motions, with the conditions that are asked of it."""
        problem, q = self._problem, found.q[k]
        bound = problem.bind_constraints(q[0], q[-1], apart=self._effort.apart)
        t = found.motion.grid.t[: len(q)]
        counts = self._effort.counts
        grid = NodeGrid(problem, t, bound, free=True, counts=counts, calm=True)
        return grid.near(q, found.qd[k], found.qdd[k])

    def _clear(self, motion: NodeMotion) -> bool:
        return self._problem.keeps_off_itself(motion.place.q)


def _cheapest(found: Together) -> Ints:
    """Return the numbers of motions, the cheapest first, without those that are not to be had."""
    order = np.argsort(found.costs, kind="stable")
    return np.asarray(order[np.isfinite(found.costs[order])])


def _hopeful(found: Together) -> Flags:
    """Return which motions are on their way, and may come to cost less than what has arrived."""
    least = found.costs[~found.going].min(initial=np.inf)
    dearest = least + ABOUT_AS_GOOD * abs(least) if np.isfinite(least) else least
    return np.asarray(found.going & (found.costs - found.promised < dearest))


def _same(a: float, b: float | None) -> bool:
    return b is not None and abs(a - b) <= SAME_TO_DIGITS * abs(a)


def _rough(motion: NodeMotion) -> RoughMotion:
    return RoughMotion(motion.trajectory, motion.cost)
