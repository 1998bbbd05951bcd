"""Options of the commands, each declared once, and what their texts mean."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

import selfmotion as sm
from selfmotion.basics import TURN, Array
from selfmotion.shell.documents import json_schema, keys_of

TaskName = Literal["pose", "position", "pointing", "planar", "planar_pose"]
_SEVERAL = "may be given several times"

# What commands are about.

ProblemArgument = Annotated[
    str,
    typer.Argument(
        help="A robot: name (see `selfmotion robots`), .urdf or .xacro file; to plan, also a "
        "problem file (.toml, .json, .yaml; see `selfmotion init`)."
    ),
]
DocumentArgument = Annotated[
    Path,
    typer.Argument(
        help="A problem file or a job file (.toml, .json, .yaml); `view` shows plans as well."
    ),
]
DocumentsArgument = Annotated[
    list[Path],
    typer.Argument(help=r"Problem files (of a \[grid] all combinations), or a job file."),
]
PlanArgument = Annotated[
    Path,
    typer.Argument(
        help="A plan saved as .npz, a .program, .parts, or, to check, a motion: .csv (t, a column "
        "per joint), .json, .yaml (ROS), .mcap (ROS bag), .src (KUKA), .mod (ABB), .script (linear "
        "URScript)."
    ),
]
PlansArgument = Annotated[
    list[Path], typer.Argument(help="Plans saved as .npz, or one or more .program.")
]

# What is planned: short forms of keys, and all keys.

PathOption = Annotated[
    Path | None,
    typer.Option(
        help="Poses: CSV with t,x,y,z and qw,qx,qy,qz or roll,pitch,yaw (about fixed axes) or "
        "rx,ry,rz (rotation vector) or nx,ny,nz (s, m, rad; x_mm, roll_deg, …), .npy, or ROS Path "
        "and PoseArray as .yaml and .json; G-code (.nc, .gcode, …), APT (.apt, .cls, …), or a "
        "drawing (.dxf). How it is read: --set path.KEY=VALUE."
    ),
]
FeedOption = Annotated[
    float | None, typer.Option(help="Constant tool speed from rest to rest (m/s): path.feed.")
]
FrameOption = Annotated[
    str | None,
    typer.Option(
        help="Pose of the frame that the path is in: x,y,z,roll,pitch,yaw (m, rad): path.frame."
    ),
]
TaskOption = Annotated[
    TaskName | None,
    typer.Option(
        help="What the path prescribes, the pose of the tool, its position, or pointing: all but "
        "its rotation about its own z axis; planar and planar_pose are for planar arms. By default "
        "pose, of a planar arm planar."
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option(
        help="q1,q2,… (rad or m), home, dexterous (far from limits and singular poses) or free "
        "(the best that is found); by default free, and dexterous where a shape begins there."
    ),
]
ToolOption = Annotated[str | None, typer.Option(help="Tool frame (a link): robot.tool.")]


@cache
def _known_keys() -> tuple[str, ...]:
    return keys_of(json_schema())


def _complete(incomplete: str) -> list[str]:
    """Return the keys of problem and job files that begin so, for the shell."""
    return [f"{key}=" for key in _known_keys() if key.startswith(incomplete)]


SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        autocompletion=_complete,
        help='A key of the file, such as path.duration=6, \'path={kind="circle", radius=0.1, '
        "duration=4}', constraints.ClosedPath=true, costs.InverseManipulability.mu=0.01 or "
        "clearance.obstacles=@boxes.json (what a file says). Repeatable.",
    ),
]
FromOption = Annotated[
    Path | None,
    typer.Option(
        "--from",
        help="Begin with what was planned before: of a plan (.npz) the start and the self-motion; "
        "of a .program what did not change is kept.",
    ),
]
DeadlineOption = Annotated[
    float | None,
    typer.Option(
        help="Stop after this many seconds by the clock, with the best so far; of many problems, "
        "each."
    ),
]
AllowCodeOption = Annotated[
    bool, typer.Option("--allow-code", help="Import what the file names as module:attribute.")
]
WorkersOption = Annotated[int | None, typer.Option(min=1, help="Processes.")]
DaskOption = Annotated[
    str | None, typer.Option(help="Or the address of a Dask scheduler, host:port.")
]

# What is written and printed.

OutOption = Annotated[
    list[Path] | None,
    typer.Option(
        help="File to write: a plan (.npz), a .program or .parts, a problem file, a replay "
        "(.html), or the motion (.csv, .json and .yaml (ROS 2 JointTrajectory), .mcap (ROS 2 bag), "
        ".xml (MuJoCo keyframes), .script (URScript), .src (KUKA), .mod (ABB)). Repeatable."
    ),
]
OneOutOption = Annotated[
    Path | None, typer.Option("--out", "-o", help="The file, or the folder, to write.")
]
FolderOption = Annotated[
    Path | None,
    typer.Option("--folder", help="Folder for what is made; what was stopped goes on there."),
]
HtmlOption = Annotated[Path | None, typer.Option(help="Write a replay to open in a browser.")]
MapOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--map",
        help="Draw a map as .png: a plan's redundancy (.npz has all of it), or places around the "
        "best (.html as well). Repeatable.",
    ),
]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Write what is refused otherwise: over a file, outside of a document's own folder, a "
        "motion that is not verified or moves at an end.",
    ),
]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print all that was measured, tried and found.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")]
SettingsOption = Annotated[
    Path | None,
    typer.Option(
        help="File with settings of a controller's program: deviation, axes, signals, "
        "flange, mass, center, approach, targets, work_object, positioner (TOML)."
    ),
]

# What motions are judged by, and made faster.

RobotOption = Annotated[
    str | None,
    typer.Option(
        help="What a motion is of: name (`selfmotion robots`), .urdf file, or a problem file "
        "(.toml, .json, .yaml) or the plan that it comes from (.npz), with everything these ask "
        "for; of the .src, .mod or .script of a job its .program."
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        help="Calibration of this arm: Universal Robots' kinematics (.yaml), their "
        "calibration.conf, or joints and offsets (.yaml, .toml)."
    ),
]
DegreesOption = Annotated[
    bool, typer.Option("--degrees", help="Angles of the motion are in degrees.")
]
ToleranceOption = Annotated[
    float | None, typer.Option(help="Allowed deviation of the tool from its path (m).")
]
TurnOption = Annotated[
    float | None, typer.Option(help="Allowed deviation of its orientation (rad).")
]
VelocityOption = Annotated[
    str | None, typer.Option(help="Velocity limits (rad/s or m/s): one, or one per joint.")
]
AccelerationOption = Annotated[
    str | None, typer.Option(help="Acceleration limits (rad/s² or m/s²): one, or one per joint.")
]
RateOption = Annotated[
    float | None,
    typer.Option(
        help="Samples per second that a controller takes: limits are kept between these. By "
        "default the plan's own, few, joined by quintics."
    ),
]

# What moves, where cells are measured and placed.

PartOption = Annotated[
    list[str] | None,
    typer.Option(help=f"A body of the part ({_SEVERAL}); by default all obstacles there."),
]
OfOption = Annotated[
    list[str] | None,
    typer.Option(
        help="What is moved: part (the default), tool or base; to place, part, base, or path for "
        "the path alone."
    ),
]
CenterOption = Annotated[
    str | None,
    typer.Option(help="Centre of rotation of the part: x,y,z (m); by default the path's middle."),
]


def numbers(text: str, option: str, count: int | None = None) -> Array:
    """Return the numbers of an option; of a wrong number of them, ProblemError."""
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise sm.errors.ProblemError(
            f"{option} is '{text}', expected numbers like 0,-0.8,1.6"
        ) from None
    if count is not None and len(values) != count:
        raise sm.errors.ProblemError(f"{option} has {len(values)} numbers, expected {count}")
    return values


def ranges(texts: list[str] | None) -> dict[str, Array]:
    """Return the ranges of --within, by coordinate."""
    pairs = [text.partition("=") for text in texts or []]
    refuse_twice("--within", [name for name, _, _ in pairs])
    for name, _, low in pairs:
        if name not in _COORDINATES:
            raise sm.errors.ProblemError(
                f"--within is '{name}={low}', expected COORDINATE=LOW,HIGH like x=-0.2,0.2, one of "
                f"{', '.join(_COORDINATES)}"
            )
    return {name: numbers(values, f"--within {name}", 2) for name, _, values in pairs}


_COORDINATES = ("x", "y", "z", "roll", "pitch", "yaw")


def refuse_twice(option: str, names: list[str]) -> None:
    """Raise ProblemError where an option says the same thing twice: only the last would count."""
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise sm.errors.ProblemError(f"{option} says '{twice}' twice; say it once")


def refuse(options: Mapping[str, Any], file: Path | str, whose: str) -> None:
    """Raise ProblemError for an option that what is checked says itself."""
    for name, value in options.items():
        if value:
            raise sm.errors.ProblemError(f"{file}: --{name} is {whose} own: leave it out")


def refuse_unused(options: Mapping[str, Any], what: str) -> None:
    """Raise ProblemError for an option that has no effect on what is planned."""
    for name, value in options.items():
        if value is not None:
            raise sm.errors.ProblemError(f"--{name} has no effect on {what}: leave it out")


def one_or_each(text: str | None, option: str) -> list[float] | float | None:
    """Return one number, or one for each joint; None where nothing is said."""
    if text is None:
        return None
    values: list[float] = numbers(text, option).tolist()
    return values[0] if len(values) == 1 else values


def process_tolerance(tolerance: float | None, turn: float | None) -> sm.Tolerance | None:
    """Return what a process allows, both numbers or none."""
    if (tolerance is None) != (turn is None):
        raise sm.errors.ProblemError("--tolerance and --turn say together what the process allows")
    return None if tolerance is None or turn is None else sm.Tolerance(tolerance, turn)


def pose(text: str, option: str) -> dict[str, Any]:
    """Return a pose x,y,z,roll,pitch,yaw as files write it."""
    values = numbers(text, option, 6).tolist()
    for angle in values[3:]:
        if abs(angle) > TURN:
            raise sm.errors.ProblemError(
                f"{option} has an angle of {angle:g} rad, more than a turn; in degrees? Expected "
                f"x,y,z,roll,pitch,yaw in m and rad: 90° is 1.5708"
            )
    return {"position": values[:3], "rpy": values[3:]}
