"""Lines, circles, spirals and helices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_flag, as_number, read_only, series, shown
from selfmotion.model.path.base import (
    Path,
    PathSamples,
    PathSeries,
    check_duration,
    check_vector,
    path_pose,
    rotations_about,
    unit,
)
from selfmotion.model.task import SE3, log3, skew

# Minimum jerk's coefficients of 1, τ, τ² …
_JERK = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)


class TimeLaw(Enum):
    """Share of the path (0 to 1) at normalised time τ (0 to 1)."""

    CONSTANT = "constant"
    MINIMUM_JERK = "minimum_jerk"

    @classmethod
    def of(cls, law: TimeLaw | str) -> TimeLaw:
        """Return the time law of that name; PathError for an unknown one."""
        try:
            return cls(law)
        except ValueError:
            names = ", ".join(member.value for member in cls)
            raise PathError(f"unknown time law {shown(law)}, expected one of: {names}") from None

    def __call__(self, tau: Array) -> tuple[Array, Array]:
        """Return s(τ) and ds/dτ.

        Constant speed: s = τ. Minimum jerk: s = 10τ³ - 15τ⁴ + 6τ⁵ (Flash and Hogan 1985).
        """
        return _TIME_LAWS[self](tau)

    def series(self, middle: Array, half: Array) -> Array:
        """Return the series of s on intervals of τ, (K + 1, I)."""
        coefficients = np.array([0.0, 1.0] if self is TimeLaw.CONSTANT else _JERK)[:, None]
        return series.of_polynomial(series.recentred(coefficients, middle, half))


def _constant(tau: Array) -> tuple[Array, Array]:
    return tau, np.ones_like(tau)


def _minimum_jerk(tau: Array) -> tuple[Array, Array]:
    return tau**3 * (10.0 + tau * (6.0 * tau - 15.0)), 30.0 * (tau * (1.0 - tau)) ** 2


_TIME_LAWS: dict[TimeLaw, Callable[[Array], tuple[Array, Array]]] = {
    TimeLaw.CONSTANT: _constant,
    TimeLaw.MINIMUM_JERK: _minimum_jerk,
}


class Round(Path):
    """A tool motion about an axis; see `Circle` and `Spiral` for its fields."""

    start: SE3
    center: Array
    normal: Array
    turns: float
    turn_tool: bool
    time_law: TimeLaw | str

    def __post_init__(self) -> None:
        name = self.kind
        object.__setattr__(self, "start", path_pose(self.start, f"{name}: start"))
        object.__setattr__(self, "center", check_vector(self.center, f"{name}: center"))
        normal = check_vector(self.normal, f"{name}: normal")
        if not np.any(normal):
            raise PathError(f"{name}: normal is zero, expected the direction of the axis")
        object.__setattr__(self, "normal", read_only(unit(normal)))
        object.__setattr__(self, "duration", check_duration(self.duration))
        object.__setattr__(self, "time_law", TimeLaw.of(self.time_law))
        turns = as_number(self.turns, f"{name}: turns", least=-1e6, most=1e6, error=PathError)
        object.__setattr__(self, "turns", turns)
        as_flag(self.turn_tool, f"{name}: turn_tool", PathError)

    @override
    def at_constant_speed(self) -> Self:
        """Return the same path, gone round evenly."""
        return replace(self, time_law=TimeLaw.CONSTANT)  # type: ignore[type-var]  # dataclasses

    def _oriented(self, turned: Array, omega: Array) -> tuple[Array, Array]:
        """Return the tool's orientations and angular velocities after turns of the path."""
        if self.turn_tool:
            return turned @ self.start.rotation, omega
        return np.tile(self.start.rotation, (len(turned), 1, 1)), np.zeros_like(omega)

    def _length(self, middle: Array, half: Array) -> Array:
        """Return the series of how far along it is, from 0 to 1."""
        return TimeLaw.of(self.time_law).series(middle / self.duration, half / self.duration)

    def _with_tool(self, place: Array, round_axis: Array) -> PathSeries:
        """Return the series of place and tool, where that of turning about the axis is known."""
        return PathSeries(place, round_axis if self.turn_tool else series.constant(1.0, round_axis))


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

    @override
    def at_constant_speed(self) -> Line:
        return replace(self, time_law=TimeLaw.CONSTANT)

    @override
    def evaluate(self, t: Array) -> PathSamples:
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

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        law, last = TimeLaw.of(self.time_law), self.duration
        share = law.series(middle / last, half / last)
        length = float(np.linalg.norm(self.end.translation - self.start.translation))
        angle = float(np.linalg.norm(log3(self.end.rotation @ self.start.rotation.T)))
        return PathSeries(length * share, series.exponential(angle * share))


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
        Number of turns; negative for clockwise.
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
        """Return a circle of `radius` [m] that starts at `start`.

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

    @cached_property
    def _arm(self) -> Array:
        return np.asarray(self.start.translation - self.center)

    @override
    def evaluate(self, t: Array) -> PathSamples:
        s, speed = TimeLaw.of(self.time_law)(t / self.duration)
        angle = 2.0 * np.pi * self.turns
        turned = rotations_about(self.normal, angle * s)
        arms = turned @ self._arm
        rate = (angle / self.duration * speed)[:, None]
        rotation, angular = self._oriented(turned, rate * self.normal)
        # ω × arm, for ω along the axis.
        twist = np.hstack([rate * (arms @ skew(self.normal).T), angular])
        return PathSamples(t, self.center + arms, rotation, twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        round_axis = series.exponential(2.0 * np.pi * abs(self.turns) * self._length(middle, half))
        return self._with_tool(self.radius * round_axis, round_axis)


# Distance from the axis [m] below which there is no radial direction.
_ON_AXIS = 1e-9


@dataclass(frozen=True, eq=False)
class Spiral(Round, kind="spiral"):
    """A spiral of Archimedes about an axis, or a helix: each turn is as far from the one before.

    Polishing, clearing a pocket, printing a round. At a feed: ``Feed(Spiral(…), 0.05)``.

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
        Number of turns; negative for clockwise.
    radius : float
        Distance from the axis at the end [m].
    rise : float
        How far the end is along the axis from the start [m].
    turn_tool : bool
        Whether the tool turns with the spiral. By default its orientation stays.
    time_law : {"minimum_jerk", "constant"}
        How fast it goes round.
    """

    start: SE3
    center: Array
    normal: Array
    duration: float
    turns: float
    radius: float
    rise: float = 0.0
    turn_tool: bool = False
    time_law: TimeLaw | str = TimeLaw.MINIMUM_JERK

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("radius", 0.0), ("rise", -1e3)):
            number = as_number(
                getattr(self, name), f"spiral: {name}", least=least, most=1e6, error=PathError
            )
            object.__setattr__(self, name, number)
        if max(self.start_radius, self.radius) < _ON_AXIS and abs(self.rise) < _ON_AXIS:
            raise PathError("spiral: it starts and ends on the axis and does not rise: no way")
        is_point = abs(self.turns) < _ON_AXIS and abs(self.rise) < _ON_AXIS
        if is_point and abs(self.radius - self.start_radius) < _ON_AXIS:
            raise PathError(
                "spiral: turns is 0, radius that of the start and rise 0: no way; say how far it "
                "goes round, or Dwell to stay"
            )

    @property
    def start_radius(self) -> float:
        """Distance of the tool from the axis at the start [m]."""
        return float(np.linalg.norm(self._away))

    @property
    def _away(self) -> Array:
        arm = self.start.translation - self.center
        return np.asarray(arm - self.normal * (self.normal @ arm))

    @property
    def _direction(self) -> Array:
        """Radial direction of the start, seen from the axis; on it any direction."""
        if self.start_radius > _ON_AXIS:
            return unit(self._away)
        other = np.eye(3)[np.argmin(np.abs(self.normal))]
        return unit(other - self.normal * (self.normal @ other))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        s, speed = TimeLaw.of(self.time_law)(t / self.duration)
        angle, first = 2.0 * np.pi * self.turns, self.start_radius
        grown = self.radius - first
        turned = rotations_about(self.normal, angle * s)
        outward = turned @ self._direction
        arms = outward * (first + grown * s)[:, None]
        rises = self.normal * (self.rise * s)[:, None]
        foot = self.start.translation - self._away
        per_length = angle * np.cross(self.normal, arms) + grown * outward + self.rise * self.normal
        rate = (speed / self.duration)[:, None]
        rotation, omega = self._oriented(turned, angle * self.normal * rate)
        return PathSamples(t, foot + arms + rises, rotation, np.hstack([per_length * rate, omega]))

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        share = self._length(middle, half)
        round_axis = series.exponential(2.0 * np.pi * abs(self.turns) * share)
        away = abs(self.radius - self.start_radius) * share
        away[0] = max(self.radius, self.start_radius)
        place = series.product(round_axis, away) + abs(self.rise) * share
        return self._with_tool(place, round_axis)
