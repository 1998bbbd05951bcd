"""The problem files that ``selfmotion init`` writes."""

import itertools
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.model.collision import (
    ALWAYS,
    PERHAPS,
    disabled_links,
    overlapping_by_design,
)
from selfmotion.model.path import Circle, Line, Path
from selfmotion.model.robot import NAMED_ARMS, RobotModel, load_robot
from selfmotion.model.task import SE3, Quaternion, Task, rotation_vectors
from selfmotion.problem.constraints import PositionDependentVelocityLimits

# Number of random configurations.
_RANDOM_CONFIGURATIONS = 1000
# Number of those, least singular first, that are moved along the paths.
_MOVED_CONFIGURATIONS = 60
# Number of poses of each path.
_POSES = 41
# Number of Newton steps to each pose.
_NEWTON_STEPS = 4
# Largest residual of a pose [m, rad].
_RESIDUAL = 1e-6


def roomy_starts(arm: RobotModel, task: Task, paths: Sequence[Path], count: int) -> list[Array]:
    """Return configurations from which an arm follows paths, those farthest from singular first.

    Of samples in the middle half of the limits (fixed seed), those whose smallest singular value
    along the minimum-norm motion is the largest.

    Parameters
    ----------
    arm : RobotModel
    task : Task
    paths : sequence of Path
        From the identity: their positions are moved to where the tool is [m].
    count : int
        So many at most.
    """
    lower, upper = arm.finite_limits()
    share = np.random.default_rng(0).uniform(0.25, 0.75, (_RANDOM_CONFIGURATIONS, arm.dof))
    drawn = lower + (upper - lower) * share
    jacobian, rotations, _ = arm.chain.along(drawn)
    first = np.argsort(-_smallest(task.select_along(jacobian, rotations)))[:_MOVED_CONFIGURATIONS]
    moved = drawn[first]
    room = np.min([_room(arm, task, moved, _positions(path)) for path in paths], axis=0)
    best = np.argsort(-room, kind="stable")[:count]
    return [moved[k] for k in best if room[k] > 0.0]


def _positions(path: Path) -> Array:
    samples = path.evaluate(np.linspace(0.0, path.duration, _POSES))
    return np.asarray(samples.translation - samples.translation[0])


def _smallest(rows: Array) -> Array:
    """Return the smallest singular values of rows (K, m, n), (K,)."""
    return np.asarray(np.linalg.svd(rows, compute_uv=False)[:, -1])


def _room(arm: RobotModel, task: Task, q: Array, positions: Array) -> Array:
    """Return the smallest singular values along positions (P, 3) from q (K, n), (K,).

    They are 0 where the arm leaves them, or its limits.
    """
    _, wanted, begin = arm.chain.along(q)
    first, least = q, np.full(len(q), np.inf)
    for offset in positions:
        for step in range(_NEWTON_STEPS + 1):
            jacobian, rotations, translations = arm.chain.along(q)
            # Of length sin θ: near enough, as orientations stay.
            turned = (
                np.cross(rotations[:, :, 2], wanted[:, :, 2])
                if task.tool_axes
                else rotation_vectors(wanted @ rotations.transpose(0, 2, 1))
            )
            error = np.hstack([begin + offset - translations, turned])[:, :, None]
            rows = task.select_along(jacobian, rotations)
            left = task.select_along(error, rotations)
            if step < _NEWTON_STEPS:
                q = q + (np.linalg.pinv(rows) @ left)[:, :, 0]
        outside = ((q < arm.lower) | (q > arm.upper)).any(axis=1)
        ended = outside | (np.abs(left).max(axis=(1, 2)) > _RESIDUAL) | (least == 0.0)
        least = np.where(ended, 0.0, np.minimum(least, _smallest(rows)))
        q = np.where(ended[:, None], first, q)
    return least


