"""What the models of all tables of problem files have in common.

A table is a class: its fields are the keys, each with type, default and sentence. From these come
the schema, the page of keys, and what is said of a file that is wrong. `build` makes what a table
stands for.
"""

import inspect
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path as FilePath
from typing import Any, Self, get_args, get_origin

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from selfmotion.basics import ANGLES, LENGTHS, Array, FileFormatError, SelfmotionError
from selfmotion.model.path import pose_of
from selfmotion.model.robot import RobotModel


class Table(BaseModel):
    """A table of a document. A key that is not given is its default, or None."""

    model_config = ConfigDict(extra="forbid", protected_namespaces=())

    @property
    def given(self) -> dict[str, Any]:
        """The keys that are given, with their values."""
        return {name: getattr(self, name) for name in _in_order(self)}


def _in_order(table: BaseModel) -> Iterator[str]:
    names = (*type(table).model_fields, *(table.model_extra or ()))
    return (name for name in names if name in table.model_fields_set)


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
        Of which part of the document errors are told, such as a seam; "" for none.
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


class OneOf:
    """Makes a type of several tables that are told apart by a key, and of the user's own classes.

    Parameters
    ----------
    tag : str
        The key that says which it is.
    tables : callable
        () → the tables, each with its value of that key.
    own : type of Table
        What reads the table of a class of the user's own.
    classes : callable
        () → all classes that are known by now, by the value of that key.
    besides : sequence of str
        Keys of such a table that are not among the parameters of its class.
    """

    def __init__(
        self,
        tag: str,
        tables: Callable[[], Sequence[type[Table]]],
        own: type[Table],
        classes: Callable[[], Mapping[str, type]],
        besides: Sequence[str] = (),
    ) -> None:
        self._tag, self._tables, self._own = tag, tables, own
        self._classes, self._besides = classes, besides

    def __get_pydantic_core_schema__(self, _source: Any, handler: Any) -> CoreSchema:
        several = {name: handler.generate_schema(item) for name, item in self.by_name().items()}
        union = core_schema.tagged_union_schema(several, self._tag)
        return core_schema.no_info_wrap_validator_function(self._read, union)

    def by_name(self) -> dict[str, type[Table]]:
        """Return the tables by the value of the key that tells them apart."""
        return {
            get_args(item.model_fields[self._tag].annotation)[0]: item for item in self._tables()
        }

    def _read(self, value: Any, refuse: Callable[[Any], Any]) -> Any:
        name = value.get(self._tag) if isinstance(value, Mapping) else None
        if isinstance(name, str):
            # Chosen here, so that errors are told without the kind in the way to a key.
            if name in (known := self.by_name()):
                return known[name].model_validate(value)
            if name in (classes := self._classes()):
                return self._read_own(classes[name], value)
        return refuse(value)

    def _read_own(self, cls: type, value: Mapping[str, Any]) -> Table:
        """Return the table of a class of the user's own, by the signature of that."""
        context = getattr(cls, "context", ())
        items = [x for x in inspect.signature(cls).parameters.values() if x.name not in context]
        known = [self._tag, *self._besides, *(item.name for item in items)]
        is_open = any(item.kind is item.VAR_KEYWORD for item in items)
        wrong = [
            unknown_key(name, known, value) for name in value if not (is_open or name in known)
        ]
        if wrong:
            raise ValidationError.from_exception_data(cls.__name__, wrong)
        poses = [item.name for item in items if "SE3" in str(item.annotation)]
        return self._own.model_validate(
            {name: pose_of(item) if name in poses else item for name, item in value.items()}
        )


class Either:
    """Makes a type of values that are told apart by what they are: a switch, a list or a table."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        types = {_form(item): item for item in get_args(source)}

        def read(value: Any, _refuse: Callable[[Any], Any]) -> Any:
            kind = types.get(type(value), types[dict])
            return TypeAdapter(kind).validate_python(value)

        return core_schema.no_info_wrap_validator_function(read, handler(source))


def _form(kind: Any) -> type:
    return next((form for form in (bool, list) if form in (kind, get_origin(kind))), dict)


def unknown_key(key: str, known: Sequence[str], table: Mapping[str, Any]) -> InitErrorDetails:
    """Return the error of a key that a table does not know."""
    said = f"unknown key{nearest_key(key, known)}"
    kind = PydanticCustomError("unknown_key", "{said}", {"said": said})
    return {"type": kind, "loc": (key,), "input": table[key]}


# Endings of keys in other units, and the keys that may have them.
UNITS = {"_deg": ANGLES, "_mm": LENGTHS}


def nearest_key(key: str, known: Sequence[str], unit: str = "") -> str:
    """Return what to say of an unknown key, which was written with a unit's ending."""
    units = [name + suffix for suffix, names in UNITS.items() for name in known if name in names]
    near = get_close_matches(key, [*known, *units], 1)
    if unit:
        # What has the same unit is what is meant.
        likely = [name for name in known if name in UNITS[unit]]
        near = [f"{name}{unit}" for name in get_close_matches(key, likely, 1)] or near
    return f", did you mean '{near[0]}'?" if near else f", expected one of: {', '.join(known)}"
