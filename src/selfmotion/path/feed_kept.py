"""How well a path at a feed keeps it: what was asked, what is reached, and what holds it."""

from dataclasses import dataclass, replace


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
