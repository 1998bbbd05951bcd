"""What a problem is given where nothing else is said: values, meant to be shared."""

from selfmotion.constraints import (
    Clearance,
    Constraint,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.costs import Cost, JointVelocity
from selfmotion.motion import FreeNullMotion

# Links must not overlap; one object, so that its bodies are made once for each arm.
NO_OVERLAP = Clearance(distance=0.0)
ANY_NULL_MOTION = FreeNullMotion()
KEPT: tuple[Constraint, ...] = (
    JointPositionLimits(),
    JointVelocityLimits(),
    JointAccelerationLimits(),
    JointJerkLimits(),
)
# Stands for the usual cost of whatever arm it is.
USUAL_COSTS: tuple[Cost, ...] = (JointVelocity(),)
