"""URDFs of Pinocchio's models, so that an arm that was built in code is one like any other."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, RobotError, is_file
from selfmotion.model.robot.urdf_elements import ARMATURE
from selfmotion.model.task import rpy

# Larger angles are no limits [rad].
_ENDLESS = 1e5
# Larger speeds and efforts are no limits.
_NONE = 1e30
# Largest difference of gravity from the standard one [m/s²].
_SAME_GRAVITY = 0.02
# Types of frames whose names a tool may have; the others are joints.
_NAMED = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)


def urdf_text_of(model: Any, geometry: Any, source: str) -> str:
    """Return URDF text of a ``pinocchio.Model``.

    Its bodies and frames become links, its revolute and prismatic joints are joints with their
    limits, and the inertia of each joint is that of the link it carries. Damping and friction are
    those of the joints; the inertia of a rotor (``armature``) is an attribute of ``<dynamics>`` of
    this package's own.

    Parameters
    ----------
    model : pinocchio.Model
    geometry : pinocchio.GeometryModel or None
        Its collision bodies; None for none.
    source : str
        Its name in messages.

    Raises
    ------
    RobotError
        A joint is neither revolute nor prismatic, a name is there twice, a URDF has no such body,
        or gravity does not act along -z.
    """
    _check_gravity(model, source)
    robot = ElementTree.Element("robot", name=model.name or "robot")
    links = _Links(model)
    names = links.names()
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise RobotError(f"{source}: two frames are called '{twice}'; rename one")
    bodies = {} if geometry is None else _bodies(model, links, geometry, source)
    for joint, link in enumerate(links.of_joint):
        element = ElementTree.SubElement(robot, "link", name=link)
        element.extend(bodies.get(link, ()))
        if joint:
            _add_inertia(element, model.inertias[joint])
    for joint in range(1, model.njoints):
        robot.append(_moving_joint(model, joint, links, source))
    for frame in links.others:
        item = model.frames[frame]
        ElementTree.SubElement(robot, "link", name=item.name).extend(bodies.get(item.name, ()))
        parent, place = links.above(frame)
        fixed = ElementTree.SubElement(robot, "joint", name=f"{item.name}_fixed", type="fixed")
        _connect(fixed, parent, item.name, place)
    return ElementTree.tostring(robot, encoding="unicode")


def _check_gravity(model: Any, source: str) -> None:
    """Refuse gravity that a URDF cannot say: torques would be verified for another one."""
    gravity = np.array(model.gravity.vector)
    usual = np.array(pin.Model().gravity.vector)
    if np.abs(gravity - usual).max() > _SAME_GRAVITY:
        found = ", ".join(f"{value:g}" for value in gravity[:3])
        raise RobotError(
            f"{source}: gravity is ({found}) m/s², expected (0, 0, -9.81): set model.gravity so, "
            f"and turn an arm on a wall by base= (load_robot({{'arm': model}}, "
            f"base={{'arm': pose}}))"
        )


class _Links:
    """Which frames of a model are links, and which of them is the body of each joint.

    Attributes
    ----------
    of_joint : list of str
        The link that each joint carries, that of the world first: its first body at its own place,
        or one that is called after it.
    others : list of int
        Frames that are links besides.
    """

    def __init__(self, model: Any) -> None:
        self._model = model
        self._bodies: dict[int, int] = {}
        named = [k for k, item in enumerate(model.frames) if item.type in _NAMED]
        for k in named:
            item = model.frames[k]
            is_there = item.placement.isIdentity(0.0) and item.type == pin.FrameType.BODY
            if is_there and item.parentJoint not in self._bodies:
                self._bodies[item.parentJoint] = k
        own = {joint: model.frames[k].name for joint, k in self._bodies.items()}
        self.of_joint = [
            own.get(joint, f"{model.names[joint]}_body" if joint else "world")
            for joint in range(model.njoints)
        ]
        self.others = [k for k in named if k not in self._bodies.values()]

    def names(self) -> list[str]:
        """Return the names of all links."""
        return [*self.of_joint, *(self._model.frames[k].name for k in self.others)]

    def above(self, frame: int) -> tuple[str, pin.SE3]:
        """Return the link that a frame is fixed to, and its place there."""
        frames = self._model.frames
        item = frames[frame]
        above, joint = item.parentFrame, item.parentJoint
        while above not in self.others and above and frames[above].parentJoint == joint:
            above = frames[above].parentFrame
        if above in self.others and frames[above].parentJoint == joint:
            return frames[above].name, frames[above].placement.actInv(item.placement)
        return self.of_joint[joint], item.placement


def _bodies(
    model: Any, links: _Links, geometry: Any, source: str
) -> dict[str, list[ElementTree.Element]]:
    """Return the ``<collision>`` elements of each link that has some."""
    found: dict[str, list[ElementTree.Element]] = {}
    for item in geometry.geometryObjects:
        link, place = links.of_joint[item.parentJoint], item.placement
        if item.parentFrame in links.others:
            # The parent of geometry that was built in code may be no frame.
            frame = model.frames[item.parentFrame]
            link, place = frame.name, frame.placement.actInv(place)
        element = ElementTree.Element("collision", name=item.name)
        ElementTree.SubElement(element, "origin", _origin(place))
        ElementTree.SubElement(element, "geometry").append(_shape(item, source))
        found.setdefault(link, []).append(element)
    return found


def _shape(item: Any, source: str) -> ElementTree.Element:
    body = item.geometry
    match body:
        case coal.Box():
            return ElementTree.Element("box", size=_text(2.0 * body.halfSide))
        case coal.Sphere():
            return ElementTree.Element("sphere", radius=repr(float(body.radius)))
        case coal.Cylinder():
            sizes = {"radius": body.radius, "length": 2.0 * body.halfLength}
            return ElementTree.Element("cylinder", {k: repr(float(v)) for k, v in sizes.items()})
    if not is_file(Path(item.meshPath)):
        raise RobotError(
            f"{source}: body '{item.name}' is a {type(body).__name__}, expected a box, sphere or "
            f"cylinder, or a mesh that was read from a file"
        )
    return ElementTree.Element("mesh", filename=item.meshPath, scale=_text(item.meshScale))


def _moving_joint(model: Any, joint: int, links: _Links, source: str) -> ElementTree.Element:
    kind, name = model.joints[joint], model.names[joint]
    data = kind.createData()
    if kind.nv != 1 or "Mimic" in kind.shortname():
        raise RobotError(
            f"{source}: joint '{name}' is a {kind.shortname()}, expected a revolute or prismatic "
            f"one: hold it by pinocchio.buildReducedModel, or give the URDF of the arm"
        )
    kind.calc(data, pin.neutral(model))
    motion = np.array(data.S).reshape(6)
    turns = bool(np.any(motion[3:]))
    if turns and np.any(motion[:3]):
        raise RobotError(
            f"{source}: joint '{name}' is a {kind.shortname()}, which turns and slides at once, "
            f"expected a revolute or prismatic one"
        )
    lower, upper, velocity, effort = _limits(model, kind)
    ends = lower > -_ENDLESS, upper < _ENDLESS
    if kind.nq == 1 and (ends[0] != ends[1] or not (turns or any(ends))):
        unit = "rad" if turns else "m"
        raise RobotError(
            f"{source}: joint '{name}' may go from {lower:g} to {upper:g} {unit}, "
            f"expected limits at both ends{' or at neither' if turns else ''}, as a URDF has them: "
            f"set lowerPositionLimit and upperPositionLimit of the model"
        )
    endless = turns and (kind.nq == 2 or not any(ends))
    form = "continuous" if endless else "revolute" if turns else "prismatic"
    element = ElementTree.Element("joint", name=name, type=form)
    parent = links.of_joint[model.parents[joint]]
    _connect(element, parent, links.of_joint[joint], model.jointPlacements[joint])
    ElementTree.SubElement(element, "axis", xyz=_text(motion[3:] if turns else motion[:3]))
    limit = {"velocity": velocity, "effort": effort}
    if not endless:
        limit |= {"lower": lower, "upper": upper}
    ElementTree.SubElement(element, "limit", {key: repr(each) for key, each in limit.items()})
    turning = {
        "damping": model.damping[kind.idx_v],
        "friction": model.upperDryFrictionLimit[kind.idx_v],
        ARMATURE: model.armature[kind.idx_v],
    }
    if any(turning.values()):
        said = {key: repr(float(each)) for key, each in turning.items()}
        ElementTree.SubElement(element, "dynamics", said)
    return element


def _limits(model: Any, kind: Any) -> tuple[float, float, float, float]:
    """Return the limits of position, velocity and effort; 0 where the last two are none."""
    lower, upper = model.lowerPositionLimit[kind.idx_q], model.upperPositionLimit[kind.idx_q]
    rates = (model.velocityLimit[kind.idx_v], model.upperEffortLimit[kind.idx_v])
    velocity, effort = (float(each) if 0.0 < each < _NONE else 0.0 for each in rates)
    return float(lower), float(upper), velocity, effort


def _connect(joint: ElementTree.Element, parent: str, child: str, place: pin.SE3) -> None:
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    ElementTree.SubElement(joint, "origin", _origin(place))


def _origin(place: pin.SE3) -> dict[str, str]:
    angles = rpy.matrixToRpy(np.array(place.rotation))
    return {"xyz": _text(place.translation), "rpy": _text(angles)}


def _add_inertia(link: ElementTree.Element, inertia: pin.Inertia) -> None:
    if not inertia.mass > 0.0:
        return
    element = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(element, "origin", xyz=_text(inertia.lever), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=repr(float(inertia.mass)))
    turning = np.array(inertia.inertia)
    values = {
        f"i{'xyz'[i]}{'xyz'[j]}": repr(float(turning[i, j])) for i in range(3) for j in range(i, 3)
    }
    ElementTree.SubElement(element, "inertia", values)


def _text(values: Array) -> str:
    # The shortest text that is the same number again.
    return " ".join(repr(float(value)) for value in values)
