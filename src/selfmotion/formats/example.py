"""The problem files that ``selfmotion init`` writes."""

import os
from pathlib import Path as FilePath

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.robot import NAMED_ARMS, RobotModel, load_robot
from selfmotion.task import SE3, Quaternion, Task

_HEAD = """\
# What to plan: selfmotion {command} {file}
# Units are SI; keys may end in _deg or _mm for degrees and millimetres.
# All keys: selfmotion schema --out problem.schema.json; editors complete them by a first line
# "#:schema ./problem.schema.json".

task = "{task}"        # pose, position, pointing (rotation about the tool axis free), planar, …
{start}# collision = false    # leaves self-collision out

"""
_START = """\
start = "dexterous"    # or "free" (the best of many is found), "home", or numbers per joint
"""
_ROBOT = """\
[robot]
{robot}       # a name, file = "arm.urdf", or "arm.xacro" with arguments = {{ … }}
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

"""
_CELL = """\
[robot]
tool = "arm/{tool}"        # the link that follows the path
reference = "table/plate"  # paths are in its frame, and move with it

[robot.parts.arm]
{robot}

[robot.parts.table]
name = "positioner"        # tilts and turns; or file = "table.urdf"
base = {{ position = [{away:.2f}, 0, 0], rpy_deg = [0, 0, 0] }}

"""
_PATH = """\
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

"""
_ON_PLATE = """\
[path]                 # in the frame of the plate
kind = "circle"        # or "line", "waypoints", "file": CSV, G-code, APT, …
start = {{ position = [0.1, 0, 0.03], rpy_deg = [180, 0, 0] }}
radius_mm = 100
normal = [0, 0, 1]
feed_mm = 50

"""
_SEAMS = """\
[job]
start = {begin}    # or "home", or numbers; without, where the first seam begins
# end = "home"
# order = "given"      # by default the best is found
branches = 2           # motions in different configurations that are tried for each seam

# [workpiece]          # paths of seams are in its frame, and move with it
# frame = {{ position = [0.5, 0, 0.2], rpy_deg = [0, 0, 0] }}
# mesh = "part.stl"

# [seams]              # or all of a file: a table with a column seam, G-code or APT, whose cuts
# file = "part.nc"     # are seams
# frame = {{ position = [0.5, 0, 0.2] }}

[[seams]]
name = "one"
events = [["tool on", 0.0]]  # what happens how long after its start [s]
# either_way = false   # from its start to its end only
# after = ["two"]
# wait = 1.0           # s, that the arm rests after it

[seams.path]
kind = "line"          # or "file", …
start = {one}
by_mm = [50, 0, 0]
feed_mm = 50

[[seams]]
name = "two"

[seams.path]
kind = "line"
start = {two}
by_mm = [50, 0, 0]
feed_mm = 50

"""
_REST = """\
# [null_motion]        # by default any at all, as good as can be found; or one of few numbers:
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
"""
_OF_ONE = """\

# [search]             # with start = "free"
# starts = 24

# outputs = ["plan.npz", "motion.csv"]  # above the first [table]; beside this file

# [grid]               # selfmotion batch {file}: all combinations
# "path.duration" = [3, 4, 5]
"""
# How far from the arm the table stands, as a share of its reach, and seams from each other [m].
_AWAY, _APART = 0.45, 0.05


def example_text(
    robot: str | FilePath,
    file: str | FilePath,
    *,
    tool: str | None = None,
    job: bool = False,
    positioner: bool = False,
) -> str:
    """Return a commented problem file to begin with, which runs as it is.

    Parameters
    ----------
    robot : str or path
        An arm known by name, or a ``.urdf`` or ``.xacro`` file.
    file : str or path
        What the problem file will be called; the robot's file is named from its folder.
    tool : str, optional
        The link that follows the path, where the arm is from a file.
    job : bool
        Whether it has many seams (`read_seam_job`) instead of one path.
    positioner : bool
        Whether a table that tilts and turns stands before the arm, and paths are on it.

    Raises
    ------
    RobotError
        The arm cannot be loaded.
    ProblemError
        Its tool follows no path with a joint to spare.
    """
    arm = load_robot(robot, tool)
    target = FilePath(file)
    named = str(robot) in NAMED_ARMS
    beside = os.path.relpath(FilePath(robot).resolve(), target.resolve().parent)
    given = {
        "robot": f'name = "{robot}"' if named else f'file = "{FilePath(beside).as_posix()}"',
        "tool": arm.tool,
        "file": target.name,
        "command": "job" if job else "plan",
        "task": "pointing" if positioner else _task_of(arm).value,
        "away": _AWAY * arm.reach,
        "start": "" if job else ('start = "free"\n' if positioner else _START),
    }
    ends = _places(arm, positioner)
    given |= {"one": ends[0], "two": ends[1], "begin": '"free"' if positioner else '"dexterous"'}
    where = _SEAMS if job else (_ON_PLATE if positioner else _PATH)
    whole = _HEAD + (_CELL if positioner else _ROBOT) + where + _REST + ("" if job else _OF_ONE)
    return whole.format(**given)


def _task_of(arm: RobotModel) -> Task:
    """Return the first task that leaves the arm a joint to spare."""
    for item in (Task.POSE, Task.POINTING, Task.POSITION, Task.PLANAR):
        if arm.can_follow(item) and arm.redundancy(item) > 0:
            return item
    raise ProblemError(
        f"{arm.name}: its {arm.dof} joints up to tool '{arm.tool}' leave none to spare for any "
        f"task; take another link as --tool"
    )


def _places(arm: RobotModel, on_plate: bool) -> tuple[str, str]:
    """Return where two seams begin, as a file says it."""
    if on_plate:
        one, two = (
            f"{{ position = [0.0, {y}, 0.03], rpy_deg = [180, 0, 0] }}" for y in (-0.05, 0.05)
        )
        return one, two
    first = arm.pose(arm.dexterous_configuration(_task_of(arm)))
    second = SE3(first)
    second.translation = first.translation + np.array([0.0, _APART, 0.0])
    return _pose(first), _pose(second)


def _pose(pose: SE3) -> str:
    place = ", ".join(f"{value + 0.0:.6f}" for value in pose.translation.tolist())
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    turn = ", ".join(f"{value + 0.0:.9f}" for value in (w, x, y, z))
    return f"{{ position = [{place}], quaternion = [{turn}] }}"
