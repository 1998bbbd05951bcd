"""Speeds and accelerations of the tool at all times."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.certificate.shares import largest_share, too_far
from selfmotion.robot import RobotModel, ToolRates

# What of the tool is limited, as [v, ω] and [dv/dt, dω/dt] have it, and in which units.
TOOL_RATES = (
    ("speed", "m/s"),
    ("turn rate", "rad/s"),
    ("acceleration", "m/s²"),
    ("turn acceleration", "rad/s²"),
)


@dataclass(frozen=True, eq=False)
class ToolMotion(Requirement):
    """|v|, |ω|, |dv/dt| and |dω/dt| of the tool stay below limits, at all times.

    Attributes
    ----------
    robot : RobotModel
    limit : (4,)
        [m/s, rad/s, m/s², rad/s²]; inf where there is none.
    """

    robot: RobotModel
    limit: Array
    name: str = "tool limits"

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", read_only(self.limit))

    @property
    def covers(self) -> tuple[str, ...]:
        """See `Requirement.covers`."""
        pairs = zip(TOOL_RATES, self.limit, strict=True)
        return tuple(f"tool {name}" for (name, _), limit in pairs if np.isfinite(limit))

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the largest share of a limit."""
        rates = ToolRates(self.robot)
        worst = largest_share(
            motion.trajectory, lambda *state: tool_sizes(rates, *state) / self.limit**2
        )
        if worst is None:
            return too_far(self.name, motion)
        share = worst.share**0.5
        (what, unit), limit = TOOL_RATES[worst.column], self.limit[worst.column]
        slower = share if worst.column < 2 else share**0.5
        size = share * limit if share > 0.0 else 0.0  # there may be no limit on what is 0
        text = (
            f"the tool '{self.robot.tool}' has a {what} of {size:.4g} {unit} at t = "
            f"{worst.time:.3f} s, {share:.5g} times its limit: give it {slower:.5g} times the "
            f"duration"
        )
        kept = bool(share <= 1.0)
        return Finding(self.name, self.robot.tool, worst.time, share, 1.0, kept, text)


def tool_sizes(rates: ToolRates, q: Array, qd: Array, qdd: Array) -> Array:
    """Return |v|², |ω|², |dv/dt|² and |dω/dt|² for a motion (K, n) each, (K, 4)."""
    parts = np.stack(rates(q, qd, qdd), axis=1).reshape(-1, 4, 3)
    return np.asarray(np.sum(parts**2, axis=2))
