"""Motions planned while the arm moves: the next seconds, again and again."""

from selfmotion.realtime.conveyed import Conveyed as Conveyed
from selfmotion.realtime.loop import State as State, follow as follow
from selfmotion.realtime.moving_pose import MovingPose as MovingPose
from selfmotion.realtime.reference import Approach as Approach
from selfmotion.realtime.replanner import Replanner as Replanner
from selfmotion.realtime.segment import Flag as Flag, Segment as Segment
from selfmotion.realtime.simulation import Plant as Plant, SimulatedArm as SimulatedArm
from selfmotion.realtime.tracking import Record as Record, Scene as Scene, track as track
from selfmotion.realtime.warm import warm_up as warm_up
