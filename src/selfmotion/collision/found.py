"""What a collision model finds, with the names of the bodies."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Closest:
    """The smallest distance found, and where.

    Attributes
    ----------
    value : float
        [m]; negative when the two overlap, inf when there is no pair to check.
    first, second : str
        The two links, or link and obstacle; empty when there is no pair.
    index : int
        Row of the samples it was found in.
    """

    value: float
    first: str
    second: str
    index: int = 0


def how_near(distance: float, digits: int = 2) -> str:
    """Return in words how far two bodies are apart [m], or how deep one is in the other."""
    length = f"{abs(distance) * 1e3:.{digits}f} mm"
    return f"are {length} apart" if distance >= 0.0 else f"overlap by {length}"


@dataclass(frozen=True)
class Overlap:
    """Two links that overlap in half or more of 500 sampled configurations.

    Attributes
    ----------
    first, second : str
        The links.
    share : float
        In how many of the configurations.
    is_checked : bool
        False for those that overlap in each, or are known to touch as they are made: they are left
        out. Of links of several pieces, others may still be checked.
    """

    first: str
    second: str
    share: float
    is_checked: bool

    @property
    def remedy(self) -> str:
        """In how many configurations, and what to do where that is how they are made."""
        return (
            f"these links overlap in {100 * self.share:.0f} % of all configurations: if that is "
            f"how they are made, give srdf= a file with {srdf_line(self.first, self.second)}"
        )


def srdf_line(first: str, second: str) -> str:
    """Return the line of an SRDF that leaves a pair of links out."""
    return f'<disable_collisions link1="{first}" link2="{second}" reason="Default"/>'
