"""Which pairs of bodies have to be checked."""

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from selfmotion.basics import CollisionError
from selfmotion.collision.bodies import Body
from selfmotion.robot import Urdf, UrdfJoint, is_placement


def candidate_pairs(
    bodies: Sequence[Body], urdf: Urdf, disabled: Iterable[tuple[str, str]] = ()
) -> list[tuple[int, int]]:
    """Return the index pairs of `bodies` that can meet and are not meant to.

    Left out are pairs whose distance no joint changes (so also the robot's base against the
    world: an arm bolted to a table touches it; see `held_pairs`), the two links that a movable
    joint joins, and pairs that are `disabled`. What is fixed to joined links, a tool to the one
    and a bracket to the other, can meet.

    Raises
    ------
    CollisionError
        What is disabled is neither a link of the arm nor an obstacle.
    """
    left_out = {frozenset((x.parent, x.child)) for x in _movable(urdf)}
    known = dict.fromkeys((*urdf.links, *(body.name for body in bodies)))
    for pair in disabled:
        for link in pair:
            if link not in known:
                near = ", ".join(f"'{name}'" for name in get_close_matches(link, known))
                raise CollisionError(
                    f"collisions of {' and '.join(repr(name) for name in pair)} are disabled, but "
                    f"the URDF has no link '{link}'" + (f"; it has {near}" if near else "")
                )
        left_out.add(frozenset(pair))

    def can_meet(first: Body, second: Body) -> bool:
        # A pair that is left out is that of two links alone, not of all that is fixed to them.
        names = frozenset((first.name, second.name))
        return first.joint != second.joint and names not in left_out

    return [
        (i, j)
        for i, j in itertools.combinations(range(len(bodies)), 2)
        if can_meet(bodies[i], bodies[j])
    ]


def held_pairs(
    bodies: Sequence[Body],
    urdf: Urdf,
    locked: Mapping[str, float],
    disabled: Iterable[tuple[str, str]] = (),
) -> list[tuple[int, int]]:
    """Return the index pairs of `bodies` that someone put where they are, and no joint moves.

    By joints that are held elsewhere than at 0, or by placing parts of a cell. Links that such a
    joint joins are left out, and parts of which one carries the other: they may touch.
    """
    up = {joint.child: joint for joint in urdf.joints.values()}
    placements = {joint.name for joint in urdf.joints.values() if is_placement(joint)}

    def put(link: str) -> frozenset[str]:
        """Return the joints from the root to a link that were put somewhere; "" for the world."""
        found = set()
        while link in up:
            joint = up[link]
            if joint.name in placements or locked.get(joint.name, 0.0) != 0.0:
                found.add(joint.name)
            link = joint.parent
        return frozenset(found)

    left_out = {frozenset(pair) for pair in disabled}
    left_out |= {frozenset((joint.parent, joint.child)) for joint in _movable(urdf)}
    above = {body.link: put(body.link) for body in bodies}

    def is_put(first: Body, second: Body) -> bool:
        if first.joint != second.joint or frozenset((first.name, second.name)) in left_out:
            return False
        ways, links = above[first.link] ^ above[second.link], (first.link, second.link)
        # What only a placement puts there may touch what carries it.
        return bool(ways - placements) or (bool(ways) and are_placed_apart(*links, urdf))

    return [
        (i, j)
        for i, j in itertools.combinations(range(len(bodies)), 2)
        if is_put(bodies[i], bodies[j])
    ]


def are_placed_apart(first: str, second: str, urdf: Urdf) -> bool:
    """Return whether two links are of parts of a cell of which none carries the other.

    What overlaps there does not so as it is made, but as it is placed.
    """
    carriers = {_part(x.child): _part(x.parent) for x in urdf.joints.values() if is_placement(x)}
    one, other = _part(first), _part(second)
    if one == other or not {one, other} <= carriers.keys():
        return False
    return carriers[one] != other and carriers[other] != one


def are_neighbours(first: str, second: str, urdf: Urdf) -> bool:
    """Return whether a movable joint joins two links, or what is fixed to them."""
    part = _rigid_parts(urdf)
    parts = frozenset((part[first], part[second]))
    return any(frozenset((part[x.parent], part[x.child])) == parts for x in _movable(urdf))


def _part(link: str) -> str:
    return link.partition("/")[0]


def _movable(urdf: Urdf) -> Iterator[UrdfJoint]:
    return (joint for joint in urdf.joints.values() if joint.kind != "fixed")


def _rigid_parts(urdf: Urdf) -> dict[str, str]:
    """Map each link to the first link of the group that fixed joints make with it."""
    by_child = {joint.child: joint for joint in urdf.joints.values()}

    def first(link: str) -> str:
        while link in by_child and by_child[link].kind == "fixed":
            link = by_child[link].parent
        return link

    return {link: first(link) for link in urdf.links}


def disabled_links(srdf: str | Path) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links whose collisions an SRDF disables.

    Raises
    ------
    CollisionError
        The SRDF cannot be read, or a pair of it is not complete.
    """
    try:
        root = ElementTree.parse(srdf).getroot()
    except OSError as error:
        raise CollisionError(f"{srdf}: SRDF cannot be read: {error.strerror or error}") from error
    except ElementTree.ParseError as error:
        raise CollisionError(f"{srdf}: SRDF is not well-formed XML: {error}") from error
    if root.tag != "robot":
        raise CollisionError(f"{srdf}: the root element is <{root.tag}>, expected <robot>")
    pairs = []
    for tag in root.iter("disable_collisions"):
        first, second = tag.get("link1", ""), tag.get("link2", "")
        if not (first and second):
            raise CollisionError(
                f"{srdf}: <disable_collisions> has link1='{first}' and link2='{second}', expected "
                f"two links"
            )
        pairs.append((first, second))
    return tuple(pairs)
