"""Where to begin: start configurations, self-motion curves, chains over them, reach."""

from selfmotion.search.curves import Curve, CurveSet, SelfMotion, targets
from selfmotion.search.guides import SequenceGuide, guides, has_curves
from selfmotion.search.pieces import Piece, Pieces, turned_towards
from selfmotion.search.reach import Reach, reachable
from selfmotion.search.sequences import SPACING, Sequence, best_sequences
from selfmotion.search.starts import spread, start_candidates

__all__ = [
    "SPACING",
    "Curve",
    "CurveSet",
    "Piece",
    "Pieces",
    "Reach",
    "SelfMotion",
    "Sequence",
    "SequenceGuide",
    "best_sequences",
    "guides",
    "has_curves",
    "reachable",
    "spread",
    "start_candidates",
    "targets",
    "turned_towards",
]
