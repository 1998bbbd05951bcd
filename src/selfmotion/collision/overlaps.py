"""How often bodies overlap in sampled configurations, and how often their convex hulls alone do."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from selfmotion.collision.bodies import Body, link_bodies
from selfmotion.collision.distances import HullDistances, Ints
from selfmotion.collision.meshes import MeshDistances
from selfmotion.collision.pairs import candidate_pairs
from selfmotion.robot import RobotModel

# How many configurations are tried.
SAMPLES = 500


@dataclass(frozen=True, eq=False)
class Links:
    """The bodies of a robot, and what 500 configurations tell of their pairs.

    Attributes
    ----------
    bodies : tuple of Body
        Its links' pieces.
    counts : dict
        Index pair of bodies → in how many configurations these overlap, and their hulls alone.
    """

    bodies: tuple[Body, ...]
    counts: dict[tuple[int, int], tuple[int, int]]


# To read the meshes of an arm and to try its pairs takes longer than many a plan.
_known: WeakKeyDictionary[RobotModel, Links] = WeakKeyDictionary()


def links_of(robot: RobotModel) -> Links:
    """Return the bodies of a robot and its pairs; made once.

    Raises
    ------
    RobotError, CollisionError
        See `link_bodies`.
    """
    if robot not in _known:
        bodies = link_bodies(robot)
        pairs = candidate_pairs(bodies, robot.urdf)
        _known[robot] = Links(tuple(bodies), counts_of(robot, bodies, pairs))
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


def count_overlaps(
    robot: RobotModel, hulls: HullDistances, meshes: MeshDistances, among: Ints
) -> tuple[Ints, Ints]:
    """Return in how many of 500 configurations bodies overlap, and in how many their hulls alone.

    Both (P,), and zero but for the pairs `among` them.
    """
    met, alone = (np.zeros(len(hulls.pairs), dtype=np.int64) for _ in range(2))
    for places, pair, distance in _near(robot, hulls, among):
        bodies = meshes.overlaps(places, pair, distance)
        met[pair] += bodies
        alone[pair] += distance <= 0.0 and not bodies
    return met, alone


def hull_overlaps(robot: RobotModel, hulls: HullDistances, among: Ints) -> Ints:
    """Return in how many of 500 configurations the hulls of the pairs `among` overlap, (A,)."""
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
