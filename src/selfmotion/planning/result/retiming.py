"""Time scaling: the same joint path in the time that velocity and acceleration limits allow."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from operator import and_

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    Ints,
    PlanError,
    ProblemError,
    as_number,
    held_interruption,
    one_blas_thread,
    per_joint,
    read_only,
    shown,
)
from selfmotion.model.motion import MAX_SAMPLES, Grid, Trajectory, slowdown_of
from selfmotion.model.path import REST_SPEED, Pace, Path, Retimed, edges_of
from selfmotion.planning.result.measured import quantities_of_pace
from selfmotion.planning.result.pace_rows import PaceLimits
from selfmotion.planning.result.pacing import Ends, along, fastest_pace
from selfmotion.planning.result.plan import Plan
from selfmotion.problem.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointVelocityLimits,
)
from selfmotion.problem.problem import Problem, along_other_paths, envelope_of_problem

# Times between two samples of the new motion [s]: the first one within the plan's tolerance.
_STEPS = (4e-3, 2e-3, 1e-3)
# Samples of a path in which waiting of the tool is noticed …
_SAMPLES = 2000
# … from this time on [s].
_BRIEF = 0.05
# A motion that exceeds limits by less than this is slowed as a whole …
_BY_A_LITTLE = 1.002
# … by slightly more than that.
_BEYOND = 1.0 + 1e-6
# Rounding of the number of sample periods [periods].
_WHOLE = 1e-6
# Slowing for samples at a rate, in steps of this share of the excess of limits …
_PART = 0.1
# … at most this number of times for all other requirements.
_SLOWER = 12
# Number of jumps of accelerations from which on a remark is made.
_OFTEN = 12


def slowdown(plan: Plan, acceleration: npt.ArrayLike | None = None) -> float:
    """Return the factor by which the plan's duration must grow to be within its limits (1: it is).

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


def retime(
    plan: Plan,
    acceleration: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    rate: float | None = None,
) -> Plan:
    """Return the plan's joint path in the shortest time within the limits, from rest to rest.

    Velocity, acceleration, jerk and torque limits, those of the tool, and all other conditions of
    the plan apply, by linear programmes in the square of the pace (`result.pacing`). Given rates at
    the ends are kept. The geometric path of joints and tool is the same; the tool motion becomes a
    `Retimed` one, and the certificate is computed anew. Costs are evaluated again; times of active
    constraints in the report are transformed, and remarks made: of frequent jumps of acceleration
    without limits of the jerk, and of waiting of the tool (`Dwell`), which is as short as limits
    allow.

    Parameters
    ----------
    plan : Plan
    acceleration : (n,) or float, optional
        Limits [rad/s² or m/s²]; by default those of the plan, or the maker's.
    velocity : (n,) or float, optional
        Limits [rad/s or m/s]; by default those of the plan, or the URDF's.
    rate : float, optional
        Samples per second of the new motion, for a controller; by default as many as the pace
        needs. Accelerations that jump between two of these overshoot in the quintics through them:
        the motion is as much slower as a whole as limits ask for.

    Raises
    ------
    ProblemError
        A limit is not positive, no limits of acceleration are given or known, the rate gives no
        samples, or the path has a feed.
    PlanError
        No pace keeps the limits, or the arm does not move at all.
    """
    _check_plan(plan)
    _check_moves(plan)
    check_no_feed(plan.problem)
    v, a = rate_limits(plan.problem, acceleration, velocity)
    wanted = [JointVelocityLimits(v), JointAccelerationLimits(a)]
    # The problem's own limits apply as well: the tighter of both.
    robot = plan.robot
    kept = reduce(
        and_,
        (item.envelope(robot) for item in wanted),
        envelope_of_problem(plan.problem),
    )
    quantities = quantities_of_pace(plan.requirements)
    limits = PaceLimits(kept.speed, kept.acceleration, kept.jerk, quantities)
    for step in _STEPS:
        with one_blas_thread(), held_interruption():
            pace = fastest_pace(plan.trajectory, limits, _ends(plan), step)
        result = _retimed(plan, wanted, pace)
        factor = max((item.factor for item in result.certificate.findings), default=1.0)
        if 1.0 < factor < _BY_A_LITTLE:
            # Samples miss a per mille of peaks between them.
            result = _retimed(plan, wanted, pace.slower(factor * _BEYOND))
        if result.certificate.on_path:
            break
    result = _with_remarks(result, plan.path, kept.acceleration, kept.jerk)
    return result if rate is None else at_rate(result, rate)


