"""Segments that end in a stop which is proved: clear of bodies, and within all quantities."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from selfmotion.realtime.commands import Commands
from selfmotion.realtime.moving_clearance import MovingClearance
from selfmotion.realtime.quantities import Quantities
from selfmotion.realtime.segment import Segment
from selfmotion.realtime.settings import GENTLER, GENTLEST, HARDER


class ProvedStop:
    """Brakes a segment as hard as its quantities allow, and proves it to its rest.

    Parameters
    ----------
    commands : Commands
    clearance : MovingClearance or None
    quantities : Quantities or None
    period : int
        Number of cycles between two steps.
    cycle : float
        Time between commands [s].
    """

    def __init__(
        self,
        commands: Commands,
        clearance: MovingClearance | None,
        quantities: Quantities | None,
        period: int,
        cycle: float,
    ) -> None:
        self._commands, self._clearance, self._quantities = commands, clearance, quantities
        self._period, self._cycle = period, cycle
        by_acceleration = quantities is not None and quantities.by_acceleration
        self._gentlest = GENTLEST if by_acceleration else 1.0
        self.reset()

    def reset(self) -> None:
        """Begin with the hardest braking; forget by how much limits have been exceeded."""
        # Deceleration, as a share of the limit.
        self._share = 1.0
        for proof in (self._clearance, self._quantities):
            if proof is not None:
                proof.forget()

    def proved(self, braked: Callable[[int, float], Segment], first: int) -> tuple[Segment, str]:
        """Return a segment, and why it is not proved: "" where it is.

        Parameters
        ----------
        braked : callable
            Returns the segment that brakes from a cycle on, by a share of the largest deceleration.
        first : int
            The last cycle from which on to brake.
        """
        segment, failure = self._within_quantities(braked, first)
        if not failure and self._clearance is not None:
            # The arm is expected at the command plus its present deviation.
            q = segment.q + self._commands.deviation
            times = segment.t - segment.t[0]
            failure = self._clearance.proof_failure(q, segment.travelled, times)
        return segment, failure

    def _within_quantities(
        self, braked: Callable[[int, float], Segment], first: int
    ) -> tuple[Segment, str]:
        """Return a segment that keeps all quantities, and why it is not proved, likewise.

        Where the braking is not proved, it is made gentler, and harder again at the next steps;
        where the path is not, it is followed for one period only.
        """
        share, shortest = self._share, min(first, self._period)
        segment = braked(first, share)
        if self._quantities is None:
            return segment, ""
        while unproved := self._quantities.unproved(segment, self._commands.deviation):
            time, has_time = unproved.time, bool(np.isfinite(unproved.time))
            if has_time and time >= first * self._cycle:
                if share <= self._gentlest:
                    return segment, unproved.reason
                share = max(GENTLER * share, self._gentlest)
            elif shortest * self._cycle <= time < np.inf and first > shortest:
                first = shortest
            else:
                if not has_time:
                    # A stop that takes too long was too gentle.
                    self._share = min(share / GENTLER, 1.0)
                return segment, unproved.reason
            segment = braked(first, share)
        self._share = min(HARDER * share, 1.0)
        return segment, ""
