"""The highest feed at which all seams of a job are kept."""

from collections.abc import Callable
from math import floor, log10, sqrt
from typing import NamedTuple

from selfmotion.basics import (
    FeedError,
    PlanError,
    Progress,
    as_called,
    as_number,
    shown,
    silent,
)
from selfmotion.work.job.program import Program

# Feeds that are tried at most.
_TRIES = 30
# The slowest feed that is worth a motion [m/s].
_SLOWEST = 1e-3
# Significant digits of the feed that is returned.
_DIGITS = 3
# As fast as `Feed` allows [m/s].
FASTEST_FEED = 3.0


class FeedFound(NamedTuple):
    """The highest feed that was found, and what was tried for it.

    Attributes
    ----------
    feed : float
        [m/s]; of three digits.
    program : Program
        At that feed.
    refused : float
        The lowest feed that was tried and not kept [m/s]; inf where the highest allowed one is.
    why : str
        Why that one was not kept.
    """

    feed: float
    program: Program
    refused: float
    why: str


def highest_feed(
    plan_at: Callable[[float], Program],
    most: float = FASTEST_FEED,
    *,
    accuracy: float = 0.02,
    progress: Progress = silent,
) -> FeedFound:
    """Return the highest feed at which a job is verified, and its program.

    Feeds are tried from the highest down, by halves or by what a refusal says is possible, until
    one is kept; then between it and the lowest that is not, until these are as near as `accuracy`.
    A feed that is kept is taken for a sign that lower ones are as well.

    Parameters
    ----------
    plan_at : callable
        Feed [m/s] → program: `plan_job` with seams at that feed.
    most : float
        The highest feed that is tried [m/s].
    accuracy : float
        How near the feed that is found is to one that is not kept, as a share.
    progress : callable, optional
        Told what is tried: ``("feed", number, most)``.

    Raises
    ------
    PlanError
        No feed is kept; says what was wrong with the lowest.
    ProblemError
        An argument is not what it should be.
    """
    as_called(plan_at, "plan_at")
    as_called(progress, "progress")
    feed = as_number(most, "most", above=0.0, most=FASTEST_FEED)
    near = as_number(accuracy, "accuracy", above=0.0, most=1.0)
    best: Program | None = None
    low, high, why = 0.0, float("inf"), ""
    for number in range(_TRIES):
        progress("feed", number, _TRIES)
        possible = None
        try:
            program = plan_at(feed)
        except FeedError as error:
            verified, said, possible = False, str(error), error.possible
        except PlanError as error:
            verified, said = False, str(error)
        else:
            if not isinstance(program, Program):
                raise PlanError(f"plan_at returned {shown(program)}, expected a Program")
            verified = program.verified
            said = "" if verified else program.verdict
            if verified:
                best, low = program, feed
        if not verified:
            high, why = feed, said
        if best is not None and (low == most or high <= low * (1.0 + near)):
            break
        if best is not None:
            feed = _rounded(sqrt(low * high))
            if not low < feed < high:
                break
            continue
        feed = possible if possible is not None and possible < high else _rounded(0.5 * high)
        if feed < _SLOWEST:
            break
    if best is None:
        raise PlanError(f"no feed from {high:g} m/s on is kept: {why}")
    return FeedFound(low, best, high, why)


def _rounded(feed: float) -> float:
    """Return a feed of three digits that is no larger."""
    digits = _DIGITS - 1 - floor(log10(feed))
    return floor(feed * 10.0**digits * (1.0 + 1e-12)) * 10.0**-digits
