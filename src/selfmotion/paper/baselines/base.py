"""Base of methods: velocity fields, integrated, and plans of their motions."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from selfmotion.basics import Array, BreakdownError, ProblemError, read_only, shown
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.model.task import feedback_rate
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan, Report
from selfmotion.problem.costs import Samples
from selfmotion.problem.problem import Problem, check_problem

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

Rate = Callable[[float, Array], Array]

# Tolerance of the integrator: far below a certificate's.
_TOLERANCE = 1e-9

# Joint speeds, in path durations per radian, at which a motion counts as broken down.
_RUNAWAY = 1e6


@dataclass(frozen=True, eq=False)
class Here:
    """The kinematics at a time and configuration.

    Attributes
    ----------
    jacobian : (m, n)
        Task Jacobian J.
    gram : (m, m)
        JJᵀ.
    command : (m,)
        ẋ + K e in the task's rows, with pose error e.
    rotation : (3, 3)
        The tool's orientation.
    twist : (6,)
        The path's twist.
    """

    jacobian: Array
    gram: Array
    command: Array
    rotation: Array
    twist: Array


class PoseFeedback:
    """t, q → `Here`: velocity of the tool for the path, with feedback of the pose error."""

    def __init__(self, problem: Problem) -> None:
        self._robot, self._path, self._task = problem.robot, problem.path, problem.task
        self._gain = feedback_rate(problem.path.duration)

    def __call__(self, t: float, q: Array) -> Here:
        """Return the kinematics at time `t` [s] and configuration `q` (n,)."""
        task = self._task
        full, rotation, translation = self._robot.chain.at(q)
        target = self._path.samples(t)
        angular = np.zeros(3)
        if np.any(task.rows >= 3):
            from selfmotion.model.task import SE3

            pose = SE3(target.rotation[0], target.translation[0])
            angular = task.twist_error(pose, SE3(rotation, translation))[3:]
        error = np.concatenate([target.translation[0] - translation, angular])
        wanted = target.twist[0] + self._gain * error
        jacobian = task.select(full, rotation)
        command = task.select(wanted[:, None], rotation)[:, 0]
        return Here(jacobian, jacobian @ jacobian.T, command, rotation, target.twist[0])


@dataclass(frozen=True, eq=False)
class Integrated:
    """An integrated motion.

    Attributes
    ----------
    at : callable
        t (K,) → q, q̇ (K, n) each.
    rates : int
        Evaluations of the velocity field.
    """

    at: Callable[[Array], tuple[Array, Array]]
    rates: int


def start_of(problem: Problem) -> Array:
    """Return q(0) (n,): the given one, or an inverse-kinematics solution where the start is free.

    Raises
    ------
    InverseKinematicsError
        The start is free and no configuration reaches the start of the path.
    """
    if problem.given_start is not None:
        return problem.given_start
    return problem.robot.inverse_kinematics(problem.path.pose(0.0), problem.task)


def integrate(problem: Problem, rate: Rate) -> Integrated:
    """Integrate q̇ = rate(t, q) from the problem's start by DOP853, piece by piece of the path.

    Raises
    ------
    BreakdownError
        The velocity grows without bound: the field is singular there.
    """
    # Here, because importing it takes as long as the rest of the package.
    from scipy.integrate import solve_ivp

    intervals: list[tuple[float, OdeSolution]] = []
    rates = 0
    q = start_of(problem)
    guarded = _guarded(problem, rate)
    for start, end in pairwise(problem.path.knots):
        solution = solve_ivp(
            guarded,
            (float(start), float(end)),
            q,
            method="DOP853",
            rtol=_TOLERANCE,
            atol=_TOLERANCE,
            dense_output=True,
        )
        if not solution.success:
            raise BreakdownError(
                f"{problem.robot.name}: the motion cannot be integrated beyond "
                f"t = {solution.t[-1]:.4g} s: {solution.message}",
                time=float(solution.t[-1]),
            )
        rates += solution.nfev
        intervals.append((float(end), cast("OdeSolution", solution.sol)))
        q = solution.y[:, -1]
    ends = np.array([end for end, _ in intervals])

    def at(t: Array) -> tuple[Array, Array]:
        which = np.minimum(np.searchsorted(ends, t), len(ends) - 1)
        configurations = np.empty((len(t), len(q)))
        for k, (_, interval) in enumerate(intervals):
            configurations[which == k] = interval(t[which == k]).T
        rows = zip(t, configurations, strict=True)
        return configurations, np.array([rate(float(time), row) for time, row in rows])

    return Integrated(at, rates)


def _guarded(problem: Problem, rate: Rate) -> Rate:
    """Return a rate that breaks down where it grows without bound."""
    fastest = _RUNAWAY / problem.path.duration

    def guarded(t: float, configuration: Array) -> Array:
        velocity = rate(t, configuration)
        if not np.all(np.abs(velocity) < fastest):
            raise BreakdownError(
                f"{problem.robot.name}: joint speeds grow without bound near t = {t:.4g} s; the "
                f"method is singular there",
                time=t,
            )
        return velocity

    return guarded


# Samples of a motion at the start …
_MIN_STEPS = 64
# … and doublings until the quintics between them are within the tolerance.
_MAX_DOUBLINGS = 6


@dataclass(frozen=True, eq=False)
class Motion:
    """Result of a method.

    Attributes
    ----------
    at : callable
        t (K,) [s] → q, q̇ (K, n) each.
    message : str
        How it was found, for the report.
    evaluations : int
        Number of motions whose cost was computed.
    jacobian_evaluations : int
        Number of Jacobians.
    status : Status
    """

    at: Callable[[Array], tuple[Array, Array]]
    message: str
    evaluations: int
    jacobian_evaluations: int
    status: Status = Status.CONVERGED


class Method(Protocol):
    """A method of redundancy resolution other than by optimised coefficients."""

    def solve(self, problem: Problem) -> Motion:
        """Return a joint motion along the problem's path.

        From the start configuration; from an inverse-kinematics solution where that is free. The
        problem's constraints are not seen: the certificate says which of them the motion breaks.
        """


def plan_by(problem: Problem, method: Method, tolerance: Tolerance | None = None) -> Plan:
    """Wrap the motion of `method` with its costs, and certify it like any plan.

    Parameters
    ----------
    problem : Problem
        Its null motion is not used.
    method : Method
    tolerance : Tolerance, optional

    Raises
    ------
    ProblemError
        The problem is damped, or relaxes rows: these are for the optimised motion.

    Returns
    -------
    Plan
        Without coefficients. `initial_trajectory` and `initial_cost` are those of the
        pseudo-inverse, as for every plan.
    """
    tolerance = Tolerance.of(tolerance)
    _check(problem, method)
    began = time.perf_counter()
    found = method.solve(problem)
    seconds = time.perf_counter() - began
    minimum_norm = pseudo_inverse(problem)
    trajectory, certificate = _sampled(problem, found, tolerance)
    grid = Grid(trajectory.t)
    terms, initial_terms = costs(problem, found, grid), costs(problem, minimum_norm, grid)
    report = Report(
        cost=sum(terms.values()),
        initial_cost=sum(initial_terms.values()),
        terms=terms,
        initial_terms=initial_terms,
        evaluations=found.evaluations,
        gradient_evaluations=0,
        jacobian_evaluations=found.jacobian_evaluations,
        steps=grid.steps,
        iterations=0,
        history=(),
        status=found.status,
        message=found.message,
        seconds=seconds,
    )
    initial = _smooth(problem, minimum_norm, grid)
    return Plan(problem, trajectory, initial, read_only([]), report, certificate)


def _check(problem: Problem, method: Method) -> None:
    check_problem(problem)
    if isinstance(method, type) or not callable(getattr(method, "solve", None)):
        raise ProblemError(f"method is {shown(method)}, expected one such as PseudoInverse()")
    if problem.damping is not None:
        raise ProblemError(
            "the problem's damping is for the optimised motion; leave it out, or take "
            "plan_by(problem, DampedLeastSquares(…))"
        )
    if problem.also:
        raise ProblemError(
            f"other works' methods follow one path, but {len(problem.follows.items)} are asked "
            f"for; call plan"
        )
    if problem.relaxations:
        raise ProblemError(
            "other works' methods follow the path exactly; leave the relaxations out"
        )


def costs(problem: Problem, motion: Motion, grid: Grid) -> dict[str, float]:
    """Return the contribution of each cost of the problem to F along a motion."""
    q, qd = motion.at(grid.stage_times)
    samples = Samples.along(problem.follows, grid.sampling, q, qd)
    return {cost.name: float(samples.weights @ cost.value(samples)) for cost in problem.costs}


def along_rate(problem: Problem, rate: Rate, message: str) -> Motion:
    """Return the motion that follows a velocity field q̇(t, q) from the problem's start."""
    run = integrate(problem, rate)
    return Motion(run.at, message, 1, run.rates)


