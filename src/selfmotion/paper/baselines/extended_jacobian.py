"""The extended Jacobian: rows added to the task until it is square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, BreakdownError
from selfmotion.model.robot import null_space
from selfmotion.paper.baselines.base import Motion, PoseFeedback, along_rate
from selfmotion.paper.baselines.local import MANIPULABILITY, configuration_gradients
from selfmotion.problem.costs import Cost
from selfmotion.problem.problem import Problem

# The attraction to the stationary pose, times the duration.
_ATTRACTION = 20.0

# Step of the central differences of the projected gradient [rad or m].
_DIFFERENCE = 1e-5


@dataclass(frozen=True)
class ExtendedJacobian:
    """Keeps h(q) stationary in the null space: Nᵀ∇h = 0 as r more rows, and no freedom is left.

    J. Baillieul, "Kinematic programming alternatives for redundant manipulators", ICRA 1985. With
    the projected gradient g = (I - J⁺J)∇h, the rows are Nᵀ ∂g/∂q q̇ = -κ Nᵀg, so that |g| decays at
    the rate κ from a start that is not stationary. Which stationary pose it tracks, of largest or
    least h, depends on the start; where the square matrix is singular (Baillieul's algorithmic
    singularities) the motion breaks down.

    Parameters
    ----------
    criterion : Cost
        h, as a cost of the pose; -w by default.
    attraction : float, optional
        κ [1/s]; 20 over the duration by default.
    """

    criterion: Cost = MANIPULABILITY
    attraction: float | None = None

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`."""
        feedback = PoseFeedback(problem)
        attraction = self.attraction
        if attraction is None:
            attraction = _ATTRACTION / problem.path.duration
        robot, task = problem.robot, problem.task
        counted = 0
        displacements = _DIFFERENCE * np.eye(robot.dof)

        def projected(t: float, q: Array) -> Array:
            """Return g at configurations (K, n), (K, n)."""
            nonlocal counted
            counted += len(q)
            jacobians = robot.task_jacobian(q, task)
            transposed = jacobians.transpose(0, 2, 1)
            slopes = configuration_gradients(problem, self.criterion, t, q)[..., None]
            y = np.linalg.solve(jacobians @ transposed, jacobians @ slopes)
            return np.asarray((slopes - transposed @ y)[..., 0])

        def rate(t: float, q: Array) -> Array:
            here = feedback(t, q)
            null = null_space(here.jacobian).T
            try:
                beside = projected(t, np.vstack([q, q + displacements, q - displacements]))
                after, before = np.split(beside[1:], 2)
                change = (after - before).T / (2.0 * _DIFFERENCE)
                square = np.vstack([here.jacobian, null @ change])
                wanted = np.append(here.command, -attraction * (null @ beside[0]))
                return np.asarray(np.linalg.solve(square, wanted))
            except np.linalg.LinAlgError:
                raise BreakdownError(
                    f"{problem.robot.name}: the extended Jacobian is singular at t = {t:.4g} s",
                    time=t,
                ) from None

        motion = along_rate(problem, rate, "followed the extended Jacobian; nothing was optimised")
        jacobians = motion.jacobian_evaluations + counted
        return Motion(motion.at, motion.message, 1, jacobians)
