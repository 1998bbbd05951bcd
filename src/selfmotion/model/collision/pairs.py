"""Pairs of bodies that are checked."""

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from selfmotion.basics import CollisionError, RobotError
from selfmotion.model.collision.bodies import Body
from selfmotion.model.robot import Packages, Urdf, UrdfJoint, expand, is_placement


def candidate_pairs(
    bodies: Sequence[Body], urdf: Urdf, disabled: Iterable[tuple[str, str]] = ()
) -> list[tuple[int, int]]:
    """Return the index pairs of `bodies` that can meet and are not meant to.

    Left out are pairs whose distance no joint changes (so also the robot's base against the world:
    an arm bolted to a table touches it; see `held_pairs`), the two links that a movable joint
    joins, and pairs that are `disabled`. A tool on one of two such links and a bracket on the other
    can meet.

    Raises
    ------
    CollisionError
        A disabled name is neither a link of the arm nor an obstacle.
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
        # Disabling is of two links alone, not of all that is fixed to them.
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

    By joints that are held elsewhere than where they rest, at 0 or the nearest limit, or by placing
    parts of a cell. Links that such a joint joins are left out, and parts of which one carries the
    other: they may touch.
    """
    up = {joint.child: joint for joint in urdf.joints.values()}
    placements = {joint.name for joint in urdf.joints.values() if is_placement(joint)}
    rests = _rests(urdf)

    def put(link: str) -> frozenset[str]:
        """Return the joints from the root to a link that were put somewhere; "" for the world."""
        found = set()
        while link in up:
            joint = up[link]
            rest = rests.get(joint.name, 0.0)
            if joint.name in placements or abs(locked.get(joint.name, rest) - rest) > _AT_REST:
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
        # An overlap by placement may be with its carrier.
        return bool(ways - placements) or (bool(ways) and are_separate_parts(*links, urdf))

    return [
        (i, j)
        for i, j in itertools.combinations(range(len(bodies)), 2)
        if is_put(bodies[i], bodies[j])
    ]


# Distance from the rest of a joint below which a coordinate is at rest: rounding [rad or m].
_AT_REST = 1e-9


def _rests(urdf: Urdf) -> dict[str, float]:
    """Return the coordinates of joints that nobody moves: 0, or the nearest limit."""
    found: dict[str, float] = {}
    for element in ElementTree.fromstring(urdf.text).findall("joint"):
        limit = element.find("limit")
        if limit is not None:
            lower, upper = (float(limit.get(key, "0")) for key in ("lower", "upper"))
            found[str(element.get("name"))] = min(max(0.0, lower), upper)
    for name, joint in urdf.joints.items():
        scale, offset = 1.0, 0.0
        while joint.mimics is not None:
            offset, scale = scale * joint.offset + offset, scale * joint.multiplier
            joint = urdf.joints[joint.mimics]
        found[name] = scale * found.get(joint.name, 0.0) + offset
    return found


def held_together(bodies: Sequence[Body], urdf: Urdf) -> list[tuple[int, int]]:
    """Return the index pairs of links with a joint between them that the motion does not move.

    The joint is held at 0, or at its nearest limit, and these pairs are not checked. The two links
    of one joint, and links that are fixed to each other, are not among them: they may touch.
    """
    part = _rigid_parts(urdf)
    joined = {frozenset((joint.parent, joint.child)) for joint in _movable(urdf)}
    return [
        (i, j)
        for i, j in itertools.combinations(range(len(bodies)), 2)
        if bodies[i].joint == bodies[j].joint
        and bodies[i].link in part
        and bodies[j].link in part
        and part[bodies[i].link] != part[bodies[j].link]
        and {bodies[i].link, bodies[j].link} not in joined
    ]


def are_separate_parts(first: str, second: str, urdf: Urdf) -> bool:
    """Return whether two links are of parts of a cell of which none carries the other.

    Overlaps of these are by placement, not by design.
    """
    carriers = {_part(x.child): _part(x.parent) for x in urdf.joints.values() if is_placement(x)}
    one, other = _part(first), _part(second)
    if one == other or not {one, other} <= carriers.keys():
        return False
    return carriers[one] != other and carriers[other] != one


def are_neighbours(first: str, second: str, urdf: Urdf) -> bool:
    """Return whether a movable joint joins two links, or links fixed to them."""
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


def disabled_links(
    srdf: str | Path,
    arguments: Mapping[str, str] | None = None,
    packages: Sequence[str | Path] = (),
) -> tuple[tuple[str, str], ...]:
    """Return the pairs of links whose collisions an SRDF disables.

    Parameters
    ----------
    srdf : path
        An SRDF, or a xacro of one, which is expanded.
    arguments : dict, optional
        Those of the arm's own xacro; undeclared ones are left out.
    packages : sequence of path
        Folders that are searched for packages.

    Raises
    ------
    CollisionError
        The SRDF cannot be read, disables nothing, or a pair of it is not complete.
    """
    pairs = []
    for tag in _srdf_root(srdf, arguments, packages).iter("disable_collisions"):
        first, second = tag.get("link1", ""), tag.get("link2", "")
        if not (first and second):
            raise CollisionError(
                f"{srdf}: <disable_collisions> has link1='{first}' and link2='{second}', expected "
                f"two links"
            )
        pairs.append((first, second))
    if not pairs:
        raise CollisionError(
            f"{srdf}: has no <disable_collisions>, the only thing that is read of an SRDF: leave "
            f"it out, or give the file that has them"
        )
    # A link with itself is no pair; some files have it, and other programs pass over it.
    return tuple((first, second) for first, second in pairs if first != second)


def srdf_notes(
    srdf: str | Path,
    arguments: Mapping[str, str] | None = None,
    packages: Sequence[str | Path] = (),
) -> tuple[str, ...]:
    """Return a note of the elements of an SRDF that are not read; see `disabled_links`."""
    root = _srdf_root(srdf, arguments, packages)
    others = dict.fromkeys(tag.tag for tag in root if tag.tag != "disable_collisions")
    if not others:
        return ()
    return (
        f"{srdf}: <disable_collisions> is what is read; passed over: "
        f"{', '.join(f'<{name}>' for name in others)}",
    )


def _srdf_root(
    srdf: str | Path, arguments: Mapping[str, str] | None, packages: Sequence[str | Path]
) -> ElementTree.Element:
    """Return the element <robot> of an SRDF, expanded where it is xacro."""
    file = Path(srdf)
    try:
        root = ElementTree.parse(file).getroot()
        if any("xacro" in tag.tag for tag in root.iter() if isinstance(tag.tag, str)):
            near = Packages(file, tuple(map(str, packages)))
            root = ElementTree.fromstring(expand(file, arguments or {}, near, of_others=True))
    except RobotError as error:
        raise CollisionError(str(error)) from error
    except OSError as error:
        raise CollisionError(f"{srdf}: SRDF cannot be read: {error.strerror or error}") from error
    except ElementTree.ParseError as error:
        raise CollisionError(f"{srdf}: SRDF is not well-formed XML: {error}") from error
    if root.tag != "robot":
        raise CollisionError(f"{srdf}: the root element is <{root.tag}>, expected <robot>")
    return root
