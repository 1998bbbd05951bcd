"""Notes on what a URDF does not say, and on limits in it that are not read."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from pathlib import Path

from selfmotion.basics import number_in
from selfmotion.model.robot.collada import says_unit
from selfmotion.model.robot.urdf_elements import SINGLE_COORDINATE

# Largest number of links or joints that a note names.
_LISTED = 5
# Limits of an angle above the first are no arm's [rad]; up to the second they may be degrees.
_TURNS = 20.0
_CIRCLE = 720.0
# Attributes of a soft limit, and of the limit that it is within; the sign of what is narrower.
_SOFT = (("soft_lower_limit", "lower", 1.0), ("soft_upper_limit", "upper", -1.0))
# Parameters of an interface of ros2_control, and the attributes of a limit that they are within.
_OF_CONTROL = {
    ("position", "min"): ("lower", 1.0),
    ("position", "max"): ("upper", -1.0),
    ("velocity", "max"): ("velocity", -1.0),
}


def axes_unsaid(root: ElementTree.Element) -> list[str]:
    """Return a note of the joints that move and say no ``<axis>``: theirs is x, as URDF has it."""
    bare = [
        joint.get("name", "")
        for joint in root.findall("joint")
        if joint.get("type") in SINGLE_COORDINATE and joint.find("axis") is None
    ]
    return [f"{_listed(bare)}: no <axis>, which is x then"] if bare else []


def angles_in_degrees(root: ElementTree.Element) -> list[str]:
    """Return a note of joints that would make turn after turn: their limits may be in degrees."""
    found = []
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") != "revolute":
            continue
        bounds = [abs(number_in(limit.get(key, "")) or 0.0) for key in ("lower", "upper")]
        if _TURNS < max(bounds) <= _CIRCLE:
            found.append(joint.get("name", ""))
    if not found:
        return []
    return [
        f"{_listed(found)}: <limit> of more than {_TURNS:g} rad, {_TURNS / (2.0 * math.pi):.2g} "
        f"turns; in degrees? URDF has radians"
    ]


def limits_passed_over(root: ElementTree.Element) -> list[str]:
    """Return notes of limits that other programs keep, and that are narrower than ``<limit>``."""
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    notes = []
    soft = [name for name, joint in joints.items() if any(_narrower_soft(joint))]
    if soft:
        notes.append(
            f"{_listed(soft)}: soft limits of <safety_controller> are narrower than <limit>, and "
            f"are passed over: keep them by JointPositionLimits"
        )
    of_control = [
        item.get("name", "")
        for item in root.findall("ros2_control/joint")
        if any(_narrower_of_control(item, joints))
    ]
    if of_control:
        notes.append(
            f"{_listed(of_control)}: min and max in <ros2_control> are narrower than <limit>, and "
            f"are passed over: keep them by constraints"
        )
    return notes


def _narrower_soft(joint: ElementTree.Element) -> Iterator[bool]:
    """Yield for each soft limit of a joint whether it is narrower than its limit."""
    soft, limit = joint.find("safety_controller"), joint.find("limit")
    if soft is None or limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return
    for key, hard, sign in _SOFT:
        yield _is_narrower(soft.get(key), limit.get(hard), sign)


def _narrower_of_control(
    item: ElementTree.Element, joints: dict[str, ElementTree.Element]
) -> Iterator[bool]:
    """Yield for each bound of ros2_control on a joint whether it is narrower than its limit."""
    joint = joints.get(item.get("name", ""))
    limit = None if joint is None else joint.find("limit")
    for interface in item.findall("command_interface") if limit is not None else ():
        for parameter in interface.findall("param"):
            key = (interface.get("name", ""), parameter.get("name", ""))
            hard, sign = _OF_CONTROL.get(key, ("", 0.0))
            yield limit is not None and _is_narrower(parameter.text, limit.get(hard), sign)


def _is_narrower(inner: str | None, outer: str | None, sign: float) -> bool:
    one, other = number_in(inner or ""), number_in(outer or "")
    return one is not None and other is not None and sign * (one - other) > 0.0


def units_unsaid(text: str) -> tuple[str, ...]:
    """Return a note of bodies of meshes in files that say no unit: in metres, as URDF has it."""
    bare = [
        link.get("name", "")
        for link in ElementTree.fromstring(text).findall("link")
        for mesh in link.findall("collision/geometry/mesh")
        if mesh.get("scale") is None and not says_unit(Path(mesh.get("filename", "")))
    ]
    if not bare:
        return ()
    return (
        f"bodies of {_listed(bare)}: their mesh files say no unit and are taken for metres "
        f'(else: <mesh scale="0.001 0.001 0.001">)',
    )


def _listed(names: Iterable[str]) -> str:
    """Return names in quotes, the first ones of many."""
    several = list(dict.fromkeys(names))
    more = f" and {len(several) - _LISTED} more" if len(several) > _LISTED else ""
    return ", ".join(f"'{name}'" for name in several[:_LISTED]) + more
