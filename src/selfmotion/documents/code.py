"""Classes and functions of a user's own, which a file names as ``module:attribute``."""

import importlib
import sys
from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Any

from selfmotion.basics import FileFormatError, Saved
from selfmotion.collision import Obstacle
from selfmotion.constraints import Constraint
from selfmotion.costs import Cost
from selfmotion.motion import NullMotion
from selfmotion.path import Path

# The kind of a cost that is a function.
FUNCTION = "function"

_FAMILIES: Mapping[str, type[Saved]] = {
    "path": Path,
    "null_motion": NullMotion,
    "costs": Cost,
    "constraints": Constraint,
}


def name_kinds(
    table: dict[str, Any], folder: FilePath, allowed: bool
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
    for section, family in _FAMILIES.items():
        found = table.get(section)
        for k, item in enumerate(found if isinstance(found, list) else [found]):
            where = f"{section}[{k}]" if isinstance(found, list) else section
            if not isinstance(item, dict):
                continue
            value = _code(item.get("kind"), f"{where}.kind", folder, allowed)
            if isinstance(value, type) and issubclass(value, family):
                item["kind"] = value.kind
            elif section == "costs" and callable(value) and not isinstance(value, type):
                functions[item["kind"]] = value
                item |= {"code": item["kind"], "kind": FUNCTION}
            elif value is not None:
                raise FileFormatError(
                    f"{where}.kind: '{item['kind']}' is {value!r}, expected a class derived from "
                    f"selfmotion.{family.__name__}" + (" or a function" * (section == "costs"))
                )
            if isinstance(item.get("obstacles"), list):
                _name_shapes(item["obstacles"], where, folder, allowed)
    return functions


def _name_shapes(listed: list[Any], where: str, folder: FilePath, allowed: bool) -> None:
    for k, item in enumerate(listed):
        if isinstance(item, dict):
            place = f"{where}.obstacles[{k}].shape"
            value = _code(item.get("shape"), place, folder, allowed)
            if isinstance(value, type) and issubclass(value, Obstacle):
                item["shape"] = value.shape
            elif value is not None:
                raise FileFormatError(
                    f"{place}: '{item['shape']}' is {value!r}, expected a class derived from "
                    f"selfmotion.obstacles.Obstacle"
                )


def _code(name: Any, where: str, folder: FilePath, allowed: bool) -> Any:
    """Return what ``module:attribute`` names; None where the name is none of that form."""
    if not isinstance(name, str) or ":" not in name:
        return None
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
