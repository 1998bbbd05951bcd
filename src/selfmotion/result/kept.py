"""What finished work is kept under: a digest of all that decides what comes of it."""

import json
import sys
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selfmotion.basics import Saved, digest_of, digest_of_file, version, write_text
from selfmotion.collision import Obstacle
from selfmotion.constraints import Clearance, Constraint
from selfmotion.robot import RobotModel, mesh_digests


def key_of(asked: Any, files: Any) -> str:
    """Return the digest of what was asked for, as JSON-safe values, and of the files it reads.

    And of the package's version, and of the files of classes that are not of the package: what
    another one made is made again.
    """
    return digest_of(version(), asked, files, _code_of(asked))


def write_kept(file: Path, values: Mapping[str, Any]) -> None:
    """Write what is known of finished work, with its own name and a digest of it; atomically."""
    known = {"kept": file.stem, **values}
    write_text(file, json.dumps({**known, "whole": digest_of(known)}) + "\n")


def read_kept(file: Path) -> dict[str, Any] | None:
    """Return what `write_kept` wrote to this very file; None where it is anything else."""
    try:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        whole = found.pop("whole")
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    own = whole == digest_of(found) and found.pop("kept") == file.stem
    return found if own else None


def own_modules(asked: Any) -> list[str]:
    """Return the modules, not of this package, of the classes that JSON-safe values name.

    Of all that is made of others, and of what these are derived from.
    """
    strangers = [(kind, cls) for kind, cls in _classes() if not _is_ours(cls)]
    if not strangers:
        return []
    names = set(_named(asked))
    found = {base for kind, cls in strangers if kind in names for base in cls.__mro__}
    return sorted({cls.__module__ for _, cls in strangers if cls in found})


def _classes() -> Iterator[tuple[str, type]]:
    """Yield all classes that files know, with the name by which they do."""
    for cls in _below(Saved):
        yield getattr(cls, "kind", ""), cls
    for cls in _below(Obstacle):
        yield getattr(cls, "shape", ""), cls


def _below(cls: type) -> Iterator[type]:
    several: list[type] = cls.__subclasses__()
    for each in several:
        yield each
        yield from _below(each)


def _is_ours(cls: type) -> bool:
    return cls.__module__.partition(".")[0] == __name__.partition(".")[0]


def _named(value: Any) -> Iterator[str]:
    """Yield the names of classes in a description."""
    if isinstance(value, Mapping):
        yield from (value[key] for key in ("kind", "shape") if isinstance(value.get(key), str))
        for item in value.values():
            yield from _named(item)
    # Long lists are of numbers.
    elif isinstance(value, list | tuple) and not (value and isinstance(value[0], float)):
        for item in value:
            yield from _named(item)


def _code_of(asked: Any) -> dict[str, str]:
    """Return the digests of the files in which the user's own classes are that values name."""
    return {name: _code_in(name) for name in own_modules(asked)}


def _code_in(module: str) -> str:
    file = getattr(sys.modules.get(module), "__file__", None)
    return digest_of_file(Path(file)) if file else ""


def told(value: Any) -> Any:
    """Return a setting as what tells it from others: what it holds, and the code of whose it is."""
    if isinstance(value, Mapping):
        return {name: told(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [told(item) for item in value]
    if isinstance(value, np.random.Generator):
        return told(value.bit_generator.state)
    if value is None or isinstance(value, bool | int | float | str | np.ndarray | np.generic):
        return value
    kind = value if hasattr(value, "__qualname__") else type(value)
    code = "" if _is_ours(kind) else _code_in(kind.__module__)
    held = {} if kind is value else told(getattr(value, "__dict__", repr(value)))
    return [f"{kind.__module__}.{kind.__qualname__}", code, held]


def files_of(
    robot: RobotModel, constraints: Sequence[Constraint], known: MutableMapping[str, Any]
) -> dict[str, str]:
    """Return the SHA-256 of each mesh file that bodies are made of; "" for one that is missing.

    Those of an arm are read once, and put into what is `known`.
    """
    # The same text names other files where its packages are elsewhere.
    own = f"meshes of {robot.urdf.sha256} in {robot.urdf.package_dirs}"
    if own not in known:
        known[own] = mesh_digests(robot.urdf, "collision")
    bodies = (body for item in constraints for body in _bodies(item, robot))
    given = {str(file): digest_of_file(file) for body in bodies for file in body.files}
    return {**known[own], **given}


def _bodies(item: Constraint, robot: RobotModel) -> Iterator[Obstacle]:
    # Its requirement makes bodies, which takes a good part of a second.
    yield from item.obstacles if isinstance(item, Clearance) else item.requirement(robot).obstacles


class Made(dict[str, Any]):
    """Arms and bodies that this process made before, by their description; see `load_plan`.

    Forgotten when there are many, or a file that they were made of is another.
    """

    _MANY = 64

    def __init__(self) -> None:
        super().__init__()
        self._files: dict[str, str] = {}

    def of(self, files: Mapping[str, str]) -> "Made":
        """Return itself, for work whose bodies are made of files with these digests."""
        changed = any(self._files.get(name, digest) != digest for name, digest in files.items())
        if changed or len(self) > self._MANY:
            self.clear()
        self._files.update(files)
        return self
