"""Constraints on the ends of a motion, told apart from those that hold at all times."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from selfmotion.basics import Array, ProblemError
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import Constraint

if TYPE_CHECKING:
    from selfmotion.problem.problem.problem import Problem


def prescribed_end(robot: RobotModel, constraints: Sequence[Constraint]) -> Array | None:
    """Return the configuration (n,) prescribed at the end of motions; None if none is."""
    for item in constraints:
        if item.ends.pins[1] and item.applies(robot):
            for end in item.conditions(robot).ends:
                if end.orders == (0,) and not end.at_start:
                    return end.target
    return None


def constraints_of_part(problem: "Problem", is_first: bool, is_last: bool) -> Iterator[Constraint]:
    """Yield the constraints on a part of the motion.

    Those on one end apply to the first or the last part alone, those that close the motion to none.
    """
    for item in problem.constraints:
        is_on_other_part = (item.ends.is_about(0) and not is_first) or (
            item.ends.is_about(1) and not is_last
        )
        if not (item.ends.closes or is_on_other_part):
            yield item


def at_all_times(constraints: Sequence[Constraint]) -> list[Constraint]:
    """Return the constraints that hold at all times, without those on an end."""
    return [item for item in constraints if not _is_on_end(item)]


def check_all_times(constraints: Sequence[Constraint], remedy: str) -> None:
    """Raise ProblemError, with a remedy, where a constraint is on an end alone."""
    for item in constraints:
        if _is_on_end(item):
            raise ProblemError(
                f"constraints: {type(item).__name__} is a condition on an end alone: {remedy}"
            )


def _is_on_end(item: Constraint) -> bool:
    return item.ends.is_about(0) or item.ends.is_about(1)
