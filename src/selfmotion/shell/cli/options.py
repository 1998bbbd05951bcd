"""Options of the commands, and what their texts mean."""

import inspect
from collections.abc import Callable, Collection, Sequence
from dataclasses import fields, replace
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

import selfmotion as sm
from selfmotion import basics
from selfmotion.basics import TURN, Array
from selfmotion.shell import documents

TaskName = Literal["pose", "position", "pointing", "planar", "planar_pose"]
Corners = Literal["blend", "stop", "round"]
Rotary = Literal["head", "table"]
DrawnUnit = Literal["mm", "cm", "dm", "m", "in", "ft"]
Axis = Literal["x", "y", "z"]
SearchMode = Literal["auto", "local", "global"]

ProblemArgument = Annotated[
    str,
    typer.Argument(
        help="A problem file (.toml, .json; see `selfmotion init`), or a robot: name (see "
        "`selfmotion robots`), .urdf or .xacro file."
    ),
]

PathOption = Annotated[
    Path | None,
    typer.Option(
        help="Poses: CSV with t,x,y,z and qw,qx,qy,qz or roll,pitch,yaw (about fixed axes) or "
        "rx,ry,rz (rotation vector) or nx,ny,nz (s, m, rad; x_mm, roll_deg, …), .npy, or ROS Path "
        "and PoseArray as .yaml and .json; G-code (.nc, .gcode, …), APT (.apt, .cls, …), or a "
        "drawing (.dxf)."
    ),
]
_FROM = "from the tool's pose at --start (by default a dexterous configuration)"
CircleOption = Annotated[
    float | None, typer.Option(help=f"Or a circle of this radius (m), {_FROM}.")
]
LineOption = Annotated[
    str | None, typer.Option(help=f"Or a straight line by dx,dy,dz (m), {_FROM}.")
]
NormalOption = Annotated[
    Axis | None,
    typer.Option(help="Axis of the circle; x by default, of a planar arm that of its plane."),
]
DurationOption = Annotated[
    float | None,
    typer.Option(
        help="Of circle or line (s; 4 by default without --feed), or of poses without times."
    ),
]
FeedOption = Annotated[
    float | None,
    typer.Option(
        help="Constant tool speed from rest to rest (m/s), of circle or line, or of poses without "
        "times."
    ),
]
JumpOption = Annotated[
    float | None,
    typer.Option(help="Largest distance between poses of --path (m; 0.5 by default)."),
]
SeamOption = Annotated[
    str | None, typer.Option(help="Which seam or cut of --path, where it has several.")
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        help="Names of the columns of --path, an array or without a header: x,y,z,nx,ny,nz."
    ),
]
FlipOption = Annotated[
    bool,
    typer.Option("--flip-normals", help="Normals of --path point out of the part, as CAD's do."),
]
StandoffOption = Annotated[
    float | None,
    typer.Option(help="Distance from the poses of --path, back along the tool's z axis (m)."),
]
AlongOption = Annotated[
    str | None,
    typer.Option(
        help="Which axis of the tool is along --path: x, -x, y or -y; with --corners stop or round."
    ),
]
LeadOption = Annotated[
    float | None,
    typer.Option(help="By how much the tool leans towards where it goes, with --along (rad)."),
]
TiltOption = Annotated[
    float | None,
    typer.Option(help="By how much it leans to the left of where it goes, with --along (rad)."),
]
LiftOption = Annotated[
    float | None,
    typer.Option(
        help="How far the tool leaves corners to turn, with --along and --corners stop (m)."
    ),
]
RotaryOption = Annotated[
    Rotary | None,
    typer.Option(
        help="What A, B, C of G-code without G43.4 turn: the head (positions are the tip's), or a "
        "table, with its axes and centre."
    ),
]
RotaryAxesOption = Annotated[
    str | None,
    typer.Option(
        help="Axes of a rotary table from the machine to the part: BC, AC, or B,-C where C turns "
        "the table right-handed; with --rotary head under tool centre point control."
    ),
]
RotaryCenterOption = Annotated[
    str | None, typer.Option(help="A point x,y,z (m) on the axes of a rotary table.")
]
UnitOption = Annotated[
    DrawnUnit | None,
    typer.Option(help="Unit of a drawing (.dxf) that states none, or a wrong one."),
]
FrameOption = Annotated[
    str | None,
    typer.Option(help="Pose of the frame that --path is in: x,y,z,roll,pitch,yaw (m, rad)."),
]
RampOption = Annotated[
    float | None,
    typer.Option(help="Duration of run-up from rest and of run-down of --path (s)."),
]
CornersOption = Annotated[
    Corners | None,
    typer.Option(
        help="At corners of --path: blend through the pose (the default), stop there, or, "
        "with --feed, round the corner between straight legs."
    ),
]
CornerToleranceOption = Annotated[
    float | None,
    typer.Option(help="Largest deviation at rounded corners (m; 0.001 by default).", min=1e-6),
]
_TASK = (
    "Task: what the path prescribes, the pose of the tool, its position, or pointing: all but its "
    "rotation about its own z axis; planar and planar_pose are for planar arms"
)
TaskOption = Annotated[TaskName, typer.Option(help=f"{_TASK}.")]
CheckedTaskOption = Annotated[TaskName | None, typer.Option(help=f"{_TASK}; pose by default.")]
PlannedTaskOption = Annotated[
    TaskName | None,
    typer.Option(help=f"{_TASK}; pose by default, planar for a planar arm."),
]
RelaxOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Tolerances of the task: ROWS[=BAND]\\[@FROM:TO]; ROWS are x,y,z, or rotations "
        "rx,ry,rz about the tool's axes, BAND in m or rad (free without), times in s. "
        "Examples: z=0.002, rx,ry=0.2 (a cone), rz@1:2.5. Repeatable."
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option(
        help="q1,q2,… (rad or m), home, dexterous (far from limits and singular poses) or free "
        "(the best that is found); by default free with --path, dexterous otherwise."
    ),
]
FromOption = Annotated[
    Path | None,
    typer.Option(
        "--from", help="Warm start: begin with the start and the self-motion of this plan (.npz)."
    ),
]
ToolOption = Annotated[str | None, typer.Option(help="Tool frame (a link).")]
ReferenceOption = Annotated[
    str | None,
    typer.Option(help="Link in whose frame the path is given, where it moves: a part on a table."),
]
DegreeOption = Annotated[
    int | None,
    typer.Option(
        help="The published method: the self-motion ε(t) is a polynomial of this degree, and no "
        "constraint is kept but closure. By default ε(t) is any function."
    ),
]
MuOption = Annotated[
    float,
    typer.Option(
        help="Weight of the cost 1/det(JJᵀ), which keeps away from singular configurations."
    ),
]
CostOption = Annotated[
    list[str] | None,
    typer.Option(
        help="NAME[=WEIGHT], such as JointAcceleration=0.1. Repeatable; replaces the "
        "default, JointVelocity."
    ),
]
ClosedOption = Annotated[
    bool, typer.Option("--closed", help="End in the configuration and velocity of the start.")
]
NoCollisionOption = Annotated[
    bool, typer.Option("--no-self-collision", help="Do not check self-collision.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="KEY=VALUE of the problem file, such as path.duration=6. Repeatable."
    ),
]
AllowCodeOption = Annotated[
    bool, typer.Option("--allow-code", help="Import what the file names as module:attribute.")
]
DampedOption = Annotated[
    bool,
    typer.Option(
        "--damped", help="Damp the inverse near singular poses; there the tool may leave its path."
    ),
]
DeadlineOption = Annotated[
    float | None,
    typer.Option(help="Stop after this many seconds by the clock, with the best so far."),
]
LimitOption = Annotated[
    int | None, typer.Option(help="Limit on cost evaluations while optimising.")
]
SearchOption = Annotated[
    SearchMode | None,
    typer.Option(
        help="Without --start: optimise from many starts (local), search all self-motions (global),"
        " or global where local fails (auto, the default)."
    ),
]
CompareOption = Annotated[
    bool,
    typer.Option(
        "--compare",
        help="Also run the global search, and report the distance from its best motion.",
    ),
]
OutOption = Annotated[
    list[Path] | None,
    typer.Option(
        help="Write the plan (.npz), its replay (.html) or motion (.csv, .json, .yaml, .mcap, "
        ".xml, .script, .src, .mod; see `selfmotion export`). Repeatable."
    ),
]
HtmlOption = Annotated[Path | None, typer.Option(help="Write a replay to open in a browser.")]

