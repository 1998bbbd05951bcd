"""Task frames on their paths: chains, paths, and the prescribed rows of all."""

from selfmotion.model.follow.coordinates import (
    Coordinates as Coordinates,
    generic_values as generic_values,
)
from selfmotion.model.follow.follow import (
    BoundTaskFrame as BoundTaskFrame,
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.model.follow.relaxed import (
    RelaxedFrames as RelaxedFrames,
    completed_along as completed_along,
    deviation_of as deviation_of,
)
from selfmotion.model.follow.virtual_joints import (
    VirtualJoints as VirtualJoints,
    joint_of as joint_of,
)
