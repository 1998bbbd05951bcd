"""Task frames on their paths: chains, paths, and the prescribed rows of all."""

from selfmotion.model.follow.coordinates import Coordinates as Coordinates
from selfmotion.model.follow.follow import (
    BoundTaskFrame as BoundTaskFrame,
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.model.follow.relaxed import RelaxedFrames as RelaxedFrames
from selfmotion.model.follow.virtual_joints import VirtualJoints as VirtualJoints
