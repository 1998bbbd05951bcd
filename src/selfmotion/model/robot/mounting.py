"""Placed base, tool offset and carried bodies of an arm, as fixed joints of its URDF.

They are part of the URDF's text, so that kinematics, collision, saved plans and replays include
them.
"""

import dataclasses
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin

from selfmotion.basics import RobotError, nearest, shown
from selfmotion.model.robot.collada import says_unit
from selfmotion.model.robot.urdf import (
    BASE_JOINT,
    BODY_JOINT,
    TOOL_JOINT,
    Urdf,
    UrdfJoint,
)

# Link between the world and a placed base.
_BASE_LINK = "placed_base"
# Colour of carried bodies in drawings, RGBA.
_COLOR = "0.32 0.36 0.42 1"


class UrdfShape(NamedTuple):
    """A shape of a URDF.

    Attributes
    ----------
    tag : str
        ``"box"``, ``"sphere"``, ``"cylinder"`` or ``"mesh"``.
    values : dict
        Its attributes.
    height : float
        Its position along the z axis of its body [m].
    """

    tag: str
    values: Mapping[str, str]
    height: float = 0.0


@runtime_checkable
class CarriedBody(Protocol):
    """Fields of an obstacle that make a link of it."""

    shape: str
    name: str
    pose: pin.SE3
    frame: str | None

    @property
    def label(self) -> str:
        """Its name in messages."""

    def urdf_shapes(self) -> Sequence[UrdfShape]:
        """Return the shapes that it consists of, the first with all its lengths."""


class Mounting(NamedTuple):
    """Additions to the URDF of an arm.

    Attributes
    ----------
    tool : str
        The URDF's own link that the tool frame is fixed to.
    base, tool_offset : tuple of (position (3,), roll-pitch-yaw (3,)) or None
        Pose of the root link in the world, and of the tool frame in that of `tool` [m, rad].
    bodies : list of dict
        The bodies that it carries, as files describe obstacles.
    """

    tool: str
    base: tuple[list[float], list[float]] | None
    tool_offset: tuple[list[float], list[float]] | None
    bodies: list[dict[str, Any]]


def with_base(urdf: Urdf, pose: pin.SE3) -> Urdf:
    """Return the URDF with its root at `pose` in the world."""
    return _joined(urdf, BASE_JOINT, _BASE_LINK, urdf.root, _BASE_LINK, pose)


def moved_base(urdf: Urdf, by: pin.SE3) -> Urdf:
    """Return the URDF with its root moved by a rigid motion in world axes."""
    if BASE_JOINT not in urdf.joints:
        return with_base(urdf, by)
    root = ElementTree.fromstring(urdf.text)
    joint = next(item for item in root.findall("joint") if item.get("name") == BASE_JOINT)
    xyz, rpy = mounting_of(urdf, urdf.root).base or ([0.0] * 3, [0.0] * 3)
    pose = by * pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
    at = list(root).index(joint)
    root.remove(joint)
    ends = urdf.joints[BASE_JOINT]
    root.insert(at, placed(BASE_JOINT, ends.parent, ends.child, pose))
    return dataclasses.replace(urdf, text=ElementTree.tostring(root, encoding="unicode"))


def with_tool_offset(urdf: Urdf, tool: str, pose: pin.SE3) -> tuple[Urdf, str]:
    """Return the URDF with a frame at `pose` in that of the link `tool`, and the frame's name."""
    urdf.check_tool(tool)
    frame = f"{tool}_offset"
    return _joined(urdf, TOOL_JOINT, tool, frame, frame, pose), frame


def with_bodies(urdf: Urdf, tool: str, bodies: Any) -> Urdf:
    """Return the URDF with bodies as links, each on its frame or else on the link `tool`."""
    if not isinstance(bodies, list | tuple):
        bodies = [bodies]
    for body in bodies:
        if not isinstance(body, CarriedBody) or isinstance(body, type):
            raise RobotError(
                f"{urdf.source}: bodies has {shown(body)}, expected Box, Sphere, Cylinder, Capsule "
                f"or Mesh"
            )
        carrier = tool if body.frame is None else body.frame
        if carrier not in urdf.links:
            raise RobotError(
                f"{urdf.source}: {body.label}: its frame '{carrier}' is no link"
                f"{nearest(carrier, urdf.links)}; links: {', '.join(urdf.links)}"
            )
        shapes = body.urdf_shapes()
        urdf = dataclasses.replace(urdf, notes=(*urdf.notes, *_units_of(body, shapes)))
        elements = [
            _element(kind, body.shape, item) for kind in ("visual", "collision") for item in shapes
        ]
        joint = f"{BODY_JOINT}{body.name}"
        urdf = _joined(urdf, joint, carrier, body.name, body.name, body.pose, elements)
    return urdf


