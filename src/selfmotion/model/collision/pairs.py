"""Pairs of bodies that are checked, their overlaps in samples, and the closest pair."""

import itertools
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from selfmotion.basics import Array, CollisionError, RobotError
from selfmotion.model.collision.bodies import Body, link_bodies
from selfmotion.model.collision.distances import HullDistances, Ints
from selfmotion.model.collision.pair_distances import MeshDistances
from selfmotion.model.robot import Packages, RobotModel, Urdf, UrdfJoint, expand, is_placement


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


# How often bodies overlap in sampled configurations, and how often their convex hulls alone do.

# Number of configurations that are sampled.
SAMPLES = 500
# Share of configurations from which on an overlap may be by design …
_NEARLY_ALWAYS = 0.95
# … if this share of its depths is alike: what comes out of a tube overlaps ever less …
_MOST = 0.75
# … which means within this share of the median depth.
_ALIKE_DEPTHS = 0.25


@dataclass(frozen=True, eq=False)
class Links:
    """Bodies of a robot, and overlaps of their pairs in 500 configurations.

    Attributes
    ----------
    bodies : tuple of Body
        Its links' pieces.
    counts : dict
        Index pair of bodies → number of configurations in which these overlap, and their hulls
        alone.
    depths : dict
        Index pair of bodies that overlap in nearly all → depths of their hulls, sorted (D,).
    """

    bodies: tuple[Body, ...]
    counts: dict[tuple[int, int], tuple[int, int]]
    depths: dict[tuple[int, int], Array]


# Cached: reading meshes and sampling pairs takes longer than many a plan.
_known: WeakKeyDictionary[RobotModel, Links] = WeakKeyDictionary()


def links_of(robot: RobotModel) -> Links:
    """Return the bodies of a robot and its pairs, cached.

    Raises
    ------
    RobotError, CollisionError
        See `link_bodies`.
    """
    if robot not in _known:
        bodies = link_bodies(robot)
        counts = counts_of(robot, bodies, candidate_pairs(bodies, robot.urdf))
        _known[robot] = Links(tuple(bodies), counts, depths_of(robot, bodies, counts))
    return _known[robot]


def counts_of(
    robot: RobotModel, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]]
) -> dict[tuple[int, int], tuple[int, int]]:
    """Return `Links.counts` of some pairs of bodies."""
    if not pairs:
        return {}
    index = np.array(pairs, dtype=np.int64)
    hulls = HullDistances(robot, bodies, index)
    meshes = MeshDistances([body.solid for body in bodies], [body.name for body in bodies], index)
    met, alone = count_overlaps(robot, hulls, meshes, np.arange(len(pairs)))
    return dict(zip(pairs, zip(met.tolist(), alone.tolist(), strict=True), strict=True))


def depths_of(
    robot: RobotModel, bodies: Sequence[Body], counts: Mapping[tuple[int, int], tuple[int, int]]
) -> dict[tuple[int, int], Array]:
    """Return `Links.depths` of the pairs of bodies that are counted."""
    pairs = [pair for pair, (met, _) in counts.items() if met >= _NEARLY_ALWAYS * SAMPLES]
    if not pairs:
        return {}
    hulls = HullDistances(robot, bodies, np.array(pairs, dtype=np.int64))
    found: list[list[float]] = [[] for _ in pairs]
    for _, pair, distance in _near(robot, hulls, np.arange(len(pairs))):
        if distance <= 0.0:
            found[pair].append(-distance)
    return {pair: np.sort(depths) for pair, depths in zip(pairs, found, strict=True)}


def _is_by_design(met: int, depths: Array | None) -> bool:
    """Whether bodies overlap in all configurations, or in nearly all by nearly the same depth."""
    if met == SAMPLES or depths is None:
        return met == SAMPLES
    usual = np.median(depths)
    alike = np.abs(depths - usual) <= _ALIKE_DEPTHS * usual
    return bool(alike.mean() >= _MOST)


def count_overlaps(
    robot: RobotModel, hulls: HullDistances, meshes: MeshDistances, among: Ints
) -> tuple[Ints, Ints]:
    """Count the configurations, of 500, in which bodies overlap, and those of hulls alone.

    Both (P,), and zero but for the pairs `among` them.
    """
    met, alone = (np.zeros(len(hulls.pairs), dtype=np.int64) for _ in range(2))
    for places, pair, distance in _near(robot, hulls, among):
        bodies = meshes.overlaps(places, pair, distance)
        met[pair] += bodies
        alone[pair] += distance <= 0.0 and not bodies
    return met, alone


def hull_overlaps(robot: RobotModel, hulls: HullDistances, among: Ints) -> Ints:
    """Count the configurations, of 500, in which the hulls of the pairs `among` overlap, (A,)."""
    counts = np.zeros(len(hulls.pairs), dtype=np.int64)
    for _, pair, distance in _near(robot, hulls, among):
        counts[pair] += distance <= 0.0
    return np.asarray(counts[among])


def _near(robot: RobotModel, hulls: HullDistances, among: Ints) -> Iterator[tuple[Any, int, float]]:
    """Yield pairs whose boxes overlap, with placements and hulls' distances: 500 configurations."""
    if not len(among):
        return
    rng = np.random.default_rng(0)
    lower, upper = robot.finite_limits()
    q = rng.uniform(lower, upper, (SAMPLES, robot.dof))
    for row, bounds in enumerate(hulls.lower_bounds(q, 0.0)):
        places = hulls.place(q[row])
        for pair in among[bounds[among] <= 0.0].tolist():
            yield places, pair, hulls.distance(pair, bounds[pair])


