"""Redundancy maps: time against the self-motion's coordinate, and what stops the arm where."""

from selfmotion.planning.redundancy.axis import coordinates_of as coordinates_of
from selfmotion.planning.redundancy.judging import Reason as Reason
from selfmotion.planning.redundancy.map import (
    PIXELS as PIXELS,
    RedundancyMap as RedundancyMap,
    redundancy_map_of as redundancy_map_of,
)
from selfmotion.planning.redundancy.picture import (
    COST_COLORS as COST_COLORS,
    LEGEND as LEGEND,
    excess_cost as excess_cost,
    shown_scale as shown_scale,
)

__all__ = ["Reason", "RedundancyMap"]
