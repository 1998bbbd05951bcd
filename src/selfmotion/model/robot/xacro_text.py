"""Xacro files, expanded by the package xacro."""

import contextlib
import io
import logging
import re
import threading
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from selfmotion.basics import RobotError, is_file, nearest, shown
from selfmotion.model.robot.urdf_text import Packages
from selfmotion.model.robot.xacro_expressions import only_arithmetic

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
