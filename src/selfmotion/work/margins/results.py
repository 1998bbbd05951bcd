"""Margins as values, and in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array

# Cosine of the angle to an axis below which a direction has the name of the axis.
_ALONG = 0.95


@dataclass(frozen=True, eq=False)
class Displacement:
    """All displacements up to a size, which a motion survives, and what a larger one meets.

    Attributes
    ----------
    position : float
        Length of the translation [m].
    rotation : float
        Angle [rad].
    stops : str
        What a larger one meets, in words; "" where nothing was met as far as was looked.
    time : float
        Time [s]; NaN for none.
    direction : (3,) or None
        The direction of the worst translation, or, without one, the axis of the worst rotation;
        of the tool at that time, in world axes.
    """

    position: float
    rotation: float
    stops: str
    time: float = math.nan
    direction: Array | None = None

    @property
    def size(self) -> str:
        """How much it is, in words."""
        if not self.position and not self.rotation:
            return "0"
        least = "" if self.stops else "at least "
        both = [f"{_down(self.position * 1e3)} mm"] if self.position else []
        if self.rotation:
            both.append(f"{_down(math.degrees(self.rotation))}°")
        return least + " and ".join(both)

    @property
    def reason(self) -> str:
        """What limits the margin, in which direction and when, in words."""
        if not self.stops:
            return "no contact in the range that was searched"
        towards = ""
        if self.direction is not None:
            what = "towards" if self.position or not self.rotation else "about"
            towards = f"{what} {_named(self.direction)}: "
        when = "" if math.isnan(self.time) else f" at {self.time:.4g} s"
        return f"{towards}{self.stops}{when}"


@dataclass(frozen=True, eq=False)
class SubjectMargin:
    """By how much one thing may be displaced.

    Attributes
    ----------
    name : str
        "part", "tool" or "base".
    bodies : tuple of str
        What is displaced; of the base, what is not.
    about : str
        What rotations are about, in words.
    center : (3,)
        The same, in the frame of what carries the bodies [m].
    translation, rotation, both : Displacement
        Of translations alone, of rotations alone, and of both at once.
    """

    name: str
    bodies: tuple[str, ...]
    about: str
    center: Array
    translation: Displacement
    rotation: Displacement
    both: Displacement

    @property
    def rows(self) -> Iterator[tuple[str, Displacement]]:
        """The three of them, by name."""
        yield from (
            ("translation", self.translation),
            ("rotation", self.rotation),
            ("both", self.both),
        )


@dataclass(frozen=True, eq=False)
class Margins:
    """By how much part, tool and base may be displaced while a program runs unchanged.

    Attributes
    ----------
    robot : str
        Name of the arm.
    part, tool, base : SubjectMargin
    judged : str
        What was judged, in words.
    motion, problem : str
        Digests of the motion and of the problem that they are of.
    """

    robot: str
    part: SubjectMargin
    tool: SubjectMargin
    base: SubjectMargin
    judged: str
    motion: str
    problem: str

    @property
    def subjects(self) -> tuple[SubjectMargin, ...]:
        """Part, tool and base."""
        return self.part, self.tool, self.base

    @property
    def sentence(self) -> str:
        """The least translation and the least rotation, and what stops them."""
        shift = min(self.subjects, key=lambda item: item.translation.position)
        turn = min(self.subjects, key=lambda item: item.rotation.rotation)
        return (
            f"margin {shift.translation.size}: {shift.name} {shift.translation.reason}; "
            f"margin {turn.rotation.size}: {turn.name} {turn.rotation.reason}"
        )

    def __repr__(self) -> str:
        return f"Margins({self.robot}: {self.sentence})"

    def __str__(self) -> str:
        """Return the sentence, and a table."""
        rows = [
            (item.name, kind, found.size, found.reason)
            for item in self.subjects
            for kind, found in item.rows
        ]
        widths = [max(len(row[k]) for row in rows) for k in range(3)]
        table = [
            "  ".join([*(text.ljust(width) for text, width in zip(row, widths, strict=False)), why])
            for *row, why in rows
        ]
        abouts = [f"rotations of the {item.name} are about {item.about}" for item in self.subjects]
        return "\n".join([self.sentence, *table, *abouts, f"judged: {self.judged}"])


def _down(value: float) -> str:
    """Return a number of three digits that is rounded down, as a margin has to be."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.floor(value / unit) * unit:.6g}"


def _named(direction: Array) -> str:
    """Return a direction in words."""
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) >= _ALONG:
        return f"{'-' if direction[axis] < 0.0 else '+'}{'xyz'[axis]}"
    return f"({', '.join(f'{x:.2f}' for x in direction)})"
