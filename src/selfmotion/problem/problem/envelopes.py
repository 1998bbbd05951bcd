"""Envelopes of a problem: limits and bodies of its constraints, and the arm's own limits."""

from collections.abc import Sequence
from functools import reduce
from operator import and_
from typing import TYPE_CHECKING

from selfmotion.certificate import Requirement, arm_limits
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints import Constraint, Envelope

if TYPE_CHECKING:
    from selfmotion.problem.problem.problem import Problem


def envelope_of_problem(problem: "Problem") -> Envelope:
    """Return the envelope of a problem's constraints and of its arm's own limits."""
    return envelope_of(problem.robot, problem.all_constraints)


def envelope_of(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return the envelope of constraints and of the arm's own limits."""
    requirements = [item.requirement(robot) for item in constraints]
    return _with_arm_limits(robot, requirements, envelope_without_arm(robot, constraints))


def envelope_without_arm(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return the envelope of constraints, without the arm's own limits."""
    unbounded = Envelope.unbounded(robot.dof)
    return reduce(and_, (item.envelope(robot) for item in constraints), unbounded)


def _with_arm_limits(
    robot: RobotModel, requirements: Sequence[Requirement], envelope: Envelope
) -> Envelope:
    """Return an envelope intersected with the arm's limits that the certificate checks."""
    arm_envelopes = (Envelope.of_limits(item) for item in arm_limits(robot, requirements))
    return reduce(and_, arm_envelopes, envelope)
