"""Types of the fields of problem files: what each accepts, says, and tells editors."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import PlainValidator, WithJsonSchema

from selfmotion.basics import PathError, is_number
from selfmotion.model.path import ORIENTATIONS, pose_of

# No angle, length, weight or time is beyond this, and its square is a number still.
_HUGE = 1e15


def _checked(kind: type | tuple[type, ...], what: str, schema: dict[str, Any]) -> Any:
    """Return a type that accepts values of a kind, and says what was expected otherwise."""

    def check(value: Any) -> Any:
        sound = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        if not sound or (isinstance(value, int | float) and not _is_sensible(value)):
            raise ValueError(f"is {value!r}, expected {what}")
        return value

    return Annotated[Any, PlainValidator(check), WithJsonSchema(schema)]


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


def _pose(value: Any) -> Any:
    try:
        return pose_of(value)
    except PathError as error:
        raise ValueError(str(error)) from error


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


def _coordinates(value: Any) -> Any:
    """Check a table of joint coordinates."""
    if not isinstance(value, Mapping) or not all(map(_is_number, value.values())):
        raise ValueError(f"is {value!r}, expected a table of joints and numbers")
    return dict(value)


def _is_number(value: Any) -> bool:
    return _are_numbers(value) and not isinstance(value, list) and _is_sensible(value)


def _start(value: Any) -> Any:
    if not (value in ("free", "home", "dexterous") if isinstance(value, str) else True):
        raise ValueError(f"is {value!r}, expected 'free', 'home', 'dexterous' or numbers")
    return value if isinstance(value, str) else _numbers(value)


_ANY_NUMBERS = {"anyOf": [{"type": "number"}, {"type": "array"}]}


_TRIPLE = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}


_POSE = {
    "anyOf": [
        {"type": "array", "minItems": 4, "maxItems": 4},
        {
            "title": "Pose",
            "type": "object",
            "properties": {"position": _TRIPLE, **{key: {"type": "array"} for key in ORIENTATIONS}},
            "additionalProperties": False,
        },
    ]
}


Number = _checked((int, float), "a number", {"type": "number"})


Whole = _checked(int, "a whole number", {"type": "integer"})


Flag = _checked(bool, "true or false", {"type": "boolean"})


Text = _checked(str, "a text", {"type": "string"})


Table = _checked(Mapping, "a table", {"type": "object"})


def _keys(*names: str) -> dict[str, Any]:
    """Return the schema of a table whose own reader refuses other keys."""
    keys: dict[str, Any] = {name: {"type": "number"} for name in names}
    keys["axis"] = _TRIPLE
    return {"type": "object", "properties": keys, "additionalProperties": False}


Leads = _checked(Mapping, "a table", _keys("length", "duration"))


Weave = _checked(Mapping, "a table", _keys("amplitude", "pitch", "dwell"))


Numbers = Annotated[Any, PlainValidator(_numbers), WithJsonSchema(_ANY_NUMBERS)]


Axis = Annotated[
    Any, PlainValidator(_axis), WithJsonSchema({"anyOf": [{"enum": ["x", "y", "z"]}, _TRIPLE]})
]


Pose = Annotated[Any, PlainValidator(_pose), WithJsonSchema(_POSE)]


Coordinates = Annotated[Any, PlainValidator(_coordinates), WithJsonSchema({"type": "object"})]


Names = Annotated[
    Any, PlainValidator(_names), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array"}]})
]


Start = Annotated[
    Any,
    PlainValidator(_start),
    WithJsonSchema({"anyOf": [{"enum": ["free", "home", "dexterous"]}, {"type": "array"}]}),
]
