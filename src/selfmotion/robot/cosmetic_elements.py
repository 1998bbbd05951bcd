"""What of a URDF only draws, names or weighs: where it is wrong, the arm is none the worse.

urdfdom refuses a whole file for a material without a name. Here such elements are mended or left
out, and what changes the picture is noted. An ``<inertial>`` that lacks something stays in the
text, so that whoever asks for torques is told; parsers get the text without it.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable

from selfmotion.basics import RobotError
from selfmotion.robot.xml_values import numbers

_UNNAMED = "unnamed_material"
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def mend_cosmetics(
    root: ElementTree.Element, check_shape: Callable[[ElementTree.Element, str], None]
) -> list[str]:
    """Mend or drop what only draws, in place; return what was done, in words.

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


def _is_colour(material: ElementTree.Element, where: str, notes: list[str]) -> bool:
    """Return whether a material has a colour or a texture; one that is none is taken out."""
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
    """Return what incomplete ``<inertial>`` elements lack, in words → the link's name."""
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
