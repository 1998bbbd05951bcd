"""Joint motions as the files that controllers and simulators read."""

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import (
    FileFormatError,
    ProblemError,
    as_path,
    read_arrays,
    shown,
    write_bytes,
    write_csv,
    write_text,
)
from selfmotion.formats import ros
from selfmotion.formats.documents import read_document, write_document
from selfmotion.formats.mujoco import keyframes
from selfmotion.formats.samples import MotionSamples
from selfmotion.formats.urscript import script
from selfmotion.job import Program
from selfmotion.motion import Trajectory, column_names
from selfmotion.result import Move, Parts, Plan
from selfmotion.robot import RobotModel


def write_motion(
    plan: Plan | Parts | Move | Program,
    file: str | Path,
    *,
    rate: float | None = None,
    form: str | None = None,
) -> None:
    """Write the motion of a plan, parts, a move or a program as others read it; atomically.

    ============  ========  ==================================================================
    form          suffix    what
    ============  ========  ==================================================================
    ``csv``       .csv      ``t``, a column per joint, ``NAME_velocity``, ``NAME_acceleration``
    ``npz``       .npz      arrays ``t``, ``q``, ``qd``, ``qdd``, ``joint_names``
    ``json``      .json     the same as lists
    ``ros``       .yaml     ROS 2 ``trajectory_msgs/JointTrajectory``
    ``moveit``              ``moveit_msgs/RobotTrajectory``
    ``mujoco``    .xml      keyframes, to include in an MJCF model made from the same URDF
    ``urscript``  .script   a stream of ``servoj``, its settings in the head
    ============  ========  ==================================================================

    Parameters
    ----------
    plan : Plan, Parts, Move or Program
    file : path
    rate : float, optional
        Samples per second; by default those of the plan (URScript: 125).
    form : str, optional
        By default the one that has the file's suffix.

    Raises
    ------
    FileFormatError
        The form is unknown, or the file cannot be written.
    ProblemError
        The rate gives no samples, or the arm has what the format cannot say.
    PlanError
        A move was not found.
    """
    if not isinstance(plan, Plan | Parts | Move | Program):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan, Parts, a Move or a Program")
    motion = plan.motion if isinstance(plan, Move) else plan.trajectory
    path = as_path(file)
    write, rate = _writer(path, rate, form)
    write(path, MotionSamples.of(motion, rate), plan.robot, rate)


def write_parts(
    plan: Plan, file: str | Path, *, rate: float | None = None, form: str | None = None
) -> dict[str, Path]:
    """Write the motion of a cell in a file for each part: part → file.

    Of ``motion.yaml`` they are called ``motion.PART.yaml``. All have the same times, and each the
    names that its joints have in the part's own robot. Parameters as in `write_motion`, which
    writes all joints into one file.

    Raises
    ------
    FileFormatError
        The form is unknown, or a file cannot be written.
    ProblemError
        The robot has no parts, the rate gives no samples, or a part has what the format cannot say.
    """
    if not isinstance(plan, Plan):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan")
    names = plan.robot.joint_names
    alone = [name for name in names if "/" not in name]
    if alone:
        raise ProblemError(
            f"{plan.robot.name}: joint '{alone[0]}' is of no part; only a cell of several robots "
            f"is written part by part"
        )
    path = as_path(file)
    write, rate = _writer(path, rate, form)
    samples, written = MotionSamples.of(plan.trajectory, rate), {}
    for part in dict.fromkeys(name.partition("/")[0] for name in names):
        written[part] = path.with_name(f"{path.stem}.{part}{path.suffix}")
        write(written[part], samples.of_part(part), plan.robot, rate)
    return written


def read_parts(files: Mapping[str, str | Path]) -> Trajectory:
    """Read the motion of a cell from a file for each part, as `write_parts` returns them.

    Raises
    ------
    FileFormatError
        A file cannot be read, is no motion, or has other times than the first.
    """
    motions = {part: read_motion(file) for part, file in files.items()}
    if not motions:
        raise FileFormatError("there is no file of a part, expected part → file")
    first, one = next(iter(motions.items()))
    for part, motion in motions.items():
        if not np.array_equal(motion.t, one.t):
            raise FileFormatError(
                f"{files[part]}: has {len(motion.t)} samples over {motion.duration:.6g} s, at "
                f"other times than {files[first]} with {len(one.t)} over {one.duration:.6g} s: "
                f"parts that move together are written together"
            )
    several = list(motions.values())
    known = [motion.qdd for motion in several if motion.qdd is not None]
    return Trajectory(
        one.t,
        np.hstack([motion.q for motion in several]),
        np.hstack([motion.qd for motion in several]),
        tuple(f"{part}/{name}" for part, motion in motions.items() for name in motion.joint_names),
        np.hstack(known) if len(known) == len(several) else None,
    )


