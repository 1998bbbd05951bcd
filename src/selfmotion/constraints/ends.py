"""Conditions on the end of the motion: a configuration, rest, repetition."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array, read_only
from selfmotion.constraints.base import (
    NodePartials,
    NodeTangents,
    motion_of_order,
    partials_of_order,
)
from selfmotion.robot import RobotModel
from selfmotion.samples import Samples

# Residuals below this [rad, rad/s] are closed: a thousandth of what a hundred loops may drift.
_CLOSED = 1e-9


@dataclass(frozen=True, eq=False)
class EndConfiguration:
    """The motion ends in a configuration that puts the tool on the end of the path.

    Parameters
    ----------
    q : (n,)
        q(T) [rad or m].
    """

    q: npt.ArrayLike

    def bind(self, robot: RobotModel) -> "BoundEnd":
        """See `Constraint.bind`."""
        return BoundEnd("end configuration", 0, read_only(robot.configuration(self.q)), robot)


@dataclass(frozen=True, eq=False)
class EndVelocity:
    """The motion ends with a joint velocity.

    Parameters
    ----------
    qd : (n,) or 0
        q̇(T) [rad/s or m/s]; must move the tool as the path does.
    """

    qd: npt.ArrayLike = 0.0

    def bind(self, robot: RobotModel) -> "BoundEnd":
        """See `Constraint.bind`."""
        qd = np.broadcast_to(np.asarray(self.qd, dtype=np.float64), (robot.dof,))
        return BoundEnd("end velocity", 1, read_only(robot.configuration(qd)), robot)


@dataclass(frozen=True)
class ClosedPath:
    """The motion ends as it began, so that it can be repeated: q(T) = q(0).

    Parameters
    ----------
    velocity : bool
        Also q̇(T) = q̇(0), for repetition without a jump in speed.
    """

    velocity: bool = True

    def bind(self, robot: RobotModel) -> "BoundEnd":
        """See `Constraint.bind`."""
        name = "closed path, velocity" if self.velocity else "closed path"
        return BoundEnd(name, 0, None, robot, also_velocity=self.velocity)


@dataclass(frozen=True, eq=False)
class BoundEnd:
    """x(T) - target = 0, or x(T) - x(0) = 0 without a target, for x = q or q̇ (or both)."""

    name: str
    order: int
    target: Array | None
    robot: RobotModel
    also_velocity: bool = False
    equality = True
    tolerance = _CLOSED

    @property
    def _orders(self) -> tuple[int, ...]:
        return (0, 1) if self.also_velocity else (self.order,)

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        parts = []
        for order in self._orders:
            x = motion_of_order(samples, order)
            parts.append(x[-1] - (x[0] if self.target is None else self.target))
        return np.concatenate(parts)[None, :]

    def pullback(self, samples: Samples, weights: Array) -> NodePartials:
        """See `BoundConstraint.pullback`."""
        n, nodes = self.robot.dof, len(samples.grid.nodes)
        values = [np.zeros((nodes, n)) for _ in self._orders]
        for k, table in enumerate(values):
            table[-1] = weights[0, k * n : (k + 1) * n]
            if self.target is None:
                table[0] = -table[-1]
        if self.also_velocity:
            return NodePartials(q=values[0], qd=values[1])
        return partials_of_order(self.order, values[0])

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        parts = []
        for order in self._orders:
            x = motion.of_order(order)
            parts.append(x[-1] - x[0] if self.target is None else x[-1])
        return np.concatenate(parts)[None]

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        n = self.robot.dof
        miss = self.residual(samples)[0, column]
        order = self._orders[column // n]
        quantity = ("position", "velocity")[order]
        goal = "its value at the start" if self.target is None else "the one asked for"
        return (
            f"{quantity} of joint '{self.robot.joint_names[column % n]}' at the end is "
            f"{miss:.3g} away from {goal}"
        )
