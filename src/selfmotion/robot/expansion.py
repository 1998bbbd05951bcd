"""Xacro files, expanded by the package xacro."""

import contextlib
import io
import re
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from selfmotion.basics import RobotError, is_file, nearest
from selfmotion.robot.packages import Packages

# Xacro keeps its state in its modules: one file at a time.
_alone = threading.Lock()
_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")
# Files that include each other are followed so deep when their arguments are listed.
_DEEPEST = 10


def expand(path: Path, arguments: Mapping[str, str], packages: Packages) -> str:
    """Return the URDF text of a xacro file.

    Parameters
    ----------
    path : Path
    arguments : dict
        Values of its ``<xacro:arg>``.
    packages : Packages
        Where ``$(find NAME)`` is looked up.

    Raises
    ------
    RobotError
        The file is missing or cannot be expanded, or has no such argument; the message says why.
    """
    import xacro

    for key, value in arguments.items():
        if not (isinstance(key, str) and isinstance(value, str | int | float)):
            raise RobotError(f"{path}: arguments has {key!r}: {value!r}, expected a text or number")
    if not is_file(path):
        raise RobotError(f"{path}: no such xacro file")
    declared = _Declared(packages)
    declared.read(path)
    for key in arguments:
        if declared.complete and key not in declared.defaults:
            raise RobotError(
                f"{path}: has no argument '{key}'{nearest(key, declared.defaults)}; {declared}"
            )
    mappings = {key: _text(value) for key, value in arguments.items()}
    try:
        with contextlib.redirect_stderr(io.StringIO()), _finding(packages):
            document = xacro.process_file(str(path), mappings=mappings)
    # A xacro file holds expressions of Python, which may raise anything.
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        # What was not found is said as it is, once, without what passed it on.
        missing = said.split("package '")
        reason = f"package '{missing[1].strip()}" if missing[1:] else said
        empty = [key for key, value in declared.defaults.items() if not value]
        known = f"; {declared}" if "argument" in reason or set(empty) - set(arguments) else ""
        raise RobotError(f"{path}: cannot be expanded by xacro: {reason}{known}") from error
    text: str = document.toxml()
    return text


def _text(value: Any) -> str:
    """Return a value as xacro reads it: True of Python and TOML is true."""
    return str(value).lower() if isinstance(value, bool) else str(value)


class _Declared:
    """The arguments of a xacro file and of what it includes.

    Attributes
    ----------
    complete : bool
        Whether all files that it includes are known.
    """

    def __init__(self, packages: Packages) -> None:
        self._given: dict[str, str | None] = {}
        self._used: dict[str, None] = {}
        self.complete = True
        self._packages, self._passed = packages, set[Path]()

    @property
    def defaults(self) -> dict[str, str | None]:
        """Name → default; None where there is none."""
        return {**self._used, **self._given}

    def read(self, file: Path, depth: int = 0) -> None:
        """Take those of a file."""
        if file.resolve() in self._passed:
            return
        self._passed.add(file.resolve())
        try:
            root = ElementTree.parse(file).getroot()
        except (OSError, ElementTree.ParseError):
            self.complete = False
            return
        for element in root.iter():
            tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
            if tag == "arg" and element.get("name"):
                self._given.setdefault(element.get("name", ""), element.get("default"))
            elif tag == "include" and depth < _DEEPEST:
                place = self._place(element.get("filename", ""), file)
                if place is None:
                    self.complete = False
                else:
                    self.read(place, depth + 1)
            for text in (*element.attrib.values(), element.text or ""):
                for name in re.findall(r"\$\(arg\s+([^)\s]+)\s*\)", text):
                    self._used[name] = None

    def _place(self, name: str, file: Path) -> Path | None:
        found = _FIND.match(name)
        if found:
            folder = self._packages.folder(found[1])
            name = name if folder is None else str(folder) + name[found.end() :]
        return None if "$" in name else file.parent / name

    def __str__(self) -> str:
        """Return them in words."""
        if not self.defaults:
            return "it declares no arguments"
        listed = ", ".join(
            f"{name} (no default)" if default is None else f'{name} (default "{default}")'
            for name, default in self.defaults.items()
        )
        return f"its arguments: {listed}; give them with --argument NAME=VALUE (arguments=)"


@contextlib.contextmanager
def _finding(packages: Packages) -> Iterator[None]:
    """Let xacro find packages without ROS: its own way asks for a module of ROS 2."""
    from xacro import substitution_args

    def find(name: str) -> str:
        folder = packages.folder(name)
        if folder is None:
            raise substitution_args.SubstitutionException(packages.searched(name))
        return str(folder)

    with _alone:
        own, known = substitution_args._eval_find, substitution_args._eval_dict
        substitution_args._eval_find = known["find"] = find
        try:
            yield
        finally:
            substitution_args._eval_find = known["find"] = own
