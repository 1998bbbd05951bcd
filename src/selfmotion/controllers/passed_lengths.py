"""How far a tool has gone along its path, as a function of time, and back."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.controllers.tool_frames import ToolFrames
from selfmotion.motion import Trajectory
from selfmotion.path import Path, times_when

# Speeds are looked at so often between two samples, and so often in all at least.
_BETWEEN, _LEAST = 4, 1600


@dataclass(frozen=True, eq=False)
class PassedLength:
    """The length that a tool has passed, at times.

    Attributes
    ----------
    t : (K,)
        Times [s].
    length : (K,)
        How far it has gone since the first [m].
    speed : (K,)
        How fast it is [m/s].
    """

    t: Array
    length: Array
    speed: Array

    @classmethod
    def of_motion(
        cls, frames: ToolFrames, motion: Trajectory, first: float, last: float
    ) -> "PassedLength":
        """Return that of a joint motion, in the work object, from one time to another [s]."""

        def speeds(times: Array) -> Array:
            at = np.clip(times, motion.t[0], motion.t[-1])
            return frames.speeds(motion(at), motion(at, 1))

        return cls._integrated(speeds, motion.t, first, last)

    @classmethod
    def of_path(cls, path: Path, first: float, last: float) -> "PassedLength":
        """Return that of a path, in its own frame."""

        def speeds(times: Array) -> Array:
            twist = path.samples(np.clip(times, 0.0, path.duration)).twist
            return np.asarray(np.linalg.norm(twist[:, :3], axis=1))

        return cls._integrated(speeds, path.marks, first, last)

    @classmethod
    def _integrated(
        cls, speeds: Callable[[Array], Array], marks: Array, first: float, last: float
    ) -> "PassedLength":
        """Return the integral of a speed by Simpson's rule."""
        inside = marks[(marks > first) & (marks < last)]
        marks = np.concatenate([[first], inside, [last]])
        count = _BETWEEN * (len(marks) - 1) + 1
        t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
        t = np.union1d(t, np.linspace(first, last, _LEAST))
        # Two that rounding puts beside each other are one.
        t = t[np.append(np.diff(t) > 1e-9 * (last - first), True)]
        here, middle = speeds(t), speeds(0.5 * (t[1:] + t[:-1]))
        steps = np.diff(t) * (here[:-1] + 4.0 * middle + here[1:]) / 6.0
        return cls(t, np.append(0.0, np.cumsum(steps)), here)

    @property
    def whole(self) -> float:
        """How far it goes in all [m]."""
        return float(self.length[-1])

    def at(self, times: Array) -> Array:
        """Return how far it has gone at times (K,) [m]."""
        found: Array = self._spline(np.clip(times, self.t[0], self.t[-1]))
        return np.clip(found, 0.0, self.whole)

    def when(self, lengths: Array) -> Array:
        """Return when it has gone as far as lengths (K,) [s]; at both ends the first and last."""
        k = np.clip(np.searchsorted(self.length, lengths) - 1, 0, len(self.t) - 2)
        found = times_when(self._spline, lengths, self.t[k], self.t[k + 1])
        found = np.where(lengths <= 0.0, self.t[0], found)
        return np.asarray(np.where(lengths >= self.whole, self.t[-1], found))

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.length, self.speed)
