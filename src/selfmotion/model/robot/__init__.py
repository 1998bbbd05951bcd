"""The arm: a URDF loaded into Pinocchio as a chain with one coordinate per joint."""

from selfmotion.model.robot.building import (
    moving_joints as moving_joints,
    rebuild_robot as rebuild_robot,
    root_place as root_place,
    with_moved_base as with_moved_base,
)
from selfmotion.model.robot.calibration import (
    calibrated_robot as calibrated_robot,
    nominal_robot as nominal_robot,
)
from selfmotion.model.robot.cells import is_placement as is_placement
from selfmotion.model.robot.chain import (
    WORLD as WORLD,
    Chain as Chain,
    Kinematics as Kinematics,
    null_space as null_space,
)
from selfmotion.model.robot.chain_series import ChainSeries as ChainSeries
from selfmotion.model.robot.collada import says_unit as says_unit, unit_of as unit_of
from selfmotion.model.robot.configurations import mean_lever as mean_lever
from selfmotion.model.robot.coordinates import (
    Coordinate as Coordinate,
    FrameCoordinate as FrameCoordinate,
    JointCoordinate as JointCoordinate,
    SwivelAngle as SwivelAngle,
    check_radians as check_radians,
)
from selfmotion.model.robot.dynamics import (
    Dynamics as Dynamics,
    Energy as Energy,
    has_masses as has_masses,
)
from selfmotion.model.robot.full_model import (
    mesh_digests as mesh_digests,
    mesh_stamps as mesh_stamps,
)
from selfmotion.model.robot.loading import load_robot as load_robot
from selfmotion.model.robot.mimic import mimic_of as mimic_of
from selfmotion.model.robot.model import LIMITS as LIMITS, RobotModel as RobotModel
from selfmotion.model.robot.mounting import (
    UrdfShape as UrdfShape,
    mounting_of as mounting_of,
)
from selfmotion.model.robot.named import (
    NAMED_ARMS as NAMED_ARMS,
    NAMED_PARTS as NAMED_PARTS,
    names_of as names_of,
)
from selfmotion.model.robot.placements import (
    compose as compose,
    place_tips as place_tips,
    placements as placements,
)
from selfmotion.model.robot.tool_rates import ToolRates as ToolRates
from selfmotion.model.robot.urdf import (
    BASE_JOINT as BASE_JOINT,
    TOOL_JOINT as TOOL_JOINT,
    Urdf as Urdf,
    UrdfJoint as UrdfJoint,
    UrdfPart as UrdfPart,
)
from selfmotion.model.robot.urdf_text import Packages as Packages
from selfmotion.model.robot.xacro_text import expand as expand, is_xacro as is_xacro

__all__ = [
    "Coordinate",
    "FrameCoordinate",
    "JointCoordinate",
    "SwivelAngle",
]
from selfmotion.model.robot.tree_arrays import (
    AXIS as AXIS,
    JOINT as JOINT,
    POSITION as POSITION,
    ROTATION as ROTATION,
)
