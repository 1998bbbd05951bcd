"""How wrong a cell may be: what a program survives."""

from selfmotion.work.margins.margin import margin as margin
from selfmotion.work.margins.results import (
    Displacement as Displacement,
    Margins as Margins,
    SubjectMargin as SubjectMargin,
)
from selfmotion.work.margins.shortfall import (
    Margin as Margin,
    Shortfall as Shortfall,
    Shortfalls as Shortfalls,
    shortfalls as shortfalls,
)

__all__ = [
    "Displacement",
    "Margins",
    "Shortfall",
    "SubjectMargin",
]
