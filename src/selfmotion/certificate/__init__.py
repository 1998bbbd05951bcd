"""Re-checks finished motions: the path, and each requirement."""

from selfmotion.certificate.bounding import (
    BoundedFunction as BoundedFunction,
    MotionSegments as MotionSegments,
)
from selfmotion.certificate.braking import (
    BrakingCurves as BrakingCurves,
    VelocityByPosition as VelocityByPosition,
)
from selfmotion.certificate.check import certify as certify
from selfmotion.certificate.ends import (
    ARRIVED as ARRIVED,
    QUANTITIES as QUANTITIES,
    REST_ACCELERATION as REST_ACCELERATION,
    AtRest as AtRest,
    ClosedMotion as ClosedMotion,
    EndState as EndState,
)
from selfmotion.certificate.limits import (
    LIMIT_NAMES as LIMIT_NAMES,
    JointLimits as JointLimits,
    arm_limits as arm_limits,
    limits_of_joints as limits_of_joints,
)
from selfmotion.certificate.path_error import (
    deviation_from as deviation_from,
    errors_at as errors_at,
    errors_of_poses as errors_of_poses,
)
from selfmotion.certificate.quantity import (
    Column as Column,
    Quantity as Quantity,
    QuantityWithinLimits as QuantityWithinLimits,
    Shares as Shares,
)
from selfmotion.certificate.requirement import (
    USUAL as USUAL,
    DampedStretch as DampedStretch,
    Extreme as Extreme,
    Finding as Finding,
    FinishedMotion as FinishedMotion,
    Requirement as Requirement,
    Tolerance as Tolerance,
    approaches as approaches,
    covered_by as covered_by,
)
from selfmotion.certificate.separation import Separation as Separation
from selfmotion.certificate.verdict import (
    Certificate as Certificate,
    allowed_text as allowed_text,
    first_of as first_of,
    relaxed_text as relaxed_text,
)

__all__ = [
    "BrakingCurves",
    "Column",
    "Extreme",
    "Finding",
    "FinishedMotion",
    "Quantity",
    "Requirement",
    "VelocityByPosition",
]
