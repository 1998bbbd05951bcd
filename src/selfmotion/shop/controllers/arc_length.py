"""Arc length that a tool has travelled, as a function of time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path, times_when
from selfmotion.shop.controllers.tool_frames import ToolFrames

# Samples of a speed per interval between two marks …
_SAMPLES_PER_INTERVAL = 4
# … and at least in all.
_MIN_SAMPLES = 1600
# Share of the duration within which two times are one, apart only by rounding.
_TIME_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class ArcLength:
    """Arc length of a tool's motion over time.

    Attributes
    ----------
    t : (K,)
        Times [s].
    length : (K,)
        Arc length since the first of them [m].
    speed : (K,)
        Its derivative, the speed of the tool [m/s].
    """

    t: Array
    length: Array
    speed: Array

    @classmethod
    def of_motion(
        cls, frames: ToolFrames, motion: Trajectory, first: float, last: float
    ) -> "ArcLength":
        """Return that of a joint motion, in the work object, from one time to another [s]."""

        def speeds(times: Array) -> Array:
            inside = np.clip(times, motion.t[0], motion.t[-1])
            return frames.speeds(motion(inside), motion(inside, 1))

        return cls._integrated(speeds, motion.t, first, last)

    @classmethod
    def of_path(cls, path: Path, first: float, last: float) -> "ArcLength":
        """Return that of a path, in its own frame, from one time to another [s]."""

        def speeds(times: Array) -> Array:
            twist = path.samples(np.clip(times, 0.0, path.duration)).twist
            return np.asarray(np.linalg.norm(twist[:, :3], axis=1))

        return cls._integrated(speeds, path.marks, first, last)

    @property
    def total(self) -> float:
        """Arc length at the last time [m]."""
        return float(self.length[-1])

    def lengths_at(self, times: Array) -> Array:
        """Return the arc length at times (K,) [m]."""
        lengths: Array = self._spline(np.clip(times, self.t[0], self.t[-1]))
        return np.clip(lengths, 0.0, self.total)

    def times_at(self, lengths: Array) -> Array:
        """Return the times [s] at which arc lengths (K,) are reached.

        Lengths beyond the ends give the first and the last time.
        """
        k = np.clip(np.searchsorted(self.length, lengths) - 1, 0, len(self.t) - 2)
        times = times_when(self._spline, lengths, self.t[k], self.t[k + 1])
        times = np.where(lengths <= 0.0, self.t[0], times)
        return np.asarray(np.where(lengths >= self.total, self.t[-1], times))

    @classmethod
    def _integrated(
        cls, speeds: Callable[[Array], Array], marks: Array, first: float, last: float
    ) -> "ArcLength":
        """Return the integral of a speed by Simpson's rule, which is smooth between marks."""
        inside = marks[(marks > first) & (marks < last)]
        marks = np.concatenate([[first], inside, [last]])
        count = _SAMPLES_PER_INTERVAL * (len(marks) - 1) + 1
        t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
        t = np.union1d(t, np.linspace(first, last, _MIN_SAMPLES))
        t = t[np.append(np.diff(t) > _TIME_ROUNDING * (last - first), True)]
        nodes, middles = speeds(t), speeds(0.5 * (t[1:] + t[:-1]))
        increments = np.diff(t) * (nodes[:-1] + 4.0 * middles + nodes[1:]) / 6.0
        return cls(t, np.append(0.0, np.cumsum(increments)), nodes)

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.length, self.speed)
