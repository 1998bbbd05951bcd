"""Tool motions one after the other, with waits in between, and with straight leads."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

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
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.path.shapes import Line
from selfmotion.model.task import SE3, log3

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
        flat = list[Path]()
        for piece in pieces:
            flat += piece.pieces if isinstance(piece, Joined) else [piece]
        if not flat:
            raise PathError("joined path: has no pieces, expected at least one")
        self.pieces: tuple[Path, ...] = tuple(flat)
        durations = [piece.duration for piece in flat]
        self._ends = np.cumsum(durations)
        self._starts: list[float] = (self._ends - durations).tolist()
        self.duration = float(self._ends[-1])
        for number, (one, other) in enumerate(itertools.pairwise(flat), 1):
            _check_continuous(one, other, number)

    @property
    @override
    def notes(self) -> tuple[str, ...]:
        """Those of all pieces as well."""
        inner = (note for piece in self.pieces for note in piece.notes)
        return tuple(dict.fromkeys((*inner, *super().notes)))

    @property
    @override
    def oriented(self) -> bool:
        """As all pieces."""
        return all(piece.oriented for piece in self.pieces)

    @property
    @override
    def knots(self) -> Array:
        """Those of the pieces, and where they meet."""
        return self._merged([piece.knots for piece in self.pieces])

    @property
    @override
    def marks(self) -> Array:
        return self._merged([piece.marks for piece in self.pieces])

    def _merged(self, times: list[Array]) -> Array:
        """Return times of each piece, from its start to its end, as those of the whole."""
        inner = [part[:-1] + start for part, start in zip(times, self._starts, strict=True)]
        return read_only([*np.concatenate(inner), self.duration])

    @property
    @override
    def rounded(self) -> Array:
        """Those of all pieces."""
        pairs = zip(self.pieces, self._starts, strict=True)
        return read_only(np.concatenate([piece.rounded + start for piece, start in pairs]))

    @property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        """Those of all pieces."""
        pairs = zip(self.pieces, self._starts, strict=True)
        return tuple(feed.later(start) for piece, start in pairs for feed in piece.feeds)

    @override
    def evaluate(self, t: Array) -> PathSamples:
        numbers = self._numbers(t)
        translation, rotation = np.empty((len(t), 3)), np.empty((len(t), 3, 3))
        twist = np.empty((len(t), 6))
        for number, piece in enumerate(self.pieces):
            here = numbers == number
            if not np.any(here):
                continue
            part = piece.samples(np.clip(t[here] - self._starts[number], 0.0, piece.duration))
            translation[here], rotation[here] = part.translation, part.rotation
            twist[here] = part.twist
        return PathSamples(t, translation, rotation, twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        numbers = self._numbers(middle)
        whole = turning(np.zeros((series.LENGTH, len(middle))))
        for number in np.unique(numbers):
            here = numbers == number
            part = path_series(self.pieces[number], middle[here] - self._starts[number], half[here])
            if part is None:
                return None
            for bounds, bounds_of_part in zip(whole, part, strict=True):
                bounds[:, here] = bounds_of_part
        return whole

    def _numbers(self, t: Array) -> Ints:
        """Return the number of the piece at each time, (K,)."""
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
    """Raise PathError where a piece does not begin as the one before, of this number, ends."""
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
