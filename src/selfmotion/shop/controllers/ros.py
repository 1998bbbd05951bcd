"""ROS 2: trajectories as messages in YAML, and bags (MCAP)."""

import io
import json
import re
import struct
from collections.abc import Mapping
from pathlib import Path
from textwrap import indent
from typing import Any

import numpy as np
from pinocchio import Quaternion

from selfmotion.basics import Array, FileFormatError, ProblemError
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.shop.cam import nanoseconds
from selfmotion.shop.controllers.samples import MotionSamples

# Messages of ROS 2 as tables: trajectory_msgs/JointTrajectory, moveit_msgs/RobotTrajectory.
#
# Their definitions: https://github.com/ros2/common_interfaces (trajectory_msgs/msg) and
# https://github.com/moveit/moveit_msgs (msg/RobotTrajectory.msg).

_NANO = 1_000_000_000
# At its ends a motion that is slower than this rests [rad/s or m/s].
_REST = 1e-6
# Where positions are joined by straight lines, a corner takes this share of the time to the next.
_CORNER = 1e-3
# Numbers such as 1e-05, which YAML 1.1 takes for text: it wants 1.0e-05.
_NO_POINT = re.compile(r"(?<=[ \[-])(\d)(?=e)")


def joint_trajectory(motion: MotionSamples) -> dict[str, Any]:
    """Return a JointTrajectory; its stamp is 0, which means: at once."""
    points = [
        {
            "positions": q,
            "velocities": qd,
            "accelerations": qdd,
            "effort": [],
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        }
        for q, qd, qdd, sec, nanosec in zip(*_columns(motion), strict=True)
    ]
    return {"header": _header(), "joint_names": list(motion.joint_names), "points": points}


def _columns(motion: MotionSamples) -> tuple[list[Any], ...]:
    """Return positions, velocities, accelerations, seconds and nanoseconds of all points."""
    rates = motion.qd.copy()
    for row in (0, -1):
        # Controllers want a 0 there, and refuse 1e-7.
        if np.abs(rates[row]).max() <= _REST:
            rates[row] = 0.0
    times = np.divmod(np.round(motion.t * _NANO).astype(np.int64), _NANO)
    return tuple(values.tolist() for values in (motion.q, rates, motion.qdd, *times))


def trajectory_yaml(motion: MotionSamples) -> str:
    """Return a JointTrajectory as YAML, as a general writer of YAML has it, which takes far longer.

    A list of numbers in Python is one in YAML, but for exponents without a point.
    """
    names = json.dumps(list(motion.joint_names))
    head = "header:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''\n"
    points = "".join(
        f"- positions: {q}\n  velocities: {qd}\n  accelerations: {qdd}\n  effort: []\n"
        f"  time_from_start: {{sec: {sec}, nanosec: {nanosec}}}\n"
        for q, qd, qdd, sec, nanosec in zip(*_columns(motion), strict=True)
    )
    return f"{head}joint_names: {names}\npoints:\n" + _NO_POINT.sub(r"\1.0", points)


def robot_yaml(motion: MotionSamples) -> str:
    """Return a RobotTrajectory as YAML; see `trajectory_yaml`."""
    floating = "  header:\n    stamp: {sec: 0, nanosec: 0}\n    frame_id: ''\n"
    return (
        f"joint_trajectory:\n{indent(trajectory_yaml(motion), '  ')}"
        f"multi_dof_joint_trajectory:\n{floating}  joint_names: []\n  points: []\n"
    )


def robot_trajectory(motion: MotionSamples) -> dict[str, Any]:
    """Return a RobotTrajectory, as MoveIt executes them."""
    return {
        "joint_trajectory": joint_trajectory(motion),
        "multi_dof_joint_trajectory": {"header": _header(), "joint_names": [], "points": []},
    }


def _header() -> dict[str, Any]:
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}


