"""Joints and links of a URDF, read strictly: invalid elements are errors with their names."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

from selfmotion.basics import RobotError, nearest, number_in

# Largest number in any unit of an arm; larger ones are typing errors.
LARGEST = 1e9


def numbers(
    element: ElementTree.Element, key: str, count: int, where: str, largest: float = LARGEST
) -> list[float]:
    """Return the numbers of an attribute, which are at most `largest`.

    Raises
    ------
    RobotError
        It is missing, empty, no number, not finite, beyond all sense, or there are not `count`.
    """
    text = element.get(key)
    found = [number_in(word) for word in (text or "").split()]
    values = [value for value in found if value is not None and math.isfinite(value)]
    if not len(values) == len(found) == count:
        given = "is missing" if text is None else f'is "{text}"'
        wanted = "a number" if count == 1 else f"{count} numbers, parted by spaces"
        raise RobotError(f"{where}: {key} {given}, expected {wanted}")
    if max(map(abs, values)) > largest:
        raise RobotError(f'{where}: {key} is "{text}", expected numbers in m, rad, s and kg')
    return values


def number(element: ElementTree.Element, key: str, where: str, largest: float = LARGEST) -> float:
    """Return the one number of an attribute; see `numbers`."""
    return numbers(element, key, 1, where, largest)[0]


def only(parent: ElementTree.Element, tag: str, where: str) -> ElementTree.Element | None:
    """Return the one child with that tag, or None.

    Raises
    ------
    RobotError
        There are more, of which libraries silently take the first.
    """
    found = parent.findall(tag)
    if len(found) > 1:
        raise RobotError(f"{where} has {len(found)} <{tag}> elements, expected one")
    return found[0] if found else None


def name_of(element: ElementTree.Element, number_of_it: int, source: str) -> str:
    """Return the name of a link or joint, the `number_of_it`-th of its kind.

    Raises
    ------
    RobotError
        It has none.
    """
    name = element.get("name")
    if not (name and name.strip()):
        raise RobotError(
            f"{source}: <{element.tag}> number {number_of_it} has no name; give it one"
        )
    return name


def check_origin(parent: ElementTree.Element, where: str) -> None:
    """Check the ``<origin>`` of an element, if it has one; see `numbers`."""
    origin = only(parent, "origin", where)
    for key in ("xyz", "rpy"):
        if origin is not None and origin.get(key) is not None:
            numbers(origin, key, 3, f"{where}: <origin>")


# Elements that only draw, name or weigh: errors in these do not matter to motions. urdfdom refuses
# a whole file for a material without a name. Here such elements are mended or left out, and visible
# changes are noted. An incomplete ``<inertial>`` is kept in the text, for messages about torques;
# parsers get the text without it.
_UNNAMED = "unnamed_material"
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def mend_cosmetics(
    root: ElementTree.Element, check_shape: Callable[[ElementTree.Element, str], None]
) -> list[str]:
    """Mend or drop elements that only draw, in place; return the changes in words.

    `check_shape` raises RobotError for a shape that cannot be drawn.
    """
    notes: list[str] = []
    count = 0
    for material in root.findall("material"):
        if not _is_colour(material, "material", notes) or not material.get("name"):
            root.remove(material)
    for link in root.findall("link"):
        where = f"link '{link.get('name')}'"
        for order, visual in enumerate(link.findall("visual"), start=1):
            which = f"{where}: <visual> {visual.get('name') or f'number {order}'}"
            try:
                check_shape(visual, which)
            except RobotError as error:
                link.remove(visual)
                notes.append(f"{error}; it is not drawn")
                continue
            for extra in visual.findall("material")[1:]:
                visual.remove(extra)
            for material in visual.findall("material"):
                drawn = _is_colour(material, f"{which}: <material>", notes)
                if not material.get("name"):
                    count += 1
                    material.set("name", f"{_UNNAMED}_{count}")
                    if not drawn:
                        visual.remove(material)
    return notes + [f"{where}; torques cannot be computed" for where in lacking_inertials(root)]


def without_limits(root: ElementTree.Element) -> dict[str, list[str]]:
    """Say 0, for none, where a ``<limit>`` has no velocity or effort; return joints by which."""
    found: dict[str, list[str]] = {"velocity": [], "effort": []}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in _MOVING:
            continue
        for key, names in found.items():
            if limit.get(key) is None:
                limit.set(key, "0")
                names.append(joint.get("name", ""))
    return found


def zero_speeds(root: ElementTree.Element) -> list[str]:
    """Return the joints whose ``<limit>`` says velocity 0, which is read as none."""
    limits = {joint.get("name", ""): joint.find("limit") for joint in root.findall("joint")
              if joint.get("type") in _MOVING}  # fmt: skip
    return [
        name
        for name, limit in limits.items()
        if limit is not None and number_in(limit.get("velocity", "")) == 0.0
    ]


def split_planar(root: ElementTree.Element, source: str) -> list[str]:
    """Turn planar joints with limits into x, y and a turn about the axis, in place; return notes.

    The plane is that of its frame's x and y if its axis is z, as in MoveIt and Tesseract; for
    another axis that frame is rotated by the shortest rotation.

    Raises
    ------
    RobotError
        Its parts would have the name of a link.
    """
    notes, taken = [], {link.get("name") for link in root.findall("link")}
    for joint in root.findall("joint"):
        if joint.get("type") != "planar":
            continue
        name, where = joint.get("name", ""), f"{source}: joint '{joint.get('name')}'"
        limit, axis = only(joint, "limit", where), only(joint, "axis", where)
        parts = [f"{name}_{part}" for part in ("x", "y", "yaw")]
        if limit is None or None in (limit.get("lower"), limit.get("upper")):
            # Of an arm that it does not move it does not matter.
            continue
        if taken & set(parts):
            raise RobotError(f"{where} is planar, and its parts have the name of a link")
        normal = [0.0, 0.0, 1.0] if axis is None else numbers(axis, "xyz", 3, f"{where}: <axis>")
        parent, child, origin = joint.find("parent"), joint.find("child"), joint.find("origin")
        if parent is None or child is None:
            continue
        links = [parent.get("link", ""), *parts[:2], child.get("link", "")]
        at = list(root).index(joint)
        root.remove(joint)
        directions = (*_plane_of(normal), normal)
        for k, (part, direction) in enumerate(zip(parts, directions, strict=True)):
            kind = "prismatic" if k < 2 else "continuous"
            one = ElementTree.Element("joint", name=part, type=kind)
            ElementTree.SubElement(one, "parent", link=links[k])
            ElementTree.SubElement(one, "child", link=links[k + 1])
            if k == 0 and origin is not None:
                one.append(origin)
            ElementTree.SubElement(one, "axis", xyz=" ".join(map(repr, direction)))
            given = dict(limit.attrib)
            if k == 2:
                given = {key: value for key, value in given.items() if key == "effort"}
            ElementTree.SubElement(one, "limit", given)
            root.insert(at + k, one)
            if k < 2:
                root.append(ElementTree.Element("link", name=part))
        plane = "; no <axis>, its plane is that of x and y" if axis is None else ""
        notes.append(
            f"joint '{name}' is planar: read as {', '.join(parts)}; its limits are those of the "
            f"first two, the turn has none{plane}"
        )
    return notes


def _plane_of(normal: list[float]) -> tuple[list[float], list[float]]:
    """Return the x and y axes of the frame whose z axis is rotated shortest to a normal."""
    length = math.hypot(*normal)
    x, y, z = (value / length for value in normal) if length > 0.0 else (0.0, 0.0, 1.0)
    if z < -1.0 + 1e-9:
        return [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]
    share = 1.0 / (1.0 + z)
    return [1.0 - share * x * x, -share * x * y, -x], [-share * x * y, 1.0 - share * y * y, -y]


# Types of joints with limits.
_MOVING = ("revolute", "prismatic", "continuous")


def _is_colour(material: ElementTree.Element, where: str, notes: list[str]) -> bool:
    """Return whether a material has a colour or a texture; an invalid one is removed."""
    for tag in ("color", "texture"):
        for extra in material.findall(tag)[1:]:
            material.remove(extra)
    colour, texture = material.find("color"), material.find("texture")
    if texture is not None and not texture.get("filename"):
        material.remove(texture)
        texture = None
    if colour is not None:
        given = (colour.get("rgba") or "").split()
        text = " ".join([*given, "1"] if len(given) == 3 else given)
        colour.set("rgba", text)
        try:
            values = numbers(colour, "rgba", 4, where)
            if not all(0.0 <= x <= 1.0 for x in values):
                colour.set("rgba", " ".join(repr(min(max(x, 0.0), 1.0)) for x in values))
        except RobotError as error:
            notes.append(f"{error}; it is drawn grey")
            material.remove(colour)
            colour = None
    return colour is not None or texture is not None


def lacking_inertials(root: ElementTree.Element) -> dict[str, str]:
    """Return missing values of incomplete ``<inertial>`` elements, in words → the link's name."""
    found = {}
    for link in root.findall("link"):
        inertial = link.find("inertial")
        lacks = "" if inertial is None else _lacks(inertial, f"link '{link.get('name')}'")
        if lacks:
            found[lacks] = link.get("name", "")
    return found