def is_retimed(plan: Plan) -> bool:
    """Whether a plan's pace is that of `retime`: as fast as limits allow, not a given one."""
    pace = plan.path.pace if isinstance(plan.path, Retimed) else None
    return pace is not None and np.array_equal(pace.t, plan.trajectory.t)


def at_rate(plan: Plan, rate: float) -> Plan:
    """Return a retimed plan by samples at a rate, as much slower as they need to keep its limits.

    It takes a whole number of periods. If no slower motion is verified either, the result is not:
    its certificate has the cause.

    Raises
    ------
    ProblemError
        The rate gives no samples.
    """
    duration = plan.trajectory.duration
    rate = as_number(rate, "rate", above=0.0)
    if not 1.0 <= rate * duration <= MAX_SAMPLES:
        raise ProblemError(
            f"rate is {rate:g} Hz, expected from {1.0 / duration:.4g} to "
            f"{MAX_SAMPLES / duration:.4g}, so that the motion of {duration:.6g} s has samples, "
            f"not too many"
        )
    envelope = envelope_of_problem(plan.problem)
    limits = envelope.speed, envelope.acceleration, envelope.jerk
    periods = int(np.ceil(duration * rate - _WHOLE))
    for _ in range(_SLOWER):
        factor = np.inf
        while factor > 1.0:
            pace = _even(plan.trajectory, periods, rate)
            factor = slowdown_of(along(pace, plan.trajectory), limits)
            # How much is too much differs with where samples lie.
            periods += int(np.ceil(_PART * (factor - 1.0) * periods)) if factor > 1.0 else 0
        found = _retimed(plan, (), pace)
        factor = max((item.factor for item in found.certificate.findings), default=1.0)
        if factor == 1.0 or not np.isfinite(factor):
            break
        periods = max(periods + 1, int(np.ceil(factor * periods)))
    return found


def _even(motion: Trajectory, periods: int, rate: float) -> Pace:
    """Return the pace of a motion that takes `periods` of a rate, slower as a whole."""
    t = np.arange(periods + 1) / rate
    share = np.full(len(t), motion.duration / t[-1])
    sigma = np.linspace(0.0, motion.duration, len(t))
    return Pace(t, sigma, share, np.zeros(len(t)))


def _with_remarks(plan: Plan, original: Path, acceleration: Array, jerk: Array) -> Plan:
    """Return a plan whose report says so where accelerations jump to and fro, or waits are lost."""
    remarks = [plan.report.message]
    waited = _waited(original)
    if waited > _BRIEF:
        remarks.append(
            f"the {waited:.3g} s that the tool waits on its way take no longer than limits ask; "
            f"where it has to wait, retime the parts, as seams of a job (wait=)"
        )
    swings = _swings(plan.trajectory, acceleration)[~np.isfinite(jerk)].sum()
    if swings >= _OFTEN:
        remarks.append(
            f"without a limit of jerk, accelerations change {swings} times from one side to the "
            f"other at once; where that shakes the arm, ask for JointJerkLimits(…)"
        )
    return replace(plan, report=replace(plan.report, message="; ".join(remarks)))


def _waited(path: Path) -> float:
    """Return the approximate time that the tool rests on a path [s]."""
    looks = Grid.aligned(edges_of(path.marks), _SAMPLES).nodes
    middles = 0.5 * (looks[:-1] + looks[1:])
    rests = np.abs(path.samples(middles).twist).max(axis=1) <= REST_SPEED
    return float(np.diff(looks)[rests].sum())


