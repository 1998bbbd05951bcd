"""Run-ups: a path is made longer at both ends, so that the tool has its feed in between."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, PathError, shown
from selfmotion.model.path.base import Path
from selfmotion.model.path.feed import Feed
from selfmotion.model.path.joined import Joined
from selfmotion.model.path.shapes import Line
from selfmotion.model.task import SE3, exp3

# Attempts at the lengths of run-up and run-down …
_TRIES = 12
# … each longer than the last one lacked by this share.
_MORE = 0.02

# A line turns by less than that [rad].
_HALF_TURN = 3.1


class Stroke(NamedTuple):
    """A path at a feed with run-up and run-down.

    Attributes
    ----------
    path : Feed
        From rest to rest.
    begin, end : float
        Times of the given path's start and end [s]: in between the tool has the feed, wherever
        bends and corners allow.
    run_up, run_down : float
        Lengths of the run-up and the run-down [m].
    """

    path: Feed
    begin: float
    end: float
    run_up: float
    run_down: float


def with_run_ups(path: Feed) -> Stroke:
    """Return a path at a feed, extended at both ends by run-up and run-down.

    These continue the path's ends, straight, with a constant turn rate. They are as long as the
    feed's acceleration and smoothing need, so that the feed is required (`FeedProfile`) from the
    start of the path to its end.

    Raises
    ------
    PathError
        It is no `Feed`; the feed is not reached at its ends with run-ups of any length; or the path
        starts or ends without translation, or turning too fast. A feed that the path does not keep
        in between is accepted: it is refused when it is planned.
    """
    if not isinstance(path, Feed):
        raise PathError(f"run-ups: path is {shown(path)}, expected a Feed(path, feed)")
    original = path.original
    run_ups = np.array([path.feed**2 / path.limits["acceleration"]] * 2)
    for _ in range(_TRIES):
        longer, first, last = _lengthened(path, original, run_ups)
        begin, end = longer.when(np.array([first, last])).tolist()
        required = np.concatenate([item.path_times[item.required] for item in longer.feeds])
        if not len(required):
            run_ups *= 2.0
            continue
        missing = np.array([required.min() - begin, end - required.max()])
        if (missing <= 0.0).all():
            return Stroke(longer, begin, end, *run_ups.tolist())
        run_ups += path.feed * np.maximum(missing, 0.0) + _MORE * run_ups * (missing > 0.0)
        if len(path.feeds) == 1:
            # Both as long: the ends are symmetric in time.
            run_ups[:] = run_ups.max()
    raise PathError(
        f"run-ups: the feed of {path.feed:g} m/s is not reached at the ends of the path with "
        f"{run_ups[0]:.3g} m before it and {run_ups[1]:.3g} m after it; ask for a lower feed, or "
        f"larger accelerations"
    )


def _lengthened(path: Feed, original: Path, run_ups: Array) -> tuple[Feed, float, float]:
    """Return the feed along the longer path, and when that is at the given one's ends [s]."""
    before, after = (
        _run_up(original, time, run) for time, run in zip((0, -1), run_ups, strict=True)
    )
    first = before.duration
    longer = path.along(Joined([before, original, after]), first)
    return longer, first, first + original.duration


def _run_up(path: Path, end: int, length: float) -> Line:
    """Return the line on which the tool comes to the start of a path (0), or leaves its end.

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
