"""Checks of single parameters of a problem: kinds, names of costs, requirements of constraints."""

from collections.abc import Sequence
from typing import Any

from selfmotion.basics import ProblemError, shown
from selfmotion.certificate import Requirement
from selfmotion.model.follow import Follow, Follows
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Damping, Relaxation
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.costs import Cost

# Parameters of a problem that are sequences, and the type of their items.
SEQUENCES = {
    "costs": Cost,
    "constraints": Constraint,
    "relaxations": Relaxation,
    "also": Follow,
}
# Type of each other parameter, …
_KINDS: dict[str, Any] = {
    "robot": RobotModel,
    "path": Path,
    "null_motion": NullMotion,
    "damping": Damping | None,
}
# … and what an error says was expected.
_EXPECTED = {
    "robot": "RobotModel (load_robot)",
    "path": "Path (Line, Circle, Waypoints, TwistPath, …, or a class derived from Path)",
    "null_motion": "NullMotion (selfmotion.motion.FreeNullMotion(), which is the default, "
    "PolynomialNullMotion(), BSplineNullMotion(…), or a class derived from NullMotion)",
    "damping": "Damping or None",
}


def check_kinds(problem: object) -> None:
    """Raise ProblemError where a single parameter is of another kind."""
    for name, kind in _KINDS.items():
        value = getattr(problem, name)
        if not isinstance(value, kind):
            raise ProblemError(f"{name} is {shown(value)}, expected a {_EXPECTED[name]}")


def check_costs(follows: Follows, costs: Sequence[Cost], all_costs: Sequence[Cost]) -> None:
    """Raise ProblemError where there is no cost, two share a name, or one does not fit the arm.

    `all_costs` are `costs` and those that damping adds.
    """
    if not costs:
        raise ProblemError("no cost is given, so that nothing tells one motion from another")
    names = [cost.name for cost in all_costs]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise ProblemError(f"two costs are called '{repeated[0]}'; give one another name=")
    for cost in costs:
        cost.check(follows)


def check_requirements(
    constraints: Sequence[Constraint], requirements: Sequence[Requirement]
) -> None:
    """Raise ProblemError where the requirement of a constraint is none."""
    for constraint, requirement in zip(constraints, requirements, strict=True):
        if not isinstance(requirement, Requirement):
            raise ProblemError(
                f"constraint {type(constraint).__name__}: requirement() returned {requirement!r}, "
                f"expected a Requirement; without one nothing judges whether a motion keeps it"
            )
