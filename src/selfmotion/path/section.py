"""A stretch of a tool motion."""

from typing import Any

import numpy as np

from selfmotion.basics import Array, PathError, as_number, read_only
from selfmotion.path.base import Path, PathSamples, PathSeries, _Derived, check_path, path_series
from selfmotion.path.retimed import Retimed

# Knots this near to an end, as a share of the duration, are the end.
_CLOSE = 1e-9


class Section(_Derived, kind="section"):
    """A tool motion from one of its times to another, at its own pace.

    Parameters
    ----------
    path : Path
        The whole motion.
    first, last : float
        Where the stretch begins and ends [s].

    Raises
    ------
    PathError
        The times are not in order, or outside the motion.
    """

    def __init__(self, path: Path, first: float, last: float) -> None:
        check_path(path, "section")
        first = as_number(first, "section: first", error=PathError)
        last = as_number(last, "section: last", error=PathError)
        if not 0.0 <= first < last <= path.duration:
            raise PathError(
                f"section: goes from {first} to {last} s, expected two times in order within "
                f"0..{path.duration:.6g} s"
            )
        self._path, self._first, self._last = path, first, last
        self.duration = last - first

    @property
    def knots(self) -> Array:
        """See `Path.knots`."""
        return self._within(self._path.knots)

    @property
    def marks(self) -> Array:
        """See `Path.marks`."""
        return self._within(self._path.marks)

    def _within(self, times: Array) -> Array:
        near = _CLOSE * self.duration
        inner = times[(times > self._first + near) & (times < self._last - near)]
        return read_only([0.0, *(inner - self._first), self.duration])

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        found = self._path.samples(np.clip(self._first + t, self._first, self._last))
        return PathSamples(t, found.translation, found.rotation, found.twist)

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`."""
        return path_series(self._path, self._first + middle, half)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        ends = {"first": self._first, "last": self._last}
        return {"kind": self.kind, "path": self._path.to_dict(), **ends}


def section_at_rest(
    path: Path, first: float, last: float, ramp: float, ramped: tuple[bool, bool]
) -> Retimed:
    """Return a stretch of a motion that is run up from rest, and brought to rest, where asked.

    Each ramp lasts `ramp` [s], as in `Ramped`, or as long as the stretch allows; the stretch takes
    half as much longer.

    Parameters
    ----------
    path : Path
    first, last : float
        Where the stretch begins and ends [s].
    ramp : float
        [s].
    ramped : (bool, bool)
        Whether its start and its end are.
    """
    section = Section(path, first, last)
    # Shorter than the stretch by some, so that the samples of the pace are in order.
    up, down = (0.9 * min(ramp, section.duration) if asked else 0.0 for asked in ramped)
    t = np.array(
        [0.0, up, section.duration + 0.5 * (up - down), section.duration + 0.5 * (up + down)]
    )
    sigma = np.array([0.0, 0.5 * up, section.duration - 0.5 * down, section.duration])
    rate = np.array([0.0 if ramped[0] else 1.0, 1.0, 1.0, 0.0 if ramped[1] else 1.0])
    kept = np.array([True, ramped[0], ramped[1], True])
    return Retimed(section, t[kept], sigma[kept], rate[kept], np.zeros(int(kept.sum())))
