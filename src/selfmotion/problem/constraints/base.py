"""What a constraint is: something that a motion must keep, written down without an arm."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, Saved, read_only
from selfmotion.certificate import JointLimits, Quantity, QuantityWithinLimits, Requirement
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import Follows
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.conditions import BoundConstraint, BoundQuantity

# What single configurations and single steps must keep, for searches that see no whole motion.


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


# What a constraint is: something that a motion must keep, written down without an arm.
#
# It is bound to one when a plan is made (`selfmotion.problem.constraints.conditions`).


class Constraint(Saved, ABC, family="constraint"):
    """Something that a motion must keep, not yet bound to an arm.

    One of one's own says what it measures, once: `quantity`. From that follow the conditions that
    the optimiser keeps (`bind`), and what the certificate judges the finished motion by, on its own
    (`requirement`). What is no quantity within limits gives these two instead.
    `selfmotion.testing.check_constraint` checks either.

    Attributes
    ----------
    margin : float
        Share of a quantity's limits that is aimed to be left unused; at least half of it is.
    of_pace : bool
        Whether it limits the pace of a motion rather than its way.
    closes : bool
        Whether it asks that the motion ends as it began, so that no part of it can keep it.
    kept_moving : bool
        Whether what its envelope says is all that it asks, so that it can be kept while the arm
        moves.
    pins : (bool, bool)
        Whether the tool has to be on the path itself, not only within what is relaxed, at the start
        and at the end of the motion.
    sets_velocity : (bool, bool)
        Whether it says how fast the arm is at the start and at the end of the motion, which else
        is at rest where the tool is.
    sets_acceleration : (bool, bool)
        Likewise whether it says how the arm accelerates there.
    """

    margin: float = 1e-3
    of_pace: ClassVar[bool] = False
    closes: ClassVar[bool] = False
    kept_moving: ClassVar[bool] = False
    pins: ClassVar[tuple[bool, bool]] = (False, False)
    sets_velocity: ClassVar[tuple[bool, bool]] = (False, False)
    sets_acceleration: ClassVar[tuple[bool, bool]] = (False, False)

    def quantity(self, robot: RobotModel) -> Quantity:
        """Return what it measures and what that may be; ProblemError where it misfits the arm."""
        raise ProblemError(
            f"constraint {type(self).__name__} does not say what it asks for: give it "
            f"quantity(robot), or bind(…) and requirement(robot)"
        )

    def bind(self, follows: Follows, start: Array, end: Array) -> BoundConstraint:
        """Return the conditions on the motion of an arm; ProblemError where it misfits.

        `start` and `end` (n,) are those of the motion that the optimisation begins with.
        """
        return BoundQuantity(self.quantity(follows.robot), self.margin)

    def requirement(self, robot: RobotModel) -> Requirement:
        """Return what the certificate judges; ProblemError where it misfits the arm."""
        return QuantityWithinLimits(self.quantity(robot))

    def applies(self, robot: RobotModel) -> bool:
        """Return whether it asks anything of an arm: not where it keeps limits nobody knows."""
        return True

    def check(self, follows: Follows) -> None:
        """Raise ProblemError where it does not fit an arm, a path or a task."""

    def check_start(self, follows: Follows, start: Array | None) -> None:
        """Raise ProblemError where it does not fit the start, (n,) or None for a free one."""

    def envelope(self, robot: RobotModel) -> Envelope:
        """Return what it asks of single configurations and velocities; by default nothing."""
        return Envelope.unbounded(robot.dof)

    def fixed_end(self, robot: RobotModel) -> Array | None:
        """Return the configuration (n,) that the motion has to end in, where it says one."""
        return None

    def at_rest(self) -> Constraint:
        """Return what is left to ask of a motion that rests at both ends by itself."""
        return self

    def on_part(self) -> Constraint | None:
        """Return what it asks of a motion along the first part of the path; None for nothing."""
        return self

    def on_last_part(self) -> Constraint | None:
        """Return what it asks of a motion along the last part of the path; None for nothing."""
        return self


def check_changes(quantity: Quantity, robot: RobotModel) -> None:
    """Raise ProblemError where no joint changes a quantity of q."""
    q = robot.generic_configurations()
    slopes = quantity.derivatives(q, np.zeros_like(q), np.zeros_like(q))[0]
    # Written so that NaN, of what has no value somewhere, passes.
    if np.all(np.abs(slopes) <= _NEVER):
        raise ProblemError(
            f"{robot.name}: {quantity.name}: no joint changes {quantity.columns[0].label}; leave "
            f"it out, or name a link that joints move"
        )


# Derivatives up to here are rounding of zero [m or rad per rad or m].
_NEVER = 1e-12
