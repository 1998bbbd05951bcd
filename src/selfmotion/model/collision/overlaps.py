"""How often pairs of bodies overlap in sampled configurations, and their closest pair."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.collision.bodies import Body, link_bodies
from selfmotion.model.collision.distances import HullDistances, Ints
from selfmotion.model.collision.mesh_distances import MeshDistances
from selfmotion.model.collision.pairs import are_neighbours, are_separate_parts, candidate_pairs
from selfmotion.model.robot import RobotModel, mesh_stamps

# Number of configurations that are sampled.
SAMPLES = 500
# Share of configurations from which on an overlap may be by design …
_NEARLY_ALWAYS = 0.95
# … if this share of its depths is alike: what comes out of a tube overlaps ever less …
_MIN_ALIKE_SHARE = 0.75
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


# Cached: reading meshes and sampling pairs takes longer than many a plan. Of the last robots that
# were loaded also for others of the same description and files, which are loaded anew.
_known: WeakKeyDictionary[RobotModel, Links] = WeakKeyDictionary()
_alike: dict[Hashable, Links] = {}
# Number of these robots.
_MAX_ALIKE = 8


def links_of(robot: RobotModel) -> Links:
    """Return the bodies of a robot and its pairs, cached.

    Raises
    ------
    RobotError, CollisionError
        See `link_bodies`.
    """
    if robot not in _known:
        key = _description(robot)
        found = _alike.get(key) or _read(robot)
        _alike[key] = _known[robot] = found
        # The oldest one goes; another thread may have been faster.
        for old in list(_alike)[:-_MAX_ALIKE]:
            _alike.pop(old, None)
    return _known[robot]


def _description(robot: RobotModel) -> Hashable:
    """Return what the bodies of a robot and the overlaps of its pairs depend on."""
    urdf = robot.urdf
    held = tuple(sorted(robot.locked.items()))
    limits = robot.lower.tobytes(), robot.upper.tobytes()
    meshes = mesh_stamps(urdf, "collision")
    return (urdf.text, urdf.source, urdf.package_dirs, held, limits, meshes)


def _read(robot: RobotModel) -> Links:
    bodies = link_bodies(robot)
    counts = counts_of(robot, bodies, candidate_pairs(bodies, robot.urdf))
    return Links(tuple(bodies), counts, depths_of(robot, bodies, counts))


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
    return bool(alike.mean() >= _MIN_ALIKE_SHARE)


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
