"""Free motions through the air: from configuration to configuration, past what stands there."""

from selfmotion.planning.transfer.free_motion import FreeMotions as FreeMotions
from selfmotion.planning.transfer.free_move import move as move
from selfmotion.planning.transfer.ways import Room as Room, rounded as rounded