def _writer(path: Path, rate: float | None, form: str | None) -> tuple["_Writer", float | None]:
    """Return what writes a file, and at which rate."""
    name = SUFFIXES.get(path.suffix) if form is None else form
    if name is None or name not in _WRITERS:
        known = ", ".join(f"{form} ({suffix})" for suffix, form in SUFFIXES.items())
        found = f"suffix '{path.suffix}'" if form is None else f"form '{form}'"
        raise FileFormatError(f"{path}: {found} is no format of motions: {known}, moveit")
    return _WRITERS[name], 125.0 if name == "urscript" and rate is None else rate


def read_motion(file: str | Path, *, degrees: bool = False) -> Trajectory:
    """Read a motion that `write_motion`, or something else, wrote: csv, npz, json, ros, moveit.

    With accelerations where the file has them; see `Trajectory`. With `degrees` all coordinates are
    taken for angles in degrees, in any format.

    Raises
    ------
    FileFormatError
        The file cannot be read, or is no motion; what is missing is named.
    """
    path = as_path(file)
    if path.suffix == ".csv":
        return Trajectory.from_csv(path, degrees=degrees)
    if path.suffix == ".npz":
        return _in_radians(_read_npz(path), degrees)
    document = read_document(path)
    read = _of_tables if "t" in document else ros.trajectory
    return _in_radians(read(path, document), degrees)


def _in_radians(motion: Trajectory, degrees: bool) -> Trajectory:
    """Return a motion whose coordinates were all read in degrees, or not, in radians."""
    if not degrees:
        return motion
    q, qd = np.radians(motion.q), np.radians(motion.qd)
    qdd = None if motion.qdd is None else np.radians(motion.qdd)
    return Trajectory(motion.t, q, qd, motion.joint_names, qdd)


def _write_csv(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    table = np.column_stack([motion.t, motion.q, motion.qd, motion.qdd])
    write_csv(file, column_names(motion.joint_names), table)


def _write_npz(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    stream = io.BytesIO()
    arrays: dict[str, Any] = {"t": motion.t, "q": motion.q, "qd": motion.qd, "qdd": motion.qdd}
    np.savez_compressed(stream, joint_names=np.array(motion.joint_names), **arrays)
    write_bytes(file, stream.getvalue())


def _write_json(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    table: dict[str, Any] = {"joint_names": list(motion.joint_names)}
    table |= {name: getattr(motion, name).tolist() for name in ("t", "q", "qd", "qdd")}
    write_text(file, json.dumps(table) + "\n")


def _write_ros(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    _write_yaml(file, ros.joint_trajectory(motion))


def _write_moveit(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    _write_yaml(file, ros.robot_trajectory(motion))


def _write_yaml(file: Path, message: Mapping[str, Any]) -> None:
    if file.suffix not in (".yaml", ".yml", ".json"):
        raise FileFormatError(f"{file}: messages are written as .yaml or .json")
    write_document(file, message)


def _write_mujoco(file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None) -> None:
    if motion.robot_joints != robot.joint_names:
        raise ProblemError(f"{file}: keyframes are of all joints of {robot.name} together")
    write_text(file, keyframes(robot, motion.t, motion.q, motion.qd))


def _write_urscript(
    file: Path, motion: MotionSamples, robot: RobotModel, rate: float | None
) -> None:
    write_text(file, script(robot, motion.robot_joints, motion.q, rate or 125.0))


def _read_npz(file: Path) -> Trajectory:
    return _of_tables(file, read_arrays(file))


def _of_tables(file: Path, tables: Mapping[str, Any]) -> Trajectory:
    missing = [name for name in ("t", "q", "qd", "joint_names") if name not in tables]
    if missing:
        raise FileFormatError(f"{file}: '{missing[0]}' is missing, expected t, q, qd, joint_names")
    try:
        names = tuple(map(str, tables["joint_names"]))
        return Trajectory(tables["t"], tables["q"], tables["qd"], names, tables.get("qdd"))
    except (FileFormatError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: {error}") from error


_Writer = Callable[[Path, MotionSamples, RobotModel, float | None], None]
_WRITERS: Mapping[str, _Writer] = {
    "csv": _write_csv,
    "npz": _write_npz,
    "json": _write_json,
    "ros": _write_ros,
    "moveit": _write_moveit,
    "mujoco": _write_mujoco,
    "urscript": _write_urscript,
}
SUFFIXES = {
    ".csv": "csv",
    ".npz": "npz",
    ".json": "json",
    ".yaml": "ros",
    ".yml": "ros",
    ".xml": "mujoco",
    ".script": "urscript",
}
FORMS = tuple(_WRITERS)
# Those that say all that a check needs.
READABLE = ("csv", "npz", "json", "ros", "moveit")
