"""Limits of how fast the tool moves and accelerates."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, as_number
from selfmotion.certificate import TOOL_RATES, ToolMotion, tool_sizes
from selfmotion.constraints.base import Constraint, NodeTangents, motion_at_nodes
from selfmotion.costs import Samples
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel, ToolRates


@dataclass(frozen=True, eq=False)
class ToolLimits(Constraint):
    """The tool moves and turns no faster, and accelerates no more, than it may.

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

    def bind(self, follows: Follows, start: Array, end: Array) -> "BoundToolLimits":
        """See `Constraint.bind`."""
        robot = follows.robot
        return BoundToolLimits(ToolRates(robot), robot.tool, self.limit, self.margin)

    def requirement(self, robot: RobotModel) -> ToolMotion:
        """See `Constraint.requirement`."""
        return ToolMotion(robot, self.limit)


@dataclass(frozen=True, eq=False)
class BoundToolLimits:
    """h = |x|² / limit² - (1 - margin)² for those of v, ω, dv/dt and dω/dt that have a limit."""

    rates: ToolRates
    tool: str
    limit: Array
    margin: float
    name: str = "tool limits"
    equality = False

    @property
    def tolerance(self) -> float:
        """See `BoundConstraint.tolerance`: half the margin is left."""
        return (1.0 - 0.5 * self.margin) ** 2 - (1.0 - self.margin) ** 2

    @property
    def _limited(self) -> npt.NDArray[np.intp]:
        return np.flatnonzero(np.isfinite(self.limit))

    def residual(self, samples: Samples) -> Array:
        """See `BoundConstraint.residual`."""
        shares = tool_sizes(self.rates, *motion_at_nodes(samples)) / self.limit**2
        return np.asarray(shares[:, self._limited] - (1.0 - self.margin) ** 2)

    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        """See `BoundConstraint.tangents`."""
        state = motion_at_nodes(samples)
        values, changes = self.rates(*state), self.rates.derivatives(*state)
        found = []
        for value, by in zip(values, changes, strict=True):
            of = (motion.of_order(order) for order in range(3))
            tangent = sum(
                np.einsum("kcj,kjd->kcd", part, x) for part, x in zip(by, of, strict=False)
            )
            each = 2.0 * value[:, :, None] * np.asarray(tangent)
            found += [each[:, :3].sum(axis=1), each[:, 3:].sum(axis=1)]
        scaled = np.stack(found, axis=1) / (self.limit**2)[:, None]
        return np.asarray(scaled[:, self._limited])

    def easing(self, column: int) -> tuple[float, str]:
        """See `easing_of`: 2 % of a limit."""
        name = TOOL_RATES[self._limited[column]][0]
        return 0.04, f"2 % more {name} for the tool"

    def describe(self, samples: Samples, row: int, column: int) -> str:
        """See `BoundConstraint.describe`."""
        which = int(self._limited[column])
        state = (part[row : row + 1] for part in motion_at_nodes(samples))
        reached = tool_sizes(self.rates, *state)[0, which] ** 0.5
        name, unit = TOOL_RATES[which]
        return (
            f"the tool '{self.tool}' has a {name} of {reached:.4g} {unit} at t = "
            f"{samples.sampling.node_times[row]:.3f} s, limit {self.limit[which]:.4g}"
        )
