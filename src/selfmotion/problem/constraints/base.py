"""Base of constraints: conditions on a motion, written down without an arm."""

from __future__ import annotations

from abc import ABC
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, Saved, read_only
from selfmotion.certificate import (
    BrakingCurves,
    JointLimits,
    Quantity,
    QuantityWithinLimits,
    Requirement,
)
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import Follows
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.conditions import BoundQuantity


@dataclass(frozen=True, eq=False)
class Envelope:
    """The part of constraints that applies to a configuration or a velocity alone.

    Attributes
    ----------
    lower, upper : (n,)
        Position limits [rad or m]; ±inf for none.
    speed, acceleration, jerk : (n,)
        Limits of |q̇|, |q̈| and of the jerk; inf for none.
    bodies : tuple of (CollisionModel, float)
        Bodies with a minimum distance [m].
    quantities : tuple of Quantity
        Of q alone, with limits.
    curves : tuple of BrakingCurves
        Limits of q̇ that depend on q.
    tool_speed : float
        Limit of the tool's speed [m/s]; inf for none.
    """

    lower: Array
    upper: Array
    speed: Array
    acceleration: Array
    jerk: Array
    bodies: tuple[tuple[CollisionModel, float], ...] = ()
    quantities: tuple[Quantity, ...] = ()
    curves: tuple[BrakingCurves, ...] = ()
    tool_speed: float = np.inf

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

    @classmethod
    def of_curves(cls, curves: BrakingCurves) -> Envelope:
        """Return the envelope of limits of q̇ that depend on q."""
        lower, upper = curves.resting
        own = cls.unbounded(len(lower))
        return replace(own, lower=read_only(lower), upper=read_only(upper), curves=(curves,))

    def __and__(self, other: Envelope) -> Envelope:
        """Return the envelope that satisfies both."""
        return Envelope(
            read_only(np.maximum(self.lower, other.lower)),
            read_only(np.minimum(self.upper, other.upper)),
            read_only(np.minimum(self.speed, other.speed)),
            read_only(np.minimum(self.acceleration, other.acceleration)),
            read_only(np.minimum(self.jerk, other.jerk)),
            (*self.bodies, *other.bodies),
            (*self.quantities, *other.quantities),
            (*self.curves, *other.curves),
            min(self.tool_speed, other.tool_speed),
        )

    def admits(self, q: Array) -> npt.NDArray[np.bool_]:
        """Return the mask of configurations (K, n) that satisfy the quantities, (K,)."""
        kept, at_rest = np.ones(len(q), dtype=bool), np.zeros_like(q)
        for item in self.quantities:
            away = item.away(q, at_rest, at_rest)
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
        """Return the mask of q and q̇ (N, n) within the limits, bodies left out, (N,)."""
        inside = (q >= self.lower) & (q <= self.upper) & (np.abs(qd) <= self.speed)
        for curves in self.curves:
            inside &= (curves.excess(q, qd) <= 0.0).all(axis=0)
        return np.asarray(inside.all(axis=1))


class Ends(NamedTuple):
    """What a constraint says of the first and the last state of a motion.

    Attributes
    ----------
    closes : bool
        Whether the motion has to end as it starts, so that no part of it can.
    pins : (bool, bool)
        Whether the tool has to be on the path itself, in spite of relaxations, at the start and at
        the end.
    velocity : (bool, bool)
        Whether it says how fast the arm is there, which else is at rest where the tool is.
    acceleration : (bool, bool)
        Likewise whether it says how the arm accelerates there.
    """

    closes: bool = False
    pins: tuple[bool, bool] = (False, False)
    velocity: tuple[bool, bool] = (False, False)
    acceleration: tuple[bool, bool] = (False, False)

    def is_about(self, end: int) -> bool:
        """Return whether it says anything of the start (0) or of the end (1)."""
        return self.closes or self.pins[end] or self.velocity[end] or self.acceleration[end]


