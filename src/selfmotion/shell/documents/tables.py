"""What the models of all tables of problem files have in common.

A table is a class: its fields are the keys, each with type, unit, default and sentence. From these
come the schema, the page of keys, and what is said of a file that is wrong. `build` makes what a
table stands for.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path as FilePath
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from selfmotion.basics import TURN, Array, FileFormatError, PathError, SelfmotionError, scaled
from selfmotion.model.path import ORIENTATIONS, pose_of
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3
from selfmotion.shell.documents.field_types import Checked, Lengths, Numbers, Turns, key

# Ending of a key → the SI unit, and what stands there in its place.
_SCALES = {"_deg": math.pi / 180.0, "_mm": 1e-3}
_UNITS = {"_deg": ("rad", "°"), "_mm": ("m", "mm")}


class Table(BaseModel):
    """A table of a document. A key that is not given is its default, or None."""

    # Built when they are first read: no file has all of them.
    model_config = ConfigDict(extra="forbid", protected_namespaces=(), defer_build=True)

    @property
    def given(self) -> dict[str, Any]:
        """The keys that are given, with their values."""
        names = (*type(self).model_fields, *(self.model_extra or ()))
        return {name: getattr(self, name) for name in names if name in self.model_fields_set}

    @model_validator(mode="before")
    @classmethod
    def _units_to_si(cls, value: Any) -> Any:
        return in_si(cls, value)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: Any) -> dict[str, Any]:
        reference: dict[str, Any] = handler(schema)
        _add_units(cls, handler.resolve_ref_schema(reference))
        return reference


def checks(info: FieldInfo) -> Checked | None:
    """Return what checks the values of a key, where it is a type of ours."""
    return next((item for item in info.metadata if isinstance(item, Checked)), None)


@cache
def other_units(table: type[BaseModel]) -> dict[str, tuple[str, float]]:
    """Return the keys of a table in other units: the key in SI units, and how large a unit is."""
    return {
        name + ending: (name, _SCALES[ending])
        for name, info in table.model_fields.items()
        for ending in getattr(checks(info), "units", ())
    }


def in_si(table: type[BaseModel], value: Any) -> Any:
    """Return what is written of a table with its keys in SI units; JSON's null is no key.

    Raises
    ------
    ValidationError
        A key is given twice, or holds no numbers; or an angle in radians is more than a turn.
    """
    if not isinstance(value, Mapping):
        return value
    found: dict[str, Any] = {}
    for written, item in value.items():
        name, unit = other_units(table).get(written, (written, None))
        if item is None:
            continue
        if name in found:
            raise refused(written, item, f"'{name}' is given twice, in two units; keep one")
        info = table.model_fields.get(name)
        if unit is not None:
            item = _in_si(written, item, unit, checks(table.model_fields[name]))
        elif info is not None and getattr(checks(info), "within_turn", False):
            _check_radians(name, item)
        found[name] = item
    return found


def _in_si(written: str, value: Any, unit: float, own: Checked | None) -> Any:
    """Return the value of a key in other units in SI units; refused as it is written."""
    try:
        found = scaled(value, unit)
    except ValueError as error:
        raise refused(written, value, str(error)) from error
    if own is not None and (said := _refusal(own, found)):
        raise refused(written, value, _refusal(own, value) or said)
    return found


def _refusal(own: Checked, value: Any) -> str:
    """Return why a type of ours refuses a value; "" where it does not."""
    try:
        own.check(value)
    except ValueError as error:
        return str(error)
    return ""


def _check_radians(name: str, value: Any) -> None:
    """Refuse an angle in radians that can only be meant in degrees."""
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, int | float) and TURN < abs(item) < math.inf:
            said = f"{item:g} rad is more than a turn; in degrees say {name}_deg"
            raise refused(name, value, said)


def refused(key: str, value: Any, said: str) -> ValidationError:
    """Return the error of a key of a table."""
    kind = PydanticCustomError("said", "{said}", {"said": said})
    error: InitErrorDetails = {"type": kind, "loc": (key,), "input": value}
    return ValidationError.from_exception_data(key, [error])


def _add_units(table: type[BaseModel], schema: dict[str, Any]) -> None:
    """Add keys in other units to the JSON Schema of a table, in place."""
    keys = schema["properties"]
    for node in keys.values():
        # JSON has no infinity.
        if isinstance(node.get("default"), float) and math.isinf(node["default"]):
            del node["default"]
    for written, (name, unit) in other_units(table).items():
        node = dict(keys[name])
        si, other = _UNITS[written.removeprefix(name)]
        # Of what is in brackets.
        node["description"] = re.sub(
            rf"(?<!\w){si}(?!\w)(?=[^\[\]]*\])", other, node["description"]
        )
        default = node.get("default")
        if isinstance(default, int | float) and not isinstance(default, bool):
            node["default"] = float(f"{default / unit:.12g}")
        elif default is not None:
            del node["default"]
        keys[written] = node
        # In another unit it will do as well.
        if name in schema.get("required", ()):
            schema["required"].remove(name)


_OF_THE_AXES = f"of the axes; one of {', '.join([*ORIENTATIONS][:-1])} and {[*ORIENTATIONS][-1]}."


class PoseTable(Table):
    """A pose: a position, and an orientation in one of several ways; or a 4 × 4 matrix."""

    position: Lengths = key("Of the origin [m].")
    rotation: Numbers = key(f"3 × 3 matrix {_OF_THE_AXES}")
    quaternion: Numbers = key(f"w, x, y, z {_OF_THE_AXES}")
    rpy: Turns = key(f"Roll, pitch and yaw [rad] {_OF_THE_AXES}")
    rotation_vector: Turns = key(f"Axis times angle [rad] {_OF_THE_AXES}")
    normal: Numbers = key("Direction of the z axis, instead of an orientation.")


class _Posed:
    """Makes a type of poses: a table of a position and an orientation, or a matrix."""

    def __get_pydantic_core_schema__(self, _source: Any, handler: Any) -> CoreSchema:
        matrix = Annotated[list[Any], Field(min_length=4, max_length=4)]
        written = handler.generate_schema(matrix | PoseTable)
        return core_schema.no_info_plain_validator_function(pose, json_schema_input_schema=written)


def pose(value: Any) -> SE3:
    """Return the pose that a file writes; ValueError for what is none."""
    try:
        return pose_of(in_si(PoseTable, value))
    except PathError as error:
        raise ValueError(str(error)) from error


Pose = Annotated[SE3, _Posed()]


@dataclass(eq=False)
class Context:
    """What tables are built with.

    Attributes
    ----------
    file : Path or None
        Where the document comes from; files that it names are looked for beside it.
    functions : dict
        Functions of the user's own, by the text that names them.
    cache : dict
        Arms, starts and files that are read already, by what describes them.
    notes : list of str
        What files that the document names are taken to say.
    robot : RobotModel
        The arm, once it is built.
    start : (n,) or None
        The start configuration, likewise.
    arguments, packages
        What the arm's xacro file is given, and where its packages are.
    degrees_key : str
        A key of the document that gives degrees joint by joint; "" for none.
    where : str
        The part of the document that errors name, such as a seam; "" for none.
    """

    file: FilePath | None
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    cache: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    robot: RobotModel = field(init=False)
    start: Array | None = None
    arguments: Mapping[str, Any] | None = None
    packages: Sequence[FilePath] = ()
    degrees_key: str = ""
    where: str = ""

    def beside(self, name: str) -> FilePath:
        """Return the place of a file that the document names, from the folder of that."""
        return FilePath(name) if self.file is None else self.file.parent / name

    def inside(self, where: str) -> Self:
        """Return it for a part of the document, which errors name."""
        found = copy(self)
        found.where = f"{where}: "
        return found

    @contextmanager
    def naming(self, key: str = "") -> Iterator[None]:
        """Say of each error which file and key it is about, where there is a file."""
        try:
            yield
        except SelfmotionError as error:
            if self.file is None:
                raise
            text, start = str(error), f"{self.file}: {self.where}"
            if text.startswith(start):
                raise
            where = f"{start}{key}: " if key else start
            raise FileFormatError(f"{where}{text.removeprefix(f'{key}: ')}") from error

    def each(
        self,
        key: str,
        tables: Iterable[Any],
        options: Callable[[Any], Mapping[str, Any]] = lambda _: {},
    ) -> list[Any]:
        """Return what the tables of a list stand for; errors name the list and the number."""
        found = []
        for number, table in enumerate(tables):
            with self.naming(f"{key}[{number}]"):
                found.append(table.build(self, **options(table)))
        return found

    def once(self, described: Any, make: Callable[[], Any]) -> Any:
        """Return what is made of a description; the same object where the cache has it."""
        # With all digits of poses, which their own text leaves out.
        name = json.dumps(described, default=_described)
        if name not in self.cache:
            self.cache[name] = make()
        return self.cache[name]


def _described(value: Any) -> Any:
    if isinstance(value, Table):
        return value.given
    return str(value) if isinstance(value, FilePath) else value.homogeneous.tolist()