@dataclass(frozen=True)
class Closest:
    """The smallest distance found, and where.

    Attributes
    ----------
    value : float
        [m]; negative when the two overlap, inf when there is no pair to check.
    first, second : str
        The two links, or link and obstacle; empty when there is no pair.
    index : int
        Row of the samples it was found in.
    """

    value: float
    first: str
    second: str
    index: int = 0


def how_near(distance: float, digits: int = 2) -> str:
    """Return in words the distance of two bodies [m], or the depth of one in the other."""
    length = f"{abs(distance) * 1e3:.{digits}f} mm"
    return f"are {length} apart" if distance >= 0.0 else f"overlap by {length}"


@dataclass(frozen=True)
class Overlap:
    """Two links that overlap in half or more of 500 sampled configurations.

    Attributes
    ----------
    first, second : str
        The links.
    share : float
        Share of the configurations.
    is_checked : bool
        False for those that overlap in each, or in nearly all by nearly the same depth, or touch by
        design: they are left out. Of links with several bodies, others may still be checked.
    depth : float or None
        Median depth of the overlap of their hulls [m]; None if they do not overlap in nearly all.
    """

    first: str
    second: str
    share: float
    is_checked: bool
    depth: float | None = None

    @property
    def extent(self) -> str:
        """In how many configurations they overlap, and how deep."""
        share = f"in {100 * self.share:.0f} % of all configurations"
        return share if self.depth is None else f"{share}, by {1e3 * self.depth:.1f} mm"

    @property
    def remedy(self) -> str:
        """Share of configurations, and the remedy for an overlap by design."""
        pair = f'["{self.first}", "{self.second}"]'
        return (
            f"these links overlap in {100 * self.share:.0f} % of all configurations: if that is "
            f"how they are made, leave them out: --set 'clearance.disabled=[{pair}]', or srdf= a "
            f"file with {srdf_line(self.first, self.second)}"
        )


def srdf_line(first: str, second: str) -> str:
    """Return the line of an SRDF that leaves a pair of links out."""
    return f'<disable_collisions link1="{first}" link2="{second}" reason="Default"/>'


# Share of sampled configurations from which on an overlap of links is reported.
_OFTEN = 0.5


@dataclass(frozen=True, eq=False)
class Checked:
    """Pairs of bodies that are checked, and overlaps of all.

    Attributes
    ----------
    pairs : tuple of (int, int)
        Indices of bodies.
    counts : dict
        See `Links.counts`, with attached bodies.
    overlapping, disabled
        See `CollisionModel`.
    """

    pairs: tuple[tuple[int, int], ...]
    counts: dict[tuple[int, int], tuple[int, int]]
    overlapping: tuple[Overlap, ...]
    disabled: tuple[tuple[str, str], ...]


def checked_pairs(
    robot: RobotModel, bodies: Sequence[Body], disabled: Sequence[tuple[str, str]]
) -> Checked:
    """Return the pairs of bodies that are checked, the robot's own links first among these.

    Raises
    ------
    CollisionError
        See `candidate_pairs`.
    """
    candidates = candidate_pairs(bodies, robot.urdf, disabled)
    known = links_of(robot).counts
    riding = [(i, j) for i, j in candidates if (i, j) not in known and not bodies[j].is_obstacle]
    more = counts_of(robot, bodies, riding)
    counts = {**known, **more}
    depths = {**links_of(robot).depths, **depths_of(robot, bodies, more)}
    # An overlap in (nearly) each configuration that is not by placement is by design.
    always = {
        (i, j)
        for (i, j), (met, _) in counts.items()
        if _is_by_design(met, depths.get((i, j)))
        and not are_separate_parts(bodies[i].link, bodies[j].link, robot.urdf)
    }
    # Next to a joint, all bodies of two links of which some touch.
    by_design = {frozenset(pair) for pair in robot.touching} | {
        frozenset((bodies[i].name, bodies[j].name))
        for i, j in always
        if are_neighbours(bodies[i].link, bodies[j].link, robot.urdf)
    }
    pairs: list[tuple[int, int]] = []
    often: dict[tuple[str, str, bool], tuple[int, float | None]] = {}
    for pair in candidates:
        met, _ = counts.get(pair, (0, 0))
        names = bodies[pair[0]].name, bodies[pair[1]].name
        is_checked = pair not in always and frozenset(names) not in by_design
        if is_checked:
            pairs.append(pair)
        if met >= _OFTEN * SAMPLES or (met and not is_checked):
            key = *names, is_checked
            if met > often.get(key, (0, None))[0]:
                often[key] = met, float(np.median(depths[pair])) if pair in depths else None
    overlapping = tuple(
        Overlap(first, second, met / SAMPLES, is_checked, depth)
        for (first, second, is_checked), (met, depth) in often.items()
    )
    kept = {(bodies[i].name, bodies[j].name) for i, j in candidates}
    every = candidate_pairs(bodies, robot.urdf) if disabled else candidates
    named = dict.fromkeys((bodies[i].name, bodies[j].name) for i, j in every)
    left_out = tuple(pair for pair in named if pair not in kept)
    return Checked(tuple(pairs), counts, overlapping, left_out)
