"""The feed that was asked for, and the one that is reached."""

from dataclasses import dataclass

from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.path import FeedKept


@dataclass(frozen=True)
class FeedReached(Requirement):
    """The tool keeps its feed; where it is on its path, that is a matter of the path alone.

    Attributes
    ----------
    found : FeedKept
    """

    found: FeedKept
    name: str = "feed"

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the slowest speed where the feed counts."""
        found = self.found
        text = f"the feed of {found.asked:g} m/s is reached up to {found.reached:.4g} m/s"
        if not found.kept:
            slow = f"for {found.slower:.3g} s, " if found.slower else ""
            text = (
                f"{text}, but {slow}at t = {found.time:.3f} s it is {found.slowest:.4g} m/s, held "
                f"by {found.held_by}: ask for {_rounded_down(found.slowest):g} m/s, or allow it "
                f"more (within=)"
            )
        least = (1.0 - found.within) * found.asked
        return Finding(self.name, "path", found.time, found.slowest, least, found.kept, text)


def _rounded_down(speed: float) -> float:
    """Return a number of two digits that is no larger."""
    digits = f"{speed:.1e}"
    least = float(digits)
    if least <= speed:
        return least
    head, power = digits.split("e")
    return float(f"{float(head) - 0.1:.1f}e{power}")
