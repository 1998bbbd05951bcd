"""Coordinates that stay within a band: the elbow up, a joint on one side, a link above a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number, restore, series, shown
from selfmotion.certificate import Column, MotionSegments, Quantity
from selfmotion.model.robot import Coordinate, RobotModel, SwivelAngle
from selfmotion.problem.constraints.base import Constraint, Envelope, check_changes

# Angle of the band's centre from upwards, about the direction from shoulder to wrist [rad].
_SIDES = {"up": 0.0, "left": -0.5 * np.pi, "right": 0.5 * np.pi, "down": np.pi}


@dataclass(frozen=True, eq=False)
class Band(Constraint):
    """A coordinate stays within a band.

    Parameters
    ----------
    coordinate : Coordinate
        `JointCoordinate`, `FrameCoordinate` or `SwivelAngle`.
    center : float
        The middle of the band [rad or m].
    half : float
        How far it reaches to each side; less than π for an angle [rad or m].
    margin : float
        Share of that which is aimed to be left unused; at least half of it is.
    """

    coordinate: Coordinate
    center: float
    half: float
    margin: float = 5e-4

    def __post_init__(self) -> None:
        if not isinstance(self.coordinate, Coordinate):
            raise ProblemError(
                f"band: coordinate is {shown(self.coordinate)}, expected a JointCoordinate, "
                f"FrameCoordinate or SwivelAngle"
            )
        self.coordinate.check_value(self.center, "band: center")
        most = min(0.5 * self.coordinate.period, 1e100)
        as_number(self.half, "band: half", above=0.0, most=most)
        as_number(self.margin, "band: margin", above=0.0, most=1.0)

    @classmethod
    def of_elbow(cls, side: str, half: float = 0.5 * np.pi, **names: str) -> Band:
        """Return the band that keeps the elbow 'up', 'down', 'left' or 'right'.

        Left and right are as seen from the shoulder towards the wrist with the head up; the angle
        is `SwivelAngle`'s, its links are `names` for arms other than of seven revolute joints.
        `half` is the allowed swivel of the elbow to each side [rad].
        """
        if side not in _SIDES:
            raise ProblemError(
                f"elbow: side is {shown(side)}, expected one of: {', '.join(_SIDES)}"
            )
        unknown = sorted(set(names) - {"shoulder", "elbow", "wrist"})
        if unknown:
            raise ProblemError(
                f"elbow: unknown argument '{unknown[0]}', expected shoulder, elbow or wrist"
            )
        return cls(SwivelAngle(**names), _SIDES[side], half)

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return Envelope.of_quantity(self.quantity(robot), robot.dof)

    @override
    def quantity(self, robot: RobotModel) -> Quantity:
        coordinate = self.coordinate
        coordinate(robot, np.zeros((1, robot.dof)))

        def known(segments: MotionSegments) -> Array | None:
            found = coordinate.series(segments.chain(), segments.motion(np.zeros(1)))
            return None if found is None else found[None]

        found = Quantity(
            f"band of {coordinate.name}",
            (Column(coordinate.name, coordinate.name, coordinate.unit),),
            lambda q, *_: coordinate(robot, q)[0][:, None],
            lambda q, *_: (coordinate(robot, q)[1][:, None],),
            limit=float(self.half),
            center=float(self.center),
            series=known if series.holds_for(coordinate, "__call__") else None,
            period=coordinate.period,
        )
        check_changes(found, robot)
        return found

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Band:
        return cls(**{**values, "coordinate": restore(Coordinate, values["coordinate"])})
