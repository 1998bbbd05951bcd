"""Rough motions from many starts, and which of them are worth more: on nodes, all at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Ints, Progress
from selfmotion.motion import Grid, Trajectory
from selfmotion.nodes import NodeGrid, NodeMotion, Together
from selfmotion.planning.apart import apart_of, unlike
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import takes
from selfmotion.planning.kept_on_nodes import broken_by
from selfmotion.planning.settings import (
    ABOUT_AS_GOOD,
    FIRST_ROUNDS,
    FURTHER,
    HEATS,
    ONE_VALLEY,
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
    deviation : (size,) or None
        Of the tool from its path, as `Deviation` has it, where some is allowed.
    cost : float or None
        F, where it is about what is best near by; None where it is farther from there.
    """

    trajectory: Trajectory
    deviation: Array | None = None
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
        """Whether problems are for nodes, and nothing is asked of ends."""
        bound = problem.bind_constraints(start, start, apart=effort.apart)
        return not any(item.equality for item in bound) and takes(problem, effort, bound)

    @property
    def ranked(self) -> list[RoughMotion]:
        """See `Ranking`."""
        # Interrupted, or of those that break conditions: the cheapest one will do.
        found = self._found
        if self._ranked or found is None or not np.isfinite(found.costs).any():
            return self._ranked
        k = int(found.costs.argmin())
        motion = found.motion.grid.copied(1).near(found.q[k], found.qd[k])
        return [] if motion is None else [_rough(motion)]

    def run(self, starts: Sequence[Array], finalists: int) -> bool:
        """See `Ranking`."""
        grid, problem = rough_grid(self._problem), self._problem
        motions, arrived = carried(problem.follows, np.array(starts), grid.nodes)
        if not arrived.any():
            return False
        # Of limits, all motions have the same.
        bound = problem.bind_constraints(*motions[0, [0, -1]], apart=self._effort.apart)
        nodes = NodeGrid(problem, grid.nodes, bound, free=True, counts=self._effort.counts)
        self._progress("rough motions", 1, 1 + ROUGH_ROUNDS)
        found = self._optima(Together.near(nodes, motions[arrived]), finalists)
        self._ranked = self._decisive(found, nodes, finalists)
        return bool(self._ranked)

    def _optima(self, found: Together, finalists: int) -> Together:
        """Return rough optima near the cheapest of motions, near unlike ones first."""
        self._found = found
        alone, near = unlike(found.q, _cheapest(found), self._apart, ONE_VALLEY)
        found = self._picked(found, [*alone, *near], max(HEATS[0][0], finalists))
        for number in range(1, ROUGH_ROUNDS + 1):
            if not found.going.any():
                break
            self._progress("rough motions", 1 + number, 1 + ROUGH_ROUNDS)
            found = self._found = found.advanced()
            if number == FIRST_ROUNDS:
                alone, _ = unlike(found.q, _cheapest(found), self._apart, SAME_OPTIMUM)
                found = self._picked(found, alone, max(FURTHER, finalists))
        return found

    def _picked(self, found: Together, order: list[int], most: int) -> Together:
        self._found = found.picked(np.array(order[:most], dtype=np.int64))
        return self._found

    def _decisive(self, found: Together, nodes: NodeGrid, finalists: int) -> list[RoughMotion]:
        """Return the cheapest motion that keeps all, then others about as cheap; or none."""
        kept: list[RoughMotion] = []
        broken: list[RoughMotion] = []
        dearest = np.inf
        for k in unlike(found.q, _cheapest(found), self._apart, SAME_OPTIMUM)[0]:
            if found.costs[k] > dearest or len(kept) + len(broken) == finalists:
                break
            motion = nodes.near(found.q[k], found.qd[k])
            # What costs the same to the last digits is one of the arm's mirror images.
            if motion is None or any(_same(motion.cost, one.cost) for one in kept):
                continue
            if broken_by(motion).any():
                broken.append(_rough(motion))
            elif self._problem.keeps_off_itself(motion.place.q):
                kept.append(_rough(motion))
            else:
                # An optimum that takes the arm into itself goes on doing that.
                continue
            dearest = min(dearest, motion.cost + ABOUT_AS_GOOD * abs(motion.cost))
        return [*kept, *broken] if kept else []


def _cheapest(found: Together) -> Ints:
    """Return the numbers of motions, the cheapest first, without those that are not to be had."""
    order = np.argsort(found.costs, kind="stable")
    return np.asarray(order[np.isfinite(found.costs[order])])


def _same(a: float, b: float | None) -> bool:
    return b is not None and abs(a - b) <= SAME_TO_DIGITS * abs(a)


def _rough(motion: NodeMotion) -> RoughMotion:
    return RoughMotion(motion.trajectory, None, motion.cost)
