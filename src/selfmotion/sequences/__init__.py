"""Global search over the self-motions along a path, for redundancy 1."""

from selfmotion.sequences.curves import Curve, CurveSet, SelfMotion, targets
from selfmotion.sequences.search import SPACING, Sequence, best_sequences

__all__ = [
    "SPACING",
    "Curve",
    "CurveSet",
    "SelfMotion",
    "Sequence",
    "best_sequences",
    "targets",
]