def _lacks(inertial: ElementTree.Element, where: str) -> str:
    for tag in ("mass", "inertia"):
        part = inertial.find(tag)
        if part is None:
            return f"{where}: its <inertial> has no <{tag}>"
        for key in ("value",) if tag == "mass" else MOMENTS:
            if part.get(key) is None:
                return f"{where}: its <{tag}> has no {key}"
    return ""


def without_lacking(root: ElementTree.Element) -> ElementTree.Element:
    """Take incomplete ``<inertial>`` elements out, in place; return the ``<robot>``."""
    lacking = set(lacking_inertials(root).values())
    for link in root.findall("link"):
        if link.get("name") in lacking:
            for inertial in link.findall("inertial"):
                link.remove(inertial)
    return root


# Links of a URDF: invalid elements are errors with their names.
#
# Pinocchio drops what it cannot read, and what follows it in the link, with a line on the
# terminal at most: a box with two sizes, numbers with commas, a capsule, a mass that is none.
# What is not there cannot be hit, so such files must not pass.

# Shape → its numbers, and their count.
_SIZES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}
# Negative inertia of a small part by rounding of CAD programs [kg m²].
_ROUNDING = 1e-9


def check_link_elements(root: ElementTree.Element, source: str) -> None:
    """Check every ``<link>`` of the ``<robot>``: name, inertia and bodies.

    Parameters
    ----------
    root : Element
        The ``<robot>``.
    source : str
        Name of the file in messages.

    Raises
    ------
    RobotError
        A name is missing or there twice, a mass or inertia is negative or no number; a collision
        element has no shape, an unknown one, or numbers that are invalid, not finite, too few or
        too many, or sizes that are not above 0. With link, element and value.
    """
    for element in root.iter("collision"):
        if not any(element in list(link) for link in root.findall("link")):
            raise RobotError(f"{source}: a <collision> is outside of the links; move it into one")
    taken: set[str] = set()
    for count, link in enumerate(root.findall("link"), start=1):
        name = name_of(link, count, source)
        if name in taken:
            raise RobotError(f"{source}: link name '{name}' is used more than once; rename one")
        taken.add(name)
        _check_inertial(link, f"{source}: link '{name}'")
        for order, element in enumerate(link.findall("collision"), start=1):
            which = element.get("name") or f"number {order}"
            check_shape(element, f"{source}: link '{name}': <collision> {which}")


