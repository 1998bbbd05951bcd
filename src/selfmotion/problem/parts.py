"""What of a problem is asked along a part of its path, and of moves between parts."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.constraints import Constraint
from selfmotion.path import Retimed
from selfmotion.problem.problem import Problem

# A window shorter than this share of a part is none.
_SHORTEST_WINDOW = 1e-2


def asked_of_part(problem: Problem, is_first: bool, is_last: bool) -> Iterator[Constraint]:
    """Yield what the constraints ask of a part that is the first or the last one, or neither."""
    for item in problem.constraints:
        kept: Constraint | None = None if item.closes else item
        if kept is not None and not is_last:
            kept = kept.on_part()
        if kept is not None and not is_first:
            kept = kept.on_last_part()
        if kept is not None:
            yield kept


def at_all_times(constraints: Sequence[Constraint]) -> list[Constraint]:
    """Return what constraints ask of all times, and nothing that they ask of an end."""
    parts = (item.on_part() for item in constraints)
    inner = (part.on_last_part() for part in parts if part is not None)
    return [item for item in inner if item is not None]


def check_all_times(constraints: Sequence[Constraint], remedy: str) -> None:
    """Raise ProblemError, with a remedy, where a constraint asks something of an end alone."""
    for item in constraints:
        if item.on_part() is None or item.on_last_part() is None:
            raise ProblemError(
                f"constraints: {type(item).__name__} asks something of an end alone: {remedy}"
            )


def times_along(path: Retimed, ends: tuple[float, float]) -> Callable[[Array], Array]:
    """Return when windows of the whole path (first, last) are open on a stretch of it.

    As (0, 0) where that is hardly at all.
    """

    def when(window: Array) -> Array:
        first, last = path.when(np.clip(window, *ends) - ends[0]).tolist()
        # A ramp hardly moves at its end: when it gets there is known to some digits only.
        first = 0.0 if window[0] <= ends[0] else first
        last = path.duration if window[1] >= ends[1] else last
        is_open = last - first > _SHORTEST_WINDOW * path.duration
        return np.array([first, last]) if is_open else np.zeros(2)

    return when
