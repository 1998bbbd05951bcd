"""What the arm follows: chains, their paths, and the rows of them that are prescribed."""

from selfmotion.model.follow.augmented import (
    AugmentedFollows as AugmentedFollows,
)
from selfmotion.model.follow.follow import (
    BoundFollow as BoundFollow,
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.model.follow.virtual_joints import VirtualJoints as VirtualJoints
