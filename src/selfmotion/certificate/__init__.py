"""Re-checks finished motions: the path, and each requirement."""

from selfmotion.certificate.apart import KeepsApart
from selfmotion.certificate.band import CoordinateBand
from selfmotion.certificate.check import certify
from selfmotion.certificate.ends import QUANTITIES, AtRest, ClosedMotion, EndState
from selfmotion.certificate.findings import DampedStretch, Extreme, Finding, Tolerance
from selfmotion.certificate.limits import LIMIT_NAMES, JointLimits, arm_limits
from selfmotion.certificate.path_error import errors_between
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.certificate.tool import TOOL_RATES, ToolMotion, tool_sizes
from selfmotion.certificate.torques import JointTorques
from selfmotion.certificate.verdict import Certificate

__all__ = [
    "LIMIT_NAMES",
    "QUANTITIES",
    "TOOL_RATES",
    "AtRest",
    "Certificate",
    "ClosedMotion",
    "CoordinateBand",
    "DampedStretch",
    "EndState",
    "Extreme",
    "Finding",
    "FinishedMotion",
    "JointLimits",
    "JointTorques",
    "KeepsApart",
    "Requirement",
    "Tolerance",
    "ToolMotion",
    "arm_limits",
    "certify",
    "errors_between",
    "tool_sizes",
]
