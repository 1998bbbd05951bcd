"""How much of their limits joints use: a smooth stand-in for the time that a motion needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, as_number, per_joint
from selfmotion.costs.base import Cost, Partials, check_name
from selfmotion.costs.samples import Samples
from selfmotion.follow import Follows

# Where nothing moves, G is this: it keeps the root smooth.
_LEAST = 1e-3


@dataclass(frozen=True, eq=False)
class LimitUse(Cost):
    """What the fastest joint uses of its limits: G = (Σ|q̇ᵢ/vᵢ|ᵖ + Σ|q̈ᵢ/aᵢ|^(p/2))^(1/p).

    At c times the pace velocities are c, and accelerations c² times as large, so that G is c times
    as large and its integral over time stays: it is, for large p, the time [s] that the motion
    needs at its fastest, as far as that is limited by velocities, and by accelerations that are
    used as much then as now. `fastest` minimises it, again and again at the pace found so far.

    Parameters
    ----------
    velocity : (n,) or float
        v [rad/s or m/s].
    acceleration : (n,) or float
        a [rad/s² or m/s²]; inf where there is none.
    power : float
        p, at least 4.
    """

    is_pointwise: ClassVar[bool] = True

    velocity: npt.ArrayLike
    acceleration: npt.ArrayLike = np.inf
    power: float = 8.0
    name: str = "limit use"

    def __post_init__(self) -> None:
        check_name(self.name)
        as_number(self.power, f"cost '{self.name}': power", least=4.0, most=100.0)

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return self._parts(samples)[0]

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        use, speed, rate = self._parts(samples)
        v, a = self._limits(samples.q.shape[1])
        # d G / d s = (|s| / G)^(p - 1) sign s, and likewise for the shares of accelerations.
        by_speed = np.abs(speed / use[:, None]) ** (self.power - 1.0) * np.sign(speed) / v
        half = 0.5 * self.power
        by_rate = 0.5 * np.abs(rate / use[:, None] ** 2) ** (half - 1.0) * np.sign(rate)
        return Partials(qd=by_speed, qdd=by_rate / (a * use[:, None]))

    def curvature(self, dof: int) -> dict[int, Array]:
        """See `Cost.curvature`: about, where half a limit is used."""
        v, a = self._limits(dof)
        return {1: np.diag((self.power - 1.0) / v**2), 2: np.diag(0.5 * self.power / a**2)}

    def check(self, follows: Follows) -> None:
        """See `Cost.check`: the limits have to be the arm's."""
        robot = follows.robot
        self._limits(robot.dof)
        if not np.isfinite(np.concatenate(self._limits(robot.dof))).any():
            raise ProblemError(f"cost '{self.name}': no joint has a limit of which to use a share")

    def _limits(self, dof: int) -> tuple[Array, Array]:
        what = f"cost '{self.name}': "
        return (
            per_joint(self.velocity, dof, what + "velocity", positive=True),
            per_joint(self.acceleration, dof, what + "acceleration", positive=True),
        )

    def _parts(self, samples: Samples) -> tuple[Array, Array, Array]:
        """Return G (S,) and the shares of velocities and accelerations (S, n) each."""
        v, a = self._limits(samples.q.shape[1])
        speed, rate = samples.qd / v, samples.qdd / a
        used = np.concatenate([np.abs(speed), np.sqrt(np.abs(rate))], axis=1)
        # Of the largest, whose power is 1: others underflow without harm.
        top = np.maximum(used.max(axis=1), _LEAST)[:, None]
        total = np.sum((used / top) ** self.power, axis=1) + (_LEAST / top[:, 0]) ** self.power
        return top[:, 0] * total ** (1.0 / self.power), speed, rate
