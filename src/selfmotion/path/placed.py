"""A tool motion given in a frame of its own, such as that of the workpiece."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array
from selfmotion.path.base import (
    Path,
    PathSamples,
    PathSeries,
    _InStep,
    check_path,
    path_pose,
    path_series,
)
from selfmotion.task import SE3


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

    def at_constant_speed(self) -> Placed:
        """See `Path.at_constant_speed`: as the original."""
        return Placed(self._path.at_constant_speed(), self._frame)

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        inner, turn = self._path.evaluate(t), self._frame.rotation
        twist = np.hstack([inner.twist[:, :3] @ turn.T, inner.twist[:, 3:] @ turn.T])
        translation = inner.translation @ turn.T + self._frame.translation
        return PathSamples(t, translation, turn @ inner.rotation, twist)

    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """See `Path.series`: lengths and angles stay."""
        return path_series(self._path, middle, half)

    def to_dict(self) -> dict[str, Any]:
        """See `Saved.to_dict`."""
        frame = self._frame.homogeneous.tolist()
        return {"kind": self.kind, "path": self._path.to_dict(), "frame": frame}
