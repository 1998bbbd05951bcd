"""The same joint path in the time that velocity and acceleration limits allow."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import and_

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PlanError, ProblemError, per_joint, read_only, shown
from selfmotion.constraints import (
    Constraint,
    Envelope,
    JointAccelerationLimits,
    JointVelocityLimits,
)
from selfmotion.motion import Trajectory
from selfmotion.path import Pace, Retimed, times_along
from selfmotion.result.plan import Plan
from selfmotion.robot import RobotModel
from selfmotion.task import Relaxation

# Where the motion rests, its length goes on at this share of its largest speed.
_STILL = 0.05
# Times are this share longer than limits ask, for the last digits of a product.
_ROUNDING = 1e-9
# Grid points of toppra, and samples of the new motion, per sample of the old one: the first that
# keeps the plan's tolerance.
_DENSITIES = (4, 8, 16)
# Where nobody limits the jerk, moves reach their full acceleration in this time [s].
_SOFT = 0.02
# By how much slower a pace is tried, and how often.
_FACTOR, _SLOWER = 1.15, 16


def slowdown(plan: Plan, acceleration: npt.ArrayLike | None = None) -> float:
    """Return by what factor the plan's duration must grow to keep its limits (1: it does).

    At the same pace profile: velocities fall with the factor, accelerations with its square.

    Parameters
    ----------
    plan : Plan
    acceleration : (n,) or float, optional
        Acceleration limits [rad/s² or m/s²]; by default only velocities count.
    """
    _check_plan(plan)
    factor = max(1.0, plan.certificate.velocity_ratio.value)
    if acceleration is not None:
        what = f"{plan.robot.name}: acceleration limits"
        limit = per_joint(acceleration, plan.robot.dof, what, positive=True)
        share = np.abs(plan.trajectory.extremes(2)[1]) / limit
        factor = max(factor, float(np.sqrt(share.max())))
    return factor


def retime(plan: Plan, acceleration: npt.ArrayLike, velocity: npt.ArrayLike | None = None) -> Plan:
    """Return the plan's joint path in the shortest time within the limits, from rest to rest.

    Time-optimal path parametrisation by reachability analysis (H. Pham and Q.-C. Pham, IEEE
    Trans. Robotics 34(3), 2018), by the package toppra. The geometric path of joints and tool
    stays; the tool motion becomes a `Retimed` one, the certificate is made anew, the report stays.

    Parameters
    ----------
    plan : Plan
    acceleration : (n,) or float
        Limits [rad/s² or m/s²].
    velocity : (n,) or float, optional
        Limits [rad/s or m/s]; by default those that the plan was asked to keep, or the URDF's.

    Raises
    ------
    ProblemError
        toppra is not installed, or a limit is not positive.
    PlanError
        No pace keeps the limits.
    """
    _check_plan(plan)
    robot, asked = plan.robot, plan.problem.envelope
    velocity = asked.speed if velocity is None else velocity
    wanted = [
        JointVelocityLimits(_positive(robot, velocity, "velocity")),
        JointAccelerationLimits(_positive(robot, acceleration, "acceleration")),
    ]
    # The problem's own limits stay: the tighter of both is kept.
    kept = reduce(and_, (item.envelope(robot) for item in wanted), asked)
    for density in _DENSITIES:
        pace = _smoothed(_pace(plan.trajectory, kept, density), kept)
        pace = _slowed(pace, plan.trajectory, kept)
        result = _retimed(plan, wanted, pace)
        if result.certificate.on_path:
            break
    # Torques, and what else depends on the pace, are seen only now.
    for _ in range(_SLOWER):
        if not _is_too_fast(result):
            break
        pace = pace.slower(_FACTOR)
        result = _retimed(plan, wanted, pace)
    return result


def paced(motion: Trajectory, kept: Envelope) -> Trajectory:
    """Return a joint path in the shortest time within limits, from rest to rest, from t = 0 on.

    Parameters
    ----------
    motion : Trajectory
        The path over any time of its own.
    kept : Envelope
        Finite limits of speed and acceleration, and those of the jerk where there are any.

    Raises
    ------
    PlanError
        No pace keeps the limits.
    """
    # Controllers want accelerations without jumps from arms of any make.
    soft = np.where(np.isfinite(kept.jerk), kept.jerk, kept.acceleration / _SOFT)
    kept = replace(kept, jerk=read_only(soft))
    pace = _smoothed(_pace(motion, kept, _DENSITIES[0]), kept)
    return _along(_slowed(pace, motion, kept), motion)


def _check_plan(plan: Plan) -> None:
    if not isinstance(plan, Plan):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan")


def _positive(robot: RobotModel, limit: npt.ArrayLike, name: str) -> Array:
    what = f"{robot.name}: {name} limits for retiming"
    return per_joint(limit, robot.dof, what, positive=True)


def _is_too_fast(plan: Plan) -> bool:
    """Return whether a plan breaks nothing but what a slower pace may keep."""
    broken = [item for item in plan.certificate.findings if not item.kept]
    of_pace = bool(broken) and all(item.of_pace for item in broken)
    return of_pace and plan.certificate.on_path


def _retimed(plan: Plan, wanted: Sequence[Constraint], pace: Pace) -> Plan:
    trajectory = _along(pace, plan.trajectory)
    old = plan.problem
    # What asks for something of the end asks for it of the whole motion.
    asked = (item.on_part() if plan.report.ending else item for item in old.constraints)
    problem = replace(
        old,
        **old.along(lambda path: Retimed(path, pace.t, pace.sigma, pace.rate, pace.bend)),
        constraints=(*(item for item in asked if item is not None), *wanted),
        relaxations=[_moved(item, pace.t, pace.sigma) for item in old.relaxations],
    )
    retimed = replace(plan, problem=problem, trajectory=trajectory, initial_trajectory=trajectory)
    return replace(retimed, certificate=retimed.check())


def _moved(item: Relaxation, t: Array, sigma: Array) -> Relaxation:
    """Return a relaxation with its window at the new times t of σ."""
    if item.during is None:
        return item
    # Near enough: the deviation and two of its derivatives vanish at the ends of a window.
    first, last = (float(np.interp(time, sigma, t)) for time in item.during)
    return replace(item, during=(first, last))


def _along(pace: Pace, motion: Trajectory) -> Trajectory:
    """Return a motion at a pace."""
    at = pace.sigma + motion.t[0]
    q, qd, rate = motion(at), motion(at, 1), pace.rate[:, None]
    faster = None if pace.bend is None else motion(at, 2) * rate**2 + qd * pace.bend[:, None]
    return Trajectory(pace.t, q, qd * rate, motion.joint_names, faster)


def _pace(motion: Trajectory, kept: Envelope, density: int) -> Pace:
    """Return the fastest pace by limits of speed and acceleration at the grid points of toppra."""
    count = density * (len(motion.t) - 1)
    sigma = np.interp(np.arange(count + 1) / density, np.arange(len(motion.t)), motion.t)
    q, qd = motion(sigma), motion(sigma, order=1)
    # The pace is looked for over the length of the joint path: over σ, a motion that begins at
    # rest would bound nothing there. A share of the largest speed keeps it increasing.
    speed = np.linalg.norm(qd, axis=1)
    stretch = np.hypot(speed, _STILL * max(float(speed.max()), np.finfo(float).tiny))
    length = np.append(0.0, np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * np.diff(sigma)))
    rates = _toppra(length, q, kept.speed, kept.acceleration)
    t = times_along(length, rates)
    return Pace(t, sigma - sigma[0], rates / stretch)


def _smoothed(pace: Pace, kept: Envelope) -> Pace:
    """Return a pace so smooth that jerks keep their limits, where there are any.

    From one limit of the acceleration to the other within the window, the jerk keeps its limit.
    """
    limited = np.isfinite(kept.jerk) & np.isfinite(kept.acceleration)
    if not limited.any():
        return pace
    return pace.smoothed(float((2.0 * kept.acceleration[limited] / kept.jerk[limited]).max()))


def _slowed(pace: Pace, motion: Trajectory, kept: Envelope) -> Pace:
    """Return a pace so much slower that limits are kept between its samples as well."""
    trial = _along(pace, motion)
    factors = [1.0]
    for order, limit in ((1, kept.speed), (2, kept.acceleration), (3, kept.jerk)):
        if order < 3 or pace.bend is not None:
            share = float((np.abs(trial.extremes(order)[1]) / limit).max())
            factors.append(share ** (1.0 / order))
    return pace.slower(max(factors) * (1.0 + _ROUNDING))


def _toppra(length: Array, q: Array, velocity: Array, acceleration: Array) -> Array:
    """Return the largest rates at lengths (K,) of a joint path q (K, n), zero at both ends."""
    import logging

    try:
        import toppra
        from toppra import algorithm, constraint
    except ImportError:
        raise ProblemError(
            "retiming needs the package toppra: pip install 'selfmotion[retime]'"
        ) from None
    logging.getLogger("toppra").setLevel(logging.ERROR)
    # The length as one more joint: where the motion rests, nothing else bounds its pace.
    velocity = np.append(velocity, np.linalg.norm(velocity))
    acceleration = np.append(acceleration, np.linalg.norm(acceleration))
    solver = algorithm.TOPPRA(
        [
            constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
            constraint.JointAccelerationConstraint(np.stack([-acceleration, acceleration], axis=1)),
        ],
        toppra.SplineInterpolator(length, np.column_stack([q, length])),
        gridpoints=length,
    )
    _, rates, _ = solver.compute_parameterization(0.0, 0.0)
    if rates is None:
        raise PlanError("no pace keeps the velocity and acceleration limits along this joint path")
    return np.asarray(rates, dtype=np.float64)
