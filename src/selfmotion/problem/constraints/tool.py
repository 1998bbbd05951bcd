"""Limits of the tool: how fast it moves and accelerates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_number
from selfmotion.certificate import Column, MotionSegments, Quantity
from selfmotion.model.robot import RobotModel, ToolRates
from selfmotion.problem.constraints.base import Constraint, Envelope

# Limit of the tool's speed that no arm has [m/s].
_FASTEST_TOOL = 50.0
# Limited rates of the tool, as in [v, ω] and [dv/dt, dω/dt], and their units.
TOOL_RATES = (
    ("speed", "m/s"),
    ("turn rate", "rad/s"),
    ("acceleration", "m/s²"),
    ("turn acceleration", "rad/s²"),
)


@dataclass(frozen=True, eq=False)
class ToolLimits(Constraint):
    """The tool moves and turns no faster, and accelerates no more, than it may.

    All are relative to the arm's reference, if it has one, and the verdict says so. Rows that the
    task prescribes are the path's: a limit that the path itself exceeds cannot be kept, and the
    verdict says by how much. Free rows, such as rotation about an axis, keep the limits.

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
    margin: float = 1e-3

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

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return replace(Envelope.unbounded(robot.dof), tool_speed=self.speed)

    @override
    def for_controller(self, *, lines: bool = False) -> Constraint | None:
        if not lines:
            return self
        return replace(self, acceleration=np.inf, turn_acceleration=np.inf)

    @override
    def remarks(self, robot: RobotModel) -> tuple[str, ...]:
        if not _FASTEST_TOOL < self.speed < np.inf:
            return ()
        return (f"ToolLimits: a speed of {self.speed:g} m/s is no limit; in mm/s? speed_mm",)

    @property
    def _given(self) -> tuple[float, float, float, float]:
        return self.speed, self.turn_rate, self.acceleration, self.turn_acceleration

    @property
    def limit(self) -> Array:
        """Speed, turn rate, acceleration and turn acceleration, (4,); inf for none."""
        return np.array(self._given, dtype=np.float64)

    @override
    def quantity(self, robot: RobotModel) -> Quantity:
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

        def known(segments: MotionSegments) -> Array:
            found = rates.series(segments.chain())
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
