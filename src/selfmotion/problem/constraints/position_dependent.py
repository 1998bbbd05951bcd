"""Velocity limits that depend on the position of the joint, as makers publish them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Ints, ProblemError, as_number, per_joint
from selfmotion.certificate import BrakingCurves, VelocityByPosition
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.base import Constraint, Envelope
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.conditions import (
    BoundConstraint,
    NodeTangents,
    motion_of_order,
)
from selfmotion.problem.costs import Samples

_NAME = "position-dependent velocity limits"


@dataclass(frozen=True, eq=False)
class PositionDependentVelocityLimits(Constraint):
    """Joints get slower towards the ends of their ranges (position-based velocity limits).

    ``q̇ ≤ max(0, sqrt(2 a max(0, upper - q)) - o)``, and its mirror image at the lower end, with a
    deceleration a and an offset o of each joint: the form in which libfranka has the limits of the
    Franka Research 3 (0.21.2, include/franka/rate_limiting.h). Where the maker also caps the speed,
    that is `JointVelocityLimits`. Proved at all times by the certificate; see
    `selfmotion.certificate.VelocityByPosition`.

    Motions are planned with ``max(0, q̇ + o)² / (2 a) + q ≤ upper``, which is the same while the
    joint moves towards the end, and keeps one that rests o²/(2a) away from it.

    Parameters
    ----------
    deceleration : (n,) or float, optional
        a [rad/s² or m/s²]; by default that of the arm's maker, if known.
    offset : (n,) or float, optional
        o [rad/s or m/s]; by default the maker's, or 0 beside a given deceleration.
    lower, upper : (n,), optional
        Where the square roots are 0 [rad or m], ±inf for a joint without a curve; by default the
        maker's, or the URDF's limits beside a given deceleration.
    margin : float
        Share of the distance in which a joint stops from its highest speed that is aimed to be left
        unused; at least half of it is. By default more than libfranka's tolerance of 1e-3 rad/s.

    Raises
    ------
    ProblemError
        A number is out of range.
    """

    of_pace: ClassVar[bool] = True
    kept_moving: ClassVar[bool] = True
    key: ClassVar[str] = "deceleration"

    deceleration: npt.ArrayLike | None = None
    offset: npt.ArrayLike | None = None
    lower: npt.ArrayLike | None = None
    upper: npt.ArrayLike | None = None
    margin: float = 2e-3

    def __post_init__(self) -> None:
        as_number(self.margin, f"{_NAME}: margin", above=0.0, most=1.0)

    def curves(self, robot: RobotModel) -> BrakingCurves:
        """Return the curves of an arm: without ends where none are given or known."""
        what = f"{robot.name}: {_NAME}"
        known = robot.position_based_limits
        # The maker's numbers belong together.
        usual = known
        if self.deceleration is not None:
            zeros = np.zeros(robot.dof)
            usual = np.stack([zeros, zeros, robot.lower, robot.upper])
        given = self.deceleration, self.offset, self.lower, self.upper
        names = "deceleration", "offset", "lower", "upper"
        numbers = [
            row if value is None else per_joint(value, robot.dof, f"{what}: {name}")
            for row, value, name in zip(usual, given, names, strict=True)
        ]
        self._check(robot, what, *numbers)
        return BrakingCurves(*numbers)

    def _check(
        self, robot: RobotModel, what: str, hard: Array, offset: Array, lower: Array, upper: Array
    ) -> None:
        """Raise ProblemError for the first joint whose numbers are out of range."""
        fits = np.isfinite(hard) & (hard > 0.0) & np.isfinite(offset) & (offset >= 0.0)
        reserve = offset**2 / np.where(fits, hard, 1.0)
        bad = np.flatnonzero(~(fits & (lower + reserve < upper)))
        if bad.size:
            k = int(bad[0])
            raise ProblemError(
                f"{what}: joint '{robot.joint_names[k]}' has deceleration {hard[k]:g}, offset "
                f"{offset[k]:g}, lower {lower[k]:g} and upper {upper[k]:g}; expected a "
                f"deceleration above 0, an offset of 0 or more, and lower + offset² / deceleration "
                f"< upper, so that it can move"
            )

    @override
    def applies(self, robot: RobotModel) -> bool:
        known = bool(np.isfinite(robot.position_based_limits[2:]).any())
        return self.deceleration is not None or known

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        return Conditions(points=(BoundBraking.of(robot, self.curves(robot), self.margin),))

    @override
    def requirement(self, robot: RobotModel) -> VelocityByPosition:
        units = tuple(robot.unit_of(name) for name in robot.joint_names)
        return VelocityByPosition(self.curves(robot), robot.joint_names, units)

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return Envelope.of_curves(self.curves(robot))


@dataclass(frozen=True, eq=False)
class BoundBraking(BoundConstraint):
    """h = e(q, q̇) / s + margin of the upper and of the lower curve, see `BrakingCurves.excess`.

    s is the distance in which a joint stops from its highest speed; without a limit of speed, the
    middle of its range.
    """

    name: str
    curves: BrakingCurves
    joints: Ints
    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    scale: Array
    margin: float

    @classmethod
    def of(cls, robot: RobotModel, curves: BrakingCurves, margin: float) -> BoundBraking:
        """Return the conditions on the joints of an arm that have a curve."""
        joints = np.flatnonzero(curves.limited)
        width = 0.5 * (curves.upper - curves.lower)
        speed = np.where(np.isfinite(robot.velocity_limit), robot.velocity_limit, 0.0)
        stopping = (speed + curves.offset) ** 2 / (2.0 * curves.deceleration)
        scale = np.where(speed > 0.0, stopping, np.where(np.isfinite(width), width, 1.0))
        names = tuple(robot.joint_names[k] for k in joints)
        units = tuple(robot.unit_of(name) for name in names)
        return cls(_NAME, curves, joints, names, units, scale, margin)

    @property
    def tolerance(self) -> float:  # type: ignore[override]  # it follows from the margin
        """Half the margin is left."""
        return 0.5 * self.margin

    @override
    def residual(self, samples: Samples) -> Array:
        q, qd = (motion_of_order(samples, order) for order in range(2))
        excess = self.curves.excess(q, qd) / self.scale
        return np.concatenate(list(excess[:, :, self.joints]), axis=1) + self.margin

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        own, scale = self.joints, self.scale[self.joints, None]
        above, below = self.curves.slopes(motion_of_order(samples, 1))
        by_q, by_qd = motion.of_order(0)[:, own], motion.of_order(1)[:, own]
        rows = [by_q + above[:, own, None] * by_qd, -by_q + below[:, own, None] * by_qd]
        return np.concatenate([row / scale for row in rows], axis=1)

    @override
    def easing(self, column: int) -> tuple[float, str]:
        name = self.joint_names[column % len(self.joints)]
        return 0.02, f"2 % more way to stop for joint '{name}'"

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
        number, is_upper = column % len(self.joints), column < len(self.joints)
        joint, unit = self.joints[number], self.units[number]
        q, qd = (motion_of_order(samples, order)[row] for order in range(2))
        limit = self.curves.velocities(q)[1 if is_upper else 0][joint]
        return (
            f"joint '{self.joint_names[number]}' moves at {qd[joint]:.4g} {unit}/s at "
            f"{q[joint]:.4g} {unit} at t = {samples.sampling.node_times[row]:.3f} s, where its "
            f"limit is {limit:.4g} {unit}/s"
        )
