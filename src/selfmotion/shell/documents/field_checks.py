"""Checks of the values of keys: each returns the value, or raises ValueError with what is wrong."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import is_number

# Names of start configurations.
STARTS = ("free", "home", "dexterous")
# No angle, length, weight or time is beyond this, and its square is a number still.
_LARGEST = 1e15


def of_kind(kind: type | tuple[type, ...], what: str) -> Callable[[Any], Any]:
    """Return a function that returns a value of a kind, and refuses others.

    Parameters
    ----------
    kind : type or tuple of type
        Booleans are not numbers.
    what : str
        What the error says was expected.
    """

    def check(value: Any) -> Any:
        is_of_kind = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not is_of_kind or (isinstance(value, int | float) and not _is_sensible(value)):
            raise ValueError(f"is {value!r}, expected {what}")
        return value

    return check


def numbers(value: Any) -> Any:
    """Return a number, or lists of numbers in rows of equal length."""
    if not _are_numbers(value):
        raise ValueError(f"is {value!r}, expected a number or a list of numbers")
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, OverflowError):
        raise ValueError(f"is {value!r}, expected rows of equal length") from None
    if not all(map(_is_sensible, array.ravel().tolist())):
        raise ValueError(f"is {value!r}, expected numbers that are not NaN, nor above {_LARGEST:g}")
    return value


def axis(value: Any) -> Any:
    """Return the name of an axis, or numbers."""
    if isinstance(value, str):
        if value not in "xyz" or len(value) != 1:
            raise ValueError(f"is '{value}', expected x, y, z or three numbers")
        return value
    return numbers(value)


def names(value: Any) -> Any:
    """Return a list of names; a single name is one of them."""
    found = [value] if isinstance(value, str) else value
    if not (isinstance(found, list) and all(isinstance(item, str) for item in found)):
        raise ValueError(f"is {value!r}, expected a name or a list of names")
    return found


def several_names(value: Any) -> Any:
    """Return a list of names, not a single one."""
    if isinstance(value, str):
        raise ValueError(f"is {value!r}, expected a list of names")
    return names(value)


def coordinates(value: Any) -> Any:
    """Return a table from joints to numbers."""
    if not isinstance(value, Mapping) or not all(map(_is_coordinate, value.values())):
        raise ValueError(f"is {value!r}, expected a table of joints and numbers")
    return dict(value)


def start(value: Any) -> Any:
    """Return the name of a start configuration, or numbers."""
    if not isinstance(value, str):
        return numbers(value)
    if value not in STARTS:
        raise ValueError(f"is {value!r}, expected 'free', 'home', 'dexterous' or numbers")
    return value


def _are_numbers(value: Any) -> bool:
    """Whether a value is a number, or a list of such that is not empty."""
    if isinstance(value, list):
        return bool(value) and all(map(_are_numbers, value))
    return is_number(value)


def _is_coordinate(value: Any) -> bool:
    """Whether a value is a number that float64 can count with."""
    return is_number(value) and _is_sensible(value)


def _is_sensible(value: float) -> bool:
    """Whether float64 can count with a number; infinity may mean that there is no limit."""
    return value == value and (abs(value) < _LARGEST or value in (math.inf, -math.inf))
