"""The price of limits that are passed, for motions that are optimised without constraints."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs.base import Cost, Partials
from selfmotion.costs.samples import Samples

# The price begins so far before a limit of position [rad or m], and before this share of a speed is
# used.
_MARGIN = 0.02


@dataclass(frozen=True, eq=False)
class BeyondLimits(Cost):
    """How far joints are beyond their limits: G = ½ w Σ (q - u)₊² + (l - q)₊² + (|q̇|/v - 1)₊².

    With the limits l, u and v drawn in by a margin, in which the price of the other costs is paid.
    A damped problem has this cost besides its own, see `Damping`.

    Parameters
    ----------
    weight : float
        w.
    lower, upper, speed : (n,)
        l, u [rad or m] and v [rad/s or m/s]; infinite where there is none.
    """

    weight: float
    lower: Array
    upper: Array
    speed: Array
    name: str = "joint limits passed"

    def _beyond(self, samples: Samples) -> tuple[Array, Array]:
        """Return signed excesses of q and of q̇ as a share of v, (S, n) each."""
        above = np.maximum(samples.q - self.upper + _MARGIN, 0.0)
        below = np.maximum(self.lower + _MARGIN - samples.q, 0.0)
        used = samples.qd / self.speed
        fast = np.sign(used) * np.maximum(np.abs(used) - 1.0 + _MARGIN, 0.0)
        return above - below, fast

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        far, fast = self._beyond(samples)
        return np.asarray(0.5 * self.weight * np.sum(far**2 + fast**2, axis=1))

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        far, fast = self._beyond(samples)
        return Partials(q=self.weight * far, qd=self.weight * fast / self.speed)
