"""Saved values: each class registers its kind and describes itself for files."""

import dataclasses
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from selfmotion.basics.errors import FileFormatError


class Saved:
    """A value that describes itself by JSON-safe numbers and texts, and restores from them.

    A class that is given ``family=`` is the head of one (paths, costs, constraints, …). Every
    class below it is known to files by its `kind`, which is ``kind=`` or else the class's name;
    so a class of one's own is saved and loaded like ours, once its module is imported.

    A dataclass whose fields are numbers, texts, arrays, sequences or saved values needs no more;
    other classes give `to_dict` and `from_dict`. Fields named in `context` are left out of the
    description and given again by whoever restores it (a robot, for example).
    """

    kind: ClassVar[str] = ""
    context: ClassVar[tuple[str, ...]] = ()
    _family: ClassVar[str] = ""
    _known: ClassVar[dict[str, type["Saved"]]] = {}

    def __init_subclass__(
        cls, *, family: str | None = None, kind: str | None = None, **rest: Any
    ) -> None:
        super().__init_subclass__(**rest)
        if family is not None:
            cls._family, cls._known = family, {}
            return
        cls.kind = kind or cls.__name__
        if cls.kind.startswith("_"):  # what some kinds share
            return
        other = cls._known.get(cls.kind, cls)
        # The same class again is a module that was imported anew.
        if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
            raise TypeError(
                f"{cls._family} kind '{cls.kind}' is taken by {other.__module__}."
                f"{other.__qualname__}; give {cls.__qualname__} another kind="
            )
        cls._known[cls.kind] = cls

    @classmethod
    def kinds(cls) -> dict[str, type[Self]]:
        """Return the classes of the family that files know, by kind."""
        return dict(cls._known)  # type: ignore[arg-type]

    def to_dict(self) -> dict[str, Any]:
        """Return the description: ``kind`` and the fields.

        Raises
        ------
        FileFormatError
            The class is no dataclass, or a field is nothing that a file can carry.
        """
        if not dataclasses.is_dataclass(self):
            raise FileFormatError(
                f"{self._family} '{self.kind}': {type(self).__qualname__} is no dataclass, so "
                f"that a file cannot carry it; give it to_dict and from_dict"
            )
        fields = (f.name for f in dataclasses.fields(self) if f.init)
        values = {name: getattr(self, name) for name in fields if name not in self.context}
        where = f"{self._family} '{self.kind}'"
        return {"kind": self.kind, **{k: _plain(v, f"{where}: {k}") for k, v in values.items()}}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        """Return the value with that description, ``kind`` left out.

        `context` has the values that descriptions leave out; a class takes its own.
        """
        given = {name: value for name, value in context.items() if name in cls.context}
        return cls(**values, **given)


def restore(family: type[Saved], description: Mapping[str, Any], **context: Any) -> Any:
    """Return the value of a family that `Saved.to_dict` described.

    Raises
    ------
    FileFormatError
        The kind is unknown, or a key is missing or unknown.
    """
    values = dict(description)
    kind = values.pop("kind", None)
    name, known = family._family, family._known
    if kind not in known:
        raise FileFormatError(
            f"{name} kind is {kind!r}, expected one of: {', '.join(sorted(known))}; where it is a "
            f"class of your own, import its module first"
        )
    try:
        return known[kind].from_dict(values, **context)
    except (TypeError, KeyError) as error:
        raise FileFormatError(f"{name} of kind '{kind}': {error}") from error


def description_of(value: Saved) -> dict[str, Any]:
    """Return the identity of a value: its description, or its class and id without any."""
    try:
        return value.to_dict()
    except (FileFormatError, TypeError):
        kind = type(value)
        return {"kind": f"{kind.__module__}.{kind.__qualname__}", "id": id(value)}


def is_known(family: type[Saved], description: Mapping[str, Any]) -> bool:
    """Whether the kind of a description is known here."""
    return description.get("kind") in family._known


def _plain(value: Any, where: str) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Saved):
        return value.to_dict()
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "homogeneous"):
        return value.homogeneous.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item, where) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = (f.name for f in dataclasses.fields(value) if f.init)
        return {name: _plain(getattr(value, name), where) for name in names}
    raise FileFormatError(
        f"{where} is {value!r}, which a file cannot carry; give the class to_dict and from_dict"
    )
