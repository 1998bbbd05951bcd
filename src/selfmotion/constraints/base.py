"""What a constraint is: something that a motion must keep, written down without an arm.

It is bound to one when a plan is made (`selfmotion.constraints.conditions`).
"""

from __future__ import annotations

from abc import ABC
from typing import ClassVar

import numpy as np

from selfmotion.basics import Array, ProblemError, Saved
from selfmotion.certificate import Quantity, QuantityWithinLimits, Requirement
from selfmotion.constraints.conditions import BoundConstraint, BoundQuantity
from selfmotion.constraints.envelope import Envelope
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel


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

    margin: float = 1e-2
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
