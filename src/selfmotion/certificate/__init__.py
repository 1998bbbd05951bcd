"""Re-checks finished motions: the path, and each requirement."""

from selfmotion.certificate.apart import KeepsApart
from selfmotion.certificate.bounding import Stretch
from selfmotion.certificate.check import certify
from selfmotion.certificate.ends import QUANTITIES, AtRest, ClosedMotion, EndState
from selfmotion.certificate.findings import DampedStretch, Extreme, Finding, Tolerance
from selfmotion.certificate.limits import LIMIT_NAMES, JointLimits, arm_limits
from selfmotion.certificate.path_error import errors_between
from selfmotion.certificate.quantity import Column, Quantity, QuantityKept
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.certificate.verdict import Certificate

__all__ = [
    "LIMIT_NAMES",
    "QUANTITIES",
    "AtRest",
    "Certificate",
    "ClosedMotion",
    "Column",
    "DampedStretch",
    "EndState",
    "Extreme",
    "Finding",
    "FinishedMotion",
    "JointLimits",
    "KeepsApart",
    "Quantity",
    "QuantityKept",
    "Requirement",
    "Stretch",
    "Tolerance",
    "arm_limits",
    "certify",
    "errors_between",
]
