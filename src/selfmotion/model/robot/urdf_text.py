"""From a file to the text of a URDF: its packages, xacro, and files that are no URDF."""

import contextlib
import io
import itertools
import logging
import os
import re
import tempfile
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmotion.basics import RobotError, is_file, is_folder, nearest, shown
from selfmotion.model.robot.xacro_expressions import only_arithmetic

# Packages and files that robot descriptions name, found on this machine without ROS.
#
# ``$(find NAME)`` of xacro, ``package://NAME/…``, ``model://NAME/…``, ``file://`` and absolute
# paths of the machine that wrote a file, and relative paths: all are looked up here, in this
# order, the nearest first:
#
# 1. folders that are given (``packages=``), and three levels below them
# 2. the folders above the file: one of that name, or whose ``package.xml`` says so, or one
#    beside it
# 3. ``AMENT_PREFIX_PATH`` (``share/NAME``), and ``ROS_PACKAGE_PATH`` with three levels below
# 4. three levels below the folders above the file, up to six of them, or to the root of a
#    repository

# Levels below a folder that are searched …
_BELOW = 3
# … below this number of folders above a file …
_ABOVE = 6
# … up to this number of folders in all: a home is larger than any workspace.
_MOST = 5000
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
                if folder in seen or len(seen) > _MOST:
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


# Xacro files, expanded by the package xacro.

# Xacro keeps its state in its modules: one file at a time.
_alone = threading.Lock()
_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")
_ARGUMENT = re.compile(r"\$\(arg\s+([^)\s]+)\s*\)")
# Largest depth of included files whose arguments are listed.
_DEEPEST_INCLUDE = 10


def expand(
    path: Path, arguments: Mapping[str, str], packages: Packages, *, of_others: bool = False
) -> str:
    """Return the text of a URDF or an SRDF that is a xacro file.

    Parameters
    ----------
    path : Path
    arguments : dict
        Values of its ``<xacro:arg>``.
    packages : Packages
        Search for ``$(find NAME)``.
    of_others : bool
        Whether arguments that it does not have are left out: they are those of another file.

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
    if of_others:
        known = declared.defaults
        arguments = {key: value for key, value in arguments.items() if key in known}
    for key in arguments:
        if declared.complete and key not in declared.defaults:
            raise RobotError(
                f"{path}: has no argument '{key}'{nearest(key, declared.defaults)}; {declared}"
            )
    mappings = {key: _text(value) for key, value in arguments.items()}
    # What <robot> says is looked at before what it holds: its arguments would have no default yet.
    mappings = {**declared.of_root(path), **mappings}
    try:
        with contextlib.redirect_stderr(io.StringIO()), _finding(packages):
            document = xacro.process_file(str(path), mappings=mappings)
    # A xacro file holds expressions of Python, which may raise anything.
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        # Only the first cause, without the chain of includes.
        missing = said.split("package '")
        reason = f"package '{missing[1].strip()}" if missing[1:] else said
        empty = [key for key, value in declared.defaults.items() if not value]
        told = f"; {declared}" if "argument" in reason or set(empty) - set(arguments) else ""
        raise RobotError(f"{path}: cannot be expanded by xacro: {reason}{told}") from error
    text: str = document.toxml()
    if not of_others and document.getElementsByTagName("link").length == 0:
        _check_called(path)
    return text


def is_xacro(file: Path) -> bool:
    """Whether a file has elements of xacro, or values that xacro replaces."""
    try:
        root = ElementTree.parse(file).getroot()
    except (OSError, ElementTree.ParseError):
        return False
    if any("xacro" in element.tag for element in root.iter() if isinstance(element.tag, str)):
        return True
    values = (value for element in root.iter() for value in element.attrib.values())
    return any("${" in value or "$(" in value for value in values)


def _check_called(path: Path) -> None:
    """Raise RobotError for a xacro file that defines macros and calls none."""
    root = ElementTree.parse(path).getroot()
    macros = [item for item in root if _tag(item) == "macro"]
    if not macros:
        return
    named = "; ".join(
        f"{item.get('name')} (params: {item.get('params') or 'none'})" for item in macros
    )
    beside = sorted(
        other.name
        for other in path.resolve().parent.glob("*.xacro")
        if other.name != path.name and f"{path.name}" in _content(other)
    )
    usual = f": {' or '.join(beside[:_FEW])}" if beside else ""
    raise RobotError(
        f"{path}: defines the macro {named} and calls none, so that it has no arm: give the file "
        f"that includes it and calls the macro{usual}; or write one beside it: <xacro:include "
        f'filename="{path.name}"/> <xacro:{macros[0].get("name")} …/>'
    )


# Largest number of including files in a message.
_FEW = 3


def _tag(element: ElementTree.Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _content(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:
        return ""


def _text(value: Any) -> str:
    """Return a value as xacro reads it: True of Python and TOML is true."""
    return str(value).lower() if isinstance(value, bool) else str(value)


class _Declared:
    """The arguments of a xacro file and of its includes.

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
        """Name → default; None for none."""
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
            tag = _tag(element)
            if tag == "arg" and element.get("name"):
                self._given.setdefault(element.get("name", ""), element.get("default"))
            elif tag == "include" and depth < _DEEPEST_INCLUDE:
                place = self._place(element.get("filename", ""), file)
                if place is None:
                    self.complete = False
                else:
                    self.read(place, depth + 1)
            for text in (*element.attrib.values(), element.text or ""):
                for name in _ARGUMENT.findall(text):
                    self._used[name] = None

    def of_root(self, file: Path) -> dict[str, str]:
        """Return the plain defaults of those that the root element of a file uses."""
        try:
            used = " ".join(ElementTree.parse(file).getroot().attrib.values())
        except (OSError, ElementTree.ParseError):
            return {}
        names = _ARGUMENT.findall(used)
        known = {name: self._given.get(name) for name in names}
        return {name: text for name, text in known.items() if text is not None and "$" not in text}

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
        return (
            f"its arguments: {listed}; give them with --set robot.arguments.NAME=VALUE (arguments=)"
        )


