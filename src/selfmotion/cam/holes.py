"""Holes that cycles of machines drill: down at the feed, and straight out again."""

from typing import NamedTuple

from selfmotion.basics import Array
from selfmotion.cam.cuts import Machine

# How fast the tool goes where it is in a hole that is there already [m/s], unless it cuts faster;
# and how far it stays off the bottom then, or comes back to break chips [m].
OUT = 0.05
_OFF = 5e-4
_PECKS = 10_000


class Pecks(NamedTuple):
    """How a deep hole is drilled: so far at once [m], and out in between, or only a little back."""

    first: float
    others: float
    is_out: bool


def drill(
    machine: Machine,
    above: Array,
    bottom: Array,
    axis: Array,
    *,
    pecks: Pecks | None = None,
    dwell: str = "",
    feeds_out: bool = False,
) -> None:
    """Drill a hole, which is a cut of its own: from a place above it to its bottom and back.

    Parameters
    ----------
    machine : Machine
        Whose line is read; its feed is that of the cut.
    above, bottom : (3,)
        Where the feed begins, and the bottom [m].
    axis : (3,)
        From the bottom to above it.
    pecks : Pecks, optional
    dwell : str
        What happens at the bottom, if anything.
    feeds_out : bool
        Whether it comes out at the feed, not faster.

    Raises
    ------
    FileFormatError
        The hole has no depth, or needs too many pecks.
    """
    depth = float((above - bottom) @ axis)
    if not depth > 0.0:
        raise machine.fault(
            f"the hole ends {-1e3 * depth:.4g} mm above where it begins, expected a depth"
        )
    machine.rapid(above, axis)
    feed = machine.feed
    out = feed if feeds_out or feed == 0.0 else max(feed, OUT)
    done = 0.0
    for reached in _depths(machine, depth, pecks):
        if done > 0.0 and pecks is not None and pecks.is_out:
            _go(machine, above, axis, out)
            _go(machine, above - max(0.0, done - _OFF) * axis, axis, out)
        elif done > 0.0:
            _go(machine, above - max(0.0, done - _OFF) * axis, axis, feed)
        _go(machine, above - reached * axis, axis, feed)
        done = reached
    if dwell:
        machine.happens(dwell)
    _go(machine, above, axis, out)
    # What follows is no part of the hole.
    machine.rapid(above, axis)


def _depths(machine: Machine, depth: float, pecks: Pecks | None) -> list[float]:
    """Return how deep it is after each peck."""
    if pecks is None:
        return [depth]
    if not min(pecks.first, pecks.others) > 0.0 or depth / pecks.others > _PECKS:
        raise machine.fault(
            f"drills by {1e3 * pecks.others:.4g} mm at once, expected a step above 0 (Q, STEP)"
        )
    found, here = list[float](), pecks.first
    while here < depth:
        found.append(here)
        here += pecks.others
    return [*found, depth]


def _go(machine: Machine, place: Array, axis: Array, feed: float) -> None:
    cutting, machine.feed = machine.feed, feed
    machine.cut(place, axis)
    machine.feed = cutting
