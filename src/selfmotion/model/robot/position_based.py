"""Velocity limits that depend on the position of a joint, as the URDF of its maker gives them."""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

from selfmotion.basics import Array, RobotError, read_only
from selfmotion.model.robot.urdf import Urdf
from selfmotion.model.robot.urdf_elements import number, only

# The element and its attributes that libfranka reads (src/joint_velocity_limits.cpp of 0.21.2).
_ELEMENT = "position_based_velocity_limits"
_DECELERATION, _OFFSET = "deceleration_limit", "velocity_offset"


def position_based_limits(urdf: Urdf, joints: Sequence[str], lower: Array, upper: Array) -> Array:
    """Return decelerations, offsets, and the ends of the curves of joints, (4, n).

    The ends are the attributes lower and upper of the element, else the limits (n,) of the joint,
    as in libfranka. A joint without the element has the ends ±inf.

    Raises
    ------
    RobotError
        A number is none, or out of range, or a joint has several such elements.
    """
    found = np.array([np.ones(len(joints)), np.zeros(len(joints)), lower, upper])
    found[2:] = np.array([[-np.inf], [np.inf]])
    if _ELEMENT not in urdf.text:
        return read_only(found)
    by_name = {
        joint.get("name"): joint
        # Of the robot alone: controls and transmissions name joints, too.
        for joint in ElementTree.fromstring(urdf.text).findall("joint")
    }
    for k, name in enumerate(joints):
        where = f"{urdf.source}: joint '{name}'"
        element = only(by_name[name], _ELEMENT, where) if name in by_name else None
        if element is None:
            continue
        where = f"{where}: <{_ELEMENT}>"
        for end, usual in (("lower", lower[k]), ("upper", upper[k])):
            if np.isfinite(usual):
                element.attrib.setdefault(end, repr(float(usual)))
        keys = _DECELERATION, _OFFSET, "lower", "upper"
        found[:, k] = [number(element, key, where) for key in keys]
        if not (found[0, k] > 0.0 and found[1, k] >= 0.0 and found[2, k] < found[3, k]):
            raise RobotError(
                f"{where} has {_DECELERATION} {found[0, k]:g}, {_OFFSET} {found[1, k]:g}, lower "
                f"{found[2, k]:g} and upper {found[3, k]:g}; expected a deceleration above 0, an "
                f"offset of 0 or more, and lower below upper"
            )
    return read_only(found)
