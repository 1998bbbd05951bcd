"""The problem file that ``selfmotion init`` writes."""

from selfmotion.basics import RobotError
from selfmotion.robot import NAMED_ARMS, load_robot
from selfmotion.task import Task

_TEXT = """\
# What to plan: selfmotion plan {file}
# Units are SI; keys may end in _deg or _mm for degrees and millimetres.
# All keys: selfmotion schema --out problem.schema.json; editors complete them by a first line
# "#:schema ./problem.schema.json".

task = "{task}"        # pose, position, pointing (rotation about the tool axis free), planar, …
start = "dexterous"    # or "free" (the best of many is found), "home", or numbers per joint
# collision = false    # leaves self-collision out

[robot]
name = "{robot}"       # or file = "arm.urdf", file = "arm.xacro" with arguments = {{ … }}
tool = "{tool}"        # the link that follows the path
# tool_offset = {{ position_mm = [0, 0, 100] }}              # a tool in the gripper
# base = {{ position = [0, 0, 0.5], rpy_deg = [0, 0, 90] }}  # where the arm stands
# lock = {{ some_joint = 0.1 }}
#
# [[robot.bodies]]       # what the arm carries; shapes as those of obstacles
# shape = "cylinder"
# name = "torch"
# position_mm = [0, 0, 50]
# radius_mm = 10
# length_mm = 80

[path]                 # from the tool's pose at the start, unless start = {{ position = …, … }}
kind = "circle"        # or "line" (by = [dx, dy, dz] or end), "waypoints", "file"
radius_mm = 50
normal = [0, 0, 1]
duration = 4.0
# kind = "file"        # CSV, ROS Path or PoseArray, NumPy
# file = "seam.csv"
# feed = 0.05          # m/s, where the file has no times
# ramp = 0.5           # s, in which it is run up to that from rest, and down again
# frame = {{ position = [0.5, 0, 0.2], rpy_deg = [0, 0, 0] }}  # of the workpiece

# [null_motion]        # by default a cubic, refined where that lowers the cost
# kind = "PolynomialNullMotion"
# degree = 3

[[costs]]
kind = "JointVelocity"

[[costs]]
kind = "InverseManipulability"
mu = 1e-3

[[constraints]]
kind = "JointPositionLimits"

[[constraints]]
kind = "JointVelocityLimits"

[[constraints]]
kind = "JointAccelerationLimits"  # those of the arm's maker, where known; or limit = …

[[constraints]]
kind = "JointJerkLimits"

# [[constraints]]
# kind = "Clearance"
# distance_mm = 10
# srdf = "arm.srdf"
#
# [[constraints.obstacles]]  # box, sphere, cylinder, capsule, mesh
# shape = "box"
# name = "post"
# position = [0.0, -0.6, 0.6]
# rpy_deg = [0, 0, 0]
# size_mm = [100, 100, 1200]
# frame = "{tool}"     # the link that carries it; without, it stands in the world

# [[relaxations]]      # rows that may leave the path
# rows = ["rx", "ry"]
# band_deg = 10

# [search]             # with start = "free"
# starts = 24

# outputs = ["plan.npz", "motion.csv"]  # above the first [table]; beside this file

# [grid]               # selfmotion batch {file}: all combinations
# "path.duration" = [3, 4, 5]
"""


def example_text(robot: str, file: str) -> str:
    """Return a commented problem file for an arm known by name.

    Raises
    ------
    RobotError
        No arm has that name.
    """
    if robot not in NAMED_ARMS:
        raise RobotError(f"unknown robot '{robot}', known by name: {', '.join(NAMED_ARMS)}")
    arm = load_robot(robot)
    task = next(
        item
        for item in (Task.POSE, Task.POINTING, Task.POSITION, Task.PLANAR)
        if arm.can_follow(item) and arm.redundancy(item) > 0
    )
    return _TEXT.format(robot=robot, tool=arm.tool, task=task.value, file=file)
