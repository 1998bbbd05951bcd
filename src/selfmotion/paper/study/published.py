"""The method exactly as published: section 2 of the paper, with its crude and costly steps."""

import numpy as np
from scipy.integrate import solve_ivp

from selfmotion.basics import Array
from selfmotion.model.motion import NullMotionTable, PolynomialNullMotion, Sampling
from selfmotion.paper.baselines import start_of
from selfmotion.planning.optimise import LineSearch, QuasiNewton
from selfmotion.problem.costs import Samples
from selfmotion.problem.problem import Problem

# Relative tolerance of MATLAB's ode23 where none is given; its absolute one is a thousandth.
ODE23_TOLERANCE = 1e-3

# δ_G "was determined more or less empirically" and is not given; the report sweeps it.
DIFFERENCE = 1e-4


class PublishedFunction:
    """F by the four steps of section 2.1, ∇F by eq. 13, slopes by eq. 14.

    1. integrate eq. 4 by an adaptive 2(3) Runge-Kutta pair with its own steps; 2. evaluate eq. 4
    again at its points for q̇; 3. evaluate the integrand there; 4. integrate it by straight lines
    between them. Nothing keeps the tool on the path but the integrator's tolerance.

    Parameters
    ----------
    problem : Problem
        Its costs and null motion are used; the null motion must be in joint space.
    rtol : float
        Relative tolerance of the integrator.
    delta : float
        δ_G of eq. 13 and 14.

    Attributes
    ----------
    evaluations, jacobian_evaluations : int
        How often F and the Jacobian were computed, those of differences included.
    """

    def __init__(
        self, problem: Problem, *, rtol: float = ODE23_TOLERANCE, delta: float = DIFFERENCE
    ) -> None:
        self._problem, self._rtol, self._delta = problem, rtol, delta
        self.evaluations = 0
        self.jacobian_evaluations = 0

    @property
    def size(self) -> int:
        """Number of coefficients, n(p + 1)."""
        problem = self._problem
        functions = problem.null_motion.functions(np.zeros(1), problem.path.duration)
        return problem.robot.dof * int(functions.shape[1])

    def value(self, x: Array) -> float:
        """Return F(x), infinite where the integrator gives up."""
        terms = self.terms(x)
        total = np.inf if terms is None else sum(terms.values())
        return total if np.isfinite(total) else np.inf

    def terms(self, x: Array) -> dict[str, float] | None:
        """Return the contribution of each cost to F(x); None if the integrator fails."""
        samples = self.samples(x)
        if samples is None:
            return None
        costs = self._problem.costs
        return {cost.name: float(samples.weights @ cost.value(samples)) for cost in costs}

    def samples(self, x: Array) -> Samples | None:
        """Return the motion at the solver's points; None where the integrator gives up."""
        self.evaluations += 1
        problem = self._problem
        solution = solve_ivp(
            lambda t, q: self._rate(t, q, x),
            (0.0, problem.path.duration),
            start_of(problem),
            method="RK23",
            rtol=self._rtol,
            atol=1e-3 * self._rtol,
        )
        q = np.ascontiguousarray(solution.y.T)
        if not solution.success or not np.all(np.isfinite(q)):
            return None
        qd = np.array([self._rate(t, row, x) for t, row in zip(solution.t, q, strict=True)])
        # Straight lines between the solver's points.
        points = Sampling.trapezoidal(solution.t)
        return Samples.along(problem.follows, points, q, qd)

    def gradient(self, x: Array) -> Array:
        """Return ∇F(x) by forward differences, n(p + 1) + 1 evaluations (eq. 13)."""
        base = self.value(x)
        shifts = self._delta * np.eye(len(x))
        return np.array([(self.value(x + shift) - base) / self._delta for shift in shifts])

    def slope(self, x: Array, direction: Array) -> float:
        """Return the derivative along `direction`, two evaluations (eq. 14)."""
        length = float(np.linalg.norm(direction))
        ahead = self.value(x + direction * self._delta / length)
        return (ahead - self.value(x)) / self._delta * length

    def metric(self, x: Array) -> Array:
        """Return the identity: the paper has no metric."""
        return np.eye(self.size)

    def _rate(self, t: float, q: Array, x: Array) -> Array:
        """Return q̇ of eq. 4."""
        self.jacobian_evaluations += 1
        problem = self._problem
        functions = problem.null_motion.functions(np.array([t]), problem.path.duration)
        epsilon = NullMotionTable(functions, None, problem.robot.dof).epsilon(x)[0]
        jacobian, rotation, _ = problem.robot.chain.at(q)
        rows = problem.task.select(jacobian, rotation)
        command = problem.task.select(problem.path.twist(t)[:, None], rotation)[:, 0]
        y = np.linalg.solve(rows @ rows.T, command - rows @ epsilon)
        return np.asarray(rows.T @ y + epsilon)


def published_null_motion() -> PolynomialNullMotion:
    """Return the paper's ε(t): powers of t in joint space (eq. 6 to 8)."""
    return PolynomialNullMotion(3, space="joint", basis="monomial")


def published_optimizer(max_iterations: int = 60) -> QuasiNewton:
    """Return the paper's optimiser: Broyden family, Fletcher's switch and line search."""
    return QuasiNewton(
        "fletcher",
        line_search=LineSearch(sigma=0.1),
        max_iterations=max_iterations,
        initial_metric="identity",
    )


def flops_per_rate(joints: int, rows: int, degree: int) -> int:
    """Return the floating-point operations of eq. 4, once, as a MATLAB of the time counted them.

    With n joints, m rows and degree p, a sine, a division and an addition one each: Jacobian of a
    planar chain 9n; JJᵀ 2nm²; its inverse 2m³; J* = Jᵀ(JJᵀ)⁻¹ 2nm²; J*ẋ 2nm; I - J*J 2n²m + n²;
    times ε 2n²; ε itself 2n(p + 1); their sum n. The Runge-Kutta pair adds 8n per evaluation.
    """
    n, m, p = joints, rows, degree
    kinematics = 9 * n
    inverse = 2 * n * m * m + 2 * m**3 + 2 * n * m * m
    projection = 2 * n * m + 2 * n * n * m + n * n + 2 * n * n
    return kinematics + inverse + projection + 2 * n * (p + 1) + n + 8 * n
