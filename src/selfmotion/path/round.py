"""What circles and spirals share: an axis, and a tool that may turn with them."""

from dataclasses import replace
from typing import Self

import numpy as np

from selfmotion.basics import Array, PathError, as_flag, as_number, read_only, series
from selfmotion.path.base import (
    Path,
    PathSeries,
    check_duration,
    check_vector,
    path_pose,
    unit,
)
from selfmotion.path.time_law import TimeLaw
from selfmotion.task import SE3


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

    def at_constant_speed(self) -> Self:
        """See `Path.at_constant_speed`: it goes round evenly."""
        return replace(self, time_law=TimeLaw.CONSTANT)  # type: ignore[type-var]  # dataclasses

    def _oriented(self, turned: Array, omega: Array) -> tuple[Array, Array]:
        """Return the tool's orientations and angular velocities where the way has turned so far."""
        if self.turn_tool:
            return turned @ self.start.rotation, omega
        return np.tile(self.start.rotation, (len(turned), 1, 1)), np.zeros_like(omega)

    def _way(self, middle: Array, half: Array) -> Array:
        """Return the series of how far along it is, from 0 to 1."""
        return TimeLaw.of(self.time_law).series(middle / self.duration, half / self.duration)

    def _with_tool(self, place: Array, round_axis: Array) -> PathSeries:
        """Return the series of place and tool, where that of turning about the axis is known."""
        return PathSeries(place, round_axis if self.turn_tool else series.constant(1.0, round_axis))