class Constraint(Saved, ABC, family="constraint"):
    """Something that a motion must keep, not yet bound to an arm.

    A user's own class gives the `quantity` that it limits. From that follow the conditions of the
    optimiser (`conditions`), and the independent judgement of the finished motion by the
    certificate (`requirement`). A constraint that is no limited quantity gives these two instead.
    `selfmotion.testing.check_constraint` checks either.

    Attributes
    ----------
    margin : float
        Share of a quantity's limits that is aimed to be left unused; at least half of it is.
    of_pace : bool
        Whether it limits the pace of a motion rather than its path in joint space.
    kept_moving : bool
        Whether its envelope is the whole constraint, so that it can be kept while the arm moves, as
        those with a `quantity` are.
    key, option : str
        What in a problem file, and which option besides, gives limits that are not known of an arm.
    ends : Ends
        What it says of the first and the last state.
    """

    margin: float = 1e-3
    of_pace: ClassVar[bool] = False
    kept_moving: ClassVar[bool] = False
    key: ClassVar[str] = "limit"
    option: ClassVar[str] = ""
    ends: ClassVar[Ends] = Ends()

    def quantity(self, robot: RobotModel) -> Quantity:
        """Return the quantity and its limits; ProblemError if it does not fit the arm."""
        raise ProblemError(
            f"constraint {type(self).__name__} does not say what it asks for: give it "
            f"quantity(robot), or conditions(robot) and requirement(robot)"
        )

    def conditions(self, robot: RobotModel) -> Conditions:
        """Return the conditions on the motion of an arm; ProblemError if it does not fit."""
        return Conditions(points=(BoundQuantity(self.quantity(robot), self.margin),))

    def decomposed_conditions(self, robot: RobotModel) -> Conditions:
        """Return the same with links as convex pieces instead of hulls, if it is on bodies."""
        return self.conditions(robot)

    def requirement(self, robot: RobotModel) -> Requirement:
        """Return the requirement for the certificate; ProblemError if it does not fit the arm."""
        return QuantityWithinLimits(self.quantity(robot))

    def applies(self, robot: RobotModel) -> bool:
        """Return whether it applies to an arm: not if its limits are unknown."""
        return True

    def check(self, follows: Follows) -> None:
        """Raise ProblemError where it does not fit an arm, a path or a task."""

    def check_start(self, follows: Follows, start: Array | None) -> None:
        """Raise ProblemError where it does not fit the start, (n,) or None for a free one."""

    def envelope(self, robot: RobotModel) -> Envelope:
        """Return its envelope for single configurations and velocities; by default an empty one."""
        return Envelope.unbounded(robot.dof)

    def at_rest(self) -> Constraint:
        """Return the remainder for a motion that rests at both ends by itself."""
        return self

    def for_controller(self, *, lines: bool = False) -> Constraint | None:
        """Return the remainder for a motion that a controller makes between targets; None for none.

        It chooses accelerations of joints itself; on straight `lines` corners have none at all.
        """
        return self

    def remarks(self, robot: RobotModel) -> tuple[str, ...]:
        """Return notes before planning, as on limits that no arm has."""
        return ()

    @property
    def load(self) -> tuple[float, Array] | None:
        """Mass [kg] that the tool holds and its centre (3,) [m] in the tool's frame, if it says."""
        return None


def check_changes(quantity: Quantity, robot: RobotModel) -> None:
    """Raise ProblemError where no joint changes a quantity of q."""
    q = robot.generic_configurations()
    slopes = quantity.derivatives(q, np.zeros_like(q), np.zeros_like(q))[0]
    # Written so that NaN, of a quantity undefined somewhere, passes.
    if np.all(np.abs(slopes) <= _NEVER):
        raise ProblemError(
            f"{robot.name}: {quantity.name}: no joint changes {quantity.columns[0].label}; leave "
            f"it out, or name a link that joints move"
        )


# Derivatives up to this are rounding of zero [m or rad per rad or m].
_NEVER = 1e-12
