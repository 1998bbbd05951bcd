"""Where an arm stands and what it holds: a placed base and an offset tool, as fixed joints.

They become part of the URDF's text, so that kinematics, bodies, saved plans and replays know of
them without a word.
"""

import dataclasses
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from selfmotion.basics import RobotError
from selfmotion.robot.urdf import BASE_JOINT, MOUNTING_JOINTS, TOOL_JOINT, Urdf, UrdfJoint

_BASE_LINK = "placed_base"


class Mounting(NamedTuple):
    """What was added to the URDF of an arm.

    Attributes
    ----------
    tool : str
        The URDF's own link that the tool frame is fixed to.
    base, tool_offset : tuple of (position (3,), roll-pitch-yaw (3,)) or None
        Pose of the root link in the world, and of the tool frame in that of `tool` [m, rad].
    """

    tool: str
    base: tuple[list[float], list[float]] | None
    tool_offset: tuple[list[float], list[float]] | None


def with_base(urdf: Urdf, pose: pin.SE3) -> Urdf:
    """Return the URDF with its root at `pose` in the world."""
    return _joined(urdf, BASE_JOINT, _BASE_LINK, urdf.root, _BASE_LINK, pose)


def with_tool_offset(urdf: Urdf, tool: str, pose: pin.SE3) -> tuple[Urdf, str]:
    """Return the URDF with a frame at `pose` in that of the link `tool`, and the frame's name."""
    urdf.check_tool(tool)
    frame = f"{tool}_offset"
    return _joined(urdf, TOOL_JOINT, tool, frame, frame, pose), frame


def mounting_of(urdf: Urdf, tool: str) -> Mounting:
    """Return what `with_base` and `with_tool_offset` added to an arm with that tool frame."""
    root = ElementTree.fromstring(urdf.text)
    found = {}
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        if joint.get("name") in MOUNTING_JOINTS and origin is not None:
            xyz, rpy = ([float(x) for x in origin.get(k, "").split()] for k in ("xyz", "rpy"))
            found[joint.get("name")] = (xyz, rpy)
    offset = urdf.joints.get(TOOL_JOINT)
    if offset is None or offset.child != tool:
        return Mounting(tool, found.get(BASE_JOINT), None)
    return Mounting(offset.parent, found.get(BASE_JOINT), found.get(TOOL_JOINT))


def _joined(urdf: Urdf, joint: str, parent: str, child: str, new: str, pose: pin.SE3) -> Urdf:
    """Return the URDF with a fixed joint and the `new` link at one end of it."""
    if joint in urdf.joints or new in urdf.links:
        taken = f"joint '{joint}'" if joint in urdf.joints else f"link '{new}'"
        raise RobotError(
            f"{urdf.source}: has a {taken}, whose name is needed for the pose of base or tool; "
            f"rename it"
        )
    root = ElementTree.fromstring(urdf.text)
    ElementTree.SubElement(root, "link", name=new)
    root.append(placed(joint, parent, child, pose))
    return dataclasses.replace(
        urdf,
        text=ElementTree.tostring(root, encoding="unicode"),
        joints={**urdf.joints, joint: UrdfJoint(joint, "fixed", parent, child, None)},
        links=(*urdf.links, new),
    )


def placed(joint: str, parent: str, child: str, pose: pin.SE3) -> ElementTree.Element:
    """Return a fixed joint that puts link `child` at a pose in the frame of link `parent`."""
    element = ElementTree.Element("joint", name=joint, type="fixed")
    ElementTree.SubElement(element, "parent", link=parent)
    ElementTree.SubElement(element, "child", link=child)
    xyz, rpy = pose.translation.tolist(), pin.rpy.matrixToRpy(pose.rotation).tolist()
    ElementTree.SubElement(element, "origin", xyz=_text(xyz), rpy=_text(rpy))
    return element


def _text(values: Sequence[float]) -> str:
    # An angle's sign of zero is noise.
    return " ".join(repr(float(np.float64(value) + 0.0)) for value in values)
