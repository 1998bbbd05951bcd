"""Constraints that a controller's program can keep: it interpolates between targets by itself."""

from collections.abc import Sequence
from dataclasses import replace

from selfmotion.problem.constraints import Constraint
from selfmotion.problem.problem import Problem


def problem_of_targets(problem: Problem) -> Problem:
    """Return a problem with only those constraints that a program of targets can keep."""
    return replace(problem, constraints=constraints_of_targets(problem.constraints))


def constraints_of_targets(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that targets can keep.

    The others, such as limits of acceleration and jerk, depend on the controller.
    """
    kept = (item.for_controller() for item in constraints)
    return tuple(item for item in kept if item is not None)


def constraints_of_lines(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the constraints that straight lines between targets can keep.

    At their corners there is no acceleration, and so no torque: torques are verified along the
    smooth curve instead.
    """
    kept = (item.for_controller(lines=True) for item in constraints)
    return tuple(item for item in kept if item is not None)