@contextlib.contextmanager
def _finding(packages: Packages) -> Iterator[None]:
    """Let xacro find packages without ROS: its own function needs a module of ROS 2."""
    from xacro import substitution_args

    def find(name: str) -> str:
        folder = packages.folder(name)
        if folder is None:
            raise substitution_args.SubstitutionException(packages.searched(name))
        return str(folder)

    with _alone, only_arithmetic(find):
        yield


# Limit beyond any motion; Pinocchio needs finite numbers for a revolute joint.
_UNLIMITED = 1e6
# Largest depth of nested elements; URDFs have six.
_DEEPEST = 100
_XACRO = "is xacro; give it as a file with the suffix .xacro"


def root_of(text: str, source: str) -> ElementTree.Element:
    """Return the ``<robot>`` of URDF text; RobotError without one."""
    if not text.strip():
        raise RobotError(f"{source}: is empty, expected a URDF")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        if "<xacro:" in text:
            raise RobotError(f"{source}: {_XACRO}") from error
        if text.startswith("version https://git-lfs"):
            raise RobotError(
                f"{source}: is a pointer of Git LFS, not the file itself; run git lfs pull"
            ) from error
        raise RobotError(f"{source}: is not well-formed XML: {error}") from error
    level = [root]
    for _ in range(_DEEPEST):
        level = [child for element in level for child in element]
    if level:
        raise RobotError(f"{source}: more than {_DEEPEST} elements lie in each other")
    if any("xacro" in element.tag for element in root.iter() if isinstance(element.tag, str)):
        raise RobotError(f"{source}: {_XACRO}")
    if root.tag != "robot":
        raise RobotError(f"{source}: the root element is <{root.tag}>, expected <robot>")
    if not root.get("name"):
        root.set("name", Path(source).stem or "robot")
    _check_names(root, source)
    if root.find("link") is None:
        raise RobotError(f"{source}: has no <link>, expected those of an arm")
    return root


# Attributes with the name of a robot, a link, a joint or a frame.
_NAMING = ("name", "link", "joint")


def _check_names(root: ElementTree.Element, source: str) -> None:
    """Refuse names that are no single line: they stand in programs, tables and pages."""
    for element in root.iter():
        for key in _NAMING:
            name = element.get(key, "")
            odd = next((letter for letter in name if not letter.isprintable()), None)
            if odd is not None:
                raise RobotError(
                    f"{source}: <{element.tag}> has {key}={shown(name)}, with a character "
                    f"{ord(odd)}, expected one line of letters, digits and marks; call it otherwise"
                )


def check_expanded(root: ElementTree.Element, source: str) -> None:
    """Raise RobotError for expressions that xacro should have replaced."""
    for part in (root, *root.findall("link"), *root.findall("joint")):
        for element in [root] if part is root else part.iter():
            for key, value in element.items():
                if "${" in value or "$(" in value:
                    owner = f"<{part.tag}> '{part.get('name')}': " if part is not element else ""
                    raise RobotError(
                        f'{source}: {owner}<{element.tag}> has {key}="{value}": xacro is not '
                        f"expanded; give the file the suffix .xacro"
                    )


def parsed_by_yourdfpy(text: str, source: str) -> Any:
    """Return the result of yourdfpy for URDF text, `yourdfpy.Robot`; RobotError if it fails."""
    import yourdfpy

    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return yourdfpy.URDF.load(
                io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False
            ).robot
    # It raises the exceptions of several parsers.
    except Exception as error:
        raise RobotError(f"{source}: is not a valid URDF: {error}") from error


def make_single_angles(root: ElementTree.Element) -> None:
    """Turn continuous joints into revolute ones without limits."""
    for joint in root.findall("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", str(-_UNLIMITED))
            limit.set("upper", str(_UNLIMITED))


def make_meshes_absolute(
    root: ElementTree.Element, packages: Packages, folders: Sequence[str]
) -> None:
    """Turn addresses of meshes into paths on this machine, as far as they are there.

    Addresses ``package://`` in the `folders` are kept; a relative name that is not found is
    relative to the file.
    """
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        scheme, mark, rest = name.partition("://")
        is_there = any(is_file(Path(folder, rest)) for folder in folders)
        if mark and scheme in ("package", "model") and is_there:
            continue
        place = packages.place(name)
        if place is not None:
            mesh.set("filename", str(place))
        elif not mark and not Path(name).is_absolute():
            mesh.set("filename", str(packages.file.resolve().parent / name))
