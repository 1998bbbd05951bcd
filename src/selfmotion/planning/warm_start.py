"""The null motion of a plan that is there, as one to begin another with."""

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError, ProblemError, shown
from selfmotion.motion import NullMotionTable, Trajectory
from selfmotion.problem import Problem
from selfmotion.result import Plan
from selfmotion.robot import RobotModel, null_space
from selfmotion.search import Manifold


def check_warm_start(plan: object, problem: Problem) -> None:
    """Raise ProblemError where a plan is none, or one of another arm."""
    if not isinstance(plan, Plan):
        raise ProblemError(f"warm_start is {shown(plan)}, expected a Plan; load_plan reads one")
    check_joints(plan.robot, problem.robot)


def check_joints(theirs: RobotModel, ours: RobotModel) -> None:
    """Raise ProblemError where what is known has another arm's joints."""
    if theirs.joint_names != ours.joint_names:
        raise ProblemError(
            f"warm_start: its joints are {', '.join(theirs.joint_names)}, expected those of "
            f"{ours.name}: {', '.join(ours.joint_names)}"
        )


def on_start(problem: Problem, seed: Array) -> Array:
    """Return the configuration (n,) near another one that is on the start of all paths.

    Raises
    ------
    InverseKinematicsError
        There is none.
    """
    follows, robot = problem.follows, problem.robot
    if not follows.is_plain:
        manifold = Manifold(follows, robot.lower, robot.upper)
        held = follows.held(np.zeros(1))
        q, arrived = manifold.project(seed[None], follows.targets(np.zeros(1)), far=True, held=held)
        if not arrived[0]:
            misses = np.array([item.miss(item.path.pose(0.0), q[0]) for item in follows.items])
            position, rotation = misses.max(axis=0)
            raise InverseKinematicsError(
                f"{robot.name}: from the configuration that is known none was found in which all "
                f"frames are where their paths begin",
                position_miss=float(position),
                rotation_miss=float(rotation),
            )
        return np.asarray(q[0])
    return problem.robot.inverse_kinematics(problem.path.pose(0.0), problem.task, seed)


def pace_of(plan: Plan, problem: Problem) -> float:
    """Return the duration of a plan's path over that of the problem's."""
    return plan.path.duration / problem.path.duration


def slower(trajectory: Trajectory, pace: float) -> Trajectory:
    """Return the same motion so many times as fast; `pace` is its duration over the new one."""
    qdd = None if trajectory.qdd is None else pace**2 * trajectory.qdd
    t, qd = trajectory.t / pace, pace * trajectory.qd
    return Trajectory(t, trajectory.q, qd, trajectory.joint_names, qdd)


def moved_to(trajectory: Trajectory, start: Array) -> Trajectory:
    """Return the same motion from another start (n,); where it is off the path, it is put there."""
    q = trajectory.q + (start - trajectory.q[0])
    return Trajectory(trajectory.t, q, trajectory.qd, trajectory.joint_names, trajectory.qdd)


def coefficients_of(
    trajectory: Trajectory, pace: float, problem: Problem, t: Array, table: NullMotionTable
) -> Array:
    """Return the coefficients x whose null motion is nearest to that of another motion, (size,).

    By least squares over the times. Of a null motion only Nᵀε acts, with N (n, r) a basis of the
    null space of the task: it is fitted to Nᵀq̇, with N and q̇ those of the other motion at the same
    share of its path.

    Parameters
    ----------
    trajectory : Trajectory
    pace : float
        The duration of its path over that of the problem's.
    problem : Problem
    t : (S,)
        Times on its path [s].
    table : NullMotionTable
        Its null motion at these times.
    """
    # A plan of a part of its path ends earlier.
    theirs = np.minimum(t * pace, trajectory.t[-1])
    q, qd = trajectory(theirs), pace * trajectory(theirs, 1)
    null = np.swapaxes(null_space(problem.follows.jacobians(q)), 1, 2)
    acting = null @ table.matrix()
    wanted = np.einsum("srn,sn->sr", null, qd)
    if not wanted.size:
        return np.zeros(table.size)
    return np.asarray(np.linalg.lstsq(acting.reshape(-1, table.size), wanted.ravel())[0])
