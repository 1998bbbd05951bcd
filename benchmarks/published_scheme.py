"""The paper's way of evaluating: an adaptive integrator and forward differences."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import selfmotion as sm
from selfmotion.arrays import Array


class PublishedFunction:
    """F by ode23 (SciPy's RK23) and the trapezoidal rule, ∇F by eq. 13, slopes by eq. 14.

    Written with NumPy and Pinocchio's Jacobians, for the velocity cost ½ q̇ᵀq̇ and optionally
    μ / det(JJᵀ); counts evaluations of F and of the Jacobian.
    """

    def __init__(
        self, problem: sm.Problem, *, mu: float = 0.0, rtol: float = 1e-3, delta: float = 1e-5
    ) -> None:
        self._problem, self._mu, self._rtol, self._delta = problem, mu, rtol, delta
        self.evaluations = 0
        self.jacobian_evaluations = 0
        self.size = 4 * problem.robot.dof

    def value(self, x: Array) -> float:
        """Return F(x)."""
        self.evaluations += 1
        problem = self._problem
        duration = problem.path.duration
        solution = solve_ivp(
            lambda t, q: self._rate(t, q, x)[0],
            (0.0, duration),
            problem.given_start,
            method="RK23",
            rtol=self._rtol,
            atol=1e-3 * self._rtol,
        )
        if not solution.success:
            return np.inf
        cost = [self._rate(t, q, x)[1] for t, q in zip(solution.t, solution.y.T, strict=True)]
        return float(np.trapezoid(cost, solution.t))

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

    def _rate(self, t: float, q: Array, x: Array) -> tuple[Array, float]:
        self.jacobian_evaluations += 1
        problem = self._problem
        robot, task = problem.robot, problem.rows
        epsilon = x.reshape(robot.dof, -1) @ t ** np.arange(x.size // robot.dof)
        rotation = robot.pose(q).rotation
        jacobian = task.select(robot.jacobian(q), rotation)
        command = task.select(problem.path.twist(t)[:, None], rotation)[:, 0]
        gram = jacobian @ jacobian.T
        qd = jacobian.T @ np.linalg.solve(gram, command - jacobian @ epsilon) + epsilon
        return qd, 0.5 * float(qd @ qd) + self._mu / float(np.linalg.det(gram))


def published_optimizer() -> sm.QuasiNewton:
    """Return the paper's optimiser: Fletcher's switch and a fairly exact line search."""
    return sm.QuasiNewton("fletcher", line_search=sm.LineSearch(sigma=0.1), max_iterations=60)
