"""From a file to the text of a URDF: its packages, and files that are no URDF.

Packages and files that robot descriptions name are found on this machine without ROS.
``$(find NAME)`` of xacro, ``package://NAME/…``, ``model://NAME/…``, ``file://`` and absolute paths
of the machine that wrote a file, and relative paths: all are looked up here, in this order, the
nearest first:

1. folders that are given (``packages=``), and three levels below them
2. the folders above the file: one of that name, or whose ``package.xml`` says so, or one beside it
3. ``AMENT_PREFIX_PATH`` (``share/NAME``), and ``ROS_PACKAGE_PATH`` with three levels below
4. three levels below the folders above the file, up to six of them, or to the root of a repository
"""

import itertools
import os
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from selfmotion.basics import is_file, is_folder

# Levels below a folder that are searched …
_BELOW = 3
# … below this number of folders above a file …
_ABOVE = 6
# … up to this number of folders in all: a home is larger than any workspace.
_MAX_FOLDERS = 5000
_SKIPPED = {"node_modules", "__pycache__", "build", "log"}


@dataclass(frozen=True)
class Packages:
    """Search for a file's packages.

    Attributes
    ----------
    file : Path
        The description that names them.
    given : tuple of str
        Folders that the user names.
    """

    file: Path
    given: tuple[str, ...] = ()

    def folder(self, name: str) -> Path | None:
        """Return the folder of a package, None if not found."""
        return next(self._places(name), None)

    def place(self, address: str) -> Path | None:
        """Return the file that an address means, None where it is not on this machine."""
        scheme, mark, rest = address.partition("://")
        if not mark:
            scheme, rest = "", address
        if scheme in ("package", "model"):
            name, _, inside = rest.partition("/")
            places = (folder / inside for folder in self._places(name))
            return next((place for place in places if is_file(place)), None)
        if scheme not in ("", "file"):
            return None
        path = Path(rest)
        if not path.is_absolute():
            places = (folder / path for folder in self._above)
            return next((place for place in places if is_file(place)), None)
        return path if is_file(path) else self._moved(path)

    def searched(self, name: str) -> str:
        """Return in words the places that were searched for a package, and a remedy."""
        given = "".join(f"{folder}, " for folder in self.given)
        variables = ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH")
        known = " and ".join(
            key if os.environ.get(key) else f"{key} (not set)" for key in variables
        )
        return (
            f"package '{name}' is in none of {given}{self.file.resolve().parent} and the folders "
            f"above it, {_BELOW} levels below the nearest of these, {known}; name the folder that "
            f"has it: --set robot.packages=DIR (packages=)"
        )

    def called_otherwise(self, name: str, inside: str) -> str:
        """Return in words which folder above has a file of a package of another name; "" for none.

        With a remedy: what finds packages goes by their names.
        """
        folder = next((folder for folder in self._above if is_file(folder / inside)), None)
        if folder is None:
            return ""
        said = _package_name(folder) or folder.name
        return (
            f"package '{name}' is nowhere, but {folder} has {inside} and is called '{said}': "
            f"rename it, or link to it by that name (ln -s {folder} DIR/{name}) and give "
            f"--set robot.packages=DIR (packages=)"
        )

    @cached_property
    def _above(self) -> tuple[Path, ...]:
        """All folders above the file but the root, nearest first."""
        return tuple(folder for folder in self.file.resolve().parents if folder.parts[1:])

    @cached_property
    def _up(self) -> tuple[Path, ...]:
        """The folders above the file that are searched downwards, nearest first."""
        found: list[Path] = []
        shared = {Path.home(), Path(tempfile.gettempdir()).resolve()}
        for folder in self._above[:_ABOVE]:
            if len(folder.parts) < 3 or folder in shared:
                break
            found.append(folder)
            if (folder / ".git").exists():
                break
        return tuple(found)

    @cached_property
    def _given(self) -> tuple["_Walk", ...]:
        return tuple(_Walk([Path(folder)]) for folder in self.given)

    @cached_property
    def _ros(self) -> "_Walk":
        return _Walk(_folders_of("ROS_PACKAGE_PATH"))

    @cached_property
    def _around(self) -> "_Walk":
        return _Walk(self._up)

    def _places(self, name: str) -> Iterator[Path]:
        """Yield the folders that have a package's name, in the order at the head of the file."""
        for walk in self._given:
            yield from walk.named(name)
        for folder in self._above:
            yield from (place for place in (folder, folder / name) if _is(place, name))
        for prefix in _folders_of("AMENT_PREFIX_PATH"):
            if is_folder(prefix / "share" / name):
                yield prefix / "share" / name
        yield from self._ros.named(name)
        yield from self._around.named(name)

    def _moved(self, path: Path) -> Path | None:
        """Return a file of another machine: each folder of its path may be a package's."""
        for k, name in enumerate(path.parts[1:-1], 1):
            inside = Path(*path.parts[k + 1 :])
            for folder in self._near(name):
                if is_file(folder / inside):
                    return folder / inside
        return None

    def _near(self, name: str) -> Iterator[Path]:
        # Words of a path are searched below folders only if they look like a package's name.
        if "_" in name or name.endswith("description"):
            yield from self._places(name)
            return
        for folder in self._above:
            yield from (place for place in (folder, folder / name) if _is(place, name))


def _folders_of(variable: str) -> list[Path]:
    return [Path(item) for item in os.environ.get(variable, "").split(os.pathsep) if item]


def _is(folder: Path, name: str) -> bool:
    """Return whether a folder is the package of that name."""
    if not is_folder(folder):
        return False
    said = _package_name(folder)
    return said == name or folder.name == name


def _package_name(folder: Path) -> str | None:
    """Return the name in a folder's ``package.xml``; None without one."""
    try:
        found = ElementTree.parse(folder / "package.xml").findtext("name")
    except (OSError, ElementTree.ParseError):
        return None
    return None if found is None else found.strip()


class _Walk:
    """Folders and those below them, level by level, each listed once, on demand.

    Parameters
    ----------
    tops : sequence of Path
    """

    def __init__(self, tops: Sequence[Path]) -> None:
        self._seen: list[tuple[Path, str | None]] = []
        self._rest = _walk(tops)

    def named(self, name: str) -> Iterator[Path]:
        """Yield the folders that are a package of a name."""
        for number in itertools.count():
            if number == len(self._seen):
                folder = next(self._rest, None)
                if folder is None:
                    return
                self._seen.append((folder, _package_name(folder)))
            folder, said = self._seen[number]
            if name in (folder.name, said) and is_folder(folder):
                yield folder


def _walk(tops: Sequence[Path]) -> Iterator[Path]:
    """Yield folders and those below them, level by level."""
    seen: set[Path] = set()
    for top in tops:
        level = [top]
        for depth in range(_BELOW + 1):
            below: list[Path] = []
            for folder in level:
                if folder in seen or len(seen) > _MAX_FOLDERS:
                    continue
                seen.add(folder)
                yield folder
                if depth < _BELOW:
                    below += _inside(folder)
            level = below


def _inside(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            found = [
                entry.path
                for entry in entries
                if entry.is_dir() and not entry.name.startswith(".") and entry.name not in _SKIPPED
            ]
    except OSError:
        return []
    return [Path(path) for path in sorted(found)]
