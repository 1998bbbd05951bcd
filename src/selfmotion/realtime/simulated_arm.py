"""A simulated arm that follows its command late, and is measured badly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError, as_number
from selfmotion.realtime.segment import Segment


@dataclass(frozen=True)
class Plant:
    """Dynamics of a simulated arm.

    Attributes
    ----------
    lag : float
        Time constant with which each joint goes to its command [s].
    delay : float
        Time from a command to its effect [s].
    noise : float
        Standard deviation of measured positions [rad or m].
    """

    lag: float = 0.01
    delay: float = 2e-3
    noise: float = 5e-5

    def __post_init__(self) -> None:
        for name in ("lag", "delay", "noise"):
            as_number(getattr(self, name), f"plant: {name}", least=0.0)


class SimulatedArm:
    """Plays segments, cycle by cycle, as a controller would: the last one it was given.

    Parameters
    ----------
    q : (n,)
        Where it stands at first.
    cycle : float
        Time between commands [s].
    plant : Plant
    rng : Generator or int
        Source of the noise.

    Attributes
    ----------
    t : float
        Time [s].
    q : (n,)
        Where the arm is.
    pushed : (n,)
        External displacement from its command [rad or m]; to be set.
    commanded : list of (q, qd, qdd)
        All commands so far.
    """

    def __init__(
        self,
        q: Array,
        cycle: float,
        plant: Plant | None = None,
        rng: np.random.Generator | int = 0,
    ) -> None:
        self.t, self.q, self.cycle = 0.0, np.array(q, dtype=np.float64), cycle
        self._plant = plant or Plant()
        self._rng = np.random.default_rng(rng)
        self.pushed = np.zeros_like(self.q)
        self._moved = self.q.copy()
        self._waiting = [self.q.copy()] * (round(self._plant.delay / cycle) + 1)
        self._segment: Segment | None = None
        self.commanded: list[tuple[Array, Array, Array]] = []

    def write(self, segment: Segment) -> None:
        """Play this segment from now on."""
        self._segment = segment

    def measure(self) -> tuple[Array, Array]:
        """Return measured positions and velocities, (n,) each."""
        noise = self._plant.noise * self._rng.standard_normal(len(self.q))
        rate = np.zeros(len(self.q)) if not self.commanded else self.commanded[-1][1]
        return self.q + noise, np.array(rate)

    def run(self, seconds: float) -> None:
        """Let time pass.

        Raises
        ------
        ProblemError
            There is no segment to play.
        """
        if self._segment is None:
            raise ProblemError("the simulated arm has no segment to play; write one first")
        share = 1.0 if self._plant.lag == 0.0 else 1.0 - np.exp(-self.cycle / self._plant.lag)
        for _ in range(round(seconds / self.cycle)):
            self.t += self.cycle
            segment = self._segment
            k = segment.index(self.t)
            self.commanded.append((segment.q[k], segment.qd[k], segment.qdd[k]))
            self._waiting = [*self._waiting[1:], segment.q[k]]
            self._moved += share * (self._waiting[0] - self._moved)
            self.q = self._moved + self.pushed
