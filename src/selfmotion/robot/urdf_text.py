"""The text of a URDF: what is no URDF at all, and what is written in it for Pinocchio."""

import contextlib
import io
import logging
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from selfmotion.basics import RobotError, is_file
from selfmotion.robot.packages import Packages

# A limit that no motion reaches; Pinocchio wants finite numbers for a revolute joint.
_UNLIMITED = 1e6
# Elements in each other; URDFs have six.
_DEEPEST = 100
_XACRO = "is xacro; give it as a file with the suffix .xacro"


def root_of(text: str, source: str) -> ElementTree.Element:
    """Return the ``<robot>`` of URDF text; RobotError where there is none."""
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
    if root.find("link") is None:
        raise RobotError(f"{source}: has no <link>, expected those of an arm")
    return root


def check_expanded(root: ElementTree.Element, source: str) -> None:
    """Raise RobotError for what xacro should have replaced."""
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
    """Return what yourdfpy makes of URDF text, `yourdfpy.Robot`; RobotError where it cannot."""
    import yourdfpy

    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return yourdfpy.URDF.load(
                io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False
            ).robot
    # It raises what its parsers do, of which there are several.
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

    What is found as ``package://`` in the `folders` stays as it is; a relative name that is nowhere
    is taken to be beside the file.
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