def _units_of(body: CarriedBody, shapes: Sequence[UrdfShape]) -> Iterator[str]:
    """Yield notes of meshes in files that say no unit, and are not scaled."""
    for item in shapes:
        scale = set(map(float, item.values.get("scale", "1").split()))
        file = Path(item.values.get("filename", ""))
        if item.tag == "mesh" and scale == {1.0} and not says_unit(file):
            yield f"{body.label}: {file.name} says no unit: taken for metres (else: scale)"


def _element(kind: str, shape: str, item: UrdfShape) -> ElementTree.Element:
    """Return a ``<visual>`` or ``<collision>`` element, called after the shape it is a part of."""
    element = ElementTree.Element(kind, name=shape)
    ElementTree.SubElement(element, "origin", xyz=_text([0.0, 0.0, item.height]), rpy="0 0 0")
    geometry = ElementTree.SubElement(element, "geometry")
    ElementTree.SubElement(geometry, item.tag, dict(item.values))
    if kind == "visual":
        material = ElementTree.SubElement(element, "material", name="carried_body")
        ElementTree.SubElement(material, "color", rgba=_COLOR)
    return element


def mounting_of(urdf: Urdf, tool: str) -> Mounting:
    """Return the additions of `with_base`, `with_tool_offset` and `with_bodies`."""
    root = ElementTree.fromstring(urdf.text)
    links = {link.get("name"): link for link in root.findall("link")}
    found: dict[str, tuple[list[float], list[float]]] = {}
    bodies = []
    for joint in root.findall("joint"):
        name, origin = joint.get("name", ""), joint.find("origin")
        if origin is None:
            continue
        if name in (BASE_JOINT, TOOL_JOINT) or name.startswith(BODY_JOINT):
            xyz, rpy = ([float(x) for x in origin.get(k, "").split()] for k in ("xyz", "rpy"))
            found[name] = (xyz, rpy)
        if name.startswith(BODY_JOINT):
            ends = urdf.joints[name]
            body = {"name": ends.child, "frame": ends.parent, "position": xyz, "rpy": rpy}
            bodies.append({**_described(links[ends.child]), **body})
    offset = urdf.joints.get(TOOL_JOINT)
    if offset is None or offset.child != tool:
        return Mounting(tool, found.get(BASE_JOINT), None, bodies)
    return Mounting(offset.parent, found.get(BASE_JOINT), found.get(TOOL_JOINT), bodies)


def _described(link: ElementTree.Element) -> dict[str, Any]:
    """Return the shape of a carried body and its lengths, as files describe obstacles."""
    (first, *_) = link.findall("collision")
    (geometry,) = first.iterfind("geometry/*")
    found: dict[str, Any] = {"shape": first.get("name", "")}
    for key, text in geometry.items():
        if key == "filename":
            found["file"] = text
        else:
            values = [float(value) for value in text.split()]
            found[key] = values if key == "size" else values[0]
    return found


def _joined(
    urdf: Urdf,
    joint: str,
    parent: str,
    child: str,
    new: str,
    pose: pin.SE3,
    elements: Sequence[ElementTree.Element] = (),
) -> Urdf:
    """Return the URDF with a fixed joint and the `new` link, of elements, at one end of it."""
    if joint in urdf.joints or new in urdf.links:
        taken = f"joint '{joint}'" if joint in urdf.joints else f"link '{new}'"
        what = "a body" if joint.startswith(BODY_JOINT) else "the pose of base or tool"
        raise RobotError(
            f"{urdf.source}: has a {taken}, whose name is needed for {what}; rename it"
        )
    root = ElementTree.fromstring(urdf.text)
    ElementTree.SubElement(root, "link", name=new).extend(elements)
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
