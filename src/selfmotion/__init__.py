"""Plans the self-motion of redundant arms along a prescribed tool motion.

The tool motion holds by construction; what is optimised is the self-motion, the joint motion in
the null space of the task.

What a first script needs is here. The rest is in namespaces: `costs`, `constraints`, `paths`,
`obstacles`, `files`, `errors`, `motion` (null motions), `optimise`, `robot` (coordinates),
`certificate`, `result`, `job`, `margins`, `placement`, `realtime`, `replay` and `baselines` (other
works' methods).
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any
from warnings import warn

from selfmotion.moved import tell_moved

# What the stub beside this file imports is imported here when it is first used: name → module. So
# that `import selfmotion` takes no time, type checkers and editors know all names, and each stands
# in one list.
_MODULES = {
    alias.name: node.module or ""
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
# Namespaces that `from selfmotion import *` leaves alone.
_BESIDE = ("realtime", "replay", "testing")
# Names that were at the top level once, and have another one since.
_RENAMED = {"Binding": "ActiveConstraint", "BoughtMargin": "PlanWithMargin"}
__all__ = sorted(_MODULES.keys() - set(_BESIDE))


def __getattr__(name: str) -> Any:
    """Return what is imported when it is first asked for.

    What has a namespace was here in earlier states of 0.1.
    """
    if name == "__version__":
        from selfmotion.basics import version

        return version()
    if name in _MODULES:
        module = _MODULES[name]
        if module == __name__:
            return import_module(f"{__name__}.{name}")
        found = globals()[name] = getattr(import_module(module), name)
        return found
    now = _RENAMED.get(name, name)
    spaces = (space for space in __all__ if _MODULES[space] == __name__)
    for space in spaces if not name.startswith("__") else ():
        if now in import_module(f"{__name__}.{space}").__all__:
            moved = f"sm.{name} is sm.{space}.{now} now; the old name goes with the next version"
            warn(moved, DeprecationWarning, stacklevel=2)
            return getattr(import_module(f"{__name__}.{space}"), now)
    raise AttributeError(f"module 'selfmotion' has no attribute '{name}'")


def __dir__() -> list[str]:
    """Return what is offered: names of the top level, and namespaces."""
    return sorted(_MODULES)


tell_moved()
