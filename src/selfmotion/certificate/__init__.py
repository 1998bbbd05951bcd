"""Re-checks finished motions."""

from selfmotion.certificate.check import certify
from selfmotion.certificate.terms import (
    Certificate,
    DampedStretch,
    Extreme,
    Requirements,
    Tolerance,
)

__all__ = ["Certificate", "DampedStretch", "Extreme", "Requirements", "Tolerance", "certify"]
