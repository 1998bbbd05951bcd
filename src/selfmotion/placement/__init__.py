"""Where to put the part, or the arm."""

from selfmotion.placement.bought import (
    BoughtMargin as BoughtMargin,
    plan_with_margin as plan_with_margin,
)
from selfmotion.placement.corners import (
    Corner as Corner,
    Correction as Correction,
    CorrectionSide as CorrectionSide,
    correction as correction,
)
from selfmotion.placement.found import PlaceMap as PlaceMap, Placement as Placement
from selfmotion.placement.page import write_placement as write_placement
from selfmotion.placement.place import place as place
from selfmotion.placement.places import Tried as Tried

__all__ = [
    "BoughtMargin",
    "Corner",
    "Correction",
    "CorrectionSide",
    "PlaceMap",
    "Placement",
    "Tried",
]
