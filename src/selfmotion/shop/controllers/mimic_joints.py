"""Joints that mimic others, in files of motions: they follow, and are no coordinates of an arm."""

import numpy as np

from selfmotion.basics import FileFormatError
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel

# Largest deviation of a joint from the one that it mimics, by rounding and encoders [rad or m].
_MAX_DEVIATION = 1e-4


def mimic_joints(robot: RobotModel) -> dict[str, str]:
    """Return the joints that move because they mimic one of an arm's joints, and which one."""
    names = list(robot.model.names)[1:]
    moved_by = (robot.joint_names[k] for k in robot.coupling.coordinates.tolist())
    pairs = zip(names, moved_by, strict=True)
    return {name: other for name, other in pairs if name not in robot.joint_names}


def without_mimic_joints(motion: Trajectory, robot: RobotModel) -> Trajectory:
    """Return a motion without the joints that mimic others, where a file has them as well.

    Raises
    ------
    FileFormatError
        One of them is not where what it mimics puts it.
    """
    mimicked, names = mimic_joints(robot), motion.joint_names
    mimics = [name for name in names if name in mimicked]
    if not mimics or any(name not in names for name in robot.joint_names):
        return motion
    expected = robot.all_joints(motion.q[:, [names.index(name) for name in robot.joint_names]])
    for name in mimics:
        deviations = np.abs(motion.q[:, names.index(name)] - expected[name])
        worst = int(deviations.argmax())
        if not deviations[worst] <= _MAX_DEVIATION:
            raise FileFormatError(
                f"trajectory: joint '{name}' is {deviations[worst]:.4g} off where joint "
                f"'{mimicked[name]}', which it mimics, puts it at t = {motion.t[worst]:.4g} s; "
                f"leave it out, or mend <mimic> in the URDF"
            )
    columns = [k for k, name in enumerate(names) if name not in mimicked]
    qdd = None if motion.qdd is None else motion.qdd[:, columns]
    kept = tuple(names[k] for k in columns)
    return Trajectory(motion.t, motion.q[:, columns], motion.qd[:, columns], kept, qdd)
