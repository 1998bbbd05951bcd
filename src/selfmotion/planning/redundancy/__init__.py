"""Redundancy maps: time against the self-motion's coordinate, and what stops the arm where."""

from selfmotion.planning.redundancy.judging import Reason as Reason
from selfmotion.planning.redundancy.map import (
    PIXELS as PIXELS,
    RedundancyMap as RedundancyMap,
    redundancy_map_of as redundancy_map_of,
)

__all__ = ["Reason", "RedundancyMap"]
