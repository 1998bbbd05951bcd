"""What single configurations and single steps must keep, for searches that see no whole motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, read_only
from selfmotion.certificate import JointLimits, Quantity
from selfmotion.collision import CollisionModel
from selfmotion.robot import RobotModel


@dataclass(frozen=True, eq=False)
class Envelope:
    """The part of constraints that can be told of a configuration or a velocity alone.

    Attributes
    ----------
    lower, upper : (n,)
        Position limits [rad or m]; ±inf where there is none.
    speed, acceleration, jerk : (n,)
        Limits of |q̇|, |q̈| and of the jerk; inf where there is none.
    bodies : tuple of (CollisionModel, float)
        Bodies to keep apart, and the distance [m].
    quantities : tuple of Quantity
        Of q alone, with limits.
    """

    lower: Array
    upper: Array
    speed: Array
    acceleration: Array
    jerk: Array
    bodies: tuple[tuple[CollisionModel, float], ...] = ()
    quantities: tuple[Quantity, ...] = ()

    @classmethod
    def unbounded(cls, dof: int) -> Envelope:
        """Return the envelope of n joints that allows everything."""
        free = read_only(np.full(dof, np.inf))
        return cls(read_only(-free), free, free, free, free)

    @classmethod
    def of_limits(cls, limits: JointLimits) -> Envelope:
        """Return the envelope of limits of q, q̇, q̈ or the jerk."""
        own = cls.unbounded(len(limits.lower))
        if limits.order == 0:
            return replace(own, lower=limits.lower, upper=limits.upper)
        if limits.order == 1:
            return replace(own, speed=limits.upper)
        if limits.order == 2:
            return replace(own, acceleration=limits.upper)
        return replace(own, jerk=limits.upper)

    @classmethod
    def of_quantity(cls, quantity: Quantity, dof: int) -> Envelope:
        """Return the envelope of a quantity of q alone, of n joints."""
        return replace(cls.unbounded(dof), quantities=(quantity,))

    def __and__(self, other: Envelope) -> Envelope:
        """Return the envelope of what both allow."""
        return Envelope(
            read_only(np.maximum(self.lower, other.lower)),
            read_only(np.minimum(self.upper, other.upper)),
            read_only(np.minimum(self.speed, other.speed)),
            read_only(np.minimum(self.acceleration, other.acceleration)),
            read_only(np.minimum(self.jerk, other.jerk)),
            (*self.bodies, *other.bodies),
            (*self.quantities, *other.quantities),
        )

    def admits(self, q: Array) -> npt.NDArray[np.bool_]:
        """Return which configurations (K, n) keep the quantities, (K,)."""
        kept, still = np.ones(len(q), dtype=bool), np.zeros_like(q)
        for item in self.quantities:
            away = item.away(q, still, still)
            sizes = np.linalg.norm(away, axis=2) if away.ndim == 3 else np.abs(away)
            kept &= (sizes <= item.bounds).all(axis=1)
        return kept

    def arm(self, robot: RobotModel) -> RobotModel:
        """Return the arm with these position limits instead of its own."""
        return replace(robot, lower=self.lower, upper=self.upper)

    @property
    def limited(self) -> bool:
        """Whether any position is limited."""
        return bool(np.any(np.isfinite(self.lower)) or np.any(np.isfinite(self.upper)))

    def keeps(self, q: Array, qd: Array) -> Array:
        """Return whether q and q̇ (N, n) are within the limits, bodies not looked at, (N,) bool."""
        inside = (q >= self.lower) & (q <= self.upper) & (np.abs(qd) <= self.speed)
        return np.asarray(inside.all(axis=1))
