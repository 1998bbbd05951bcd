"""Coordinates z = (q, δ) of a motion: the arm's joints, and the virtual joints of tolerances."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Flags, RobotError, read_only
from selfmotion.model.follow.virtual_joints import VirtualJoints
from selfmotion.model.robot import RobotModel, mean_lever
from selfmotion.model.task import Task


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Names, limits and weights of the coordinates z = (q, δ).

    Attributes
    ----------
    robot : RobotModel
        Its joints come first.
    virtual : VirtualJoints or None
        Those of tolerances, after the arm's; None for none.
    lower, upper : (n,)
        Limits [rad or m; of virtual joints in their own units]; ±inf for none.
    """

    robot: RobotModel
    virtual: VirtualJoints | None
    lower: Array
    upper: Array

    @classmethod
    def of(cls, robot: RobotModel, virtual: VirtualJoints | None = None) -> Coordinates:
        """Return the coordinates of an arm, with its own limits, and virtual joints after them."""
        if virtual is None:
            return cls(robot, None, robot.lower, robot.upper)
        limits = np.array([joint.limit for joint in virtual.each])
        lower, upper = np.append(robot.lower, -limits), np.append(robot.upper, limits)
        return cls(robot, virtual, read_only(lower), read_only(upper))

    def within(self, lower: Array, upper: Array) -> Coordinates:
        """Return the same with other limits, (n,) each."""
        return replace(self, lower=lower, upper=upper)

    @property
    def dof(self) -> int:
        """Number n of all coordinates."""
        return len(self.lower)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, (n,)."""
        virtual = () if self.virtual is None else self.virtual.each
        return (*self.robot.joint_names, *(joint.name for joint in virtual))

    @property
    def is_revolute(self) -> Flags:
        """Mask of coordinates that are back after a turn of 2π, (n,)."""
        if self.virtual is None:
            return self.robot.is_revolute
        turns = [
            joint.turns and joint.scale == 1.0 and not joint.name.startswith("tilt")
            for joint in self.virtual.each
        ]
        return np.concatenate([self.robot.is_revolute, turns])

    @property
    def sizes(self) -> Array:
        """How far a unit of each coordinate goes [rad or m], (n,)."""
        if self.virtual is None:
            return self.robot.coordinate_sizes
        return np.append(self.robot.coordinate_sizes, [one.scale for one in self.virtual.each])

    @property
    def weights(self) -> Array:
        """Weight of a unit of each in lengths of motions, (n,); see `RobotModel.joint_weights`.

        A virtual metre or radian counts as one of the arm.
        """
        if self.virtual is None:
            return self.robot.joint_weights
        virtual = self.virtual.weights(1.0 / mean_lever(self.robot))
        return np.concatenate([self.robot.joint_weights, virtual])

    def label(self, k: int) -> str:
        """Return coordinate number k in words: a joint, or the deviation that it allows."""
        number = k - self.robot.dof
        if self.virtual is None or number < 0:
            return self.robot.label(k)
        return self.virtual.label(number)

    def unit(self, k: int) -> str:
        """Return the unit of coordinate number k, times its size."""
        number = k - self.robot.dof
        if self.virtual is None or number < 0:
            return self.robot.unit_of(self.robot.joint_names[k])
        return "rad" if self.virtual.each[number].turns else "m"

    def finite_limits(self) -> tuple[Array, Array]:
        """Return the limits with ±π where a coordinate has none, for sampling."""
        return (
            np.where(np.isfinite(self.lower), self.lower, -np.pi),
            np.where(np.isfinite(self.upper), self.upper, np.pi),
        )

    def usual(self) -> Array:
        """Return home (n,) where it is known, virtual joints at 0; else the middle of limits."""
        n = self.robot.dof
        own = replace(self.robot, lower=self.lower[:n], upper=self.upper[:n])
        try:
            return np.concatenate([own.home, np.zeros(self.dof - n)])
        except RobotError:
            return np.asarray(0.5 * np.add(*self.finite_limits()))

    def dexterous(self, task: Task) -> Array:
        """Return a dexterous configuration of the arm for a task, on the path itself, (n,)."""
        q = self.robot.dexterous_configuration(task)
        return np.concatenate([q, np.zeros(self.dof - len(q))])


def generic_values(coordinates: Coordinates) -> Array:
    """Return a few values within the limits, at none of which anything is special, (5, n)."""
    lower, upper = coordinates.finite_limits()
    return np.random.default_rng(0).uniform(lower, upper, (5, coordinates.dof))
