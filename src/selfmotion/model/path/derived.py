"""Paths derived from another one: placed, reversed."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, read_only
from selfmotion.model.path.base import (
    Path,
    PathSamples,
    PathSeries,
    _Derived,
    _InStep,
    check_path,
    path_pose,
    path_series,
)
from selfmotion.model.path.feed_profile import FeedProfile
from selfmotion.model.task import SE3


class Placed(_InStep, kind="placed"):
    """A path in a frame that stands somewhere in the world.

    Parameters
    ----------
    path : Path
        Poses in the frame.
    frame : SE3 or (4, 4)
        Pose of the frame in the world [m].
    """

    def __init__(self, path: Path, frame: SE3 | npt.ArrayLike) -> None:
        self._path = check_path(path, "placed path")
        self._frame = path_pose(frame, "placed path: frame")
        self.duration = path.duration

    @property
    def frame(self) -> SE3:
        """Pose of the frame in the world."""
        return SE3(self._frame)

    @override
    def at_constant_speed(self) -> Placed:
        """As the original."""
        return Placed(self._path.at_constant_speed(), self._frame)

    @override
    def evaluate(self, t: Array) -> PathSamples:
        inner, turn = self._path.evaluate(t), self._frame.rotation
        twist = np.hstack([inner.twist[:, :3] @ turn.T, inner.twist[:, 3:] @ turn.T])
        translation = inner.translation @ turn.T + self._frame.translation
        return PathSamples(t, translation, turn @ inner.rotation, twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """Lengths and angles stay."""
        return path_series(self._path, middle, half)

    @override
    def to_dict(self) -> dict[str, Any]:
        frame = self._frame.homogeneous.tolist()
        return {"kind": self.kind, "path": self._path.to_dict(), "frame": frame}


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
    @override
    def knots(self) -> Array:
        return self._mirrored(self._path.knots)

    @property
    @override
    def marks(self) -> Array:
        return self._mirrored(self._path.marks)

    @property
    @override
    def rounded(self) -> Array:
        return read_only(self.duration - self._path.rounded[::-1, ::-1])

    @property
    @override
    def feeds(self) -> tuple[FeedProfile, ...]:
        return tuple(item.timed(lambda t: self.duration - t) for item in self._path.feeds)

    @override
    def at_constant_speed(self) -> Reversed:
        """As the original."""
        return Reversed(self._path.at_constant_speed())

    def when(self, wanted: Array) -> Array:
        """Return when times of the original (K,) are passed, (K,) [s]."""
        return self.duration - wanted

    @override
    def evaluate(self, t: Array) -> PathSamples:
        sigma = np.clip(self.duration - t, 0.0, self.duration)
        return self._at_pace(t, sigma, -np.ones_like(t))

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """Bounds of derivatives are the same in reversed time."""
        return path_series(self._path, self.duration - middle, half)

    @override
    def to_dict(self) -> dict[str, Any]:
        return {"kind": self.kind, "path": self._path.to_dict()}

    def _mirrored(self, times: Array) -> Array:
        inner = self.duration - times[::-1]
        return read_only([0.0, *inner[1:-1], self.duration])
