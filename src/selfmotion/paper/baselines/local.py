"""Methods that decide from the present pose alone, by pseudo-inverses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, BreakdownError, ProblemError, as_number
from selfmotion.model.motion import Grid, Sampling
from selfmotion.paper.baselines.base import Motion, PoseFeedback, along_rate, costs, pseudo_inverse
from selfmotion.problem.costs import Cost, Manipulability, Samples
from selfmotion.problem.problem import Problem

# Steps of the quadrature that compares gains.
_STEPS = 64
# Cost evaluations of the search for the best gain.
_TRIALS = 16
# Default criterion.
MANIPULABILITY = Manipulability()


@dataclass(frozen=True)
class PseudoInverse:
    """q̇ = J⁺ẋ: at every instant the slowest joint motion, x = 0 in the paper's terms.

    D. E. Whitney, "Resolved motion rate control of manipulators and human prostheses", IEEE Trans.
    Man-Machine Systems 10, 1969.
    """

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`."""
        return pseudo_inverse(problem)


@dataclass(frozen=True)
class DampedLeastSquares:
    """q̇ = Jᵀ(JJᵀ + λ²I)⁻¹ẋ: bounded speeds near singular poses, at the price of the path.

    Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions with singularity robustness for robot
    manipulator control", J. Dyn. Sys. Meas. Control 108, 1986; with `threshold`, the variable
    damping λ² (1 - (σ_min/σ_0)²) below σ_0 of S. Chiaverini, IEEE Trans. Robotics Autom. 13, 1997.

    Parameters
    ----------
    damping : float
        λ > 0 [m, rad].
    threshold : float, optional
        σ_0 [m, rad]: no damping where the smallest singular value is larger. Always by default.
    """

    damping: float = 0.1
    threshold: float | None = None

    def __post_init__(self) -> None:
        as_number(self.damping, "damped least squares: damping", above=0.0)
        if self.threshold is not None:
            as_number(self.threshold, "damped least squares: threshold", above=0.0)

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`."""
        feedback = PoseFeedback(problem)
        identity = np.eye(problem.task.dimension)

        def rate(t: float, q: Array) -> Array:
            here = feedback(t, q)
            damped = here.gram + self._squared(here.gram) * identity
            return np.asarray(here.jacobian.T @ np.linalg.solve(damped, here.command))

        return along_rate(
            problem, rate, f"followed the damped inverse, λ = {self.damping:g}; nothing optimised"
        )

    def _squared(self, gram: Array) -> float:
        if self.threshold is None:
            return self.damping**2
        smallest = max(float(np.linalg.eigvalsh(gram)[0]), 0.0)
        return self.damping**2 * max(0.0, 1.0 - smallest / self.threshold**2)


@dataclass(frozen=True)
class GradientProjection:
    """ε = -k ∇h(q) in eq. 4: the self-motion climbs down a function of the pose as it goes.

    A. Liégeois, "Automatic supervisory control of the configuration and behavior of multibody
    mechanisms", IEEE Trans. SMC 7, 1977. With the default h = -w, ε = k ∇w.

    Parameters
    ----------
    criterion : Cost
        h, as a cost of the pose.
    gain : float, optional
        k ≥ 0. By default the one that minimises the problem's costs: a search over k.
    """

    criterion: Cost = MANIPULABILITY
    gain: float | None = None

    def __post_init__(self) -> None:
        if self.gain is not None:
            as_number(self.gain, "gradient projection: gain", least=0.0)

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`."""
        if self.gain is not None:
            return self._follow(problem, self.gain)
        return self._tuned(problem)

    def _follow(self, problem: Problem, gain: float) -> Motion:
        feedback = PoseFeedback(problem)

        def rate(t: float, q: Array) -> Array:
            here = feedback(t, q)
            epsilon = -gain * pose_gradient(problem, self.criterion, t, q)
            y = np.linalg.solve(here.gram, here.command - here.jacobian @ epsilon)
            return np.asarray(here.jacobian.T @ y + epsilon)

        return along_rate(problem, rate, f"followed ε = -k∇h with k = {gain:.4g}")

    def _tuned(self, problem: Problem) -> Motion:
        """Search over log k, from gains that hardly act to gains that dominate; keep the best."""
        from scipy.optimize import minimize_scalar

        grid = Grid.aligned(problem.path.knots, _STEPS)
        tried: list[tuple[float, Motion]] = []

        def cost_of(gain: float) -> float:
            try:
                motion = self._follow(problem, gain)
            except BreakdownError:
                return np.inf
            cost = sum(costs(problem, motion, grid).values())
            tried.append((cost, motion))
            return cost

        minimum_norm = cost_of(0.0)
        if not np.isfinite(minimum_norm):
            # Raises again, with the time at which it breaks down.
            self._follow(problem, 0.0)
        scale = self._scale(problem, tried[0][1])
        gains = scale * np.geomspace(1e-3, 1e1, _TRIALS // 2)
        coarse = [cost_of(gain) for gain in gains]
        best = int(np.argmin(coarse))
        if coarse[best] < minimum_norm:
            low, high = gains[max(best - 1, 0)], gains[min(best + 1, len(gains) - 1)]
            minimize_scalar(
                lambda logarithm: cost_of(float(np.exp(logarithm))),
                bounds=(float(np.log(low)), float(np.log(high))),
                method="bounded",
                options={"maxiter": _TRIALS // 2},
            )
        found = min(tried, key=lambda pair: pair[0])[1]
        spent = sum(motion.jacobian_evaluations for _, motion in tried)
        message = f"{found.message}, the best of {len(tried)}"
        return Motion(found.at, message, len(tried), spent)

    def _scale(self, problem: Problem, minimum_norm: Motion) -> float:
        """Return the gain at which ε is as fast as the motion without it."""
        t = np.linspace(0.0, problem.path.duration, 9)
        q, qd = minimum_norm.at(t)
        slopes = [
            pose_gradient(problem, self.criterion, time, row)
            for time, row in zip(t, q, strict=True)
        ]
        return float(np.linalg.norm(qd) / max(float(np.linalg.norm(slopes)), 1e-12))


def pose_gradient(problem: Problem, criterion: Cost, t: float, q: Array) -> Array:
    """Return ∂h/∂q (n,) of a cost of the pose at one configuration."""
    moment = Sampling.trapezoidal(np.array([t]))
    rest = np.zeros((1, len(q)))
    samples = Samples.along(problem.follows, moment, q[None], rest)
    partials = criterion.gradient(samples)
    if partials.q is None:
        raise ProblemError(f"cost '{criterion.name}' does not depend on the pose")
    return np.asarray(partials.q[0])
