"""Limits of how fast the tool moves and accelerates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number
from selfmotion.certificate import Column, Quantity, Stretch
from selfmotion.constraints.base import Constraint
from selfmotion.robot import RobotModel, ToolRates

# What of the tool is limited, as [v, ω] and [dv/dt, dω/dt] have it, and in which units.
TOOL_RATES = (
    ("speed", "m/s"),
    ("turn rate", "rad/s"),
    ("acceleration", "m/s²"),
    ("turn acceleration", "rad/s²"),
)


@dataclass(frozen=True, eq=False)
class ToolLimits(Constraint):
    """The tool moves and turns no faster, and accelerates no more, than it may.

    All are as the arm's reference sees them, where it has one, and the verdict says so.
    What the path prescribes is the path's: a limit that it passes itself cannot be kept, and the
    verdict says by how much. What the task leaves free, such as turning, keeps the limits.

    Parameters
    ----------
    speed : float
        Of the tool frame's origin [m/s].
    turn_rate : float
        [rad/s].
    acceleration : float
        [m/s²].
    turn_acceleration : float
        [rad/s²].
    margin : float
        Share of each that is aimed to be left unused; at least half of it is.
    """

    speed: float = np.inf
    turn_rate: float = np.inf
    acceleration: float = np.inf
    turn_acceleration: float = np.inf
    margin: float = 5e-3

    def __post_init__(self) -> None:
        for (name, _), value in zip(TOOL_RATES, self._given, strict=True):
            if not (isinstance(value, float) and value == np.inf):
                as_number(value, f"tool limits: {name.replace(' ', '_')}", above=0.0)
        as_number(self.margin, "tool limits: margin", above=0.0, most=1.0)
        if not np.isfinite(self.limit).any():
            raise ProblemError(
                "tool limits: none is given, expected one of speed, turn_rate, acceleration and "
                "turn_acceleration"
            )

    @property
    def _given(self) -> tuple[float, float, float, float]:
        return self.speed, self.turn_rate, self.acceleration, self.turn_acceleration

    @property
    def limit(self) -> Array:
        """Speed, turn rate, acceleration and turn acceleration, (4,); inf where there is none."""
        return np.array(self._given, dtype=np.float64)

    def quantity(self, robot: RobotModel) -> Quantity:
        """See `Constraint.quantity`."""
        rates, tool = ToolRates(robot.chain), robot.tool
        limited = np.isfinite(self.limit)
        seen = "" if robot.reference is None else f" seen from '{robot.reference}'"

        def values(q: Array, qd: Array, qdd: Array) -> Array:
            return np.stack(rates(q, qd, qdd), axis=1).reshape(-1, 4, 3)

        def derivatives(q: Array, qd: Array, qdd: Array) -> tuple[Array, ...]:
            speeds, accelerations = rates.derivatives(q, qd, qdd)
            # A speed does not depend on q̈.
            pairs = zip((*speeds, np.zeros_like(speeds[0])), accelerations, strict=True)
            return tuple(np.stack(pair, axis=1).reshape(-1, 4, 3, robot.dof) for pair in pairs)

        def known(stretch: Stretch) -> Array:
            found = rates.series(stretch.chain())
            length = min(map(len, found))
            return np.stack([item[:length] for item in found])

        return Quantity(
            "tool limits",
            [
                Column(tool, f"{name} of the tool '{tool}'{seen}", unit, 1 if k < 2 else 2)
                for k, (name, unit) in enumerate(TOOL_RATES)
            ],
            values,
            derivatives,
            limit=self.limit,
            of_pace=True,
            series=known,
            components=3,
            covers=tuple(
                f"tool {name}{seen}"
                for (name, _), own in zip(TOOL_RATES, limited, strict=True)
                if own
            ),
        )