CheckedArgument = Annotated[
    Path,
    typer.Argument(
        help="A plan saved as .npz, a .program, .parts, or a motion: .csv (t, a column per joint), "
        ".json, .yaml (ROS), .mcap (ROS bag), .src (KUKA), .mod (ABB), .script (linear URScript)."
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        help="For a motion: name (`selfmotion robots`), .urdf file, or a problem file (.toml, "
        ".json) or the plan that it comes from (.npz), with everything these ask for; for the "
        ".src, .mod or .script of a job its .program."
    ),
]
LockOption = Annotated[
    list[str] | None,
    typer.Option(help="Joint to lock: NAME=VALUE (rad or m). Repeatable."),
]
ArgumentOption = Annotated[
    list[str] | None,
    typer.Option(help="Argument of a .xacro file: NAME=VALUE. Repeatable."),
]
PackagesOption = Annotated[
    list[Path] | None,
    typer.Option(
        help="Folder with packages that a robot's file names (package://, $(find …)); by default "
        "they are looked for around the file, and by AMENT_PREFIX_PATH and ROS_PACKAGE_PATH. "
        "Repeatable."
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
VelocityOption = Annotated[
    str | None, typer.Option(help="Velocity limits (rad/s or m/s): one, or one per joint.")
]
AccelerationOption = Annotated[
    str | None, typer.Option(help="Acceleration limits (rad/s² or m/s²): one, or one per joint.")
]
JointLimitsOption = Annotated[
    Path | None,
    typer.Option(help="Limits of joints in MoveIt's joint_limits.yaml, besides the arm's own."),
]
ObstaclesOption = Annotated[
    Path | None,
    typer.Option(help=r"Obstacles: a list of shapes in JSON, or TOML with \[\[obstacles]]."),
]
ClearanceOption = Annotated[
    float,
    typer.Option(
        help="Distance to keep from obstacles and of links from each other (m); at 0 they may not "
        "overlap."
    ),
]
SrdfOption = Annotated[
    Path | None, typer.Option(help="SRDF: its disabled pairs of links are not checked.")
]
DisabledOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LINK,LINK",
        help="Two links that may overlap, as they are made so. Repeatable.",
    ),
]
ToleranceOption = Annotated[
    float | None,
    typer.Option(
        help="Allowed deviation from the path (m and rad); 1e-6 by default, or the plan's."
    ),
]
ForceOption = Annotated[
    bool,
    typer.Option("--force", help="Write outputs that the file names outside of its own folder."),
]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print all that was measured, tried and found.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the outcome as JSON.")]


