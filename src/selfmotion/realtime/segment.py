"""Segments: the commands of the next moments, with a state for each cycle."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, read_only


class Flag(Enum):
    """How a segment follows the path, from the best to the last resort."""

    PLANNED = "planned"
    KEPT = "kept"
    TRACKING = "tracking"
    STOPPING = "stopping"

    @property
    def message(self) -> str:
        """Its meaning."""
        return _MESSAGES[self]


_MESSAGES = {
    Flag.PLANNED: "planned from where the arm is",
    Flag.KEPT: "the rest of the last plan",
    Flag.TRACKING: "the tool is tracked without a plan of the self-motion",
    Flag.STOPPING: "the arm is brought to rest",
}


@dataclass(frozen=True, eq=False)
class Segment:
    """The commanded motion from a step on, one sample for each control cycle.

    It goes on where the segment before is at its first sample, with the same position, velocity
    and acceleration, and keeps the limits at all times. It covers more than one period: when the
    next one is late, the rest of this one is commanded, which follows the path for a while and
    then brings the arm to rest. At its end the arm rests.

    Attributes
    ----------
    t : (M,)
        Times [s].
    q, qd, qdd : (M, n)
        Positions, velocities and accelerations [rad or m, and per s, per s²].
    flag : Flag
        How it follows the path.
    reasons : tuple of str
        Causes of an unusual segment, and observations; empty for none.
    follows : bool
        Whether the tool moves as planned: not with joints at their limits.
    tool_error : (2,)
        Distance of the tool from the path at the segment's start, by the measured state [m, rad]:
        from where the path was `delay` ago.
    delay : float
        By how much the tool is late on its path at the segment's start [s].
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    flag: Flag
    reasons: tuple[str, ...]
    follows: bool
    tool_error: Array
    delay: float

    def __post_init__(self) -> None:
        for name in ("t", "q", "qd", "qdd", "tool_error"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def travelled(self) -> Array:
        """Upper bounds of the path lengths of joints from the first sample on, (K, n).

        Between samples q̇ is quadratic, and nowhere larger than the largest of its control points
        q̇, q̇ + ½ h q̈ and the next q̇.
        """
        h = float(self.t[1] - self.t[0])
        before, after = self.qd[:-1], self.qd[1:]
        fastest = np.max(np.abs([before, before + 0.5 * h * self.qdd[:-1], after]), axis=0)
        return np.vstack([np.zeros(self.q.shape[1]), np.cumsum(h * fastest, axis=0)])

    def index(self, t: npt.ArrayLike) -> int:
        """Return the sample to command at a time [s]: the last one from the end on."""
        step = self.t[1] - self.t[0]
        last = len(self.t) - 1
        return min(max(round((float(t) - float(self.t[0])) / float(step)), 0), last)  # type: ignore[arg-type]