def pseudo_inverse(problem: Problem) -> Motion:
    """Return the motion q̇ = J⁺ẋ: eq. 4 with ε = 0."""
    feedback = PoseFeedback(problem)

    def rate(t: float, q: Array) -> Array:
        here = feedback(t, q)
        return np.asarray(here.jacobian.T @ np.linalg.solve(here.gram, here.command))

    return along_rate(problem, rate, "followed q̇ = J⁺ẋ; nothing was optimised")


def _sampled(
    problem: Problem, motion: Motion, tolerance: Tolerance
) -> tuple[Trajectory, Certificate]:
    """Return the motion as quintics, with as many samples as the tolerance needs."""
    grid = Grid.aligned(problem.path.knots, _MIN_STEPS)
    before = np.inf
    for attempt in range(_MAX_DOUBLINGS + 1):
        trajectory = _smooth(problem, motion, grid)
        certificate = problem.certify(trajectory, tolerance)
        errors = certificate.position_error.value, certificate.rotation_error.value
        # An error that halving does not change is the motion's own, not that of its samples.
        if certificate.on_path or attempt == _MAX_DOUBLINGS or sum(errors) > 0.5 * before:
            break
        before = sum(errors)
        grid = grid.halved()
    return trajectory, certificate


def _smooth(problem: Problem, motion: Motion, grid: Grid) -> Trajectory:
    """Return the motion as quintics between the nodes of a grid."""
    q, qd = motion.at(grid.nodes)
    return Trajectory(grid.nodes, q, qd, problem.robot.joint_names, grid.derivative(qd))
