"""Types of the keys of problem files: what each accepts, says, and tells editors."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from pydantic_core import CoreSchema, core_schema

from selfmotion.basics import is_number

# No angle, length, weight or time is beyond this, and its square is a number still.
_HUGE = 1e15


def key(told: str | None = None, default: Any = None) -> Any:
    """Return a key that may be left out, with the sentence that says what it is.

    That of a table may be the table's own.
    """
    return Field(default, description=told)


def needed(told: str) -> Any:
    """Return a key that has to be given, with the sentence that says what it is."""
    return Field(description=told)


@dataclass(frozen=True, eq=False)
class Checked:
    """Makes a type of a function that returns a value or refuses it, and of its JSON Schema.

    Attributes
    ----------
    check : callable
    schema : dict
    units : tuple of str
        Endings of the key in other units.
    per_joint : bool
        Whether a list of it has a number for each joint.
    within_turn : bool
        Whether more than a turn can only be meant in degrees.
    """

    check: Callable[[Any], Any]
    schema: Mapping[str, Any]
    units: tuple[str, ...] = ()
    per_joint: bool = False
    within_turn: bool = False

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, _schema: Any, _handler: Any) -> dict[str, Any]:
        return dict(self.schema)


def of_kind(kind: type | tuple[type, ...], what: str) -> Callable[[Any], Any]:
    """Return a function that refuses what is not of a kind, and says what was expected."""

    def check(value: Any) -> Any:
        sound = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not sound or (isinstance(value, int | float) and not _is_sensible(value)):
            raise ValueError(f"is {value!r}, expected {what}")
        return value

    return check


def _is_sensible(value: float) -> bool:
    """Whether float64 can count with a number; infinity may mean that there is no limit."""
    return value == value and (abs(value) < _HUGE or value in (math.inf, -math.inf))


def _are_numbers(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(map(_are_numbers, value))
    return is_number(value)


def _numbers(value: Any) -> Any:
    if not _are_numbers(value):
        raise ValueError(f"is {value!r}, expected a number or a list of numbers")
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, OverflowError):
        raise ValueError(f"is {value!r}, expected rows of equal length") from None
    if not all(map(_is_sensible, array.ravel().tolist())):
        raise ValueError(f"is {value!r}, expected numbers that are not NaN, nor above {_HUGE:g}")
    return value


def _axis(value: Any) -> Any:
    if isinstance(value, str):
        if value not in "xyz" or len(value) != 1:
            raise ValueError(f"is '{value}', expected x, y, z or three numbers")
        return value
    return _numbers(value)


def _names(value: Any) -> Any:
    listed = [value] if isinstance(value, str) else value
    if not (isinstance(listed, list) and all(isinstance(item, str) for item in listed)):
        raise ValueError(f"is {value!r}, expected a name or a list of names")
    return listed


def _several_names(value: Any) -> Any:
    if isinstance(value, str):
        raise ValueError(f"is {value!r}, expected a list of names")
    return _names(value)


def _coordinates(value: Any) -> Any:
    if not isinstance(value, Mapping) or not all(map(_is_coordinate, value.values())):
        raise ValueError(f"is {value!r}, expected a table of joints and numbers")
    return dict(value)


def _is_coordinate(value: Any) -> bool:
    return is_number(value) and _is_sensible(value)


def _start(value: Any) -> Any:
    if not (value in ("free", "home", "dexterous") if isinstance(value, str) else True):
        raise ValueError(f"is {value!r}, expected 'free', 'home', 'dexterous' or numbers")
    return value if isinstance(value, str) else _numbers(value)


_NUMBER = {"type": "number"}
_TRIPLE = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
_STRINGS = {"type": "array", "items": {"type": "string"}}
_ONE = (of_kind((int, float), "a number"), _NUMBER)
_SOME = (_numbers, {"anyOf": [_NUMBER, {"type": "array"}]})
_LISTED = (_names, {"anyOf": [{"type": "string"}, {"type": "array"}]})
_START = {"anyOf": [{"enum": ["free", "home", "dexterous"]}, {"type": "array"}]}

# A number: without a unit, and of a length, an angle or either, or a rate of it.
Number = Annotated[float, Checked(*_ONE)]
Length = Annotated[float, Checked(*_ONE, ("_mm",))]
Angle = Annotated[float, Checked(*_ONE, ("_deg",))]
Turn = Annotated[float, Checked(*_ONE, ("_deg",), within_turn=True)]
LengthOrAngle = Annotated[float, Checked(*_ONE, ("_deg", "_mm"))]
# A number, or a list of numbers; those of joints are one for all, or one for each.
Numbers = Annotated[Any, Checked(*_SOME)]
Lengths = Annotated[Any, Checked(*_SOME, ("_mm",))]
Turns = Annotated[Any, Checked(*_SOME, ("_deg",), within_turn=True)]
Joints = Annotated[Any, Checked(*_SOME, ("_deg",), per_joint=True)]
Rates = Annotated[Any, Checked(*_SOME, ("_deg", "_mm"))]
Coordinates = Annotated[
    dict[str, float], Checked(_coordinates, {"type": "object"}, ("_deg",), per_joint=True)
]
Start = Annotated[Any, Checked(_start, _START, ("_deg",), per_joint=True)]
Axis = Annotated[Any, Checked(_axis, {"anyOf": [{"enum": ["x", "y", "z"]}, _TRIPLE]})]
Whole = Annotated[int, Checked(of_kind(int, "a whole number"), {"type": "integer"})]
Flag = Annotated[bool, Checked(of_kind(bool, "true or false"), {"type": "boolean"})]
Text = Annotated[str, Checked(of_kind(str, "a text"), {"type": "string"})]
File = Annotated[str, Checked(of_kind(str, "the name of a file"), {"type": "string"})]
Files = Annotated[list[str], Checked(*_LISTED)]
Names = Annotated[list[str], Checked(*_LISTED)]
SeveralNames = Annotated[list[str], Checked(_several_names, _STRINGS)]
AnyTable = Annotated[dict[str, Any], Checked(of_kind(Mapping, "a table"), {"type": "object"})]
