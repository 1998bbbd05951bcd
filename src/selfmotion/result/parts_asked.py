"""Whether parts are, together, the motion that was asked for."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from selfmotion.path import Path, Retimed
from selfmotion.problem import START_MISS, asked_of_part, at_all_times, times_along
from selfmotion.result.asked import Asked, another_tool, follows_at, looked_at, not_judged_by
from selfmotion.result.joints import Piece, elsewhere, gaps
from selfmotion.result.plan import Plan

if TYPE_CHECKING:
    from selfmotion.result.parts import Parts

# A part is never quicker than the path is [share].
_OWN_PACE = 1.0 + 1e-9


class PartsAsked:
    """Holds parts against their problem: the whole path in order, and one move after another.

    Parameters
    ----------
    parts : Parts
    """

    def __init__(self, parts: "Parts") -> None:
        self._parts, self._problem = parts, parts.problem

    def failures(self) -> Iterator[str]:
        """Yield what was asked for and is not so."""
        parts = self._parts
        if not parts.plans:
            yield "there is no part"
            return
        stops = [0.0, *parts.cuts, self._problem.path.duration]
        if len(stops) != len(parts.plans) + 1 or not np.all(np.diff(stops) > 0.0):
            yield (
                f"{len(parts.plans)} parts are cut at {list(parts.cuts)} s, expected a time "
                f"between each two, in order, within 0..{stops[-1]:.6g} s"
            )
            return
        for number, (plan, ends) in enumerate(zip(parts.plans, pairwise(stops), strict=True), 1):
            for text in self._of_part(plan, ends, number):
                yield f"part {number}: {text}"
        yield from self._of_moves()

    def _of_part(self, plan: Plan, ends: tuple[float, float], number: int) -> Iterator[str]:
        problem, made = self._problem, plan.problem
        is_first, is_last = number == 1, number == len(self._parts.plans)
        path = made.path
        if not (is_first and is_last):
            if not _is_part(path, problem.path, ends):
                yield f"it is not the path from {ends[0]:.6g} to {ends[1]:.6g} s"
                return
            if isinstance(path, Retimed):
                moved = problem.along(lambda _: path, times_along(path, ends))
                relaxed = moved["relaxations"]
            else:
                relaxed = tuple(problem.relaxations)
            constraints = tuple(asked_of_part(problem, is_first, is_last))
        else:
            path, relaxed = problem.path, tuple(problem.relaxations)
            constraints = tuple(problem.constraints)
        own = problem.own_collision
        kept = [item for item in constraints if item.applies(problem.robot)]
        asked = Asked(
            problem.robot,
            path,
            problem.task,
            relaxed,
            (*kept, *([] if own is None else [own])),
            tolerance=self._parts.tolerance,
            also=problem.also,
            rest=problem.rest and problem.damping is None,
        )
        yield from asked.failures(plan)
        start = problem.given_start
        if is_first and start is not None:
            # What a start given near the path is put onto it by.
            first = Piece("it", plan.trajectory)
            yield from elsewhere(problem.robot, first, 0, start, START_MISS)

    def _of_moves(self) -> Iterator[str]:
        parts, problem = self._parts, self._problem
        plans, moves = parts.plans, parts.moves
        is_closed = any(item.closes for item in problem.constraints) and len(plans) > 1
        wanted = len(plans) if is_closed else len(plans) - 1
        if len(moves) != wanted:
            yield f"{len(plans)} parts have {len(moves)} moves in between, expected {wanted}"
            return
        own = problem.own_collision
        asked = [*at_all_times(problem.constraints), *([] if own is None else [own])]
        for number, move in enumerate(moves, 1):
            for text in another_tool(move.robot, problem.robot):
                yield f"move {number}: {text}"
            if move.trajectory is not None:
                kept = [item for item in asked if item.applies(problem.robot)]
                for text in not_judged_by(move.constraints, kept, None):
                    yield f"move {number}: {text}"
        pieces = []
        for number, plan in enumerate(plans, 1):
            pieces.append(Piece.of(f"part {number}", plan))
            pieces += [Piece.of(f"move {number}", move) for move in moves[number - 1 : number]]
        if is_closed:
            pieces.append(Piece.of("part 1", plans[0]))
        found = [piece for piece in pieces if piece is not None]
        # Where a move was not found, that is told already.
        if len(found) == len(pieces):
            yield from gaps(problem.robot, found)


def _is_part(part: Path, whole: Path, ends: tuple[float, float]) -> bool:
    """Whether a path is another one from one of its times to another, or slower."""
    t = looked_at(part)
    first, last = ends
    passed = part.pace(t) if isinstance(part, Retimed) else t
    # All of it: what is left out at either end is bridged by a move.
    reached = np.array([passed[0], passed[-1]])
    if not np.abs(reached - [0.0, last - first]).max() <= 1e-9 * whole.duration:
        return False
    if isinstance(part, Retimed) and not np.all(part.pace(t, 1) <= _OWN_PACE):
        return False
    return follows_at(part, t, whole, np.clip(first + passed, first, last))
