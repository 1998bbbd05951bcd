"""Local redundancy resolution: pseudo-inverse, damped least squares, gradient projection."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, BreakdownError, ProblemError, as_number
from selfmotion.model.motion import Grid, Sampling
from selfmotion.paper.baselines.base import Motion, PoseFeedback, along_rate, costs, pseudo_inverse
from selfmotion.problem.costs import Cost, Manipulability, Samples
from selfmotion.problem.problem import Problem

# Steps of the grid on which costs of gains are compared.
_STEPS = 64
# Cost evaluations of the search for the gain: half of them on a geometric grid, half by bounded
# minimisation.
_TRIALS = 16
# Smallest and largest gain of the search, as multiples of the natural gain.
_GAIN_RANGE = (1e-3, 1e1)
# Samples of a motion by which the natural gain is computed.
_SCALE_SAMPLES = 9
# Norm of ∇h below which it is taken for this, against division by zero.
_MIN_SLOPE = 1e-12
# Default criterion.
MANIPULABILITY = Manipulability()


@dataclass(frozen=True)
class PseudoInverse:
    """q̇ = J⁺ẋ: the joint velocities of minimum norm at each instant; x = 0 in the paper's notation.

    D. E. Whitney, "Resolved motion rate control of manipulators and human prostheses", IEEE Trans.
    Man-Machine Systems 10, 1969.
    """

    def solve(self, problem: Problem) -> Motion:
        """See `Method.solve`."""
        return pseudo_inverse(problem)


@dataclass(frozen=True)
class DampedLeastSquares:
    """q̇ = Jᵀ(JJᵀ + λ²I)⁻¹ẋ: bounded speeds near singular configurations, with a path error.

    Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions with singularity robustness for robot
    manipulator control", J. Dyn. Sys. Meas. Control 108, 1986; with `threshold`, the variable
    damping λ² (1 - (σ_min/σ_0)²) below σ_0 of S. Chiaverini, IEEE Trans. Robotics Autom. 13, 1997.

    Parameters
    ----------
    damping : float
        λ > 0 [m, rad].
    threshold : float, optional
        σ_0 [m, rad], the smallest singular value above which damping is zero. By default, damping
        is constant.
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
            damped = here.gram + self._damping_squared(here.gram) * identity
            return np.asarray(here.jacobian.T @ np.linalg.solve(damped, here.command))

        return along_rate(
            problem, rate, f"followed the damped inverse, λ = {self.damping:g}; nothing optimised"
        )

    def _damping_squared(self, gram: Array) -> float:
        if self.threshold is None:
            return self.damping**2
        # An eigenvalue of JJᵀ, that is σ_min².
        smallest_squared = max(float(np.linalg.eigvalsh(gram)[0]), 0.0)
        return self.damping**2 * max(0.0, 1.0 - smallest_squared / self.threshold**2)


@dataclass(frozen=True)
class GradientProjection:
    """ε = -k ∇h(q) in eq. 4: the self-motion descends along the gradient of a function h.

    A. Liégeois, "Automatic supervisory control of the configuration and behavior of multibody
    mechanisms", IEEE Trans. SMC 7, 1977. With the default h = -w, ε = k ∇w.

    Parameters
    ----------
    criterion : Cost
        h, as a cost of the configuration.
    gain : float, optional
        k ≥ 0. By default, the one that minimises the problem's costs, by a search.
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
        return self._with_best_gain(problem)

    def _follow(self, problem: Problem, gain: float) -> Motion:
        feedback = PoseFeedback(problem)

        def rate(t: float, q: Array) -> Array:
            here = feedback(t, q)
            epsilon = -gain * configuration_gradient(problem, self.criterion, t, q)
            y = np.linalg.solve(here.gram, here.command - here.jacobian @ epsilon)
            return np.asarray(here.jacobian.T @ y + epsilon)

        return along_rate(problem, rate, f"followed ε = -k∇h with k = {gain:.4g}")

    def _with_best_gain(self, problem: Problem) -> Motion:
        """Return the motion with the gain of lowest cost, by a search over log k."""
        from scipy.optimize import minimize_scalar

        trials = _Trials(problem, self._follow)
        minimum_norm = self._follow(problem, 0.0)
        minimum_norm_cost = trials.add(minimum_norm)
        gains = self._natural_gain(problem, minimum_norm) * np.geomspace(*_GAIN_RANGE, _TRIALS // 2)
        grid_costs = [trials.cost_of(gain) for gain in gains]
        best = int(np.argmin(grid_costs))
        if grid_costs[best] < minimum_norm_cost:
            low, high = gains[max(best - 1, 0)], gains[min(best + 1, len(gains) - 1)]
            minimize_scalar(
                lambda logarithm: trials.cost_of(float(np.exp(logarithm))),
                bounds=(float(np.log(low)), float(np.log(high))),
                method="bounded",
                options={"maxiter": _TRIALS // 2},
            )
        return trials.best()

    def _natural_gain(self, problem: Problem, minimum_norm: Motion) -> float:
        """Return the gain at which ε is as fast as the motion without it."""
        t = np.linspace(0.0, problem.path.duration, _SCALE_SAMPLES)
        q, qd = minimum_norm.at(t)
        slopes = [
            configuration_gradient(problem, self.criterion, time, row)
            for time, row in zip(t, q, strict=True)
        ]
        return float(np.linalg.norm(qd) / max(float(np.linalg.norm(slopes)), _MIN_SLOPE))


class _Trials:
    """Motions with several gains, and their costs.

    Parameters
    ----------
    problem : Problem
    follow : callable
        Returns the motion of the problem with a gain; raises BreakdownError where there is none.
    """

    def __init__(self, problem: Problem, follow: Callable[[Problem, float], Motion]) -> None:
        self._problem, self._follow = problem, follow
        self._grid = Grid.aligned(problem.path.knots, _STEPS)
        self._tried: list[tuple[float, Motion]] = []

    def cost_of(self, gain: float) -> float:
        """Return the cost with a gain; inf where the motion breaks down."""
        try:
            motion = self._follow(self._problem, gain)
        except BreakdownError:
            return np.inf
        return self.add(motion)

    def add(self, motion: Motion) -> float:
        """Add a motion; return its cost."""
        cost = sum(costs(self._problem, motion, self._grid).values())
        self._tried.append((cost, motion))
        return cost

    def best(self) -> Motion:
        """Return the motion of lowest cost, with the work that all of them took."""
        motion = min(self._tried, key=lambda pair: pair[0])[1]
        evaluations = sum(each.jacobian_evaluations for _, each in self._tried)
        message = f"{motion.message}, the best of {len(self._tried)}"
        return Motion(motion.at, message, len(self._tried), evaluations)


def configuration_gradient(problem: Problem, criterion: Cost, t: float, q: Array) -> Array:
    """Return ∂h/∂q (n,) of a cost of the configuration, at one configuration."""
    return np.asarray(configuration_gradients(problem, criterion, t, q[None])[0])


def configuration_gradients(problem: Problem, criterion: Cost, t: float, q: Array) -> Array:
    """Return the same at several configurations (K, n) at one time, (K, n)."""
    instant = Sampling.trapezoidal(np.full(len(q), t))
    partials = criterion.gradient(Samples.along(problem.follows, instant, q, np.zeros_like(q)))
    if partials.q is None:
        raise ProblemError(f"cost '{criterion.name}' does not depend on the configuration")
    return np.asarray(partials.q)
