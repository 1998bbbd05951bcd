"""Limits of joints on the motion of one arm, as the optimiser sees them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Ints
from selfmotion.certificate import JointLimits
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.conditions import (
    BoundConstraint,
    Linear,
    NodeTangents,
    motion_of_order,
)
from selfmotion.problem.costs import Samples

_QUANTITIES = ("position", "speed", "acceleration", "jerk")
_POWERS = ("", "/s", "/s²", "/s³")


@dataclass(frozen=True, eq=False)
class BoundLimits(BoundConstraint):
    """lower ≤ x ≤ upper for x = q, q̇, q̈ or the jerk of the joints that have finite limits.

    h = (x - upper) / s + margin and (lower - x) / s + margin, with s = 1 for positions and the
    limit itself for its derivatives.
    """

    name: str
    order: int
    joints: npt.NDArray[np.intp]
    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    lower: Array
    upper: Array
    scale: Array
    margin: float
    tolerance: float = field(init=False)

    def __post_init__(self) -> None:
        # Half the margin is left.
        object.__setattr__(self, "tolerance", 0.5 * self.margin)

    @classmethod
    def of(cls, robot: RobotModel, limits: JointLimits, margin: float) -> BoundLimits:
        """Return the judged limits, for the joints with a finite limit on either side."""
        lower, upper, order = limits.lower, limits.upper, limits.order
        joints = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        scale = np.ones(len(joints)) if order == 0 else upper[joints]
        names = tuple(robot.joint_names[k] for k in joints)
        units = tuple("rad" if turns else "m" for turns in robot.is_revolute[joints].tolist())
        sides = lower[joints], upper[joints]
        return cls(limits.name, order, joints, names, units, *sides, scale, margin)

    @override
    def residual(self, samples: Samples) -> Array:
        x = motion_of_order(samples, self.order)
        x = x if len(self.joints) == x.shape[1] else x[:, self.joints]
        h = np.empty((len(x), 2 * len(self.joints)))
        np.subtract(x, self.upper, out=h[:, : len(self.joints)])
        np.subtract(self.lower, x, out=h[:, len(self.joints) :])
        h /= self._both_scales
        h += self.margin
        return h

    @cached_property
    def _both_scales(self) -> Array:
        return np.concatenate([self.scale, self.scale])

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        above = motion.of_order(self.order)[:, self.joints] / self.scale[:, None]
        return np.concatenate([above, -above], axis=1)

    @override
    def linearised_at(self, samples: Samples) -> tuple[tuple[int, int], Linear]:
        return (len(samples.nodes), 2 * len(self.joints)), self

    def picked(self, motion: NodeTangents, rows: Ints, columns: Ints) -> Array:
        """See `Linear.picked`."""
        joints = columns % len(self.joints)
        signed = np.where(columns < len(self.joints), 1.0, -1.0) / self.scale[joints]
        return motion.picked(self.order, rows, self.joints[joints]) * signed[:, None]

    @override
    def easing(self, column: int) -> tuple[float, str]:
        number = column % len(self.joints)
        joint = f"joint '{self.joint_names[number]}'"
        if self.order > 0:
            return 0.02, f"2 % more {_QUANTITIES[self.order]} for {joint}"
        side = "upper" if column < len(self.joints) else "lower"
        return 0.01, f"0.01 {self.units[number]} more at the {side} limit of {joint}"

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
        joint = column % len(self.joints)
        value = motion_of_order(samples, self.order)[row, self.joints[joint]]
        limit = self.upper[joint] if column < len(self.joints) else self.lower[joint]
        unit = self.units[joint] + _POWERS[self.order]
        return (
            f"{_QUANTITIES[self.order]} of joint '{self.joint_names[joint]}' is {value:.4g} {unit} "
            f"at t = {samples.sampling.node_times[row]:.3f} s, limit {limit:.4g} {unit}"
        )
