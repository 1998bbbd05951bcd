"""Classes and functions of the user's own, which files name as ``module:attribute``."""

import importlib
import sys
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import FileFormatError, ProblemError, Saved, public_name
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import NullMotion
from selfmotion.model.path import Path
from selfmotion.problem.constraints import Constraint
from selfmotion.problem.costs import Cost

# What the tables of a key may be of.
_FAMILIES: Mapping[str, type[Saved]] = {
    **dict.fromkeys(("path", "pieces"), Path),
    "null_motion": NullMotion,
    "costs": Cost,
    "constraints": Constraint,
}
_SHAPES = ("obstacles", "bodies", "leaves")


def import_own(
    node: Any, folder: FilePath, allowed: bool, key: str = "", where: str = ""
) -> dict[str, Callable[..., Any]]:
    """Import what kinds and shapes name as ``module:attribute``, and put the kinds there instead.

    Modules are looked for in `folder`, too.

    Returns
    -------
    dict
        The functions among them, by the name that the file gives; only costs may be functions.

    Raises
    ------
    FileFormatError
        Code is not allowed, or cannot be imported, or is nothing of that family.
    """
    functions: dict[str, Callable[..., Any]] = {}
    if isinstance(node, list):
        for number, item in enumerate(node):
            functions |= import_own(item, folder, allowed, key, f"{where}[{number}]")
    if not isinstance(node, dict):
        return functions
    family = _FAMILIES.get(key, Obstacle if key in _SHAPES else None)
    tag = "shape" if family is Obstacle else "kind"
    name = node.get(tag)
    if family is not None and isinstance(name, str) and ":" in name:
        value = _imported(name, f"{where}.{tag}", folder, allowed)
        if isinstance(value, type) and issubclass(value, family):
            node[tag] = getattr(value, tag)
        elif family is Cost and callable(value) and not isinstance(value, type):
            functions[name] = value
            node |= {"code": name, "kind": "function"}
        else:
            raise FileFormatError(
                f"{where}.{tag}: '{name}' is {value!r}, expected a class derived from "
                f"{public_name(family)}{' or a function' * (family is Cost)}"
            )
    for inner, value in node.items():
        place = f"{where}.{inner}" if where else inner
        functions |= import_own(value, folder, allowed, inner, place)
    return functions


def _imported(name: str, where: str, folder: FilePath, allowed: bool) -> Any:
    """Return what ``module:attribute`` names."""
    if not allowed:
        raise FileFormatError(
            f"{where}: '{name}' is code, which is run only where you ask for it: --allow-code, or "
            f"allow_code=True"
        )
    module, _, attribute = name.partition(":")
    place = str(folder.resolve())
    if place not in sys.path:
        sys.path.insert(0, place)
    try:
        return getattr(importlib.import_module(module), attribute)
    # A module of the user's may raise anything.
    except Exception as error:
        raise FileFormatError(
            f"{where}: '{name}' cannot be imported: {error}; expected module:attribute, the module "
            f"in {folder} or installed"
        ) from error


def described(value: Saved) -> dict[str, Any]:
    """Return the description of a value, its class named by module where it is the user's own."""
    table, cls = value.to_dict(), type(value)
    if table["kind"] != cls.kind:
        family = next(base for base in cls.__mro__ if Saved in base.__bases__)
        raise ProblemError(
            f"{cls.__name__} '{getattr(value, 'name', '')}' holds a function, which a file cannot "
            f"carry; derive a class from {public_name(family)}"
        )
    if not cls.__module__.startswith("selfmotion."):
        if cls.__module__ == "__main__":
            raise FileFormatError(
                f"{cls.__name__} is defined in the script that runs; move it into a module, which "
                f"a file can name"
            )
        table["kind"] = f"{cls.__module__}:{cls.__qualname__}"
    return table
