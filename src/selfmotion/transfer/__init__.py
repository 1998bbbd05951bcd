"""Free motions through the air: from configuration to configuration, past what stands there."""

from selfmotion.transfer.free_motion import FreeMotions as FreeMotions
from selfmotion.transfer.free_move import move as move
from selfmotion.transfer.ways import Room as Room, rounded as rounded
