"""Free motions: from configuration to configuration, around obstacles."""

from selfmotion.planning.transfer.free_motion import (
    FreeMotions as FreeMotions,
    constraints_of_moves as constraints_of_moves,
)
from selfmotion.planning.transfer.free_move import move as move
from selfmotion.planning.transfer.rrt_connect import Room as Room, rounded as rounded
