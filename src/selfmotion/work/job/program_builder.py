"""From an order to a program: moves are planned, and the order again where they take longer."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from selfmotion.basics import (
    Array,
)
from selfmotion.planning.result import Move
from selfmotion.work.job.obstructing import ObstructingBuilder
from selfmotion.work.job.order import EXACT
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.step import Step
from selfmotion.work.job.work import Work, seam_steps

# Orders that are tried at most, where the best order is computed exactly.
_ORDERS = 200
# Orders that are tried at most, where there are too many seams for that.
_ORDERS_OF_MANY = 12
# Penalty of a move that was not found, where every order needs one [s].
_GAP = 1e6
# From which state to which one; None is the start or the end of the program.
Pair = tuple[int | None, int | None]


class Builder:
    """Builds the program of a job.

    Parameters
    ----------
    ordering : Ordering
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """

    def __init__(self, ordering: Ordering, work: Work, ends: tuple[Array | None, ...]) -> None:
        self._ordering, self._work, self._ends = ordering, work, ends
        self._notes: list[str] = []

    def program(self) -> Program:
        """Return the program; seams without a motion are named in it."""
        if any(seam.leaves for seam in self._ordering.seams):
            return ObstructingBuilder(self._ordering, self._work, self._ends).program()
        return self._of_moves()

    def _of_moves(self) -> Program:
        ordering, moves = self._ordering, dict[Pair, Move]()
        bound = ordering.best().bound
        best: tuple[float, tuple[int, ...]] = (np.inf, ())
        exact = len(ordering.planned) <= EXACT
        for _ in range(_ORDERS if exact else _ORDERS_OF_MANY):
            found = ordering.best()
            if not found.states:
                break
            wanted = [pair for pair in self._pairs(found.states) if pair not in moves]
            self._plan(wanted, moves)
            cost = self._cost(found.states, moves)
            bound = max(bound, found.bound) if exact else bound
            if np.isfinite(cost):
                best = min(best, (cost, found.states))
            # Moves not planned yet are estimated below what they take: no other order is better.
            if not wanted or (np.isfinite(cost) and not exact):
                break
        states = best[1] or self._with_gaps(moves)
        return Program(
            self._work.settings.robot,
            tuple(self._steps(states, moves)),
            dict(ordering.missing),
            bound,
            tuple(self._notes),
        )

    def _with_gaps(self, moves: dict[Pair, Move]) -> tuple[int, ...]:
        """Return the order with the fewest moves that are not found."""
        for pair, move in moves.items():
            if not move.verified:
                self._ordering.record_time(*pair, _GAP)
        states = self._ordering.best().states
        self._plan([pair for pair in self._pairs(states) if pair not in moves], moves)
        return states

    def _pairs(self, states: Sequence[int]) -> list[Pair]:
        start, end = self._ends
        first = [] if start is None else [(None, states[0])]
        last = [] if end is None else [(states[-1], None)]
        return [*first, *pairwise(states), *last]

    def _plan(
        self,
        wanted: Sequence[Pair],
        moves: dict[Pair, Move],
    ) -> None:
        """Plan moves, and record their times in the ordering."""
        ends = [(*self._ends_of(pair), ()) for pair in wanted]
        names = [self._ordering.name_of_move(*pair) for pair in wanted]
        for pair, move in zip(wanted, self._work.moves(ends, names), strict=True):
            moves[pair] = move
            seconds = move.motion.duration if move.verified else np.inf
            self._ordering.record_time(*pair, seconds)
            if not move.verified:
                name = self._ordering.name_of_move(*pair)
                self._notes.append(f"'{name}' is dropped: {move.trouble}")

    def _ends_of(self, pair: Pair) -> tuple[Array, Array]:
        """Return start and end of a move, (n,) each."""
        states, (one, other) = self._ordering.states, pair
        first = self._ends[0] if one is None else states[one].ends[1]
        last = self._ends[1] if other is None else states[other].ends[0]
        if first is None or last is None:
            raise RuntimeError("a move has an end that is not given")
        return first, last

    def _cost(self, states: Sequence[int], moves: dict[Pair, Move]) -> float:
        found = [moves[pair] for pair in self._pairs(states)]
        if not all(move.verified for move in found):
            return float(np.inf)
        own = sum(self._ordering.own(state) for state in states)
        return own + sum(move.motion.duration for move in found)

    def _steps(self, states: Sequence[int], moves: dict[Pair, Move]) -> list[Step]:
        pairs, steps = self._pairs(states), list[Step]()
        by_last = {pair[1]: pair for pair in pairs}
        for state in states:
            if state in by_last:
                pair = by_last[state]
                steps.append(Step(self._ordering.name_of_move(*pair), moves[pair]))
            here = self._ordering.states[state]
            seam = self._ordering.seams[here.seam]
            plan = self._ordering.plan_of(state)
            steps += seam_steps(seam, plan, here.turned, self._work)
        if None in by_last:
            steps.append(Step(self._ordering.name_of_move(*by_last[None]), moves[by_last[None]]))
        return steps
