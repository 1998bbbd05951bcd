"""Motions planned while the arm moves: the next seconds, again and again."""

from selfmotion.realtime.replanner import Approach, Replanner
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.simulation import Plant, SimulatedArm

__all__ = ["Approach", "Flag", "Plant", "Replanner", "Segment", "SimulatedArm"]
