"""Cells: several robots as one URDF tree on a common world.

Links and joints are named PART/NAME. The tree is one URDF text, so that kinematics, collision,
saved plans and replays include all parts.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from pathlib import Path

import pinocchio as pin

from selfmotion.basics import RobotError, is_file, nearest
from selfmotion.model.robot.mounting import placed
from selfmotion.model.robot.urdf import (
    Urdf,
    UrdfJoint,
    parse_urdf,
)

WORLD_LINK = "world"
# Name of the joint that places a part: PART/placement.
_PLACEMENT = "placement"
# Names of links, joints and materials in a URDF, by element and attribute.
_NAMES = (
    ("link", "name"),
    ("joint", "name"),
    ("joint/parent", "link"),
    ("joint/child", "link"),
    ("joint/mimic", "joint"),
    ("material", "name"),
    ("link/visual/material", "name"),
)


def is_placement(joint: UrdfJoint) -> bool:
    """Return whether a joint places a part of a cell."""
    return joint.kind == "fixed" and joint.name == f"{joint.child.partition('/')[0]}/{_PLACEMENT}"


def composed(
    parts: Mapping[str, Urdf],
    base: Mapping[str, pin.SE3],
    on: Mapping[str, str],
) -> Urdf:
    """Return several URDFs as one tree, whose root is the link "world".

    Parameters
    ----------
    parts : dict
        Name of a part → its URDF; links and joints are called ``PART/NAME`` from now on.
    base : dict
        Part → pose of its root link in the world, or on the link that carries it.
    on : dict
        Part → link that carries it, ``PART/LINK``.

    Raises
    ------
    RobotError
        A part that is placed does not exist, a link that carries one does not, or they carry each
        other.
    """
    _check_placed(parts, base=base, on=on)
    cell = ElementTree.Element("robot", name="+".join(parts))
    ElementTree.SubElement(cell, "link", name=WORLD_LINK)
    folders = dict.fromkeys(folder for urdf in parts.values() for folder in urdf.package_dirs)
    links = {f"{name}/{link}" for name, urdf in parts.items() for link in urdf.links}
    for name, urdf in parts.items():
        carrier = on.get(name, WORLD_LINK)
        if not isinstance(carrier, str) or carrier not in {*links, WORLD_LINK}:
            raise RobotError(
                f"on: part '{name}' stands on '{carrier}', which is no link"
                f"{nearest(carrier, sorted(links))}; links are called PART/LINK"
            )
        root = ElementTree.fromstring(urdf.text)
        for path, attribute in _NAMES:
            for element in root.findall(path):
                if element.get(attribute):
                    element.set(attribute, f"{name}/{element.get(attribute)}")
        _with_own_meshes(root, urdf.package_dirs, folders)
        cell.extend(root.findall("material") + root.findall("link") + root.findall("joint"))
        pose = base.get(name, pin.SE3.Identity())
        cell.append(placed(f"{name}/{_PLACEMENT}", carrier, f"{name}/{urdf.root}", pose))
    text = ElementTree.tostring(cell, encoding="unicode")
    found = parse_urdf(text, source=" + ".join(parts), package_dirs=tuple(folders))
    return found.with_continuous(
        f"{name}/{joint}" for name, urdf in parts.items() for joint in urdf.continuous()
    )


def _check_placed(parts: Mapping[str, Urdf], **placed_parts: Mapping[str, object]) -> None:
    for what, given in placed_parts.items():
        for name in given:
            if name not in parts:
                raise RobotError(
                    f"{what} names part '{name}', which there is not{nearest(name, parts)}; parts: "
                    f"{', '.join(parts)}"
                )


def _with_own_meshes(
    root: ElementTree.Element, own: Iterable[str], all_parts: Iterable[str]
) -> None:
    """Give meshes that another part's package would be taken for the address of the file."""
    for mesh in root.iter("mesh"):
        address = mesh.get("filename", "")
        file = _found(address, own)
        if file is not None and file != _found(address, all_parts):
            mesh.set("filename", str(file))


def _found(address: str, folders: Iterable[str]) -> Path | None:
    """Return the file of a ``package://`` address in the first folder that has it."""
    scheme, _, place = address.partition("://")
    files = (Path(folder) / place for folder in folders if scheme == "package")
    return next((file for file in files if is_file(file)), None)
