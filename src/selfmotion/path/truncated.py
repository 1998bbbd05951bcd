"""The first part of a tool motion."""

from typing import Any

import numpy as np

from selfmotion.basics import Array, PathError, read_only
from selfmotion.path.base import Path, PathSamples, PathSeries, _Derived, path_series

# The knots crowd towards the end by halves, down to about this share of the duration.
_GRADES = 14
# Of two knots this close, as a share of the time left, one is enough.
_CLOSE = 1e-3


class Truncated(_Derived, kind="truncated"):
    """A tool motion up to a time, for what the arm can follow of it.

    Its knots crowd towards the end: a motion that ends near a singular pose changes there faster
    than any equal steps resolve.

    Parameters
    ----------
    path : Path
        The whole motion.
    duration : float
        Where the part ends [s].
    """

    def __init__(self, path: Path, duration: float) -> None:
        if not 0.0 < duration <= path.duration:
            raise PathError(
                f"truncated path: ends at {duration} s, expected a time within 0..{path.duration} s"
            )
        self._path = path
        self.duration = float(duration)

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        given = self._path.knots
        inner = given[(given > 0.0) & (given < (1.0 - _CLOSE) * self.duration)]
        rest = self.duration * 0.5 ** np.arange(1.0, _GRADES + 1.0)
        gaps = np.abs(self.duration - rest[:, None] - given).min(axis=1)
        graded = self.duration - rest[gaps > _CLOSE * rest]
        return read_only([0.0, *np.union1d(inner, graded), self.duration])

    @property
    def marks(self) -> Array:
        """See `Path.marks`."""
        inner = self._path.marks
        return np.union1d(self.knots, inner[inner < self.duration])

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        return self._path.samples(t)

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`."""
        return path_series(self._path, middle, half)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        return {"kind": self.kind, "path": self._path.to_dict(), "duration": self.duration}