def _swings(motion: Trajectory, limit: Array) -> Ints:
    """Return the number of jumps of each joint's acceleration from half its limit to minus that.

    As seen at the samples.
    """
    sides = np.sign(motion(motion.t, 2)) * (np.abs(motion(motion.t, 2)) >= 0.5 * limit)
    each = (side[side != 0.0] for side in sides.T)
    return np.array([np.count_nonzero(np.diff(side)) for side in each])


def _ends(plan: Plan) -> Ends:
    """Return the ends at which the problem gives the arm's rates: they are kept."""
    said = [item.ends.velocity for item in plan.problem.constraints]
    return Ends(any(start for start, _ in said), any(end for _, end in said))


def _check_plan(plan: Plan) -> None:
    if not isinstance(plan, Plan):
        raise ProblemError(f"plan is {shown(plan)}, expected a Plan")


def check_no_feed(problem: Problem) -> None:
    """Raise ProblemError if the path has a feed: no other pace keeps it."""
    feeds = [feed for item in problem.follows.items for feed in item.path.feeds]
    if feeds:
        raise ProblemError(
            f"{problem.robot.name}: the path asks for a feed of {feeds[0].asked:g} m/s, which a "
            f"faster pace does not keep; make strokes that keep a feed seams of a job, whose moves "
            f"take the least time, or plan without it (Feed.original)"
        )


def _check_moves(plan: Plan) -> None:
    if np.abs(plan.trajectory.extremes(1)[1]).max() <= REST_SPEED:
        raise PlanError(
            f"{plan.robot.name}: the arm rests all the time, which nothing makes faster"
        )


def rate_limits(
    problem: Problem, acceleration: npt.ArrayLike | None, velocity: npt.ArrayLike | None
) -> tuple[Array, Array]:
    """Return the limits of velocity and acceleration of a fastest motion, (n,) each.

    The given ones, or else those of the problem.

    Raises
    ------
    ProblemError
        One is not positive, or no joint's acceleration is limited.
    """
    robot, limits = problem.robot, envelope_of_problem(problem)
    v = limits.speed if velocity is None else velocity
    a = limits.acceleration if acceleration is None else acceleration
    v = per_joint(v, robot.dof, f"{robot.name}: velocity limits", positive=True)
    a = per_joint(a, robot.dof, f"{robot.name}: acceleration limits", positive=True)
    if not np.all(np.isfinite(a)):
        joint = robot.joint_names[int(np.argmax(~np.isfinite(a)))]
        raise ProblemError(
            f"{robot.name}: no limit of acceleration is known of joint '{joint}', without which "
            f"no pace is the fastest; give acceleration="
        )
    return read_only(np.minimum(v, limits.speed)), read_only(np.minimum(a, limits.acceleration))


def _retimed(plan: Plan, wanted: Sequence[Constraint], pace: Pace) -> Plan:
    trajectory = along(pace, plan.trajectory)
    old = plan.problem
    when = Retimed(old.path, pace.t, pace.sigma, pace.rate, pace.bend).when
    active = tuple(
        replace(item, spans=tuple((float(a), float(b)) for a, b in map(when, np.array(item.spans))))
        for item in plan.report.active
    )

    def passed(times: Array) -> Array:
        # Ends exactly: a ramp hardly moves there.
        inner = when(np.clip(times, 0.0, pace.sigma[-1]))
        late = np.where(times >= pace.sigma[-1], pace.t[-1], inner)
        return np.where(times <= 0.0, 0.0, late)

    # A plan of a part has no conditions on the end.
    kept = [item for item in old.constraints if not (plan.report.ending and item.ends.is_about(1))]
    problem = replace(
        old,
        **along_other_paths(
            old,
            lambda path: Retimed(path, pace.t, pace.sigma, pace.rate, pace.bend),
            passed,
        ),
        constraints=(*kept, *wanted),
    )
    # Of the tool's motion at any pace the same joint path is of minimum norm.
    is_whole = plan.initial_trajectory.duration == plan.trajectory.duration
    initial = along(pace, plan.initial_trajectory) if is_whole else trajectory
    retimed = replace(plan, problem=problem, trajectory=trajectory, initial_trajectory=initial)
    report = retimed.report.with_found(plan.report, active)
    return replace(retimed, report=report, certificate=retimed.check())
