"""Checks of the feeds that a path asks for: that it keeps them, and that the tool may have them."""

from collections.abc import Sequence

from selfmotion.basics import FeedError
from selfmotion.model.path import FeedPossible, Path

# Share of a limit of the tool's speed that a recommended feed uses.
_FEED_SHARE = 0.98


def check_feeds(whose: str, paths: Sequence[Path], most: float) -> None:
    """Refuse feeds that paths do not keep by themselves, or that the tool may not have.

    A feed counts but for run-up, run-down and rounded corners; a motion that does not keep it there
    is never verified (`FeedProfile`). The arm is not involved.

    Parameters
    ----------
    whose : str
        Start of messages.
    paths : sequence of Path
        The paths, that of the tool first.
    most : float
        Limit of the tool's speed [m/s]; inf for none.

    Raises
    ------
    FeedError
        With the largest possible feed, and remedies for more.
    """
    for path in paths:
        for profile in path.feeds:
            if not profile.kept:
                possible = FeedPossible(profile)
                raise FeedError(
                    f"{whose}: {possible.text(path)}",
                    asked=profile.asked,
                    possible=possible.feed,
                    time=profile.time,
                )
    for profile in paths[0].feeds:
        # The speed along the path is a lower bound of the total speed.
        if (1.0 - profile.within) * profile.asked > most:
            feed = _FEED_SHARE * most
            raise FeedError(
                f"{whose}: the feed of {profile.asked:g} m/s is faster than the tool may be, "
                f"{most:g} m/s (ToolLimits): ask for {feed:.3g} m/s, or allow a larger speed",
                asked=profile.asked,
                possible=feed,
                time=profile.time,
            )
