"""What a package's door names."""

import ast
import inspect
from types import ModuleType


def named(door: ModuleType) -> list[str]:
    """Return the names that a package offers: those that its door imports under their own name."""
    imports = [
        x for x in ast.walk(ast.parse(inspect.getsource(door))) if isinstance(x, ast.ImportFrom)
    ]
    return [x.name for found in imports for x in found.names if x.asname == x.name]


def offered(top: ModuleType) -> list[str]:
    """Return what the top level offers: its own names, and those of its namespaces."""
    found = list[str]()
    for name in top.__all__:
        part = getattr(top, name)
        found += [f"{name}.{each}" for each in part.__all__] if inspect.ismodule(part) else [name]
    return found


def of(top: ModuleType, name: str) -> object:
    """Return what has a name, which may be one of a namespace."""
    found: object = top
    for part in name.split("."):
        found = getattr(found, part)
    return found
