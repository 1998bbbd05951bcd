"""Collision elements of a URDF: each is a body, or refused by name.

Pinocchio drops what it cannot read without a word: a box with two sizes, numbers with commas, a
capsule. What is not there cannot be hit, so such files must not pass.
"""

import math
import xml.etree.ElementTree as ElementTree

from selfmotion.basics import RobotError

# Shape → its numbers, and how many of each.
_SIZES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}


def check_collision_elements(root: ElementTree.Element, source: str) -> None:
    """Check that every ``<collision>`` of every link describes a body.

    Parameters
    ----------
    root : Element
        The ``<robot>``.
    source : str
        What messages call the file.

    Raises
    ------
    RobotError
        An element has no shape, one that URDF does not know, or numbers that are none, not finite,
        too few or too many, or sizes that are not above 0. Link, element and value are named.
    """
    for element in root.iter("collision"):
        if not any(element in list(link) for link in root.findall("link")):
            raise RobotError(f"{source}: a <collision> is outside of the links; move it into one")
    for link in root.findall("link"):
        for number, element in enumerate(link.findall("collision"), start=1):
            which = element.get("name") or f"number {number}"
            _check_element(element, f"{source}: link '{link.get('name')}': <collision> {which}")


def _check_element(element: ElementTree.Element, where: str) -> None:
    for origin in element.findall("origin"):
        for key in ("xyz", "rpy"):
            if origin.get(key) is not None:
                _numbers(origin, key, 3, f"{where}: <origin>")
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
        if min(_numbers(shape, key, count, where)) <= 0.0:
            raise RobotError(f'{where} has {key}="{shape.get(key)}", expected sizes above 0')
    if shape.tag == "mesh":
        if not shape.get("filename"):
            raise RobotError(f"{where} has no filename")
        if shape.get("scale") is not None and 0.0 in _numbers(shape, "scale", 3, where):
            raise RobotError(
                f'{where} has scale="{shape.get("scale")}", expected numbers other than 0'
            )


def _numbers(element: ElementTree.Element, key: str, count: int, where: str) -> list[float]:
    text = element.get(key)
    try:
        values = [float(word) for word in (text or "").split()]
    except ValueError:
        values = []
    # Python reads 1_000, Pinocchio does not.
    if len(values) != count or not all(map(math.isfinite, values)) or "_" in (text or ""):
        given = "is missing" if text is None else f'is "{text}"'
        wanted = "a number" if count == 1 else f"{count} numbers, parted by spaces"
        raise RobotError(f"{where}: {key} {given}, expected {wanted}")
    return values
