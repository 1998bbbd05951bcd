"""Tool motions one after the other, with waits in between, and with run-ups to a feed."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, Ints, PathError, as_number, read_only, restore, series, shown
from selfmotion.model.path.base import (
    REST_SPEED,
    Path,
    PathSamples,
    PathSeries,
    check_duration,
    check_path,
    check_vector,
    path_pose,
    path_series,
    turning,
)
from selfmotion.model.path.feed import Feed
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.path.shapes import Line
from selfmotion.model.task import SE3, exp3, log3

# Largest gap between consecutive paths [m, rad].
_GAP = 1e-6


@dataclass(frozen=True, eq=False)
class Dwell(Path, kind="dwell"):
    """The tool stays where it is.

    Parameters
    ----------
    at : SE3 or (4, 4)
        Where [m], world axes.
    duration : float
        How long [s].
    """

    at: SE3
    duration: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", path_pose(self.at, "dwell: at"))
        object.__setattr__(self, "duration", check_duration(self.duration))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        count = len(t)
        return PathSamples(
            t,
            np.tile(self.at.translation, (count, 1)),
            np.tile(self.at.rotation, (count, 1, 1)),
            np.zeros((count, 6)),
        )

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        return turning(np.zeros((series.LENGTH, len(middle))))


def with_leads(
    path: Path, length: float, duration: float, *, axis: npt.ArrayLike = (0.0, 0.0, -1.0)
) -> Joined:
    """Return a path with a straight lead-in and lead-out, each from rest to rest.

    Parameters
    ----------
    path : Path
        Starts and ends at rest.
    length : float
        Of each lead [m].
    duration : float
        Of each lead [s].
    axis : (3,)
        Where from and where to, in tool axes at that end: by default back along the tool's z axis.

    Raises
    ------
    PathError
        A number is not above 0, the axis is zero, or the path does not rest at an end.
    """
    check_path(path, "lead: path")
    duration = as_number(duration, "lead: duration", above=0.0, error=PathError)
    length = as_number(length, "lead: length", above=0.0, error=PathError)
    away = check_vector(axis, "lead: axis")
    if not np.any(away):
        raise PathError("lead: axis is zero, expected a direction")
    back = SE3(np.eye(3), length * away / np.linalg.norm(away))
    first, last = path.pose(0.0), path.pose(path.duration)
    lead_in, lead_out = Line(first * back, first, duration), Line(last, last * back, duration)
    return Joined([lead_in, path, lead_out])


class Joined(Path, kind="joined"):
    """Paths one after the other; ``first + second`` makes one.

    Parameters
    ----------
    pieces : sequence of Path
        Each starts at the end of the one before, in pose and speed.

    Raises
    ------
    PathError
        There is no piece, or the tool would jump from one to the next; says by how much.
    """

    def __init__(self, pieces: Sequence[Path]) -> None:
        if not isinstance(pieces, Iterable):
            raise PathError(f"joined path: pieces is {shown(pieces)}, expected a list of paths")
        pieces = [check_path(piece, "joined path: a piece") for piece in pieces]
        flat = [
            part for one in pieces for part in (one.pieces if isinstance(one, Joined) else [one])
        ]
        if not flat:
            raise PathError("joined path: has no pieces, expected at least one")
        self.pieces: tuple[Path, ...] = tuple(flat)
        self._ends = np.cumsum([piece.duration for piece in flat])
        self.duration = float(self._ends[-1])
        for number, (one, other) in enumerate(itertools.pairwise(flat), 1):
            _check_continuous(one, other, number)

    @property
    def notes(self) -> tuple[str, ...]:
        """See `Path.notes`: those of all pieces as well."""
        inner = (note for piece in self.pieces for note in piece.notes)
        return tuple(dict.fromkeys((*inner, *super().notes)))

    @property
    def oriented(self) -> bool:
        """See `Path.oriented`: as all pieces."""
        return all(piece.oriented for piece in self.pieces)

    @property
    def knots(self) -> Array:
        """See `Path.knots`: those of the pieces, and where they meet."""
        return self._all([piece.knots for piece in self.pieces])

    @property
    @override
    def marks(self) -> Array:
        return self._all([piece.marks for piece in self.pieces])

    def _all(self, times: list[Array]) -> Array:
        starts = self._ends - [piece.duration for piece in self.pieces]
        inner = [part[:-1] + start for part, start in zip(times, starts, strict=True)]
        return read_only([*np.concatenate(inner), self.duration])

    @property
    def rounded(self) -> Array:
        """See `Path.rounded`: those of all pieces."""
        starts = self._ends - [piece.duration for piece in self.pieces]
        pairs = zip(self.pieces, starts.tolist(), strict=True)
        return read_only(np.concatenate([piece.rounded + start for piece, start in pairs]))

    @property
    def feeds(self) -> tuple[FeedProfile, ...]:
        """See `Path.feeds`: those of all pieces."""
        starts = self._ends - [piece.duration for piece in self.pieces]
        pairs = zip(self.pieces, starts.tolist(), strict=True)
        return tuple(item.later(start) for piece, start in pairs for item in piece.feeds)

    @override
    def evaluate(self, t: Array) -> PathSamples:
        which = self._which(t)
        translation, rotation = np.empty((len(t), 3)), np.empty((len(t), 3, 3))
        twist = np.empty((len(t), 6))
        for number, piece in enumerate(self.pieces):
            here = which == number
            if not np.any(here):
                continue
            own = t[here] - (self._ends[number] - piece.duration)
            part = piece.samples(np.clip(own, 0.0, piece.duration))
            translation[here], rotation[here] = part.translation, part.rotation
            twist[here] = part.twist
        return PathSamples(t, translation, rotation, twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        which = self._which(middle)
        found = turning(np.zeros((series.LENGTH, len(middle))))
        for number in np.unique(which):
            here, piece = which == number, self.pieces[number]
            own = middle[here] - (self._ends[number] - piece.duration)
            known = path_series(piece, own, half[here])
            if known is None:
                return None
            for whole, part in zip(found, known, strict=True):
                whole[:, here] = part
        return found

    def _which(self, t: Array) -> Ints:
        """Return the pieces of times (K,)."""
        later = np.searchsorted(self._ends, t, side="right")
        return np.minimum(later, len(self.pieces) - 1)

    @override
    def to_dict(self) -> dict[str, Any]:
        return {"kind": self.kind, "pieces": [piece.to_dict() for piece in self.pieces]}

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Joined:
        return cls([restore(Path, piece) for piece in values["pieces"]])


def _check_continuous(one: Path, other: Path, number: int) -> None:
    end, start = one.pose(one.duration), other.pose(0.0)
    apart = float(np.linalg.norm(start.translation - end.translation))
    turned = float(np.linalg.norm(log3(end.rotation.T @ start.rotation)))
    where = f"joined path: piece {number + 1} begins"
    if apart > _GAP or turned > _GAP:
        raise PathError(
            f"{where} {apart:.3g} m and {turned:.3g} rad from where piece {number} ends; put a "
            f"Line between them"
        )
    jump = float(np.abs(other.twist(0.0) - one.twist(one.duration)).max())
    if jump > REST_SPEED:
        raise PathError(
            f"{where} {jump:.3g} m/s or rad/s faster or slower than piece {number} ends; let both "
            f"rest there (time_law='minimum_jerk', section_at_rest)"
        )


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
    feed's acceleration and smoothing need, so that the feed counts (`FeedProfile`), and is judged,
    from the start of the path to its end.

    Raises
    ------
    PathError
        It is no `Feed`; the feed does not count at its ends with run-ups of any length; or the path
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
        counted = np.concatenate([item.path_times[item.required] for item in longer.feeds])
        if not len(counted):
            run_ups *= 2.0
            continue
        missing = np.array([counted.min() - begin, end - counted.max()])
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
    whole = Joined([before, original, after])
    first = before.duration
    return path.along(whole, first), first, first + original.duration


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
