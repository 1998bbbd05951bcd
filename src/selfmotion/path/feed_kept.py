"""How well a path at a feed keeps it: what was asked, what is reached, and what holds it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Flags


@dataclass(frozen=True)
class FeedKept:
    """What a `Feed` makes of the feed that was asked for.

    Stretches count but for run-up and run-down, rounded corners, and turning on the spot.

    Attributes
    ----------
    asked : float
        [m/s].
    within : float
        What may be missing of it, as a share.
    reached : float
        The largest speed [m/s].
    slowest : float
        The smallest speed where it counts [m/s]; where nothing does, the largest one.
    time : float
        When that is [s].
    slower : float
        For how long the tool is too slow where it counts [s].
    held_by : str
        What holds it there.
    """

    asked: float
    within: float
    reached: float
    slowest: float
    time: float
    slower: float
    held_by: str

    @classmethod
    def of(
        cls,
        asked: float,
        within: float,
        t: Array,
        speeds: Array,
        causes: Sequence[str],
        here: Flags,
        counts: Flags,
    ) -> "FeedKept":
        """Return how well a feed is kept.

        Parameters
        ----------
        asked, within : float
        t, speeds : (K,)
            Times [s], and how fast the tool is then [m/s].
        causes : sequence of str
            What holds it at each time.
        here, counts : (K,)
            When this feed is asked for, and when a feed counts.
        """
        fastest = float(np.max(speeds[here]))
        counted = counts & here
        if not counted.any():
            # Too short to run up and down.
            at = float(t[int(np.argmax(np.where(here, speeds, -np.inf)))])
            return cls(asked, within, fastest, fastest, at, 0.0, "run-up and run-down")
        slow = (speeds < (1.0 - within) * asked) & counted
        worst = int(np.argmin(np.where(counted, speeds, np.inf)))
        lasts = float(np.gradient(t) @ slow)
        return cls(
            asked, within, fastest, float(speeds[worst]), float(t[worst]), lasts, causes[worst]
        )

    @property
    def kept(self) -> bool:
        """Whether the feed is kept where it counts, and reached at all."""
        return self.slowest >= (1.0 - self.within) * self.asked

    @property
    def left_over(self) -> float:
        """How much faster or slower than the path the tool may be where the feed counts [m/s]."""
        most = max((1.0 + self.within) * self.asked, self.reached)
        return max(min(most - self.reached, self.slowest - (1.0 - self.within) * self.asked), 0.0)

    def later(self, seconds: float) -> "FeedKept":
        """Return the same, begun later."""
        return replace(self, time=self.time + seconds)