def _check_inertial(link: ElementTree.Element, where: str) -> None:
    inertial = only(link, "inertial", where)
    if inertial is None:
        return
    check_origin(inertial, f"{where}: <inertial>")
    parts = {tag: only(inertial, tag, where) for tag in ("mass", "inertia")}
    for tag, part in parts.items():
        for key in ("value",) if tag == "mass" else MOMENTS:
            if part is None or part.get(key) is None:
                # Needed for torques alone.
                continue
            value = number(part, key, f"{where}: <{tag}>")
            if tag == "mass" and value < 0.0:
                raise RobotError(f"{where} has a negative mass {value} kg")
            if key in MOMENTS[:3] and value < -_ROUNDING:
                raise RobotError(f"{where} has a negative inertia {key} {value} kg m²")


def check_shape(element: ElementTree.Element, where: str) -> None:
    """Raise RobotError where a ``<collision>`` or ``<visual>`` has no shape of a URDF."""
    check_origin(element, where)
    shapes = [shape for geometry in element.findall("geometry") for shape in geometry]
    if len(shapes) != 1 or shapes[0].tag not in _SIZES:
        found = ", ".join(f"<{shape.tag}>" for shape in shapes) or "nothing"
        raise RobotError(
            f"{where}: its <geometry> holds {found}, expected one of "
            f"{', '.join(f'<{name}>' for name in _SIZES)}; a capsule is a cylinder and two spheres"
        )
    (shape,) = shapes
    where = f"{where}: <{shape.tag}>"
    for key, count in _SIZES[shape.tag].items():
        if min(numbers(shape, key, count, where)) <= 0.0:
            raise RobotError(f'{where} has {key}="{shape.get(key)}", expected sizes above 0')
    if shape.tag == "mesh":
        if not shape.get("filename"):
            raise RobotError(f"{where} has no filename")
        if shape.get("scale") is not None and 0.0 in numbers(shape, "scale", 3, where):
            raise RobotError(
                f'{where} has scale="{shape.get("scale")}", expected numbers other than 0'
            )


# Joints of a URDF: each is one that Pinocchio reads as it stands, or refused by name.
#
# Pinocchio loads a zero axis or reversed limits without a word, takes the first of two limits,
# and refuses the rest with one sentence for the whole file.

SINGLE_COORDINATE = ("revolute", "prismatic", "continuous")
_KNOWN_TYPES = (*SINGLE_COORDINATE, "fixed", "floating", "planar")
# Name of the world's frame in Pinocchio.
_WORLD = "universe"


def check_joint_elements(root: ElementTree.Element, source: str) -> None:
    """Check every ``<joint>`` of the ``<robot>``; `source` is the file's name in messages.

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
        _check_dynamics(joint, where)
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
            limit.set(key, "0")
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


# Attribute of ``<dynamics>`` with a rotor's inertia at the joint [kg m² or kg].
ARMATURE = "armature"


def _check_dynamics(joint: ElementTree.Element, where: str) -> None:
    turning = only(joint, "dynamics", where)
    for key in ("damping", "friction", ARMATURE):
        if turning is not None and turning.get(key) is not None:
            value = number(turning, key, f"{where}: <dynamics>")
            if value < 0.0:
                raise RobotError(f"{where}: <dynamics>: {key} is {value:g}, expected a number ≥ 0")


def _check_mimic(joint: ElementTree.Element, where: str) -> None:
    mimic = only(joint, "mimic", where)
    if mimic is None:
        return
    if not mimic.get("joint"):
        raise RobotError(f'{where} has a <mimic> without joint="…"')
    for key in ("multiplier", "offset"):
        if mimic.get(key) is not None:
            number(mimic, key, f"{where}: <mimic>")
