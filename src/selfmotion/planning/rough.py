"""Rough motions from many starts, and which of them are worth more: on nodes, all at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Flags, Ints, Progress
from selfmotion.motion import Grid, Trajectory
from selfmotion.nodes import NodeGrid, Together
from selfmotion.planning.apart import apart_of, unlike
from selfmotion.planning.effort import Effort
from selfmotion.planning.for_nodes import takes
from selfmotion.planning.settings import (
    FIRST_ROUNDS,
    FURTHER,
    HEATS,
    HOPELESS,
    ONE_VALLEY,
    ROUGH_ROUNDS,
    ROUGH_STEPS,
    SAME_OPTIMUM,
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

    def run(self, starts: Sequence[Array], finalists: int) -> None:
        """Leave the best `finalists` of the starts (n,), or fewer where they became the same."""


def rough_grid(problem: Problem) -> Grid:
    """Return the grid of rough motions."""
    steps = max(ROUGH_STEPS, problem.null_motion.rough.fewest_steps)
    # A path of many waypoints is crossed in strides: what is rough needs not stop at each.
    knots = problem.knots if len(problem.knots) <= steps else problem.knots[[0, -1]]
    return Grid.aligned(knots, steps)


class OnNodes:
    """Ranks starts by rough optima on nodes, of all of them at once.

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
        self._order: Ints = np.zeros(0, dtype=np.int64)
        # Which take the arm into itself, once that was looked at.
        self._met: Flags = np.zeros(0, dtype=np.bool_)

    @staticmethod
    def takes(problem: Problem, effort: Effort, start: Array) -> bool:
        """Whether problems are for nodes, and neither bodies nor ends have to be seen to."""
        bound = problem.bind_constraints(start, start, apart=effort.apart)
        own = problem.own_collision is not None
        bodies = bool(problem.envelope.bodies) and not own
        none = not bodies and not any(item.equality for item in bound)
        return none and takes(problem, effort, bound)

    @property
    def ranked(self) -> list[RoughMotion]:
        """See `Ranking`."""
        found = self._found
        if found is None:
            return []
        motions, grid = [], found.motion.grid.copied(1)
        for k in self._order.tolist():
            motion = grid.near(found.q[k], found.qd[k])
            if motion is not None:
                motions.append(RoughMotion(motion.trajectory, None, float(found.costs[k])))
        return motions

    def run(self, starts: Sequence[Array], finalists: int) -> None:
        """See `Ranking`."""
        grid, problem = rough_grid(self._problem), self._problem
        motions, arrived = carried(problem.follows, np.array(starts), grid.nodes)
        if not arrived.any():
            return
        # Of limits, all motions have the same.
        bound = problem.bind_constraints(*motions[0, [0, -1]], apart=False)
        nodes = NodeGrid(problem, grid.nodes, bound, free=True, counts=self._effort.counts)
        self._progress("rough motions", 1, 1 + ROUGH_ROUNDS)
        found = self._keep(Together.near(nodes, motions[arrived]))
        alone, near = unlike(found.q, self._order, self._apart, ONE_VALLEY)
        most = np.array([*alone, *near][: max(HEATS[0][0], finalists)], dtype=np.int64)
        found = self._keep(found.picked(most))
        for number in range(1, ROUGH_ROUNDS + 1):
            if not found.going.any():
                break
            self._progress("rough motions", 1 + number, 1 + ROUGH_ROUNDS)
            found = self._keep(found.advanced())
            if number == FIRST_ROUNDS:
                found = self._drop(found, max(FURTHER, finalists))
        if not len(self._met):
            self._drop(found, finalists)
        self._order = self._order[:finalists]

    def _keep(self, found: Together) -> Together:
        """Know motions from now on, whatever interrupts; return them."""
        merits = found.merits
        known = self._met if len(self._met) == found.count else np.zeros(found.count, np.bool_)
        order = np.lexsort((merits, known))
        self._found, self._order = found, order[np.isfinite(merits[order])]
        return found

    def _drop(self, found: Together, most: int) -> Together:
        """Keep and return so many at most; those that take the arm into itself last.

        Not what became the same as a better one, nor what costs much more than the best.
        """
        merits, clear, met = found.merits, list[int](), list[int]()
        for k in unlike(found.q, self._order, self._apart, SAME_OPTIMUM)[0]:
            best = merits[clear[0]] if clear else np.inf
            if len(clear) == most or merits[k] > best + (HOPELESS - 1.0) * abs(best):
                break
            # That takes a while; beside one that is clear, others are looked at when they are best.
            is_clear = bool(clear) or self._problem.keeps_off_itself(found.q[k])
            (clear if is_clear else met).append(k)
        kept = np.array([*clear, *met][:most], dtype=np.int64)
        self._met = np.arange(len(kept)) >= len(clear)
        return self._keep(found.picked(kept))
