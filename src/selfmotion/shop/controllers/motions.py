"""Joint motions as the files that controllers and simulators read."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    PlanError,
    ProblemError,
    Progress,
    as_called,
    as_flag,
    as_path,
    read_document,
    shown,
    silent,
    write_bytes,
    write_document,
    write_text,
)
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shop.controllers import ros
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.motion_tables import (
    motion_of_arrays,
    read_npz,
    write_json,
    write_npz,
    write_table,
)
from selfmotion.shop.controllers.mujoco_keyframes import keyframes
from selfmotion.shop.controllers.program_draft import check_signals
from selfmotion.shop.controllers.program_files import (
    PROGRAMS,
    READ_PROGRAMS,
    read_program,
    write_program,
)
from selfmotion.shop.controllers.program_settings import ProgramSettings
from selfmotion.shop.controllers.ros import bag, motion_of_bag
from selfmotion.shop.controllers.samples import (
    MotionSamples,
    check_ends,
    coarsest_rate,
    for_cubics,
    within_limits_at,
)
from selfmotion.shop.controllers.urscript_stream import script
from selfmotion.work.job import Program


def write_motion(
    plan: Plan | Parts | Move | Program,
    file: str | Path,
    *,
    rate: float | None = None,
    format: str | None = None,
    settings: ProgramSettings | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> None:
    """Write the motion of a plan, parts, a move or a program as others read it; atomically.

    - ``csv`` (``.csv``): ``t``, a column per joint, ``NAME_velocity``, ``NAME_acceleration``
    - ``npz`` (``.npz``): arrays ``t``, ``q``, ``qd``, ``qdd``, ``joint_names``
    - ``json`` (``.json``): the same as lists
    - ``ros`` (``.yaml``): ROS 2 ``trajectory_msgs/JointTrajectory``
    - ``moveit``: ``moveit_msgs/RobotTrajectory``
    - ``bag`` (``.mcap``): a ROS 2 bag of ``sensor_msgs/JointState`` and the tool's frame
      (``tf2_msgs/TFMessage``), for Foxglove, PlotJuggler or ``ros2 bag play``
    - ``mujoco`` (``.xml``): keyframes, to include in an MJCF model made from the same URDF
    - ``urscript`` (``.script``): a stream of ``servoj``, its settings in the head
    - ``krl`` (``.src``): KUKA: axis targets with their times in spline blocks
    - ``rapid`` (``.mod``): ABB: axis targets with their times, rounded corners

    With ``settings=ProgramSettings(targets="poses")`` programs of controllers are linear and
    circular motions to tool poses in a work object, wherever these keep the motion; seams at a feed
    have it as their speed, with ramps of the controller's own.

    Parameters
    ----------
    plan : Plan, Parts, Move or Program
    file : path
    rate : float, optional
        Samples per second; by default those of the plan: few, whose quintics are its motion, as
        controllers of ROS 2 join them (URScript: 125). Messages of ROS have the coarsest rate at
        which straight lines keep the plan's tolerance, where that is fewer. A retimed plan is as
        much slower as quintics between samples at the rate need to keep its limits, which
        ``retime(plan, rate=…)`` returns.
    format : str, optional
        By default the one that has the file's suffix.
    settings : ProgramSettings, optional
        Of a controller's program (``urscript``, ``krl``, ``rapid``): outputs, tool, load, approach.
        Of ``krl`` and ``rapid`` also axes, and it bounds how far the controller, which passes
        targets, may be off the motion; there are as many as that takes, and a `rate` has no effect.
    force : bool
        Whether a motion that is not verified, or begins or ends moving, is written all the same.
    progress : callable, optional
        Told how far a controller's program is: ``("targets", 2, 7)``.

    Raises
    ------
    FileFormatError
        The format is unknown, or the file cannot be written.
    ProblemError
        The rate gives no samples, or the arm has what the format cannot say.
    PlanError
        It is not verified, a move was not found, or a joint moves at its start or its end, and
        the problem does not ask for that.
    """
    if not isinstance(plan, Plan | Parts | Move | Program):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan, Parts, a Move or a Program")
    if not (settings is None or isinstance(settings, ProgramSettings)):
        raise ProblemError(f"settings are {shown(settings)}, expected ProgramSettings")
    as_called(progress, "progress")
    path = as_path(file)
    name = form_of(path, format)
    check_verified(plan, path, as_flag(force, "force"))
    check_ends(plan, path, force)
    if name in PROGRAMS.values() or _is_linear(name, settings):
        if rate is not None:
            raise ProblemError(
                f"{path}: rate has no effect on a program, which has the targets that it needs"
            )
        write_program(plan, path, name, settings or ProgramSettings(), progress)
        return
    if name == "urscript":
        stream_settings = settings or ProgramSettings()
        if stream_settings != stream_settings.streamed:
            raise ProblemError(
                f"{path}: settings: deviation, move_deviation and axes have no effect on URScript, "
                f"which has all joints in their order at each period; leave them out"
            )
        _write_stream(path, plan, STREAM if rate is None else rate, stream_settings)
        return
    if settings is not None:
        raise ProblemError(f"{path}: settings have no effect: they are of controllers' programs")
    if isinstance(plan, Plan):
        plan = within_limits_at(plan, rate)
    motion = plan.motion if isinstance(plan, Move) else plan.trajectory
    if name == "bag" and rate is None:
        motion = for_cubics(motion)
    if name in MESSAGES and rate is None and isinstance(plan, Plan):
        rate = coarsest_rate(plan)
    WRITERS[name](path, MotionSamples.of(motion, rate), plan.robot, rate)


def _is_linear(form: str, settings: ProgramSettings | None) -> bool:
    """Whether a program of Universal Robots is one of targets, not a stream."""
    return form == "urscript" and settings is not None and settings.by_poses


def check_verified(plan: Plan | Parts | Move | Program, file: Path, force: bool) -> None:
    """Raise PlanError for a motion that is not verified, unless it is forced."""
    if isinstance(plan, Plan):
        sound, verdict = plan.certificate.verified and not plan.altered, plan.certificate.verdict
        verdict = plan.altered or verdict
    else:
        sound, verdict = plan.verified, plan.verdict
    if not (sound or force):
        raise PlanError(
            f"{file}: is not written: {verdict}; give force=True to write it all the same"
        )


def form_of(path: Path, form: str | None) -> str:
    """Return the format of a file."""
    ending = path.suffix.lower()
    if path.name.lower().endswith(_TIMETABLE):
        raise FileFormatError(
            f"{path}: {_TIMETABLE} is the name of a job's timetable, which is no motion: "
            f"`selfmotion job FILE --out {path.name}` writes it; call the motion otherwise"
        )
    is_program = ending in PROGRAMS
    name = SUFFIXES.get(ending) if form is None else form
    if name is None or name not in FORMS:
        known = ", ".join(f"{form} ({suffix})" for suffix, form in SUFFIXES.items())
        form_text = f"suffix '{path.suffix}'" if form is None else f"format '{form}'"
        raise FileFormatError(f"{path}: {form_text} is no format of motions: {known}, moveit")
    if PROGRAMS.get(ending, name) != name or (name in PROGRAMS.values() and not is_program):
        # Controllers, and what reads their programs, go by the suffix.
        suffix = next((end for end, each in PROGRAMS.items() if each == name), "another suffix")
        raise FileFormatError(f"{path}: format '{name}' is written with {suffix}")
    return name


def read_motion(
    file: str | Path, *, degrees: bool = False, robot: RobotModel | None = None
) -> Trajectory:
    r"""Read a motion that `write_motion`, or something else, wrote.

    In the formats ``csv``, ``npz``, ``json``, ``ros``, ``moveit`` and ``bag``, and programs.
    With accelerations where the file has them; see `Trajectory`. With `degrees` all coordinates are
    taken for angles in degrees, in any format.

    Of controllers' programs (``.src``, ``.mod``, ``.script``) those statements are read that
    `write_motion` writes, with other numbers, spaces and names: any other line is refused, by its
    number.

    - KRL: ``DEF``, ``END``, comments, ``BAS``, ``$BASE``, ``$TOOL``, ``$LOAD``, ``$VEL``,
      ``$ORI_TYPE``, ``$CIRC_TYPE``, ``$OUT[n]``, ``PTP {A1 …}``, ``PTP_SPLINE``, ``SPTP {A1 …}``,
      ``LIN {X …}``, ``SPLINE``, ``SPL {X …}``, ``SLIN {X …}``, ``SCIRC {X …}, {X …}`` (these
      three ``WITH $VEL.CP``), ``TIME_BLOCK`` with a ``PART`` for each target, ``TRIGGER WHEN PATH =
      0 DELAY = 0 DO $OUT[n]``, ``ENDSPLINE``, ``WAIT SEC``
    - RAPID: ``MODULE``, ``PROC`` without parameters, comments, ``tooldata``, ``wobjdata``,
      ``speeddata``, ``ConfL``, ``CirPathMode \ObjectFrame``, ``MoveAbsJ [[…], […]]\NoEOffs`` with
      ``\T``, ``MoveL [[…], […], […], […]]`` with ``\T`` or a speed, ``MoveC`` with a speed,
      ``fine`` or a zone ``z…``, ``\WObj``, ``SetDO``, ``WaitTime``
    - URScript: ``def selfmotion():``, comments, ``set_tcp``, ``set_payload``, ``feature = p[…]``,
      ``movel(pose_trans(feature, p[…]), t=…, r=…)`` or with ``a=…, v=…, r=…``, ``movec`` with these
      and ``mode=0``, ``movej``, ``sleep``, ``set_standard_digital_out``, ``end``

    The motion is the cubic spline through their targets, from rest to rest; of seams at speeds what
    the makers publish of such motions, with even ramps that fill the time in the comment ``planned
    time: … s``. Comments ``axes: A1 =
    joint [deg], …``, as they are written, name the joints and say which of them slide. Tool poses
    are those of a `robot`; its joints are followed from where the program begins.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is no motion; what is missing is named.
    """
    path = as_path(file)
    if not (robot is None or isinstance(robot, RobotModel)):
        raise ProblemError(f"robot is {shown(robot)}, expected a RobotModel")
    if path.suffix.lower() in READ_PROGRAMS:
        if degrees:
            raise FileFormatError(f"{path}: is in degrees by itself; drop degrees")
        return motion_of_program(path, read_program(path, robot))
    if path.suffix.lower() == ".csv":
        return Trajectory.from_csv(path, degrees=degrees)
    if path.suffix.lower() == ".npz":
        return _in_radians(read_npz(path), degrees)
    if path.suffix.lower() == ".mcap":
        return _in_radians(motion_of_bag(path), degrees)
    if path.suffix.lower() not in (".json", ".yaml", ".yml"):
        written = ", though it is written" if path.suffix.lower() in SUFFIXES else ""
        raise FileFormatError(
            f"{path}: is no motion that is read{written}: expected .csv, .npz, .json, .yaml (ROS), "
            f".mcap (ROS bag), .src (KUKA), .mod (ABB) or .script (linear URScript)"
        )
    document = read_document(path)
    read = motion_of_arrays if "t" in document else ros.trajectory
    return _in_radians(read(path, document), degrees)


# Velocities of a point of a message: a list that is not empty.
_VELOCITIES = re.compile(rb"velocities[\"']?\s*:\s*(\[\s*[-+.0-9]|-\s+[-+.0-9])")
# Bytes at the head of a file that are searched for velocities.
_HEAD = 100_000


def motion_notes(file: str | Path, *, degrees: bool = False) -> tuple[str, ...]:
    """Return notes of what `read_motion` takes for granted of a file that is no program."""
    path = as_path(file)
    form, angle = SUFFIXES.get(path.suffix.lower(), ""), "degrees" if degrees else "radians"
    is_message = form in (*MESSAGES, "bag")
    whose = "messages of ROS are in" if is_message and not degrees else "says no unit: taken for"
    other = "" if is_message or degrees else " (else: --degrees)"
    notes = [f"{path}: {whose} {angle}, metres of joints that slide, and seconds{other}"]
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    if form == "csv" and b"_velocity" not in head:
        notes.append(f"{path}: says no velocities: those of a cubic spline through its positions")
    if form == "ros" and not _VELOCITIES.search(head) and b"positions" in head:
        notes.append(f"{path}: says no velocities: straight lines from point to point")
    return tuple(notes)


def motion_of_program(path: Path, program: ControllerProgram) -> Trajectory:
    """Return the motion of a program that was read; FileFormatError where its targets are none."""
    try:
        return program.trajectory
    # Numbers that no controller holds make splines that none follows.
    except (ArithmeticError, ValueError, FileFormatError) as error:
        raise FileFormatError(f"{path}: its targets are no motion: {error}") from error


def _in_radians(motion: Trajectory, degrees: bool) -> Trajectory:
    """Return a motion whose coordinates were all read in degrees, or not, in radians."""
    if not degrees:
        return motion
    q, qd = np.radians(motion.q), np.radians(motion.qd)
    qdd = None if motion.qdd is None else np.radians(motion.qdd)
    return Trajectory(motion.t, q, qd, motion.joint_names, qdd)


def _write_ros(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    _write_message(file, motion, ros.joint_trajectory, ros.trajectory_yaml)


def _write_moveit(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    _write_message(file, motion, ros.robot_trajectory, ros.robot_yaml)


def _write_message(
    file: Path,
    motion: MotionSamples,
    message: Callable[[MotionSamples], Mapping[str, Any]],
    as_yaml: Callable[[MotionSamples], str],
) -> None:
    match file.suffix:
        case ".json":
            write_document(file, message(motion))
        case ".yaml" | ".yml":
            write_text(file, as_yaml(motion))
        case _:
            raise FileFormatError(f"{file}: messages are written as .yaml or .json")


def _write_bag(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    write_bytes(file, bag(motion, robot))


def _write_mujoco(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    if motion.robot_joints != robot.joint_names:
        raise ProblemError(f"{file}: keyframes are of all joints of {robot.name} together")
    write_text(file, keyframes(robot, motion.t, motion.q, motion.qd))


def _write_urscript(
    file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None
) -> None:
    write_text(file, script(robot, motion.robot_joints, motion.q, rate or STREAM))


def _write_stream(
    file: Path, plan: Plan | Parts | Move | Program, rate: float, settings: ProgramSettings
) -> None:
    """Write URScript with all that is to be said besides the motion."""
    motion = MotionSamples.of(plan.motion if isinstance(plan, Move) else plan.trajectory, rate)
    job_events = plan.events if isinstance(plan, Program) else ()
    check_signals({event: seam for _, seam, event in job_events}, settings)
    events = [(int(np.searchsorted(motion.t, time - 1e-9)), event) for time, _, event in job_events]
    joints, q = motion.robot_joints, motion.q
    write_text(file, script(plan.robot, joints, q, rate, settings, events))


# End of the names of timetables.
_TIMETABLE = ".timetable.csv"
# Messages of ROS, as texts.
MESSAGES = ("ros", "moveit")
# Samples per second of a stream to an arm of Universal Robots.
STREAM = 125.0
_Writer = Callable[[Path, MotionSamples, RobotModel, float | None], None]
WRITERS: Mapping[str, _Writer] = {
    "csv": write_table,
    "npz": write_npz,
    "json": write_json,
    "ros": _write_ros,
    "moveit": _write_moveit,
    "bag": _write_bag,
    "mujoco": _write_mujoco,
    "urscript": _write_urscript,
}
SUFFIXES = {
    ".csv": "csv",
    ".npz": "npz",
    ".json": "json",
    ".yaml": "ros",
    ".yml": "ros",
    ".mcap": "bag",
    ".xml": "mujoco",
    ".script": "urscript",
    **PROGRAMS,
}
FORMS = (*WRITERS, *PROGRAMS.values())
# Those that say all that a check needs.
READABLE = ("csv", "npz", "json", "ros", "moveit", "bag")
