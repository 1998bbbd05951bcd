"""ROS 2 bags (MCAP): joint states and the tool's frame, for Foxglove, PlotJuggler and ``ros2 bag``.

The container: https://mcap.dev/spec. The messages: https://github.com/ros2/common_interfaces
(sensor_msgs/msg/JointState) and https://github.com/ros2/geometry2 (tf2_msgs/msg/TFMessage).
"""

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from pinocchio import Quaternion

from selfmotion.basics import FileFormatError, ProblemError
from selfmotion.controllers.samples import MotionSamples
from selfmotion.motion import Trajectory
from selfmotion.robot import RobotModel

STATES, FRAMES = "/joint_states", "/tf"
_NANO = 1_000_000_000
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
            "header": _header(at, ""),
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


def _header(at: int, frame: str) -> dict[str, Any]:
    sec, nanosec = divmod(at, _NANO)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def _tool(robot: RobotModel, q: np.ndarray, at: int) -> dict[str, Any]:
    pose = robot.pose(q)
    turn = Quaternion(pose.rotation).coeffs()
    return {
        "header": _header(at, robot.reference or robot.urdf.root),
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
    # What spoilt bytes lead to is as various as the fields that they are in.
    spoilt = (McapError, ZstdError, *_SPOILT)
    try:
        with file.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            found = [message for *_, message in reader.iter_decoded_messages([STATES])]
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from error
    except spoilt as error:
        raise FileFormatError(f"{file}: is no bag of ROS 2 messages: {error}") from error
    names = {tuple(state.name) for state in found}
    if len(names) != 1:
        told = "no" if not names else "several sets of"
        raise FileFormatError(f"{file}: has {told} joint names on {STATES}, expected one")
    stamps = [_NANO * s.header.stamp.sec + s.header.stamp.nanosec for s in found]
    t = np.array([at - stamps[0] for at in stamps]) / _NANO
    q, qd = (np.array([getattr(s, each) for s in found]) for each in ("position", "velocity"))
    try:
        return Trajectory(t, q, qd, names.pop())
    except (FileFormatError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: {error}") from error
