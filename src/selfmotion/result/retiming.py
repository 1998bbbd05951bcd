"""The same joint path in the time that velocity and acceleration limits allow."""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import and_

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, per_joint, shown
from selfmotion.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointVelocityLimits,
)
from selfmotion.path import Pace, Retimed
from selfmotion.result.plan import Plan
from selfmotion.result.toppra_pace import along, slowed, smoothed, toppra_pace
from selfmotion.robot import RobotModel
from selfmotion.task import Relaxation

# Grid points of toppra, and samples of the new motion, per sample of the old one: the first that
# keeps the plan's tolerance.
_DENSITIES = (4, 8, 16)
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
        pace = smoothed(toppra_pace(plan.trajectory, kept, density), kept)
        pace = slowed(pace, plan.trajectory, kept)
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
    trajectory = along(pace, plan.trajectory)
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
