"""Motions planned while the arm moves: the next seconds, again and again."""

from selfmotion.realtime.conveyed import Conveyed
from selfmotion.realtime.loop import State, follow
from selfmotion.realtime.reference import Approach
from selfmotion.realtime.replanner import Replanner
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.simulation import Plant, SimulatedArm
from selfmotion.realtime.tracking import Record, Scene, track
from selfmotion.realtime.warm import warm_up

__all__ = [
    "Approach",
    "Conveyed",
    "Flag",
    "Plant",
    "Record",
    "Replanner",
    "Scene",
    "Segment",
    "SimulatedArm",
    "State",
    "follow",
    "track",
    "warm_up",
]
