"""Types of keys that hold one of several tables, or of several forms."""

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from typing import Any, get_args, get_origin

from pydantic import TypeAdapter
from pydantic_core import CoreSchema, core_schema

from selfmotion.basics import scaled
from selfmotion.shell.documents.tables import Table, other_units, pose, refused


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
            # Chosen here, so that errors come without the kind in the way to a key.
            if name in (known := self.by_name()):
                return known[name].model_validate(value)
            cls = self._classes().get(name)
            # Of ours, what has no table is made while it is planned.
            if cls is not None and not cls.__module__.startswith("selfmotion."):
                return self._read_own(cls, value)
        return refuse(value)

    def _read_own(self, cls: type, written: Mapping[str, Any]) -> Table:
        """Return the table of a class of the user's own, by the signature of that."""
        context = getattr(cls, "context", ())
        items = [x for x in inspect.signature(cls).parameters.values() if x.name not in context]
        known = [self._tag, *self._besides, *(item.name for item in items)]
        units = {key: value for key, value in all_units().items() if value[0] in known}
        is_open = any(item.kind is item.VAR_KEYWORD for item in items)
        poses = [item.name for item in items if "SE3" in str(item.annotation)]
        value = dict[str, Any]()
        for key, item in written.items():
            name, unit = units.get(key, (key, 1.0))
            if not (is_open or name in known):
                raise refused(key, item, unknown_key(key, [*known, *units]))
            try:
                value[name] = scaled(item, unit) if key in units else item
                value[name] = pose(item) if name in poses else value[name]
            except ValueError as error:
                raise refused(key, item, str(error)) from error
        return self._own.model_validate(value)


def all_units() -> dict[str, tuple[str, float]]:
    """Return the keys in other units of all tables; see `other_units`."""
    found = [other_units(table) for table in all_tables()]
    # A margin is a share of limits, but for those of positions.
    return {key: value for units in found for key, value in units.items() if value[0] != "margin"}


def all_tables() -> Iterator[type[Table]]:
    """Yield all models of tables."""
    several = [Table]
    while several:
        table = several.pop()
        several += table.__subclasses__()
        yield table


class Either:
    """Makes a type of values that are told apart by what they are: a switch, a list or a table."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        types = {_form(item): item for item in get_args(source)}

        def read(value: Any, _refuse: Callable[[Any], Any]) -> Any:
            kind = types.get(type(value), types[dict])
            return _adapter(kind).validate_python(value)

        return core_schema.no_info_wrap_validator_function(read, handler(source))


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def _form(kind: Any) -> type:
    return next((form for form in (bool, list) if form in (kind, get_origin(kind))), dict)


def unknown_key(key: str, known: Sequence[str]) -> str:
    """Return what to say of a key that a table does not know."""
    near = get_close_matches(key, known, 1)
    plain = [name for name in known if not name.endswith(("_deg", "_mm"))]
    said = f"did you mean '{near[0]}'?" if near else f"expected one of: {', '.join(plain)}"
    return f"unknown key, {said}"
