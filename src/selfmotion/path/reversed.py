"""A tool motion the other way round."""

from __future__ import annotations

from typing import Any

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.path.base import (
    Path,
    PathSamples,
    PathSeries,
    _Derived,
    check_path,
    path_series,
)
from selfmotion.path.feed_kept import FeedKept


class Reversed(_Derived, kind="reversed"):
    """A tool motion from its end to its start, as fast as from its start to its end.

    Parameters
    ----------
    path : Path
        The motion that is reversed.

    Raises
    ------
    PathError
        It is no path.
    """

    def __init__(self, path: Path) -> None:
        self._path = check_path(path, "reversed")
        self.duration = path.duration

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        return self._mirrored(self._path.knots)

    @property
    def marks(self) -> Array:
        """See `Path.marks`."""
        return self._mirrored(self._path.marks)

    @property
    def rounded(self) -> Array:
        """See `Path.rounded`."""
        return read_only(self.duration - self._path.rounded[::-1, ::-1])

    @property
    def feeds(self) -> tuple[FeedKept, ...]:
        """See `Path.feeds`."""
        return tuple(item.timed(lambda t: self.duration - t) for item in self._path.feeds)

    def at_constant_speed(self) -> Reversed:
        """See `Path.at_constant_speed`: as the original."""
        return Reversed(self._path.at_constant_speed())

    def when(self, wanted: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]."""
        return self.duration - wanted

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        sigma = np.clip(self.duration - t, 0.0, self.duration)
        return self._at_pace(t, sigma, -np.ones_like(t))

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`: bounds of derivatives do not see which way time goes."""
        return path_series(self._path, self.duration - middle, half)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        return {"kind": self.kind, "path": self._path.to_dict()}

    def _mirrored(self, times: Array) -> Array:
        inner = self.duration - times[::-1]
        return read_only([0.0, *inner[1:-1], self.duration])
