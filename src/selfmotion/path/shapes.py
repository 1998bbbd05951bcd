"""Straight lines and circles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PathError, as_number, series
from selfmotion.path.base import (
    Path,
    PathSamples,
    PathSeries,
    check_duration,
    check_vector,
    path_pose,
    rotations_about,
)
from selfmotion.path.round import Round
from selfmotion.path.time_law import TimeLaw
from selfmotion.task import SE3, log3


@dataclass(frozen=True, eq=False)
class Line(Path, kind="line"):
    """A straight line; the orientation turns about one fixed axis.

    Parameters
    ----------
    start, end : SE3 or (4, 4)
        Poses of the tool [m], world axes.
    duration : float
        [s].
    time_law : {"minimum_jerk", "constant"}
        Speed along the line.
    """

    start: SE3
    end: SE3
    duration: float
    time_law: TimeLaw | str = TimeLaw.MINIMUM_JERK

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", path_pose(self.start, "line: start"))
        object.__setattr__(self, "end", path_pose(self.end, "line: end"))
        object.__setattr__(self, "duration", check_duration(self.duration))
        object.__setattr__(self, "time_law", TimeLaw.of(self.time_law))

    def at_constant_speed(self) -> Line:
        """See `Path.at_constant_speed`."""
        return replace(self, time_law=TimeLaw.CONSTANT)

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        s, speed = TimeLaw.of(self.time_law)(t / self.duration)
        offset = self.end.translation - self.start.translation
        turn = log3(self.end.rotation @ self.start.rotation.T)
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
        return PathSamples(
            t,
            self.start.translation + s[:, None] * offset,
            rotations_about(axis, s * angle) @ self.start.rotation,
            (speed / self.duration)[:, None] * np.concatenate([offset, turn]),
        )

    def series(self, middle: Array, half: Array) -> PathSeries:
        """See `Path.series`."""
        law, last = TimeLaw.of(self.time_law), self.duration
        way = law.series(middle / last, half / last)
        length = float(np.linalg.norm(self.end.translation - self.start.translation))
        angle = float(np.linalg.norm(log3(self.end.rotation @ self.start.rotation.T)))
        return PathSeries(length * way, series.exponential(angle * way))


@dataclass(frozen=True, eq=False)
class Circle(Round, kind="circle"):
    """A circle, or an arc, about an axis.

    Parameters
    ----------
    start : SE3 or (4, 4)
        Pose of the tool at the start [m], world axes.
    center : (3,)
        A point on the axis [m].
    normal : (3,)
        Direction of the axis; the tool moves counter-clockwise about it.
    duration : float
        [s].
    turns : float
        How many times round; negative for clockwise.
    turn_tool : bool
        Whether the tool turns with the circle. By default its orientation stays.
    time_law : {"minimum_jerk", "constant"}
        Speed along the circle.
    """

    start: SE3
    center: Array
    normal: Array
    duration: float
    turns: float = 1.0
    turn_tool: bool = False
    time_law: TimeLaw | str = TimeLaw.MINIMUM_JERK

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.radius < 1e-9:
            raise PathError("circle: the tool starts on the axis, so the radius is zero")

    @classmethod
    def around(
        cls,
        start: SE3 | npt.ArrayLike,
        radius: float,
        duration: float,
        *,
        normal: npt.ArrayLike = (0.0, 0.0, 1.0),
        **options: Any,
    ) -> Circle:
        """Return a circle of `radius` [m] that begins at `start`.

        Its centre lies from the start in the direction of -x, or of -y where the axis is x.
        `options` are those of the class.
        """
        pose = path_pose(start, "circle: start")
        axis = check_vector(normal, "circle: normal")
        away = np.array([0.0, 1.0, 0.0]) if abs(axis[0]) > 0.9 * np.linalg.norm(axis) else None
        away = np.array([1.0, 0.0, 0.0]) if away is None else away
        away = away - axis * (axis @ away) / max(float(axis @ axis), 1e-300)
        radius = as_number(radius, "circle: radius", above=0.0, error=PathError)
        center = pose.translation - radius * away / np.linalg.norm(away)
        return cls(pose, center, axis, duration, **options)

    @property
    def radius(self) -> float:
        """Distance of the tool from the axis [m]."""
        return float(np.linalg.norm(self._arm - self.normal * (self.normal @ self._arm)))

    @property
    def _arm(self) -> Array:
        return np.asarray(self.start.translation - self.center)

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        s, speed = TimeLaw.of(self.time_law)(t / self.duration)
        angle = 2.0 * np.pi * self.turns
        turned = rotations_about(self.normal, angle * s)
        arms = turned @ self._arm
        omega = (angle / self.duration * speed)[:, None] * self.normal
        rotation, angular = self._oriented(turned, omega)
        twist = np.hstack([np.cross(omega, arms), angular])
        return PathSamples(t, self.center + arms, rotation, twist)

    def series(self, middle: Array, half: Array) -> PathSeries:
        """See `Path.series`."""
        round_axis = series.exponential(2.0 * np.pi * abs(self.turns) * self._way(middle, half))
        return self._with_tool(self.radius * round_axis, round_axis)
