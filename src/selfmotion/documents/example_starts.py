"""Where the arm of an example begins: where it has room for the example's paths."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import SE3, Task

# Configurations that are drawn; so many of them, least singular first, are moved along the paths.
_DRAWN, _MOVED = 1000, 60
# Poses of each path, Newton steps to each, and what may be left of it [m, rad].
_POSES, _STEPS, _LEFT = 41, 4, 1e-6


def roomy_starts(arm: RobotModel, task: Task, paths: Sequence[Path], count: int) -> list[Array]:
    """Return configurations from which an arm follows paths, those farthest from singular first.

    Of samples in the middle half of the limits (fixed seed), those whose smallest singular value
    along the minimum-norm motion is the largest.

    Parameters
    ----------
    arm : RobotModel
    task : Task
    paths : sequence of Path
        From the identity: their positions are moved to where the tool is [m].
    count : int
        So many at most.
    """
    lower, upper = arm.finite_limits()
    share = np.random.default_rng(0).uniform(0.25, 0.75, (_DRAWN, arm.dof))
    drawn = lower + (upper - lower) * share
    least = np.array([_smallest(arm, task, q) for q in drawn])
    ways = [_positions(path) for path in paths]
    found = []
    for k in np.argsort(-least)[:_MOVED]:
        room = min(_room(arm, task, drawn[k], way) for way in ways)
        if room > 0.0:
            found.append((room, int(k)))
    return [drawn[k] for _, k in sorted(found, reverse=True)[:count]]


def _positions(path: Path) -> Array:
    samples = path.evaluate(np.linspace(0.0, path.duration, _POSES))
    return np.asarray(samples.translation - samples.translation[0])


def _smallest(arm: RobotModel, task: Task, q: Array) -> float:
    return float(np.linalg.svd(arm.task_jacobian(q, task), compute_uv=False)[-1])


def _room(arm: RobotModel, task: Task, q: Array, way: Array) -> float:
    """Return the smallest singular value along a way (K, 3), 0 where the arm leaves it."""
    begin, least = arm.pose(q), np.inf
    for offset in way:
        goal = SE3(begin.rotation, begin.translation + offset)
        for step in range(_STEPS + 1):
            jacobian, rotation, position = arm.chain.at(q)
            error = task.twist_error(goal, SE3(rotation, position))
            rows = task.select(jacobian, rotation)
            left = task.select(error[:, None], rotation)[:, 0]
            if step == _STEPS:
                if np.abs(left).max() > _LEFT:
                    return 0.0
                break
            q = q + np.linalg.pinv(rows) @ left
        if np.any(q < arm.lower) or np.any(q > arm.upper):
            return 0.0
        least = min(least, float(np.linalg.svd(rows, compute_uv=False)[-1]))
    return float(least)
