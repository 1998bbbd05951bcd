"""Lengths and angles in words, with the unit in which people read them."""

import math

# Sizes below this are written as 0 [m, rad].
_ROUNDING = 1e-12
# Unit → the largest size that is written in it [m, rad].
_LENGTHS = (("µm", 1e-6, 1e-4), ("mm", 1e-3, 1.0), ("m", 1.0, math.inf))
_ANGLES = (("µrad", 1e-6, 1e-4), ("mrad", 1e-3, 0.1), ("rad", 1.0, math.inf))


def in_length(metres: float, digits: int = 2) -> str:
    """Return a length in µm below 0.1 mm, in mm below 1 m, else in m."""
    return _in_units(metres, digits, _LENGTHS)


def in_angle(radians: float, digits: int = 2) -> str:
    """Return an angle in µrad below 0.1 mrad, in mrad below 0.1 rad, else in rad."""
    return _in_units(radians, digits, _ANGLES)


def _in_units(value: float, digits: int, units: tuple[tuple[str, float, float], ...]) -> str:
    # Less than a picometre, or a picoradian, is rounding.
    value = 0.0 if abs(value) < _ROUNDING else value
    # NaN is below no size: it is written in the last unit.
    unit, scale, _ = next((each for each in units if abs(value) < each[2]), units[-1])
    text = f"{value / scale:.{digits}g}"
    # 99.7 with two digits is 1e+02.
    return f"{float(text):g} {unit}" if "e+" in text else f"{text} {unit}"
