"""The unit that a Collada file says for its lengths."""

import re
from pathlib import Path

# Bytes at the head of a file that are searched for its unit.
_HEAD = 100_000
_UNIT = re.compile(rb"<unit\b[^>]{0,200}?\bmeter\s*=\s*[\"']\s*([0-9.eE+-]+)\s*[\"']")


def says_unit(file: Path) -> bool:
    """Whether a mesh file says in which unit it is: a ``.dae`` with one, no other format."""
    if file.suffix.lower() != ".dae":
        return False
    try:
        with file.open("rb") as stream:
            return _UNIT.search(stream.read(_HEAD)) is not None
    except OSError:
        return True


def unit_of(file: Path) -> float:
    """Return the metres of a length 1 in a mesh file: of a ``.dae`` its unit, else 1.

    RViz, Gazebo and MoveIt scale by it; Pinocchio's and coal's loaders do not.
    """
    if file.suffix.lower() != ".dae":
        return 1.0
    try:
        with file.open("rb") as stream:
            found = _UNIT.search(stream.read(_HEAD))
        unit = 1.0 if found is None else float(found[1])
    except (OSError, ValueError):
        return 1.0
    return unit if 0.0 < unit < 1e6 else 1.0
