"""A joint motion from one configuration to another, or to a pose of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from warnings import warn

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    FormerUseWarning,
    ProblemError,
    Progress,
    as_number,
    as_several,
    held_interruption,
    obeying,
    one_blas_thread,
    random_numbers,
    shown,
    silent,
)
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Task
from selfmotion.planning.result import Move
from selfmotion.planning.transfer.free_motion import MOVE_SECONDS, FreeMotions, is_pose
from selfmotion.problem.constraints import (
    MOVED_CLEARANCE,
    NO_OVERLAP,
    Clearance,
    Constraint,
    separate_clearances,
)
from selfmotion.problem.problem import KEPT, check_all_times


def move(
    robot: RobotModel,
    first: npt.ArrayLike | SE3,
    last: npt.ArrayLike | SE3,
    *,
    constraints: Sequence[Constraint] = KEPT,
    clearance: Clearance | Sequence[Clearance] | None = NO_OVERLAP,
    via: Sequence[npt.ArrayLike] = (),
    task: Task | str = "pose",
    seconds: float = MOVE_SECONDS,
    rng: np.random.Generator | int = 0,
    progress: Progress = silent,
) -> Move:
    """Move between configurations, from rest to rest, around obstacles.

    Straight if that is free; else along the best of several paths of two trees (RRT-Connect),
    shortened, with corners rounded as far as there is room. The pace is as fast as the limits of
    joint velocity, acceleration and jerk allow. The motion is judged like a plan, at all times.

    Parameters
    ----------
    robot : RobotModel
    first, last : (n,) or SE3
        Configurations [rad or m], or a pose of the tool (an SE3 or a 4 × 4 matrix, in the frame of
        `RobotModel.pose`): then any configuration that puts the tool there.
    constraints : sequence of Constraint
        Conditions on the motion. By default limits of joint position and velocity, and those of
        acceleration and jerk that the arm's maker publishes.
    clearance : Clearance or sequence of Clearance, optional
        Distance of the arm from obstacles and from itself: by default its links must not overlap.
        None to leave that out; the verdict then says so.
    via : sequence of (n,)
        Configurations that the motion passes exactly, in this order, without stopping where there
        is room for a curve.
    task : Task or str
        The rows of the pose that count where an end is one.
    seconds : float
        Processor time after which the search fails [s]: the result is independent of other
        processes.
    rng : Generator or int
        Shifts the samples; the same one gives the same move, unless the search fails before.
    progress : callable, optional
        Called with the stage, as in `plan`.

    Returns
    -------
    Move
        Also without a motion: `Move.trouble` has the time of the search, and `Move.require` raises.
        A failure does not prove that there is none.

    Raises
    ------
    InverseKinematicsError
        No configuration puts the tool at a pose.
    ProblemError
        An argument is invalid.
    """
    if not isinstance(robot, RobotModel):
        raise ProblemError(f"robot is {shown(robot)}, expected a RobotModel")
    listed = as_several(constraints, "constraints", Constraint)
    check_all_times(listed, "the ends of a move are first and last; leave it out")
    others, apart = separate_clearances(listed, clearance)
    if len(others) < len(listed):
        warn(MOVED_CLEARANCE.format("move"), FormerUseWarning, stacklevel=2)
    conditions = [item for item in (*others, *apart) if item.applies(robot)]
    if not isinstance(via, list | tuple | np.ndarray):
        raise ProblemError(f"via is {shown(via)}, expected a list of configurations")
    given = (first, *via, last)
    if Task.of(task) is not Task.POSE and not any(is_pose(end) for end in given):
        raise ProblemError(
            f"task is '{Task.of(task).value}', which counts where an end is a pose: all ends are "
            f"configurations"
        )
    seconds, generator = as_number(seconds, "seconds", above=0.0), random_numbers(rng)
    motions = FreeMotions(robot, conditions, generator, obeying(progress))
    with one_blas_thread(), held_interruption():
        ends = [motions.configurations(end, Task.of(task)) for end in given]
        return motions.through(ends, seconds)
