"""The same problem on an arm as it was measured, and how far that is from the drawn one."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.certificate import Extreme
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel, calibrated_robot, nominal_robot
from selfmotion.model.task import Task
from selfmotion.problem.problem.problem import Problem, check_problem

# Newton steps onto the path, each of which at least halves the error …
_STEPS = 50
# … and the error at which they end [m, rad].
_ON_PATH = 1e-10
# Times that are compared for each sample of a motion.
_PER_SAMPLE = 4


def calibrated(problem: Problem, calibration: str | Path | Mapping[str, str | Path]) -> Problem:
    """Return a problem on the same arm, its joints where a calibration puts them.

    A given start is moved onto the path: to the nearest configuration by least-norm steps Δq = J⁺
    e. So
    ``plan(calibrated(plan.problem, file), warm_start=plan)`` plans for the real arm, and
    ``calibrated(…).certify(plan.trajectory)`` judges the nominal plan on the real arm.

    Parameters
    ----------
    problem : Problem
    calibration : path, or dict of paths by part
        See `load_robot`.

    Raises
    ------
    RobotError
        The file cannot be read or does not fit the arm, or that is calibrated already.
    ProblemError
        No configuration near the start is on the path.
    """
    check_problem(problem)
    robot = calibrated_robot(problem.robot, calibration)
    start = problem.given_start
    if start is not None:
        follows = Follows.of(robot, problem.path, problem.task, problem.also)
        start = start_on_path(follows, start)
    return problem.changed(robot=robot, start="free" if start is None else start)


def start_on_path(follows: Follows, start: Array) -> Array:
    """Return the configuration near a start (n,) that is on the path, by steps Δq = J⁺ e.

    Raises
    ------
    ProblemError
        None is near.
    """
    q = np.array(start)
    for _ in range(_STEPS):
        error = np.concatenate([item.error(0.0, q) for item in follows.items])
        if np.abs(error).max() <= _ON_PATH:
            return q
        q = q + np.linalg.pinv(follows.jacobian(q)) @ error
    raise ProblemError(
        f"{follows.robot.name}: no configuration near the start {shown(start.tolist())} puts the "
        f"arm on the path: it is {np.abs(error).max():.2g} m or rad off; leave the start free"
    )


def off_nominal(robot: RobotModel, motion: Trajectory) -> tuple[Extreme, Extreme]:
    """Return the largest distance of a calibrated arm's tool from the nominal arm's.

    The largest distance [m] and angle [rad] on a motion, at its samples and between; both 0 for an
    arm that is not calibrated.

    Raises
    ------
    ProblemError
        The motion is none.
    """
    if not isinstance(robot, RobotModel) or not isinstance(motion, Trajectory):
        raise ProblemError(
            f"off_nominal: given are {shown(robot)} and {shown(motion)}, expected a RobotModel "
            f"and a Trajectory"
        )
    own = motion.of_joints(robot.joint_names)
    shares = np.arange(_PER_SAMPLE) / _PER_SAMPLE
    t = np.append((own.t[:-1, None] + np.diff(own.t)[:, None] * shares).ravel(), own.t[-1])
    q = own(t)
    drawn = nominal_robot(robot).chain
    errors = np.array([Task.POSE.miss(drawn.place(each), robot.chain.place(each)) for each in q])
    worst = np.argmax(errors, axis=0)
    position, rotation = (
        Extreme(float(errors[row, column]), float(t[row]), robot.tool)
        for column, row in enumerate(worst.tolist())
    )
    return position, rotation
