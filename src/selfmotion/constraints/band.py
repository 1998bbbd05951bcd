"""Coordinates that stay within a band: the elbow up, a joint on one side, a link above a table."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number, restore, shown
from selfmotion.certificate import CoordinateBand
from selfmotion.constraints.base import Constraint, NodeTangents, motion_of_order
from selfmotion.costs import Samples
from selfmotion.follow import Follows
from selfmotion.robot import Coordinate, RobotModel, SwivelAngle

# Centre of the swivel angle from upwards, about the direction from shoulder to wrist [rad].
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
    margin: float = 2e-3

    def __post_init__(self) -> None:
        if not isinstance(self.coordinate, Coordinate):
            raise ProblemError(
                f"band: coordinate is {shown(self.coordinate)}, expected a JointCoordinate, "
                f"FrameCoordinate or SwivelAngle"
            )
        as_number(self.center, "band: center")
        most = min(0.5 * self.coordinate.period, 1e100)
        as_number(self.half, "band: half", above=0.0, most=most)
        as_number(self.margin, "band: margin", above=0.0, most=1.0)

    @classmethod
    def of_elbow(cls, side: str, half: float = 0.5 * np.pi, **names: str) -> "Band":
        """Return the band that keeps the elbow 'up', 'down', 'left' or 'right'.

        Left and right are those of who looks from the shoulder to the wrist with the head up; the
        angle is `SwivelAngle`'s, its links are `names` where the arm is not of seven revolute
        joints. `half` is how far the elbow may swivel to each side of that [rad].
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

    def bind(self, follows: Follows, start: Array, end: Array) -> "BoundBand":
        """See `Constraint.bind`."""
        robot = follows.robot
        self.coordinate(robot, start[None])
        return BoundBand(robot, self.coordinate, float(self.center), float(self.half), self.margin)

    def requirement(self, robot: RobotModel) -> CoordinateBand:
        """See `Constraint.requirement`."""
        self.coordinate(robot, np.zeros((1, robot.dof)))
        return CoordinateBand(robot, self.coordinate, float(self.center), float(self.half))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> "Band":
        """See `Saved.from_dict`."""
        return cls(**{**values, "coordinate": restore(Coordinate, values["coordinate"])})


@dataclass(frozen=True, eq=False)
class BoundBand:
    """h = ±(c - center) / half - 1 + margin."""

    robot: RobotModel
    coordinate: Coordinate
    center: float
    half: float
    margin: float
    equality = False

    @property
    def name(self) -> str:
        """See `BoundConstraint.name`."""
        return f"band of {self.coordinate.name}"

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin."""
        return 0.5 * self.margin

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        values, _ = self.coordinate(self.robot, motion_of_order(samples, 0))
        away = self.coordinate.away(values, self.center)[:, None] / self.half
        return np.hstack([away, -away]) - 1.0 + self.margin

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        _, gradient = self.coordinate(self.robot, motion_of_order(samples, 0))
        change = np.einsum("kn,knd->kd", gradient, motion.q)[:, None] / self.half
        return np.concatenate([change, -change], axis=1)

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`: 2 % of the half band, on both sides."""
        return 0.02, f"2 % more room for {self.coordinate.name}"

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        values, _ = self.coordinate(self.robot, motion_of_order(samples, 0)[row : row + 1])
        unit = self.coordinate.unit
        return (
            f"{self.coordinate.name} is {values[0]:.4g} {unit} at t = "
            f"{samples.sampling.node_times[row]:.3f} s, expected {self.center - self.half:.4g} to "
            f"{self.center + self.half:.4g}"
        )
