"""Joints that mimic others, in files of motions: they follow, and are no coordinates of an arm."""

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.motion import Trajectory
from selfmotion.robot import RobotModel

# How far a joint may be off what it mimics [rad or m]: rounding of a file, and what encoders see.
_OFF = 1e-4


def followers(robot: RobotModel) -> dict[str, str]:
    """Return the joints that move because they mimic one of an arm's joints, and which one."""
    names = list(robot.model.names)[1:]
    moved_by = (robot.joint_names[k] for k in robot.coupling.coordinates.tolist())
    pairs = zip(names, moved_by, strict=True)
    return {name: other for name, other in pairs if name not in robot.joint_names}


def without_followers(motion: Trajectory, robot: RobotModel) -> Trajectory:
    """Return a motion without the joints that mimic others, where a file has them as well.

    Raises
    ------
    FileFormatError
        One of them is not where what it mimics puts it.
    """
    following = followers(robot)
    own = motion.joint_names
    beside = [name for name in own if name in following]
    if not beside or any(name not in own for name in robot.joint_names):
        return motion
    wanted = robot.all_joints(motion.q[:, [own.index(name) for name in robot.joint_names]])
    for name in beside:
        away = np.abs(motion.q[:, own.index(name)] - wanted[name])
        worst = int(away.argmax())
        if not away[worst] <= _OFF:
            raise FileFormatError(
                f"trajectory: joint '{name}' is {away[worst]:.4g} off where joint "
                f"'{following[name]}', which it mimics, puts it at t = {motion.t[worst]:.4g} s; "
                f"leave it out, or mend <mimic> in the URDF"
            )
    kept = [k for k, name in enumerate(own) if name not in following]
    faster = None if motion.qdd is None else motion.qdd[:, kept]
    names = tuple(own[k] for k in kept)
    return Trajectory(motion.t, motion.q[:, kept], motion.qd[:, kept], names, faster)
