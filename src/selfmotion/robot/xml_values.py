"""Numbers, names and single elements of a URDF, read strictly: what is wrong is named."""

import math
import xml.etree.ElementTree as ElementTree

from selfmotion.basics import RobotError

# Nothing about an arm is larger, in any of its units; beyond it lie typing errors.
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
    try:
        values = [float(word) for word in (text or "").split()]
    except ValueError:
        values = []
    # Python reads 1_000, Pinocchio does not.
    if len(values) != count or not all(map(math.isfinite, values)) or "_" in (text or ""):
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
    """Return the one child with that tag, or None where there is none.

    Raises
    ------
    RobotError
        There are more, of which Pinocchio would silently take the first.
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
