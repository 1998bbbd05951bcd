"""Feeds that no motion has, whatever the arm: told before anything is planned."""

from collections.abc import Sequence

from selfmotion.basics import FeedError
from selfmotion.constraints import Constraint, ToolLimits
from selfmotion.path import FeedPossible, Path

# What is left of a limit of the tool's speed where a feed is named by it.
_BELOW = 0.98


def check_feeds(whose: str, paths: Sequence[Path], constraints: Sequence[Constraint]) -> None:
    """Refuse feeds that paths do not keep by themselves, or that the tool may not have.

    A feed counts but for run-up, run-down and rounded corners; a motion that does not keep it there
    is never verified (`FeedKept`). Nothing of the arm is asked here.

    Parameters
    ----------
    whose : str
        What messages begin with.
    paths : sequence of Path
        Those that are followed, that of the tool first.
    constraints : sequence of Constraint

    Raises
    ------
    FeedError
        It says which feed is possible, and what would allow more.
    """
    for path in paths:
        for found in path.feeds:
            if not found.kept:
                possible = FeedPossible(found)
                raise FeedError(
                    f"{whose}: {possible.text(path)}",
                    asked=found.asked,
                    possible=possible.feed,
                    time=found.time,
                )
    most = min((item.speed for item in constraints if isinstance(item, ToolLimits)), default=None)
    for found in paths[0].feeds:
        # What is as fast along the path as it has to be is at least as fast altogether.
        if most is not None and (1.0 - found.within) * found.asked > most:
            feed = _BELOW * most
            raise FeedError(
                f"{whose}: the feed of {found.asked:g} m/s is faster than the tool may be, "
                f"{most:g} m/s (ToolLimits): ask for {feed:.3g} m/s, or allow a larger speed",
                asked=found.asked,
                possible=feed,
                time=found.time,
            )
