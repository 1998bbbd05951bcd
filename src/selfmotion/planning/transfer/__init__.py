"""Free motions: from configuration to configuration, around obstacles."""

from selfmotion.planning.transfer.free_motion import FreeMotions as FreeMotions
from selfmotion.planning.transfer.free_move import move as move
from selfmotion.planning.transfer.rrt_connect import Room as Room, rounded as rounded