def trajectory(file: Path, document: Mapping[str, Any]) -> Trajectory:
    """Return the motion of either message.

    Raises
    ------
    FileFormatError
        A key is missing, or points do not fit the joints; the point is named.
    """
    several = document.get("trajectory")
    if isinstance(several, list) and len(several) == 1 and isinstance(several[0], Mapping):
        # A DisplayTrajectory.
        document = several[0]
    message = document.get("joint_trajectory", document)
    floating = document.get("multi_dof_joint_trajectory")
    if isinstance(floating, Mapping) and floating.get("points"):
        raise FileFormatError(
            f"{file}: moves joints of several coordinates as well (multi_dof_joint_trajectory), "
            f"which no arm here has; leave them out"
        )
    try:
        names, points = tuple(map(str, message["joint_names"])), list(message["points"])
    except (KeyError, TypeError):
        raise FileFormatError(
            f"{file}: has no joint_names and points, expected a JointTrajectory or RobotTrajectory"
        ) from None
    t, q, qd, qdd = [], [], [], []
    for k, point in enumerate(points):
        try:
            t.append(nanoseconds(point["time_from_start"]) / _NANO)
            q.append(_values(point, "positions"))
            qd.append(_values(point, "velocities"))
            qdd.append(_values(point, "accelerations"))
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{file}: points[{k}]: {error}; expected positions, and time_from_start with sec "
                f"and nanosec (ROS 1: secs and nsecs)"
            ) from error
        counts = len(q[-1]), len(qd[-1]), len(qdd[-1])
        if counts[0] != len(names) or not {*counts[1:]} <= {0, len(names)}:
            raise FileFormatError(
                f"{file}: points[{k}]: {counts[0]} positions, {counts[1]} velocities and "
                f"{counts[2]} accelerations for {len(names)} joints"
            )
        for what, values in (("velocities", qd), ("accelerations", qdd)):
            if bool(values[-1]) != bool(values[0]):
                raise FileFormatError(
                    f"{file}: points[{k}]: {what} are given for some points only; give all, or none"
                )
    faster = np.array(qdd) if all(qdd) else None
    try:
        if qd and not qd[0]:
            return Trajectory(*_straight(Trajectory(np.array(t), np.array(q), np.array(q), names)))
        return Trajectory(np.array(t), np.array(q), np.array(qd), names, faster)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _straight(points: Trajectory) -> tuple[Array, Array, Array, tuple[str, ...]]:
    """Return the motion of a controller that is given positions only: straight from one to another.

    At each point its velocity goes over from one to the next within a thousandth of the time to
    either, in which it is off the lines by next to nothing.
    """
    t, q = points.t, points.q
    lasts = np.diff(t)
    rates = np.diff(q, axis=0) / lasts[:, None]
    near = _CORNER * np.minimum(lasts[:-1], lasts[1:])
    before, after = t[1:-1] - near, t[1:-1] + near
    times = np.concatenate([t[:1], np.stack([before, after], axis=1).ravel(), t[-1:]])
    ends = [q[1:-1] - near[:, None] * rates[:-1], q[1:-1] + near[:, None] * rates[1:]]
    shape = (-1, q.shape[1])
    places = np.concatenate([q[:1], np.stack(ends, axis=1).reshape(shape), q[-1:]])
    speeds = np.repeat(rates, 2, axis=0)
    return times, places, speeds, points.joint_names


def _values(point: Mapping[str, Any], key: str) -> list[float]:
    """Return numbers of a point; empty lists are absent ones, but for positions."""
    numbers = point[key] if key == "positions" else point.get(key)
    return [float(value) for value in numbers or []]


# ROS 2 bags (MCAP): joint states and the tool's frame, for Foxglove, PlotJuggler and ``ros2
# bag``.
#
# The container: https://mcap.dev/spec. The messages: https://github.com/ros2/common_interfaces
# (sensor_msgs/msg/JointState) and https://github.com/ros2/geometry2 (tf2_msgs/msg/TFMessage).

# Topic of joint states.
STATES = "/joint_states"
# Topic of transforms.
FRAMES = "/tf"

