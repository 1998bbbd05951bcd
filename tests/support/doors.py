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
