"""Types of the keys of problem files: what each accepts, says, and tells editors."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field
from pydantic_core import CoreSchema, core_schema

from selfmotion.shell.documents import field_checks as checks


def key(description: str | None = None, default: Any = None) -> Any:
    """Return a key that may be left out, with the sentence that says what it is.

    The sentence of a table may be the table's own.
    """
    return Field(default, description=description)


def needed(description: str) -> Any:
    """Return a key that has to be given, with the sentence that says what it is."""
    return Field(description=description)


@dataclass(frozen=True, eq=False)
class Checked:
    """Makes a type of pydantic's from a function that checks a value, and its JSON Schema.

    Attributes
    ----------
    check : callable
        Returns the value, or raises ValueError with what is wrong.
    schema : dict
        JSON Schema of the value, for editors.
    units : tuple of str
        Endings of the key for values in other units.
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


_NUMBER_SCHEMA = {"type": "number"}
_VECTOR_SCHEMA = {"type": "array", "items": _NUMBER_SCHEMA, "minItems": 3, "maxItems": 3}
_NAMES_SCHEMA = {"anyOf": [{"type": "string"}, {"type": "array"}]}
_START_SCHEMA = {"anyOf": [{"enum": list(checks.STARTS)}, {"type": "array"}]}
# Check and schema of a number, and of a number or lists of numbers.
_NUMBER = (checks.of_kind((int, float), "a number"), _NUMBER_SCHEMA)
_NUMBERS = (checks.numbers, {"anyOf": [_NUMBER_SCHEMA, {"type": "array"}]})

# --- one number: without a unit, and of a length, an angle or either, or a rate of it
Number = Annotated[float, Checked(*_NUMBER)]
Length = Annotated[float, Checked(*_NUMBER, ("_mm",))]
Angle = Annotated[float, Checked(*_NUMBER, ("_deg",))]
Turn = Annotated[float, Checked(*_NUMBER, ("_deg",), within_turn=True)]
LengthOrAngle = Annotated[float, Checked(*_NUMBER, ("_deg", "_mm"))]
Whole = Annotated[int, Checked(checks.of_kind(int, "a whole number"), {"type": "integer"})]

# --- a number, or a list of numbers; those of joints are one for all, or one for each
Numbers = Annotated[Any, Checked(*_NUMBERS)]
Lengths = Annotated[Any, Checked(*_NUMBERS, ("_mm",))]
Turns = Annotated[Any, Checked(*_NUMBERS, ("_deg",), within_turn=True)]
Joints = Annotated[Any, Checked(*_NUMBERS, ("_deg",), per_joint=True)]
Rates = Annotated[Any, Checked(*_NUMBERS, ("_deg", "_mm"))]
Coordinates = Annotated[
    dict[str, float], Checked(checks.coordinates, {"type": "object"}, ("_deg",), per_joint=True)
]

# --- a name, or numbers
Start = Annotated[Any, Checked(checks.start, _START_SCHEMA, ("_deg",), per_joint=True)]
Axis = Annotated[Any, Checked(checks.axis, {"anyOf": [{"enum": ["x", "y", "z"]}, _VECTOR_SCHEMA]})]

# --- texts, names, and the rest
Flag = Annotated[bool, Checked(checks.of_kind(bool, "true or false"), {"type": "boolean"})]
Text = Annotated[str, Checked(checks.of_kind(str, "a text"), {"type": "string"})]
File = Annotated[str, Checked(checks.of_kind(str, "the name of a file"), {"type": "string"})]
Files = Annotated[list[str], Checked(checks.names, _NAMES_SCHEMA)]
Names = Annotated[list[str], Checked(checks.names, _NAMES_SCHEMA)]
SeveralNames = Annotated[
    list[str], Checked(checks.several_names, {"type": "array", "items": {"type": "string"}})
]
AnyTable = Annotated[
    dict[str, Any], Checked(checks.of_kind(Mapping, "a table"), {"type": "object"})
]
