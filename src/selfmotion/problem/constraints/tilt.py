"""An axis of a link near a direction of the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number, as_numbers, nearest, shown
from selfmotion.certificate import Column, MotionSegments, Quantity
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.base import Constraint, Envelope, check_changes

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True, eq=False)
class Tilt(Constraint):
    """An axis of a link stays within an angle of a direction of the world, at all times.

    With a the axis and d the direction, both of length 1, |a - d| = 2 sin(θ/2) ≤ 2 sin(within/2).

    Parameters
    ----------
    frame : str
        The link.
    axis : {"x", "y", "z"} or (3,)
        In the link's own frame.
    within : float
        The largest angle [rad], less than π.
    towards : (3,)
        In world axes; downwards by default, in files to be said.
    margin : float
        Share of the angle which is aimed to be left unused; at least half of it is.
    """

    frame: str
    axis: str | npt.ArrayLike = "z"
    within: float = 0.1
    towards: npt.ArrayLike = (0.0, 0.0, -1.0)
    margin: float = 5e-4

    def __post_init__(self) -> None:
        if not isinstance(self.frame, str):
            raise ProblemError(f"tilt: frame is {shown(self.frame)}, expected the name of a link")
        _direction(_axis(self.axis), "tilt: axis")
        _direction(self.towards, "tilt: towards")
        as_number(self.within, "tilt: within", above=0.0, most=np.pi * (1.0 - 1e-6))
        as_number(self.margin, "tilt: margin", above=0.0, most=1.0)

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return Envelope.of_quantity(self.quantity(robot), robot.dof)

    @override
    def quantity(self, robot: RobotModel) -> Quantity:
        if self.frame not in robot.urdf.links:
            raise ProblemError(
                f"{robot.name}: no link '{self.frame}' whose tilt could be limited"
                f"{nearest(self.frame, robot.urdf.links)}; links: {', '.join(robot.urdf.links)}"
            )
        chain = robot.chain_to(self.frame)
        axis = _direction(_axis(self.axis), "tilt: axis")
        towards = _direction(self.towards, "tilt: towards")

        def values(q: Array, qd: Array, qdd: Array) -> Array:
            _, rotations, _ = chain.along(q)
            return np.asarray((rotations @ axis - towards)[:, None])

        def derivatives(q: Array, qd: Array, qdd: Array) -> tuple[Array, ...]:
            # A joint that turns the link at ω takes its axis a along ω × a.
            jacobians, rotations, _ = chain.along(q)
            turned = (rotations @ axis)[:, None]
            slopes = np.cross(jacobians[:, 3:].transpose(0, 2, 1), turned)
            return (slopes.transpose(0, 2, 1)[:, None],)

        def known(segments: MotionSegments) -> Array:
            return np.asarray(segments.chain().orientation(chain.tip)[None])

        found = _Angle(
            f"tilt of '{self.frame}'",
            (Column(self.frame, f"the tilt of '{self.frame}' from {_with_angle(towards)}", "rad"),),
            values,
            derivatives,
            limit=2.0 * np.sin(0.5 * self.within),
            series=known,
            components=3,
        )
        check_changes(found, robot)
        return found


class _Angle(Quantity):
    """A quantity that is the chord of an angle, reported as the angle."""

    @override
    def said(self, column: int, away: float, time: float) -> str:
        angle, limit = (
            2.0 * float(np.arcsin(min(0.5 * abs(chord), 1.0)))
            for chord in (away, self.bounds[column])
        )
        return (
            f"{self.columns[column].label} is {angle:.4g} rad at t = {time:.3f} s, expected at "
            f"most {limit:.4g} rad"
        )


def _axis(axis: str | npt.ArrayLike) -> npt.ArrayLike:
    if not isinstance(axis, str):
        return axis
    if axis not in _AXES:
        raise ProblemError(f"tilt: axis is '{axis}', expected x, y, z or three numbers")
    return _AXES[axis]


def _direction(given: npt.ArrayLike, what: str) -> Array:
    """Return three numbers as a unit vector."""
    vector = as_numbers(given, what, "three numbers, not all 0", (3,))
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise ProblemError(f"{what} is zero, expected a direction")
    return np.asarray(vector / length)


def _with_angle(direction: Array) -> str:
    return "[" + ", ".join(f"{number:.3g}" for number in np.round(direction, 6) + 0.0) + "]"
