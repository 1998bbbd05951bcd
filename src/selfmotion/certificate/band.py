"""A coordinate within a band at all times."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.certificate.shares import largest_share, too_far
from selfmotion.robot import Coordinate, RobotModel


@dataclass(frozen=True, eq=False)
class CoordinateBand(Requirement):
    """|c(q) - center| ≤ half, at all times, the short way round where c is an angle.

    Attributes
    ----------
    robot : RobotModel
    coordinate : Coordinate
    center, half : float
        [rad or m].
    """

    robot: RobotModel
    coordinate: Coordinate
    center: float
    half: float

    @property
    def name(self) -> str:  # type: ignore[override]  # it follows from the coordinate
        """See `Requirement.name`."""
        return f"band of {self.coordinate.name}"

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the largest share of the half band."""
        worst = largest_share(motion.trajectory, self._shares)
        if worst is None:
            return too_far(self.name, motion)
        share, time, _ = worst
        where = self.coordinate(self.robot, motion.trajectory(np.array([time])))[0][0]
        unit = self.coordinate.unit
        text = (
            f"{self.coordinate.name} is {where:.4g} {unit} at t = {time:.3f} s, expected "
            f"{self.center - self.half:.4g} to {self.center + self.half:.4g} {unit}"
        )
        kept = bool(share <= 1.0)
        return Finding(self.name, self.coordinate.name, time, share, 1.0, kept, text)

    def _shares(self, q: Array, qd: Array, qdd: Array) -> Array:
        values, _ = self.coordinate(self.robot, q)
        return self.coordinate.away(values, self.center)[:, None] / self.half
