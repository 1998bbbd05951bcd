"""Messages of ROS 2 as tables: trajectory_msgs/JointTrajectory, moveit_msgs/RobotTrajectory.

Their definitions: https://github.com/ros2/common_interfaces (trajectory_msgs/msg) and
https://github.com/moveit/moveit_msgs (msg/RobotTrajectory.msg).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.formats.samples import MotionSamples
from selfmotion.motion import Trajectory

_NANO = 1_000_000_000


def joint_trajectory(motion: MotionSamples) -> dict[str, Any]:
    """Return a JointTrajectory; its stamp is 0, which means: at once."""
    points = []
    for t, q, qd, qdd in zip(motion.t, motion.q, motion.qd, motion.qdd, strict=True):
        sec, nanosec = divmod(round(float(t) * _NANO), _NANO)
        points.append(
            {
                "positions": q.tolist(),
                "velocities": qd.tolist(),
                "accelerations": qdd.tolist(),
                "effort": [],
                "time_from_start": {"sec": sec, "nanosec": nanosec},
            }
        )
    return {"header": _header(), "joint_names": list(motion.joint_names), "points": points}


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
    message = document.get("joint_trajectory", document)
    try:
        names, points = tuple(map(str, message["joint_names"])), list(message["points"])
    except (KeyError, TypeError):
        raise FileFormatError(
            f"{file}: has no joint_names and points, expected a JointTrajectory or RobotTrajectory"
        ) from None
    t, q, qd, qdd = [], [], [], []
    for k, point in enumerate(points):
        try:
            since = point["time_from_start"]
            t.append((int(since["sec"]) * _NANO + int(since["nanosec"])) / _NANO)
            q.append([float(value) for value in point["positions"]])
            qd.append([float(value) for value in point["velocities"]])
            qdd.append([float(value) for value in point.get("accelerations", [])])
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"{file}: points[{k}]: {error}; expected positions, velocities and "
                f"time_from_start with sec and nanosec"
            ) from error
        if not len(q[-1]) == len(qd[-1]) == len(names):
            raise FileFormatError(
                f"{file}: points[{k}]: {len(q[-1])} positions and {len(qd[-1])} velocities for "
                f"{len(names)} joints"
            )
    try:
        faster = np.array(qdd) if all(len(row) == len(names) for row in qdd) else None
        return Trajectory(np.array(t), np.array(q), np.array(qd), names, faster)
    except FileFormatError as error:
        raise FileFormatError(f"{file}: {error}") from error
