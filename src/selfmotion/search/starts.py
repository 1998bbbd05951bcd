"""Start configurations worth trying."""

from collections.abc import Iterator

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import Task

# Solutions nearer than this [rad or m, Euclidean] lead to the same plan once the start may move.
_SAME = 0.3


def start_candidates(
    robot: RobotModel, path: Path, task: Task, count: int, rng: np.random.Generator
) -> list[Array]:
    """Return distinct configurations that put the tool on the start of the path.

    Inverse kinematics from a low-discrepancy sequence over the joint limits; solutions near an
    earlier one are dropped.

    Parameters
    ----------
    robot, path, task
    count : int
        Seeds to try.
    rng : Generator
        Shifts the sequence.

    Returns
    -------
    list of (n,)
        Never empty.

    Raises
    ------
    InverseKinematicsError
        No seed led to the pose.
    """
    pose = path.pose(0.0)
    found: list[Array] = []
    for seed in spread(robot, count, rng):
        try:
            q = robot.inverse_kinematics(pose, task, seed=seed, attempts=1)
        except InverseKinematicsError:
            continue
        if all(np.linalg.norm(q - other) > _SAME for other in found):
            found.append(q)
    if not found:
        # Many more attempts, and an error that names the miss.
        found = [robot.inverse_kinematics(pose, task, rng=rng)]
    return found


def spread(robot: RobotModel, count: int, rng: np.random.Generator) -> Iterator[Array]:
    """Yield configurations that fill the limits evenly.

    The additive recurrence with the generalised golden ratio: fractions of k g^-1 … k g^-n, where
    g > 1 solves g^(n+1) = g + 1 (M. Roberts, "The unreasonable effectiveness of quasirandom
    sequences", 2018).
    """
    lower, upper = robot.finite_limits()
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (robot.dof + 1.0))
    steps = ratio ** -np.arange(1.0, robot.dof + 1.0)
    shift = rng.uniform(size=robot.dof)
    for k in range(count):
        yield lower + (upper - lower) * ((shift + (k + 1) * steps) % 1.0)
