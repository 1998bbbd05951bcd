"""What a method is, and the plan made of the motion it finds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.baselines.integration import PoseFeedback, Rate, integrate
from selfmotion.basics import Array, ProblemError, read_only, shown
from selfmotion.certificate import Certificate, Tolerance
from selfmotion.costs import Samples
from selfmotion.motion import Grid, Trajectory
from selfmotion.optimise import Status
from selfmotion.problem import Problem, check_problem
from selfmotion.result import Plan, Report

# Samples of a motion to begin with; doubled until the quintics between them hold the tolerance.
_FEWEST_STEPS, _MOST_DOUBLINGS = 64, 6


@dataclass(frozen=True, eq=False)
class Motion:
    """What a method found.

    Attributes
    ----------
    at : callable
        t (K,) [s] → q, q̇ (K, n) each.
    message : str
        How it was found, for the report.
    evaluations : int
        Motions whose cost was computed on the way.
    jacobian_evaluations : int
        Jacobians computed on the way.
    status : Status
    """

    at: Callable[[Array], tuple[Array, Array]]
    message: str
    evaluations: int
    jacobian_evaluations: int
    status: Status = Status.CONVERGED


class Method(Protocol):
    """A way to resolve the redundancy of a problem other than by optimising coefficients."""

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
    still = pseudo_inverse(problem)
    trajectory, certificate = _sampled(problem, found, tolerance)
    grid = Grid(trajectory.t)
    terms, initial_terms = costs(problem, found, grid), costs(problem, still, grid)
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
    initial = _smooth(problem, still, grid)
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
    """Return what each cost of the problem contributes to F along a motion."""
    q, qd = motion.at(grid.stage_times)
    samples = Samples.along(problem.follows, grid.sampling, q, qd)
    return {cost.name: float(samples.weights @ cost.value(samples)) for cost in problem.costs}


def along_rate(problem: Problem, rate: Rate, message: str, *, evaluations: int = 1) -> Motion:
    """Return the motion that follows a velocity field q̇(t, q) from the problem's start."""
    run = integrate(problem, rate)
    return Motion(run.at, message, evaluations, run.rates)


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
    """Return the motion as quintics, at as many samples as the tolerance needs."""
    grid = Grid.aligned(problem.path.knots, _FEWEST_STEPS)
    before = np.inf
    for attempt in range(_MOST_DOUBLINGS + 1):
        trajectory = _smooth(problem, motion, grid)
        certificate = problem.certify(trajectory, tolerance)
        errors = certificate.position_error.value, certificate.rotation_error.value
        # An error that halving does not change is the motion's own, not that of its samples.
        if certificate.on_path or attempt == _MOST_DOUBLINGS or sum(errors) > 0.5 * before:
            break
        before = sum(errors)
        grid = grid.halved()
    return trajectory, certificate


def _smooth(problem: Problem, motion: Motion, grid: Grid) -> Trajectory:
    """Return the motion as quintics between the nodes of a grid."""
    q, qd = motion.at(grid.nodes)
    return Trajectory(grid.nodes, q, qd, problem.robot.joint_names, grid.derivative(qd))
