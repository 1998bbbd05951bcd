"""Motions planned while the arm moves: the next seconds, again and again."""

from selfmotion.realtime.chunks import Blended as Blended, Chunk as Chunk
from selfmotion.realtime.commands import Flag as Flag, Segment as Segment
from selfmotion.realtime.loop import (
    Plant as Plant,
    Record as Record,
    Scene as Scene,
    SimulatedArm as SimulatedArm,
    State as State,
    follow as follow,
    track as track,
    warm_up as warm_up,
)
from selfmotion.realtime.reference import (
    Approach as Approach,
    Conveyed as Conveyed,
    MovingPose as MovingPose,
)
from selfmotion.realtime.replanner import Replanner as Replanner