_LINE = "=" * 80
_HEADER = f"""{_LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_HEADER}"""
_TRANSFORMS = f"""geometry_msgs/TransformStamped[] transforms
{_LINE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{_LINE}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{_LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_LINE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{_HEADER}"""


_SPOILT = (
    EOFError,
    LookupError,
    MemoryError,
    OverflowError,
    RuntimeError,
    struct.error,
    ValueError,
)


def bag(motion: MotionSamples, robot: RobotModel) -> bytes:
    """Return a bag with a JointState and the tool's frame in its reference for each sample.

    Parameters
    ----------
    motion : MotionSamples
        Stamps are its times, from 0.
    robot : RobotModel
        Where the tool is.

    Raises
    ------
    ProblemError
        The package that writes bags is not installed.
    """
    try:
        from mcap_ros2.writer import Writer
    except ModuleNotFoundError:
        raise ProblemError("bags need mcap-ros2-support: pip install 'selfmotion[bags]'") from None
    stream = io.BytesIO()
    writer: Any = Writer(stream)
    states = writer.register_msgdef("sensor_msgs/msg/JointState", _JOINT_STATE)
    frames = writer.register_msgdef("tf2_msgs/msg/TFMessage", _TRANSFORMS)
    names = list(motion.joint_names)
    whole = motion.robot_joints == robot.joint_names
    for t, q, qd in zip(motion.t, motion.q, motion.qd, strict=True):
        at = round(float(t) * _NANO)
        state = {
            "header": _stamped(at, ""),
            "name": names,
            "position": q.tolist(),
            "velocity": qd.tolist(),
            "effort": [],
        }
        writer.write_message(STATES, states, state, log_time=at, publish_time=at)
        if whole:
            message = {"transforms": [_tool(robot, q, at)]}
            writer.write_message(FRAMES, frames, message, log_time=at, publish_time=at)
    writer.finish()
    return stream.getvalue()


def _stamped(at: int, frame: str) -> dict[str, Any]:
    sec, nanosec = divmod(at, _NANO)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def _tool(robot: RobotModel, q: np.ndarray, at: int) -> dict[str, Any]:
    pose = robot.pose(q)
    turn = Quaternion(pose.rotation).coeffs()
    return {
        "header": _stamped(at, robot.reference or robot.urdf.root),
        "child_frame_id": robot.tool,
        "transform": {
            "translation": dict(zip("xyz", pose.translation.tolist(), strict=True)),
            "rotation": dict(zip("xyzw", turn.tolist(), strict=True)),
        },
    }


def motion_of_bag(file: Path) -> Trajectory:
    """Return the motion of the joint states in a bag, from its first stamp on.

    Raises
    ------
    FileFormatError
        It is no bag, or has no joint states that are a motion.
    ProblemError
        The package that reads bags is not installed.
    """
    try:
        from mcap.exceptions import McapError
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
        from zstandard import ZstdError
    except ModuleNotFoundError:
        raise ProblemError("bags need mcap-ros2-support: pip install 'selfmotion[bags]'") from None
    # Damaged bytes raise as many kinds of errors as there are fields.
    spoilt = (McapError, ZstdError, *_SPOILT)
    try:
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            states = [message for *_, message in reader.iter_decoded_messages([STATES])]
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from error
    except spoilt as error:
        raise FileFormatError(f"{file}: is no bag of ROS 2 messages: {error}") from error
    names = {tuple(state.name) for state in states}
    if len(names) != 1:
        count = "no" if not names else "several sets of"
        raise FileFormatError(f"{file}: has {count} joint names on {STATES}, expected one")
    stamps = [_NANO * s.header.stamp.sec + s.header.stamp.nanosec for s in states]
    t = np.array([at - stamps[0] for at in stamps]) / _NANO
    q, qd = (np.array([getattr(s, each) for s in states]) for each in ("position", "velocity"))
    try:
        return Trajectory(t, q, qd, names.pop())
    except (FileFormatError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: {error}") from error
