"""Spirals in a plane, helices, and what is both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, PathError, as_number, series
from selfmotion.path.base import (
    PathSamples,
    PathSeries,
    rotations_about,
    unit,
)
from selfmotion.path.round import Round
from selfmotion.path.time_law import TimeLaw
from selfmotion.task import SE3

# Nearer to the axis [m] there is no direction away from it.
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
        How many times round; negative for clockwise.
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
        still = abs(self.turns) < _ON_AXIS and abs(self.rise) < _ON_AXIS
        if still and abs(self.radius - self.start_radius) < _ON_AXIS:
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
        """Where the spiral begins, seen from the axis; from on it some direction."""
        if self.start_radius > _ON_AXIS:
            return unit(self._away)
        other = np.eye(3)[np.argmin(np.abs(self.normal))]
        return unit(other - self.normal * (self.normal @ other))

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        s, speed = TimeLaw.of(self.time_law)(t / self.duration)
        angle, first = 2.0 * np.pi * self.turns, self.start_radius
        grown = self.radius - first
        turned = rotations_about(self.normal, angle * s)
        outward = turned @ self._direction
        arms = outward * (first + grown * s)[:, None]
        rises = self.normal * (self.rise * s)[:, None]
        foot = self.start.translation - self._away
        per_way = angle * np.cross(self.normal, arms) + grown * outward + self.rise * self.normal
        rate = (speed / self.duration)[:, None]
        rotation, omega = self._oriented(turned, angle * self.normal * rate)
        return PathSamples(t, foot + arms + rises, rotation, np.hstack([per_way * rate, omega]))

    def series(self, middle: Array, half: Array) -> PathSeries:
        """See `Path.series`."""
        way = self._way(middle, half)
        round_axis = series.exponential(2.0 * np.pi * abs(self.turns) * way)
        away = abs(self.radius - self.start_radius) * way
        away[0] = max(self.radius, self.start_radius)
        place = series.product(round_axis, away) + abs(self.rise) * way
        return self._with_tool(place, round_axis)
