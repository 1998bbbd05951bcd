"""Default null motion, constraints and costs of a problem."""

from selfmotion.model.motion import FreeNullMotion
from selfmotion.problem.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
    PositionDependentVelocityLimits,
)
from selfmotion.problem.costs import Cost, JointVelocity

# Any null motion.
ANY_NULL_MOTION = FreeNullMotion()
# Limits that arms' makers publish …
OF_MAKER: tuple[Constraint, ...] = (
    JointAccelerationLimits(),
    JointJerkLimits(),
    PositionDependentVelocityLimits(),
)
# … and with those of URDFs: the constraints of a problem that names none.
KEPT: tuple[Constraint, ...] = (JointPositionLimits(), JointVelocityLimits(), *OF_MAKER)
# Placeholder for the usual cost of the problem's arm (`JointVelocity.usual`).
USUAL_COSTS: tuple[Cost, ...] = (JointVelocity(),)
