"""What constraints, and the arm's own limits, ask of single configurations and velocities."""

from collections.abc import Sequence
from functools import reduce
from operator import and_

from selfmotion.certificate import Requirement, arm_limits
from selfmotion.constraints import Constraint, Envelope
from selfmotion.robot import RobotModel


def envelope_of(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return what constraints ask of single configurations, with the arm's own limits."""
    requirements = [item.requirement(robot) for item in constraints]
    return with_own_limits(robot, requirements, asked_envelope(robot, constraints))


def asked_envelope(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return what constraints ask, without the arm's own limits."""
    free = Envelope.unbounded(robot.dof)
    return reduce(and_, (item.envelope(robot) for item in constraints), free)


def with_own_limits(
    robot: RobotModel, requirements: Sequence[Requirement], asked: Envelope
) -> Envelope:
    """Return an envelope with the arm's own limits where the certificate judges these."""
    own = (Envelope.of_limits(item) for item in arm_limits(robot, requirements))
    return reduce(and_, own, asked)
