"""Links of a URDF: each part is what it says, or refused by name.

Pinocchio drops what it cannot read, and what follows it in the link, with a line on the terminal at
most: a box with two sizes, numbers with commas, a capsule, a mass that is none. What is not there
cannot be hit, so such files must not pass.
"""

import xml.etree.ElementTree as ElementTree

from selfmotion.basics import RobotError
from selfmotion.robot.cosmetic_elements import MOMENTS
from selfmotion.robot.xml_values import check_origin, name_of, number, numbers, only

# Shape → its numbers, and how many of each.
_SIZES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}
# How far below 0 CAD programs round the inertia of a small part [kg m²].
_ROUNDING = 1e-9


def check_link_elements(root: ElementTree.Element, source: str) -> None:
    """Check every ``<link>`` of the ``<robot>``: name, inertia and bodies.

    Parameters
    ----------
    root : Element
        The ``<robot>``.
    source : str
        What messages call the file.

    Raises
    ------
    RobotError
        A name is missing or there twice, a mass or inertia is negative or no number; a collision
        element has no shape, one that URDF does not know, or numbers that are none, not finite, too
        few or too many, or sizes that are not above 0. Link, element and value are named.
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
                # Missed only where torques are asked for.
                continue
            value = number(part, key, f"{where}: <{tag}>")
            if tag == "mass" and value < 0.0:
                raise RobotError(f"{where} has a negative mass {value} kg")
            if key in MOMENTS[:3] and value < -_ROUNDING:
                raise RobotError(f"{where} has a negative inertia {key} {value} kg m²")


def check_shape(element: ElementTree.Element, where: str) -> None:
    """Raise RobotError where a ``<collision>`` or ``<visual>`` has no shape that URDF knows."""
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
