"""Task frames on their paths: chains, paths, and the prescribed rows of all."""

from selfmotion.model.follow.augmented import (
    AugmentedFollows as AugmentedFollows,
)
from selfmotion.model.follow.follow import (
    BoundFollow as BoundFollow,
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.model.follow.virtual_joints import VirtualJoints as VirtualJoints