_HEAD = """\
# What to plan: selfmotion {command} {file}
# Units are SI; keys may end in _deg or _mm for degrees and millimetres.
# All keys: selfmotion schema --out problem.schema.json; editors complete them by a first line
# "#:schema ./problem.schema.json".

task = "{task}"        # pose, position, pointing (rotation about the tool axis free), planar, …
{start}{clearance}

"""
_START = """\
start = {begin}    # {also}"free" (the best of many is found), "home"
"""
_ROBOT = """\
[robot]
{robot}       # a name, file = "arm.urdf", or "arm.xacro" with arguments = {{ … }}
tool = "{tool}"        # the link that follows the path
# tool_offset = {{ position_mm = [0, 0, 100] }}              # a tool in the gripper
# base = {{ position = [0, 0, 0.5], rpy_deg = [0, 0, 90] }}  # where the arm stands
{lock}
{more}#
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
{of_all}
[robot.parts.arm]
{robot}

[robot.parts.table]
name = "positioner"        # tilts and turns; or file = "table.urdf"
base = {{ position = [{away:.2f}, 0, 0], rpy_deg = [0, 0, 0] }}

"""
_PATH = """\
[path]                 # from the tool's pose at the start, unless start = {{ position = …, … }}
kind = "circle"        # or "line" (by = [dx, dy, dz] or end), "waypoints", "file"
radius_mm = {radius}
normal = [0, 0, 1]
duration = 4.0         # or feed_mm = 20: one speed from run-up to run-down [mm/s]
# kind = "file"        # CSV, ROS Path or PoseArray, NumPy
# file = "seam.csv"
# feed = 0.05          # m/s, where the file has no times
# standoff_mm = 5      # held back along the tool's axis
# ramp = 0.5           # s, in which it is run up from rest, and down again, where it has times
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
# events = [["tool on", 0.0]]  # what happens how long after its start [s]; a program for a
#                              # controller needs [signals] that say what it switches
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
_CURVES = """
[[constraints]]        # slower towards the ends of joints, as the maker says
kind = "PositionDependentVelocityLimits"
"""
_REST = """\
[[costs]]              # what is to be low
kind = "JointVelocity"

[[costs]]
kind = "InverseManipulability"    # keeps away from singular configurations
mu = 1e-3              # its weight

[[constraints]]
kind = "JointPositionLimits"

[[constraints]]
kind = "JointVelocityLimits"

[[constraints]]
kind = "JointAccelerationLimits"  # those of the arm's maker, where known; or limit = …

[[constraints]]
kind = "JointJerkLimits"
{curves}
# [clearance]          # in place of the clearance above
# distance_mm = 10
# srdf = "arm.srdf"
#
# [[clearance.obstacles]]  # box, sphere, cylinder, capsule, mesh
# shape = "box"
# name = "post"
# position = [0.0, -0.6, 0.6]
# rpy_deg = [0, 0, 0]
# size_mm = [100, 100, 1200]
# frame = "{link}"     # the link that carries it; without, it stands in the world

# [[relaxations]]      # what the tool may do besides: lean by 10 degrees to any side
# rows = ["rx", "ry"]  # x, y, z, or turns rx, ry, rz about the tool's axes
# band_deg = 10

# [null_motion]        # only for the published method, which keeps fewer constraints
# kind = "PolynomialNullMotion"
# degree = 3
"""
_OF_ONE = """\

# [search]             # with start = "free"
# starts = 24

# outputs = ["plan.npz", "motion.csv"]  # above the first [table]; beside this file

