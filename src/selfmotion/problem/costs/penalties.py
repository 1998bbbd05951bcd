"""Prices of limits that are used or passed, and of leaving the path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number, per_joint
from selfmotion.model.follow import Follows
from selfmotion.problem.costs.base import ERROR, Cost, Partials, check_name
from selfmotion.problem.costs.samples import Samples

# G at rest: it keeps the root differentiable.
_AT_REST = 1e-3


@dataclass(frozen=True, eq=False)
class LimitUse(Cost):
    """Use of limits by the fastest joint: G = (Σ|q̇ᵢ/vᵢ|ᵖ + Σ|q̈ᵢ/aᵢ|^(p/2))^(1/p).

    At c times the pace velocities are c, and accelerations c² times as large, so that G is c times
    as large and its time integral is constant. For large p it is the time [s] that the motion needs
    at its fastest, as far as that is limited by velocities, and by accelerations at their present
    use. `fastest` minimises it repeatedly, at the best pace so far.

    Parameters
    ----------
    velocity : (n,) or float
        v [rad/s or m/s].
    acceleration : (n,) or float
        a [rad/s² or m/s²]; inf for none.
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

    @override
    def value(self, samples: Samples) -> Array:
        return self._parts(samples)[0]

    @override
    def gradient(self, samples: Samples) -> Partials:
        use, speed, rate = self._parts(samples)
        v, a = self._limits(samples.q.shape[1])
        # d G / d s = (|s| / G)^(p - 1) sign s, and likewise for the shares of accelerations.
        by_speed = np.abs(speed / use[:, None]) ** (self.power - 1.0) * np.sign(speed) / v
        half = 0.5 * self.power
        by_rate = 0.5 * np.abs(rate / use[:, None] ** 2) ** (half - 1.0) * np.sign(rate)
        return Partials(qd=by_speed, qdd=by_rate / (a * use[:, None]))

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        """About, where half a limit is used."""
        v, a = self._limits(dof)
        return {1: np.diag((self.power - 1.0) / v**2), 2: np.diag(0.5 * self.power / a**2)}

    @override
    def check(self, follows: Follows) -> None:
        """Require that the limits are the arm's."""
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
        top = np.maximum(used.max(axis=1), _AT_REST)[:, None]
        total = np.sum((used / top) ** self.power, axis=1) + (_AT_REST / top[:, 0]) ** self.power
        return top[:, 0] * total ** (1.0 / self.power), speed, rate


# The penalty starts at this distance from a limit of position [rad or m], and at this unused share
# of a speed.
_MARGIN = 0.02


@dataclass(frozen=True, eq=False)
class BeyondLimits(Cost):
    """Excess of joints over limits: G = ½ w Σ (q - u)₊² + (l - q)₊² + (|q̇|/v - 1)₊².

    With the limits l, u and v drawn in by a margin, in which the price of the other costs is paid.
    A damped problem has this cost besides its own, see `Damping`.

    Parameters
    ----------
    weight : float
        w.
    lower, upper, speed : (n,)
        l, u [rad or m] and v [rad/s or m/s]; infinite for none.
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

    @override
    def value(self, samples: Samples) -> Array:
        far, fast = self._beyond(samples)
        return np.asarray(0.5 * self.weight * np.sum(far**2 + fast**2, axis=1))

    @override
    def gradient(self, samples: Samples) -> Partials:
        far, fast = self._beyond(samples)
        return Partials(q=self.weight * far, qd=self.weight * fast / self.speed)


@dataclass(frozen=True)
class OffPath(Cost):
    """Distance of the tool from the path: G = ½ w |S e|², e the pose error [m, rad].

    S selects the task's rows. On the path it is 0 and has no gradient. A damped problem has this
    cost besides its own, see `Damping`.

    Parameters
    ----------
    weight : float
        w, such that G has the unit of the other costs.
    rows : int
        Number m of the task's rows.
    """

    weight: float
    rows: int
    name: str = "path error"

    @override
    def value(self, samples: Samples) -> Array:
        return np.asarray(0.5 * self.weight * np.sum(_selected(samples) ** 2, axis=1))

    @override
    def gradient(self, samples: Samples) -> Partials:
        """∂G/∂e = w SᵀS e."""
        return Partials(error=self.weight * _selected(samples))

    @override
    def curvature(self, dof: int) -> dict[int, Array]:
        """W I on S e."""
        return {ERROR: self.weight * np.eye(self.rows)}


def _selected(samples: Samples) -> Array:
    """Return the pose errors with 0 in the rows that are free, (S, 6 F) [m, rad].

    Its length is that of S e also for `Task.POINTING`, whose error has no part about the tool's
    axis.
    """
    tasks = [item.task for item in samples.follows.items]
    counts = [
        np.isin(np.arange(6), task.rows) | (task.tool_axes & (np.arange(6) >= 3)) for task in tasks
    ]
    return np.where(np.concatenate(counts), samples.error, 0.0)
