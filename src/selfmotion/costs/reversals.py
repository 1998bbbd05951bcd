"""How often joints turn round, as something smooth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, as_number
from selfmotion.costs.base import Cost, Partials, check_name
from selfmotion.costs.samples import Samples
from selfmotion.follow import Follows


@dataclass(frozen=True, eq=False)
class JointReversals(Cost):
    """Changes of direction of the joints: G = w / π Σ_i (√(u_i² + δ²) - δ) [1/s].

    u_i = q̈_i v / (v² + q̇_i²) is the rate of atan(q̇_i / v), which goes from -π/2 to π/2 where a
    joint turns round from speeds far above v: the integral of G is about w for each reversal, and
    half of that for each joint that begins or ends at rest. Gears have their play there, and
    polished surfaces their marks. It belongs beside another cost, such as `JointVelocity`: alone it
    has many optima, and takes long. `Plan.reversals` counts what is left.

    Parameters
    ----------
    weight : float
        w, what a reversal costs.
    speed : float
        v [rad/s or m/s]: a joint that is slower nearly rests.
    smoothing : float
        δ [1/s]: changes slower than that cost next to nothing.
    """

    weight: float = 1.0
    speed: float = 0.02
    smoothing: float = 0.05
    name: str = "joint reversals"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        rate = samples.qdd * self._share(samples)
        turns = np.hypot(rate, self.smoothing) - self.smoothing
        return np.asarray(self.weight / np.pi * turns.sum(axis=1))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        share = self._share(samples)
        rate = samples.qdd * share
        slope = self.weight / np.pi * rate / np.hypot(rate, self.smoothing)
        # ∂u/∂q̇ = -2 q̈ q̇ v / (v² + q̇²)².
        by_speed = -2.0 / self.speed * samples.qdd * samples.qd * share**2
        return Partials(qd=slope * by_speed, qdd=slope * share)

    def check(self, follows: Follows) -> None:
        """See `Cost.check`."""
        check_name(self.name)
        as_number(self.weight, f"cost '{self.name}': weight", least=0.0)
        as_number(self.speed, f"cost '{self.name}': speed", above=0.0)
        as_number(self.smoothing, f"cost '{self.name}': smoothing", above=0.0)

    def _share(self, samples: Samples) -> Array:
        return np.asarray(self.speed / (self.speed**2 + samples.qd**2))