# [grid]               # selfmotion batch {file}: all combinations
# "path.duration" = [3, 4, 5]
"""
# Radii of the circle, tried in turn [mm].
_RADII = (50, 20, 5)
# Number of initial configurations that are tried with each radius.
_STARTS = 3
# Distance of the table from the arm, as a share of the arm's reach.
_TABLE_DISTANCE = 0.45
# Distance of the two seams of an example [m].
_SEAM_DISTANCE = 0.05


def example_text(robot: str | FilePath, file: str | FilePath, **options: Any) -> str:
    """Return the first of `example_texts`."""
    return next(example_texts(robot, file, **options))


def example_texts(
    robot: str | FilePath,
    file: str | FilePath,
    *,
    tool: str | None = None,
    job: bool = False,
    positioner: bool = False,
    lock: Mapping[str, float] | None = None,
    arguments: Mapping[str, str] | None = None,
    packages: Sequence[str | FilePath] = (),
    clearance: bool = True,
    srdf: str | FilePath | None = None,
    disabled: Sequence[Sequence[str]] = (),
) -> Iterator[str]:
    """Yield commented problem files to begin with, the one most likely to run first.

    An arm known by name has one, which runs as it is. Of others they begin where the arm has room
    for the example's path, which is smaller in those that come later; planning tells which runs.

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
    lock, arguments, packages : optional
        As of `load_robot`.
    clearance : bool
        Whether the arm is kept from meeting itself. Links that overlap as they are made are left
        out, and listed in the file.
    srdf : path, optional
        A file that says which links are left out as well.
    disabled : sequence of (str, str)
        Pairs of links that are left out as well.

    Raises
    ------
    RobotError
        The arm cannot be loaded.
    ProblemError
        Its tool follows no path with a joint to spare, or none of an example's.
    """
    loaded: dict[str, Any] = {
        "lock": lock or {},
        "arguments": arguments or {},
        "packages": packages,
    }
    arm = load_robot(robot, tool, **loaded)
    target = FilePath(file)
    named = str(robot) in NAMED_ARMS
    task = Task.POINTING if positioner else _task_of(arm)
    where = _SEAMS if job else (_ON_PLATE if positioner else _PATH)
    whole = _HEAD + (_CELL if positioner else _ROBOT) + where + _REST + ("" if job else _OF_ONE)
    kept = [_NONE]
    if clearance:
        # Last, what may be made so as well, for the user to judge.
        shares = (ALWAYS,) if named else (ALWAYS, PERHAPS)
        kept = [_clearance(arm, target, loaded, srdf, disabled, positioner, x) for x in shares]
    given = _said_of_robot(robot, target, loaded, positioner) | {
        "tool": arm.tool,
        "curves": _CURVES if PositionDependentVelocityLimits().applies(arm) else "",
        "link": f"arm/{arm.tool}" if positioner else arm.tool,
        "file": target.name,
        "command": "job" if job else "plan",
        "task": task.value,
        "away": _TABLE_DISTANCE * arm.reach,
    }
    is_free = named or positioner
    starts = [(_RADII[0], None)] if is_free else list(_starts(arm, task, job))
    if not starts:
        raise ProblemError(
            f"{arm.name}: no configuration was found from which tool '{arm.tool}' follows a circle "
            f"of {_RADII[-1]} mm; take another link as --tool"
        )
    for apart, (radius, q) in itertools.product(dict.fromkeys(kept), starts):
        usual = '"free"' if positioner else '"dexterous"'
        begin = usual if q is None else str(np.round(q, 4).tolist())
        also = "or numbers per joint, " if q is None else 'or "dexterous", '
        start = 'start = "free"\n' if positioner else _START.format(begin=begin, also=also)
        at = arm.dexterous_configuration(_task_of(arm)) if q is None else np.round(q, 4)
        one, two = _places(arm, at, positioner)
        given |= {"one": one, "two": two, "begin": begin, "start": "" if job else start}
        given["clearance"] = apart
        yield whole.format(**given, radius=radius)


# What a file says of links that it leaves out and that only the user knows of.
MAYBE = "are made so, or may be: see that they are"
_NONE = "clearance = false      # leaves self-collision out"


def _clearance(
    arm: RobotModel,
    target: FilePath,
    loaded: Mapping[str, Any],
    srdf: str | FilePath | None,
    disabled: Sequence[Sequence[str]],
    in_cell: bool,
    share: float,
) -> str:
    """Return the lines of a file that say which links are kept apart.

    But for those that overlap in at least a `share` of all configurations.
    """
    asked = [(one, other) for one, other in disabled]
    known = () if srdf is None else disabled_links(srdf, loaded["arguments"], loaded["packages"])
    pairs = dict.fromkeys(asked, "as asked") | overlapping_by_design(
        arm, (*asked, *known), share=share
    )
    if not pairs and srdf is None:
        return "# clearance = false    # leaves self-collision out"
    said = ["distance = 0"]
    if srdf is not None:
        beside = os.path.relpath(FilePath(srdf).resolve(), target.resolve().parent)
        said.append(f"srdf = {_quoted(FilePath(beside).as_posix())}")
    lines = []
    if pairs:
        part = "arm/" if in_cell else ""
        listed = ", ".join(
            f"[{_quoted(part + first)}, {_quoted(part + second)}]" for first, second in pairs
        )
        said.append(f"disabled = [{listed}]")
        lines = [f"# {first} - {second}: {why}" for (first, second), why in pairs.items()]
        # An arm may be drawn in a pose in which it meets itself: only the user knows.
        is_asked = all(pair in asked for pair in pairs)
        lines.insert(0, f"# Left out, as {'asked' if is_asked else f'these links {MAYBE}'}:")
    return "\n".join([*lines, f"clearance = {{ {', '.join(said)} }}    # false: none"])


def _said_of_robot(
    robot: str | FilePath, target: FilePath, loaded: Mapping[str, Any], in_cell: bool
) -> dict[str, str]:
    """Return the lines of a file that say which robot it is, and how it is loaded."""
    beside = os.path.relpath(FilePath(robot).resolve(), target.resolve().parent)
    named = str(robot) in NAMED_ARMS
    said = f'name = "{robot}"' if named else f"file = {_quoted(FilePath(beside).as_posix())}"
    lock, arguments = loaded["lock"], loaded["arguments"]
    folders = [
        os.path.relpath(FilePath(folder).resolve(), target.resolve().parent)
        for folder in loaded["packages"]
    ]
    more = ""
    if arguments:
        given = ", ".join(f"{_quoted(key)} = {_quoted(value)}" for key, value in arguments.items())
        more += f"arguments = {{ {given} }}\n"
    if in_cell:
        said, more = said + ("\n" + more.rstrip() if more else ""), ""
    held = ", ".join(
        f"{_quoted(f'arm/{name}' if in_cell else name)} = {value!r}" for name, value in lock.items()
    )
    of_all = f"lock = {{ {held} }}\n" if held else ""
    if folders:
        listed = ", ".join(_quoted(FilePath(folder).as_posix()) for folder in folders)
        of_all += f"packages = [{listed}]\n"
    return {
        "robot": said,
        "lock": of_all.partition("\n")[0] if lock else "# lock = { some_joint = 0.1 }",
        "more": more + (of_all.partition("\n")[2] if lock else of_all),
        "of_all": of_all,
    }


def _quoted(text: str) -> str:
    return json.dumps(str(text), ensure_ascii=False)


def _starts(arm: RobotModel, task: Task, job: bool) -> Iterator[tuple[int, Array]]:
    """Yield radii [mm] and configurations to begin in, the largest circles first."""
    begin = SE3.Identity()
    second = SE3(begin)
    second.translation = np.array([0.0, _SEAM_DISTANCE, 0.0])
    for radius in _RADII[:1] if job else _RADII:
        if job:
            along = np.array([_SEAM_DISTANCE, 0.0, 0.0])
            paths: list[Path] = []
            for first in (begin, second):
                last = SE3(first)
                last.translation = first.translation + along
                paths.append(Line(first, last, 1.0))
            paths.append(Line(begin, second, 1.0))
        else:
            paths = [Circle.around(begin, 1e-3 * radius, 1.0)]
        for q in roomy_starts(arm, task, paths, _STARTS):
            yield radius, q


def _task_of(arm: RobotModel) -> Task:
    """Return the first task that leaves the arm a joint to spare."""
    for item in (Task.POSE, Task.POINTING, Task.POSITION, Task.PLANAR):
        if arm.can_follow(item) and arm.redundancy(item) > 0:
            return item
    raise ProblemError(
        f"{arm.name}: its {arm.dof} joints up to tool '{arm.tool}' leave none to spare for any "
        f"task; take another link as --tool"
    )


def _places(arm: RobotModel, q: Array, on_plate: bool) -> tuple[str, str]:
    """Return where two seams begin, as a file says it."""
    if on_plate:
        one, two = (
            f"{{ position = [0.0, {y}, 0.03], rpy_deg = [180, 0, 0] }}" for y in (-0.05, 0.05)
        )
        return one, two
    first = arm.pose(q)
    second = SE3(first)
    second.translation = first.translation + np.array([0.0, _SEAM_DISTANCE, 0.0])
    return _pose(first), _pose(second)


def _pose(pose: SE3) -> str:
    place = ", ".join(f"{value + 0.0:.6f}" for value in pose.translation.tolist())
    x, y, z, w = Quaternion(pose.rotation).coeffs().tolist()
    turn = ", ".join(f"{value + 0.0:.9f}" for value in (w, x, y, z))
    return f"{{ position = [{place}], quaternion = [{turn}] }}"
