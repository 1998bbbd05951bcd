"""The fastest motion along a path: pace and null motion, each in its turn."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PlanError, ProblemError, Progress, per_joint, silent
from selfmotion.constraints import Constraint
from selfmotion.costs import LimitUse
from selfmotion.path import Path, Retimed
from selfmotion.planning.run import plan
from selfmotion.planning.settings import COARSE, DEGREE, POWER, ROUND_GAIN, ROUNDS
from selfmotion.problem import Problem, check_problem
from selfmotion.result import Plan, retime

# What brings a path to another pace.
Pace = Callable[[Path], Path]


@dataclass(frozen=True, eq=False)
class Fastest:
    """The fastest motion found, and what it began with.

    Attributes
    ----------
    plan : Plan
        The motion, from rest to rest.
    duration : float
        Its time [s].
    pseudo_inverse : float
        Time of the motion x = 0 at its fastest [s]; inf where that keeps other limits at no pace.
    times : tuple of float
        After each round [s].
    """

    plan: Plan
    pseudo_inverse: float
    times: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Time of the motion [s]."""
        return self.plan.path.duration


def fastest(
    problem: Problem,
    acceleration: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    *,
    progress: Progress = silent,
) -> Fastest:
    """Return the fastest motion along the problem's path, whatever its own pace and costs.

    In turn, the pace is the fastest for the joint path (`retime`), and the null motion minimises
    what is used of the limits at that pace (`LimitUse`); rounds go on while they gain, and the best
    motion is returned. It is never slower than the pseudo-inverse's motion at its own fastest pace
    is, where that can be driven at all.

    Parameters
    ----------
    problem : Problem
        Its constraints are kept, its costs are not used.
    acceleration : (n,) or float, optional
        Limits [rad/s² or m/s²]; by default those of the arm's maker.
    velocity : (n,) or float, optional
        Limits [rad/s or m/s]; by default those that the problem asks for, or the URDF's.
    progress : callable, optional
        Called with ``("fastest", round, rounds)``.

    Raises
    ------
    ProblemError
        No limits of acceleration are given or known.
    PlanError
        No motion that was found keeps all limits at any pace; says the last verdict.
    """
    check_problem(problem)
    v, a = _limits(problem, acceleration, velocity)
    geometric = tuple(item for item in problem.constraints if not item.of_pace)
    free = replace(problem, constraints=geometric, costs=(LimitUse(v, a, POWER),))
    best: Plan | None = None
    pace: Pace = _own
    times, verdict, still = [], "", np.inf
    for number in range(ROUNDS):
        progress("fastest", number, ROUNDS)
        planned = plan(replace(free, **free.along(pace)))
        if planned.report.ending or not planned.certificate.on_path:
            # At no pace can it be followed to its end.
            verdict = planned.certificate.verdict
            break
        found = _at_its_fastest(planned, problem, v, a)
        if number == 0:
            slow = replace(planned, trajectory=planned.initial_trajectory)
            other = _at_its_fastest(slow, problem, v, a)
            if other.certificate.verified:
                still, best = other.path.duration, other
        before = np.inf if best is None else best.path.duration
        if found.certificate.verified and found.path.duration < before:
            best = found
        verdict = found.certificate.verdict
        if best is not None:
            times.append(best.path.duration)
            if times[-1] > (1.0 - ROUND_GAIN) * before:
                break
        pace = _stand_in(problem.path, planned.path, found.path)
    if best is None:
        raise PlanError(f"no motion keeps all limits at any pace: {verdict}")
    return Fastest(best, still, tuple(times))


def _limits(
    problem: Problem, acceleration: npt.ArrayLike | None, velocity: npt.ArrayLike | None
) -> tuple[Array, Array]:
    robot, asked = problem.robot, problem.envelope
    v = asked.speed if velocity is None else velocity
    a = asked.acceleration if acceleration is None else acceleration
    v = per_joint(v, robot.dof, f"{robot.name}: velocity limits", positive=True)
    a = per_joint(a, robot.dof, f"{robot.name}: acceleration limits", positive=True)
    if not np.all(np.isfinite(a)):
        joint = robot.joint_names[int(np.argmax(~np.isfinite(a)))]
        raise ProblemError(
            f"{robot.name}: no limit of acceleration is known of joint '{joint}', without which "
            f"no pace is the fastest; give acceleration="
        )
    return np.minimum(v, asked.speed), np.minimum(a, asked.acceleration)


def _at_its_fastest(planned: Plan, problem: Problem, v: Array, a: Array) -> Plan:
    """Return a motion at the fastest pace that keeps all that the problem asks for."""
    constraints: tuple[Constraint, ...] = tuple(problem.constraints)
    whole = replace(planned, problem=replace(planned.problem, constraints=constraints))
    return retime(whole, a, v)


def _own(path: Path) -> Path:
    return path


def _stand_in(original: Path, current: Path, found: Path) -> Pace:
    """Return what brings a path to about the pace of `found`, which is a pace of `current`.

    As smooth as the path: its accelerations do not jump from limit to limit.
    """
    from scipy.interpolate import make_interp_spline

    if not isinstance(found, Retimed):
        raise TypeError(f"a retimed motion has a {type(found).__name__}")
    t = np.linspace(0.0, found.duration, COARSE + 1)
    sigma = np.clip(found.pace(t), 0.0, current.duration)
    if isinstance(current, Retimed) and current is not original:
        sigma = current.pace(sigma)
    sigma = np.maximum.accumulate(sigma)
    sigma[0], sigma[-1] = 0.0, original.duration
    still: Any = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(t, sigma, DEGREE, bc_type=(still, still))
    rate, bend = np.maximum(spline(t, 1), 0.0), spline(t, 2)
    return lambda path: Retimed(path, t, sigma, rate, bend)
