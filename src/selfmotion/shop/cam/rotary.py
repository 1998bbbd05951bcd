"""Rotary axes A, B and C of a machine tool, which turn its head or the table with the part."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from selfmotion.basics import Array, as_numbers, shown

_AXES = ("A", "B", "C")
# Kind of axes that turn the head.
HEAD = "head"
# Kind of axes that turn the table.
TABLE = "table"
# Largest deviation of chords from a line of the machine that the table bends [m].
_CHORD = 1e-5
# Largest number of such chords.
_CHORDS = 100_000


@dataclass(frozen=True)
class Rotary:
    """Rotary axes of a machine, and whether they turn the head or a table.

    Parameters
    ----------
    kind : {"head", "table"}
        With ``"head"`` positions are those of the tip in the part, and A, B, C turn the tool; or
        a table under tool centre point control, which turns the part instead.
        With ``"table"`` they are those of the machine, in which the table has turned the part.
    axes : tuple of (str, float)
        Of a table, from the machine to the part, with their signs: ``("B", 1.0), ("C", 1.0)`` for a
        C axis on a B axis; none for Rz(C) Ry(B) Rx(A). By ISO 841 a positive word moves the tool
        right-handed about the axis, relative to the part: the table itself turns the other way. -1
        for a table that turns right-handed.
    center : (3,)
        A point on all axes, in the program's coordinates at A = B = C = 0 [m].
    """

    kind: str
    axes: tuple[tuple[str, float], ...] = ()
    center: Array = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(cls, options: Mapping[str, Any]) -> "Rotary | None":
        """Return the axes that options state; ValueError for options that contradict each other."""
        kind, axes = options.get("rotary"), options.get("rotary_axes")
        center = options.get("rotary_center")
        if kind is None:
            if axes is not None or center is not None:
                raise ValueError("rotary_axes and rotary_center are of rotary = 'table'; say that")
            return None
        if kind not in (HEAD, TABLE):
            raise ValueError(f"rotary is {shown(kind)}, expected 'head' or 'table'")
        if kind == HEAD:
            if center is not None:
                raise ValueError("rotary_center is of a table whose positions are the machine's")
            return cls(HEAD) if axes is None else cls(HEAD, _axes_of(axes))
        if center is None:
            raise ValueError("rotary_center is missing: a point on the table's axes [x, y, z] (m)")
        where = as_numbers(center, "rotary_center", "three numbers", (3,))
        return cls(TABLE, _axes_of(axes), where)

    def rotation(self, turns: Mapping[str, float]) -> Array:
        """Return the rotation (3, 3) from machine to part directions, by angles [rad]."""
        if not self.axes:
            return _about("C", turns) @ _about("B", turns) @ _about("A", turns)
        rotation = np.eye(3)
        for axis, sign in self.axes:
            rotation = _about(axis, {axis: sign * turns.get(axis, 0.0)}) @ rotation
        return rotation

    def in_part(self, position: Array, turns: Mapping[str, float]) -> Array:
        """Return where a position of the machine (3,) is in the part; NaN where it is not known."""
        if self.kind == HEAD:
            return position
        if np.isnan(position).any():
            return np.full(3, np.nan)
        return np.asarray(self.center + self.rotation(turns) @ (position - self.center))

    def chord_count(
        self,
        start: Array,
        goal: Array,
        start_turns: Mapping[str, float],
        goal_turns: Mapping[str, float],
    ) -> int:
        """Return how many chords in the part replace a line of the machine.

        For s from 0 to 1 the tool is at R(s) p(s) in the part: R turns by θ, and p travels d, at a
        distance of at most r from the axes. The second derivative is at most r θ² + 2 d θ; a chord
        deviates by at most an eighth of it.
        """
        if self.kind == HEAD:
            return 1
        angle = sum(
            abs(goal_turns.get(axis, 0.0) - start_turns.get(axis, 0.0)) for axis, _ in self.axes
        )
        radius = max(float(np.linalg.norm(point - self.center)) for point in (start, goal))
        bend = angle * (radius * angle + 2.0 * float(np.linalg.norm(goal - start)))
        return int(np.clip(np.ceil(np.sqrt(bend / (8.0 * _CHORD))), 1, _CHORDS))


def _axes_of(value: Any) -> tuple[tuple[str, float], ...]:
    """Return names and signs of axes: of ``"BC"``, ``"B,-C"`` or ``["B", "-C"]``."""
    if isinstance(value, str):
        items = _split(value.replace(" ", ""))
    else:
        items = list(value) if isinstance(value, list | tuple) else [value]
    names = [str(item).lstrip("+-").upper() for item in items]
    if not set(names) <= set(_AXES) or len(set(names)) != len(names) or len(names) > 2:
        raise ValueError(
            f"rotary_axes is {shown(value)}, expected the table's axes from the machine to the "
            f"part: BC or AC, or one; B,-C where C turns the table right-handed"
        )
    signs = [-1.0 if str(item).startswith("-") else 1.0 for item in items]
    return tuple(zip(names, signs, strict=True))


def _split(text: str) -> list[str]:
    if "," in text:
        return text.split(",")
    return [text] if "-" in text else list(text)


def _about(axis: str, turns: Mapping[str, float]) -> Array:
    """Return the rotation (3, 3) about an axis by its angle [rad]."""
    angle, k = turns.get(axis, 0.0), _AXES.index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = np.cos(angle)
    rotation[j, i] = np.sin(angle)
    rotation[i, j] = -rotation[j, i]
    return rotation