def of_table(
    table: type[Any], after: str, names: Collection[str] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command the fields of a dataclass as options.

    The command reads them from its context.

    Parameters
    ----------
    table : type
        A dataclass whose types are options.
    after : str
        The parameter of the command after which they are listed.
    names : collection of str
        Which of the fields; by default all.
    """
    added = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.POSITIONAL_OR_KEYWORD,
            default=field.default,
            annotation=field.type,
        )
        for field in fields(table)
        if not names or field.name in names
    ]

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command).parameters
        place = list(own).index(after) + 1

        @wraps(command)
        def run(**given: Any) -> None:
            command(**{name: given[name] for name in own})

        parameters = [*own.values()]
        parameters[place:place] = added
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        return run

    return with_options


def relaxation(text: str) -> sm.Relaxation:
    """Return what --relax describes."""
    rest, _, window = text.partition("@")
    rows, _, band = rest.partition("=")
    try:
        first, last = (float(time) for time in window.split(":")) if window else (0.0, 0.0)
        item = sm.Relaxation(
            tuple(rows.split(",")),
            float(band) if band else np.inf,
            (first, last) if window else None,
        )
    except ValueError:
        raise sm.errors.ProblemError(
            f"--relax is '{text}', expected ROWS[=BAND][@FROM:TO] like rx,ry=0.2 or rz@1:2.5"
        ) from None
    return item


def search_of(
    mode: SearchMode | None, compare: bool, known: sm.Search | None = None
) -> sm.Search | None:
    """Return how to search where the user says something about it, else as is `known`."""
    if mode is None and not compare:
        return None
    search = known or sm.Search()
    return replace(search, mode=mode or search.mode, compare=compare or search.compare)


def numbers(text: str, option: str, count: int | None = None) -> Array:
    """Return the numbers of an option, so many if a count is given."""
    try:
        numbers = np.array([float(part) for part in text.split(",")])
    except ValueError:
        raise sm.errors.ProblemError(
            f"{option} is '{text}', expected numbers like 0,-0.8,1.6"
        ) from None
    if count is not None and len(numbers) != count:
        raise sm.errors.ProblemError(f"{option} has {len(numbers)} numbers, expected {count}")
    return numbers


def locks(texts: list[str] | None) -> dict[str, float]:
    """Return what --lock describes."""
    held = {}
    refuse_twice("--lock", [text.partition("=")[0] for text in texts or []])
    for text in texts or []:
        name, _, value = text.partition("=")
        try:
            held[name] = float(value)
        except ValueError:
            raise sm.errors.RobotError(
                f"--lock is '{text}', expected NAME=VALUE like joint_7=0.5"
            ) from None
    return held


def arguments(texts: list[str] | None) -> dict[str, str]:
    """Return what --argument describes."""
    values = {}
    refuse_twice("--argument", [text.partition("=")[0] for text in texts or []])
    for text in texts or []:
        name, mark, value = text.partition("=")
        if not (name and mark):
            raise sm.errors.RobotError(
                f"--argument is '{text}', expected NAME=VALUE like prefix=left_"
            )
        values[name] = value
    return values


def refuse_twice(option: str, names: list[str]) -> None:
    """Raise ProblemError where an option says the same thing twice: only the last would count."""
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise sm.errors.ProblemError(f"{option} says '{twice}' twice; say it once")


def refuse(options: dict[str, Any], file: Path | str, whose: str) -> None:
    """Raise ProblemError for an option that what is checked says itself."""
    for name, value in options.items():
        if value is not None:
            raise sm.errors.ProblemError(f"{file}: --{name} is {whose} own: leave it out")


def refuse_unused(options: dict[str, Any], what: str) -> None:
    """Raise ProblemError for an option that has no effect on what is planned."""
    for name, value in options.items():
        if value is not None:
            option = name.replace("_", "-")
            raise sm.errors.ProblemError(f"--{option} has no effect on {what}: leave it out")


def one_or_each(text: str, option: str) -> list[float] | float:
    """Return one number, or one for each joint."""
    values: list[float] = numbers(text, option).tolist()
    return values[0] if len(values) == 1 else values


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


def read_obstacles(file: Path) -> tuple[sm.obstacles.Obstacle, ...]:
    """Return the obstacles of a file; see `obstacle_tables`."""
    obstacles = []
    for k, item in enumerate(obstacle_tables(file)):
        try:
            obstacles.append(documents.obstacle(item, lambda name: Path(name)))
        except sm.SelfmotionError as error:
            raise sm.errors.FileFormatError(f"{file}: [{k}]: {error}") from error
    return tuple(obstacles)


def obstacle_tables(file: Path) -> list[dict[str, Any]]:
    """Return the tables of a JSON list of obstacles, or of ``[[obstacles]]`` in TOML or JSON.

    Mesh files are looked for beside the file.
    """
    listed = _listed(file)
    if not (isinstance(listed, list) and all(isinstance(item, dict) for item in listed)):
        raise sm.errors.FileFormatError(
            f"{file}: expected a list of obstacles, each a table of values"
        )
    tables = [basics.in_si(item, f"{file}: [{k}].") for k, item in enumerate(listed)]
    for item in tables:
        if isinstance(item.get("file"), str):
            item["file"] = str(file.parent / item["file"])
    return tables


def _listed(file: Path) -> Any:
    content = basics.read_values(file)
    return content.get("obstacles") if isinstance(content, dict) else content


def disabled_pairs(texts: Sequence[str] | None) -> list[list[str]]:
    """Return the pairs of links of --disabled."""
    pairs = [[name.strip() for name in text.split(",")] for text in texts or ()]
    for text, pair in zip(texts or (), pairs, strict=True):
        if len(pair) != 2 or not all(pair):
            raise sm.errors.ProblemError(f"--disabled is {text!r}, expected two links: LINK,LINK")
    return pairs
