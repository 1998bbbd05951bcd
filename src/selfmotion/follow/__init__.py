"""What the arm follows: chains, their paths, and the rows of them that are prescribed."""

from selfmotion.follow.augmented import (
    AugmentedFollows as AugmentedFollows,
)
from selfmotion.follow.follow import (
    BoundFollow as BoundFollow,
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.follow.virtual_joints import VirtualJoints as VirtualJoints
