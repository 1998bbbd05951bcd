"""Strokes that keep their feed from their begin to their end: run-up and run-down are outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, PathError, shown
from selfmotion.path.base import Path
from selfmotion.path.feed import Feed
from selfmotion.path.joined import Joined
from selfmotion.path.shapes import Line
from selfmotion.task import SE3, exp3

# Ways are looked for so often, and a little longer than the last one lacked [of its length].
_TRIES, _MORE = 12, 0.02

# A line turns by less than that [rad].
_HALF_TURN = 3.1


class Stroke(NamedTuple):
    """A path at a feed with what is put before and after it.

    Attributes
    ----------
    path : Feed
        From rest to rest.
    begin, end : float
        When the tool is at the begin and at the end of what was given [s]: in between it is at the
        feed, wherever bends and corners allow.
    run_up, run_down : float
        How long the ways before and after are [m].
    """

    path: Feed
    begin: float
    end: float
    run_up: float
    run_down: float


def with_run_ups(path: Feed) -> Stroke:
    """Return a path at a feed, made longer at both ends by what it takes to run up and down.

    The ways go on as the path begins and ends, straight, turning evenly where it turns. They are
    as long as the acceleration of the feed and its smoothing ask for, so that the feed counts
    (`FeedKept`), and is judged, from the begin of the path to its end.

    Raises
    ------
    PathError
        It is no `Feed`; the feed does not count at its ends, however long the ways are; or the path
        begins or ends on the spot, or turning too fast. A feed that the path does not keep in
        between is none of this: it is refused when it is planned.
    """
    if not isinstance(path, Feed):
        raise PathError(f"run-ups: path is {shown(path)}, expected a Feed(path, feed)")
    original = path.original
    ways = np.array([path.feed**2 / path.limits["acceleration"]] * 2)
    for _ in range(_TRIES):
        longer, first, last = _lengthened(path, original, ways)
        begin, end = longer.when(np.array([first, last])).tolist()
        counted = np.concatenate([found.own[found.counts] for found in longer.feeds])
        if not len(counted):
            ways *= 2.0
            continue
        missing = np.array([counted.min() - begin, end - counted.max()])
        if (missing <= 0.0).all():
            return Stroke(longer, begin, end, *ways.tolist())
        ways += path.feed * np.maximum(missing, 0.0) + _MORE * ways * (missing > 0.0)
        if len(path.feeds) == 1:
            # Both as long, so that what happens at the ends is on time either way.
            ways[:] = ways.max()
    raise PathError(
        f"run-ups: the feed of {path.feed:g} m/s is not reached at the ends of the path with "
        f"{ways[0]:.3g} m before it and {ways[1]:.3g} m after it; ask for a lower feed, or larger "
        f"accelerations"
    )


def _lengthened(path: Feed, original: Path, ways: Array) -> tuple[Feed, float, float]:
    """Return the feed along the longer path, and when that is at the given one's ends [s]."""
    before, after = (_way(original, time, way) for time, way in zip((0, -1), ways, strict=True))
    whole = Joined([before, original, after])
    first = before.duration
    return path.along(whole, first), first, first + original.duration


def _way(path: Path, end: int, length: float) -> Line:
    """Return the line on which the tool comes to the begin of a path (0), or goes on from its end.

    At the speed of the path, turning on as it turns.
    """
    time = path.duration if end else 0.0
    pose, twist = path.pose(time), path.twist(time)
    speed = float(np.linalg.norm(twist[:3]))
    if speed == 0.0:
        raise PathError("run-ups: the path begins or ends on the spot, expected a direction")
    seconds = length / speed * (1.0 if end else -1.0)
    turned = abs(seconds) * float(np.linalg.norm(twist[3:]))
    if turned > _HALF_TURN:
        raise PathError(
            f"run-ups: going on as the path {'ends' if end else 'begins'} the tool turns by "
            f"{turned:.2g} rad on {length:.3g} m; let it turn less there, or ask for a lower feed"
        )
    other = SE3(exp3(seconds * twist[3:]) @ pose.rotation, pose.translation + seconds * twist[:3])
    both = (pose, other) if end else (other, pose)
    return Line(*both, abs(seconds), time_law="constant")
