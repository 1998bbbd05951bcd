"""Where to put the part, or the arm."""

from selfmotion.work.placement.correction_range import (
    Corner as Corner,
    Correction as Correction,
    CorrectionSide as CorrectionSide,
    correction as correction,
)
from selfmotion.work.placement.page import write_placement as write_placement
from selfmotion.work.placement.place import place as place
from selfmotion.work.placement.places import Tried as Tried
from selfmotion.work.placement.results import PlaceMap as PlaceMap, Placement as Placement
from selfmotion.work.placement.with_margin import (
    PlanWithMargin as PlanWithMargin,
    plan_with_margin as plan_with_margin,
)

__all__ = [
    "Corner",
    "Correction",
    "CorrectionSide",
    "PlaceMap",
    "Placement",
    "PlanWithMargin",
    "Tried",
]
