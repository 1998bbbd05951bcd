"""A fact, and how its number is written for people."""

import math
from dataclasses import dataclass
from typing import Any

from selfmotion.basics import in_angle, in_length
from selfmotion.certificate import Extreme

# Angles from here on are written in degrees [rad].
_WIDE = 0.1


def with_unit(value: float, unit: str, digits: int = 4) -> str:
    """Return a number in SI as people read it: m in µm, mm or m, rad in µrad, mrad or °."""
    match unit:
        case "m":
            return in_length(value, digits)
        case "rad":
            wide = abs(value) >= _WIDE
            return f"{math.degrees(value):.{digits}g}°" if wide else in_angle(value, digits)
        case "of its limit":
            return f"{value:.1%} of its limit"
        case _:
            return f"{value:.{digits}g} {unit}".strip()


@dataclass(frozen=True)
class Fact:
    """Something that is known of a motion.

    Attributes
    ----------
    label : str
        What it is.
    value : float or str
        In SI, or in words.
    unit : str
        Of the value, in SI; "of its limit" of shares, "" of counts and words.
    when : float or None
        Its time [s], where it has one.
    where : str
        Its subject: a joint, a frame, a pair of bodies.
    allowed : float or None
        Limit of the value, in its unit.
    at_least : bool
        Whether that is a lower bound.
    kept : bool or None
        Whether the limit is kept; None where it has none.
    group : str
        Which table it is in: "plan", "path", "motion", "requirement", "near", "search".
    remark : str
        What is said besides, in smaller letters.
    """

    label: str
    value: float | str
    unit: str = ""
    when: float | None = None
    where: str = ""
    allowed: float | None = None
    at_least: bool = False
    kept: bool | None = None
    group: str = "plan"
    remark: str = ""

    @classmethod
    def worst(cls, label: str, found: Extreme | None, unit: str, group: str) -> "list[Fact]":
        """Return the fact of a worst value, none where there is no value."""
        if found is None:
            return []
        when = None if math.isnan(found.time) else found.time
        return [cls(label, found.value, unit, when, found.name, group=group)]

    @property
    def number(self) -> str:
        """The value as people read it."""
        return self.value if isinstance(self.value, str) else with_unit(self.value, self.unit)

    @property
    def time(self) -> str:
        """When, as people read it; "" where it has no time."""
        return "" if self.when is None else f"{self.when:.3f} s"

    @property
    def limit(self) -> str:
        """The limit as people read it; "" where it has none."""
        if self.allowed is None:
            return ""
        limit = with_unit(self.allowed, self.unit)
        return f"at least {limit}" if self.at_least else f"{limit} allowed"

    @property
    def place(self) -> str:
        """Where, when and what besides, in one line."""
        at = "" if self.when is None else f"at {self.time}"
        return ", ".join(part for part in (self.where, at, self.remark) if part)

    def to_dict(self) -> dict[str, Any]:
        """Return it in SI, as JSON-safe values."""
        names = ("label", "value", "unit", "when", "where", "allowed", "at_least", "kept")
        return {name: getattr(self, name) for name in names}
