"""Constraints that a controller's program can keep."""

from collections.abc import Sequence
from dataclasses import replace

from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import Problem


def by_targets(problem: Problem) -> Problem:
    """Return a problem with the constraints that targets can keep."""
    return replace(problem, constraints=constraints_of_targets(problem.constraints))


def constraints_of_targets(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that targets can keep: the controller sets the accelerations."""
    limited = (item.for_controller() for item in constraints)
    return tuple(item for item in limited if item is not None)


def constraints_of_lines(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that straight lines between targets can keep.

    Corners have no acceleration, and so no torques, which are verified along the smooth curve.
    """
    limited = (item.for_controller(lines=True) for item in constraints)
    return tuple(item for item in limited if item is not None)
