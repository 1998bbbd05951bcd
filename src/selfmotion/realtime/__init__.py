"""Motions planned while the arm moves: the next seconds, again and again."""

from selfmotion.realtime.chunks import Blended as Blended, Chunk as Chunk
from selfmotion.realtime.loop import State as State, follow as follow, warm_up as warm_up
from selfmotion.realtime.record import Record as Record
from selfmotion.realtime.reference import (
    Approach as Approach,
    Conveyed as Conveyed,
    MovingPose as MovingPose,
)
from selfmotion.realtime.replanner import Replanner as Replanner
from selfmotion.realtime.segment import Flag as Flag, Segment as Segment
from selfmotion.realtime.simulated_arm import Plant as Plant, SimulatedArm as SimulatedArm
from selfmotion.realtime.simulation import Scene as Scene, track as track
