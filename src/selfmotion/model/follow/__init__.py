"""Task frames on their paths: chains, paths, and the prescribed rows of all."""

from selfmotion.model.follow.coordinates import (
    Coordinates as Coordinates,
    generic_values as generic_values,
)
from selfmotion.model.follow.follow import BoundTaskFrame as BoundTaskFrame, Follow as Follow
from selfmotion.model.follow.follows import Follows as Follows
from selfmotion.model.follow.frame_tables import (
    chain_tables as chain_tables,
    joint_columns as joint_columns,
    kinematics_of as kinematics_of,
    linear_rows as linear_rows,
    null_basis as null_basis,
    row_names as row_names,
    single_tip as single_tip,
)
from selfmotion.model.follow.relaxed import (
    band_limits as band_limits,
    completed as completed,
    completed_along as completed_along,
    deviation_of as deviation_of,
    has_windows as has_windows,
    is_plain as is_plain,
    limits_within as limits_within,
    tip_names as tip_names,
    window_edges as window_edges,
    windows_shut as windows_shut,
    with_tolerances as with_tolerances,
    within_limits as within_limits,
)
from selfmotion.model.follow.virtual_joints import (
    VirtualJoints as VirtualJoints,
    joint_of as joint_of,
)
