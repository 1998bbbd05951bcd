"""From seams in the best order to a program, with the moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array
from selfmotion.planning.result import Move
from selfmotion.work.job.obstructing import ObstructingBuilder
from selfmotion.work.job.order import EXACT
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.step import Step
from selfmotion.work.job.work import Work, seam_steps

# Orders that are tried at most, where the best order is computed exactly.
_MAX_ORDERS = 200
# Orders that are tried at most, where there are too many seams for that.
_MAX_ORDERS_OF_MANY = 12
# Penalty of a move that was not found, where every order needs one [s].
_MISSING_MOVE = 1e6
# States that a move leads from and to; None is the start or the end of the program.
_StatePair = tuple[int | None, int | None]


def build_program(ordering: Ordering, work: Work, ends: tuple[Array | None, ...]) -> Program:
    """Return the program of a job; seams without a motion are named in it.

    Parameters
    ----------
    ordering : Ordering
        The states of all seams; gets the times of moves.
    work : Work
        Plans the moves.
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """
    if any(seam.leaves for seam in ordering.seams):
        return ObstructingBuilder(ordering, work, ends).program()
    return _ProgramBuilder(ordering, work, ends).program()


class _ProgramBuilder:
    """Builds the program of a job whose seams leave no obstacles behind.

    The first order is the best by lower bounds of the times of moves. Its moves are planned; where
    they take longer, the best order is computed again, until all moves of one are planned.

    Parameters
    ----------
    ordering : Ordering
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """

    def __init__(self, ordering: Ordering, work: Work, ends: tuple[Array | None, ...]) -> None:
        self._ordering, self._work, self._ends = ordering, work, ends
        self._moves: dict[_StatePair, Move] = {}
        self._notes: list[str] = []

    def program(self) -> Program:
        """Return the program; seams without a motion are named in it."""
        states, bound = self._best_order()
        if not states:
            states = self._order_with_gaps()
        return Program(
            self._work.settings.robot,
            tuple(self._steps(states)),
            dict(self._ordering.missing),
            bound,
            tuple(self._notes),
        )

    def _best_order(self) -> tuple[tuple[int, ...], float]:
        """Return the states of the cheapest order whose moves are all found, and a lower bound.

        No states where no such order is found; the bound is on the cost of any order [s].
        """
        ordering = self._ordering
        bound = ordering.best().bound
        cheapest: tuple[float, tuple[int, ...]] = (np.inf, ())
        is_exact = len(ordering.planned) <= EXACT
        for _ in range(_MAX_ORDERS if is_exact else _MAX_ORDERS_OF_MANY):
            candidate = ordering.best()
            if not candidate.states:
                break
            unplanned = self._unplanned_pairs(candidate.states)
            self._plan_moves(unplanned)
            cost = self._cost(candidate.states)
            bound = max(bound, candidate.bound) if is_exact else bound
            if np.isfinite(cost):
                cheapest = min(cheapest, (cost, candidate.states))
            # Moves not planned yet are estimated below what they take: no other order is better.
            if not unplanned or (np.isfinite(cost) and not is_exact):
                break
        return cheapest[1], bound

    def _order_with_gaps(self) -> tuple[int, ...]:
        """Return the states of the order with the fewest moves that are not found."""
        for pair, move in self._moves.items():
            if not move.verified:
                self._ordering.record_time(*pair, _MISSING_MOVE)
        states = self._ordering.best().states
        self._plan_moves(self._unplanned_pairs(states))
        return states

    def _unplanned_pairs(self, states: Sequence[int]) -> list[_StatePair]:
        """Return the moves of an order that are not planned yet."""
        return [pair for pair in self._pairs(states) if pair not in self._moves]

    def _pairs(self, states: Sequence[int]) -> list[_StatePair]:
        """Return the moves of an order, with those from the start and to the end if given."""
        start, end = self._ends
        first = [] if start is None else [(None, states[0])]
        last = [] if end is None else [(states[-1], None)]
        return [*first, *pairwise(states), *last]

    def _plan_moves(self, pairs: Sequence[_StatePair]) -> None:
        """Plan moves, record their times in the ordering, and note those that are not found."""
        ends = [(*self._move_ends(pair), ()) for pair in pairs]
        names = [self._ordering.name_of_move(*pair) for pair in pairs]
        moves = self._work.moves(ends, names)
        for pair, name, move in zip(pairs, names, moves, strict=True):
            self._moves[pair] = move
            duration = move.motion.duration if move.verified else np.inf
            self._ordering.record_time(*pair, duration)
            if not move.verified:
                self._notes.append(f"'{name}' is dropped: {move.trouble}")

    def _move_ends(self, pair: _StatePair) -> tuple[Array, Array]:
        """Return start and end of a move, (n,) each."""
        states, (origin, destination) = self._ordering.states, pair
        start = self._ends[0] if origin is None else states[origin].ends[1]
        end = self._ends[1] if destination is None else states[destination].ends[0]
        if start is None or end is None:
            raise RuntimeError("a move has an end that is not given")
        return start, end

    def _cost(self, states: Sequence[int]) -> float:
        """Return the cost of an order whose moves are planned [s]; inf where one is not found."""
        moves = [self._moves[pair] for pair in self._pairs(states)]
        if not all(move.verified for move in moves):
            return float(np.inf)
        seams = sum(self._ordering.cost_of(state) for state in states)
        return seams + sum(move.motion.duration for move in moves)

    def _steps(self, states: Sequence[int]) -> list[Step]:
        """Return the steps of an order: its seams, each after the move to it, and the last move."""
        steps = list[Step]()
        move_to = {pair[1]: pair for pair in self._pairs(states)}
        for state in states:
            if state in move_to:
                steps.append(self._move_step(move_to[state]))
            motion = self._ordering.states[state]
            seam = self._ordering.seams[motion.seam]
            plan = self._ordering.plan_of(state)
            steps += seam_steps(seam, plan, motion.turned, self._work)
        if None in move_to:
            steps.append(self._move_step(move_to[None]))
        return steps

    def _move_step(self, pair: _StatePair) -> Step:
        return Step(self._ordering.name_of_move(*pair), self._moves[pair])
