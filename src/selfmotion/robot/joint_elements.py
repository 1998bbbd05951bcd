"""Joints of a URDF: each is one that Pinocchio reads as it stands, or refused by name.

Pinocchio loads a zero axis or reversed limits without a word, takes the first of two limits, and
refuses the rest with one sentence for the whole file.
"""

import math
import xml.etree.ElementTree as ElementTree

from selfmotion.basics import RobotError, nearest
from selfmotion.robot.xml_values import LARGEST, check_origin, name_of, number, numbers, only

SINGLE_COORDINATE = ("revolute", "prismatic", "continuous")
_KNOWN_TYPES = (*SINGLE_COORDINATE, "fixed", "floating", "planar")
# What Pinocchio calls the world's frame.
_WORLD = "universe"


def check_joint_elements(root: ElementTree.Element, source: str) -> None:
    """Check every ``<joint>`` of the ``<robot>``; `source` is what messages call the file.

    Raises
    ------
    RobotError
        A name, a type, an end, an origin, an axis, a limit or a mimic is missing, there twice, or
        no such thing; joint, element and value are named.
    """
    links = [link.get("name", "") for link in root.findall("link")]
    taken: set[str] = set()
    for count, joint in enumerate(root.findall("joint"), start=1):
        name = name_of(joint, count, source)
        if name in taken:
            raise RobotError(f"{source}: joint name '{name}' is used more than once; rename one")
        if name == _WORLD:
            raise RobotError(
                f"{source}: a joint is called '{_WORLD}', as Pinocchio calls the world; rename it"
            )
        taken.add(name)
        where = f"{source}: joint '{name}'"
        _check_type(joint, where)
        for end in ("parent", "child"):
            _check_end(joint, end, links, where)
        check_origin(joint, where)
        _check_axis(joint, where)
        _check_limit(joint, where)
        _check_mimic(joint, where)


def _check_type(joint: ElementTree.Element, where: str) -> None:
    kind = joint.get("type")
    if kind not in _KNOWN_TYPES:
        found = "no type" if kind is None else f"type '{kind}'"
        hint = "" if kind is None else nearest(kind, _KNOWN_TYPES)
        raise RobotError(f"{where} has {found}, expected one of {', '.join(_KNOWN_TYPES)}{hint}")


def _check_end(joint: ElementTree.Element, end: str, links: list[str], where: str) -> None:
    element = only(joint, end, where)
    link = None if element is None else element.get("link")
    if not link:
        raise RobotError(f'{where} has no {end}; add <{end} link="…"/>')
    if link not in links:
        raise RobotError(
            f"{where} refers to link '{link}', which does not exist{nearest(link, links)}"
        )


def _check_axis(joint: ElementTree.Element, where: str) -> None:
    axis = only(joint, "axis", where)
    if axis is None or joint.get("type") in ("fixed", "floating"):
        return
    values = numbers(axis, "xyz", 3, f"{where}: <axis>")
    if not math.hypot(*values) > 1e-6:
        raise RobotError(f"{where} has axis {values}, expected a direction of length > 0")


def _check_limit(joint: ElementTree.Element, where: str) -> None:
    limit, kind = only(joint, "limit", where), joint.get("type")
    bounded = kind in ("revolute", "prismatic")
    if bounded and (limit is None or None in (limit.get("lower"), limit.get("upper"))):
        remedy = "add them, or make it continuous" if kind == "revolute" else "add them"
        raise RobotError(f"{where} is {kind} without lower and upper limits; {remedy}")
    if limit is None:
        return
    for key in ("velocity", "effort"):
        if limit.get(key) is None:
            raise RobotError(
                f'{where} has a <limit> without {key}; add {key}="…", 0 where there is none'
            )
        value = _limit_number(limit, key, where, "; 0 is for none", math.inf)
        if value < 0.0:
            raise RobotError(f"{where} has {key} limit {value:g}, expected a number ≥ 0")
    remedy = "; without limits it is continuous" if kind == "revolute" else ""
    lower, upper = (
        _limit_number(limit, key, where, remedy) if limit.get(key) is not None else 0.0
        for key in ("lower", "upper")
    )
    if bounded and not lower <= upper:
        raise RobotError(f"{where} has reversed limits: lower {lower:g} is above upper {upper:g}")


def _limit_number(
    limit: ElementTree.Element, key: str, where: str, remedy: str, largest: float = LARGEST
) -> float:
    try:
        return number(limit, key, f"{where}: <limit>", largest)
    except RobotError as error:
        raise RobotError(f"{error}{remedy}") from None


def _check_mimic(joint: ElementTree.Element, where: str) -> None:
    mimic = only(joint, "mimic", where)
    if mimic is None:
        return
    if not mimic.get("joint"):
        raise RobotError(f'{where} has a <mimic> without joint="…"')
    for key in ("multiplier", "offset"):
        if mimic.get(key) is not None:
            number(mimic, key, f"{where}: <mimic>")
