"""Distances between the robot's real collision geometry, itself and the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, CollisionError, RobotError
from selfmotion.model.collision import bodies as of_bodies
from selfmotion.model.collision.bodies import Body, obstacle_bodies
from selfmotion.model.collision.distances import HullDistances, Ints
from selfmotion.model.collision.obstacles import Obstacle
from selfmotion.model.collision.overlaps import Closest, checked_pairs, count_overlaps, links_of
from selfmotion.model.collision.pair_distances import PairDistances
from selfmotion.model.collision.pairs import held_pairs, held_together
from selfmotion.model.robot import RobotModel

# Overlap of bodies in contact that counts as rounding [m].
_TOUCHING = 1e-6
# Smallest overlap of links held together by joints that is reported [m].
_WORTH_SAYING = 1e-4
# Name of the links of an arm as a whole.
ITSELF = "the arm itself"
_NO_PAIR = Closest(math.inf, "", "")


class CollisionModel:
    """Exact clearance of an arm, and of attached bodies, from itself and from obstacles.

    Every body is a solid. The distance of two disjoint bodies is that of the real meshes. When they
    overlap, the value is minus the depth by which their convex hulls do, an upper bound of the true
    depth; a mesh that fills its hull to 0.1 % of the volume counts as the hull. A body wholly
    inside another one overlaps it, which the distance of two surfaces alone would miss.

    Parameters
    ----------
    robot : RobotModel
        The arm. All its links count, those on locked joints too, where they are held.
    obstacles : sequence of Obstacle
        Obstacles in the world, and bodies attached to links, which count as parts of these. The
        robot's immovable base is not checked against the world.
    disabled : sequence of (str, str)
        Pairs of links or obstacles that are left out; see `disabled_links` for those of an SRDF.
    only : sequence of str
        Names of obstacles: pairs of which neither is one of these are left out. By default none is.

    Attributes
    ----------
    pairs : tuple of (str, str)
        Names of the P pairs that are checked; a link of several pieces appears repeatedly.
    bodies : tuple of str
        Names of the B bodies, likewise.
    to_world : (P,)
        Mask of pairs of an attached body and an obstacle of the world.
    checks_links, checks_obstacles : bool
        Whether any pair is of links or attached bodies, and of an obstacle.
    overlapping : tuple of Overlap
        Pairs of links that overlap in half or more of 500 sampled configurations. Those that
        overlap in each, or in 95 % by nearly the same depth, or touch by design
        (`RobotModel.touching`), are not checked, but for parts of a cell that were placed in each
        other.
    disabled : tuple of (str, str)
        Pairs of links that are disabled by the user alone.

    Raises
    ------
    CollisionError
        Two obstacles, or an obstacle and a link, have the same name; an obstacle's frame is no
        link; a piece of geometry is no body; a mesh cannot be read; what is disabled is neither a
        link of the arm nor an obstacle.
    RobotError
        A mesh of the robot is missing.

    Notes
    -----
    The two links that a movable joint joins are not checked against each other. Without collision
    geometry in the URDF (`has_bodies` is False) there is no pair at all.

    Boxes around the hulls, then the hulls (GJK) bound the distances of the meshes from below, so
    the meshes are visited only for the few pairs that may hold the minimum.
    """

    def __init__(
        self,
        robot: RobotModel,
        obstacles: Sequence[Obstacle] = (),
        disabled: Sequence[tuple[str, str]] = (),
        only: Sequence[str] = (),
    ) -> None:
        self.robot, self.obstacles, self._disabled = robot, tuple(obstacles), tuple(disabled)
        self.only = tuple(only)
        self._bodies = (*links_of(robot).bodies, *obstacle_bodies(self.obstacles, robot))
        self.has_bodies = not all(body.is_obstacle for body in self._bodies)
        self.bodies = tuple(body.name for body in self._bodies)
        checked = checked_pairs(robot, self._bodies, self._disabled)
        self._counts = checked.counts
        self.overlapping, self.disabled = checked.overlapping, checked.disabled
        of_these = frozenset(self.only)
        self._take(
            [
                pair
                for pair in checked.pairs
                if not of_these or not of_these.isdisjoint(self.bodies[k] for k in pair)
            ]
        )

    def _take(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Check these pairs of bodies."""
        self._index = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self.pairs = tuple((self.bodies[i], self.bodies[j]) for i, j in pairs)
        self.to_world = np.array([self._bodies[j].is_obstacle for _, j in pairs], dtype=np.bool_)
        obstacles = {item.name for item in self.obstacles}
        self.checks_links = not self.to_world.all()
        self.checks_obstacles = not all(obstacles.isdisjoint(pair) for pair in self.pairs)
        self._near = PairDistances(self.robot, self._bodies, self._index)
        self.hulls = self._near.hulls

    def of_pairs(self, pairs: Sequence[tuple[int, int]]) -> CollisionModel:
        """Return the model of the same bodies in which these pairs are checked, by index."""
        other = copy(self)
        for known in ("pair_levers", "_lever_arms"):
            other.__dict__.pop(known, None)
        other._take(pairs)
        return other

    @property
    def every_body(self) -> tuple[Body, ...]:
        """The B bodies, as `bodies` names them."""
        return self._bodies

    @property
    def index(self) -> Ints:
        """Which bodies each pair is of, (P, 2)."""
        return self._index

    @property
    def groups(self) -> dict[str, CollisionModel]:
        """The models of "the arm itself", its links alone, and of each obstacle or carried body.

        With all candidates to meet it, by name. Groups without pairs are left out.
        """
        names = dict.fromkeys(body.name for body in self._bodies if body.link != body.name)
        found: dict[str, list[tuple[int, int]]] = {}
        for (i, j), pair in zip(self._index.tolist(), self.pairs, strict=True):
            for name in [name for name in names if name in pair] or [ITSELF]:
                found.setdefault(name, []).append((i, j))
        return {name: self.of_pairs(found[name]) for name in (ITSELF, *names) if name in found}

    @cached_property
    def stuck(self) -> Closest | None:
        """Deepest overlap of links that held joints or placed parts cause, if any."""
        pairs = held_pairs(self._bodies, self.robot.urdf, self.robot.locked, self._disabled)
        if not pairs:
            return None
        worst = self.of_pairs(pairs).worst(np.zeros((1, self.robot.dof)))
        return worst if worst.value < -_TOUCHING else None

    @cached_property
    def held(self) -> tuple[Closest, ...]:
        """The links that overlap where joints hold them which the motion does not move.

        They are left out, as no motion parts them; the deepest come first.
        """
        put = set(held_pairs(self._bodies, self.robot.urdf, self.robot.locked, self._disabled))
        asked = {frozenset(pair) for pair in self._disabled}
        pairs = [
            (i, j)
            for i, j in held_together(self._bodies, self.robot.urdf)
            if (i, j) not in put and {self.bodies[i], self.bodies[j]} not in asked
        ]
        if not pairs:
            return ()
        at = np.clip(np.zeros(self.robot.dof), self.robot.lower, self.robot.upper)
        found = self.of_pairs(pairs).touching(at)
        deepest = {frozenset((x.first, x.second)): x for x in reversed(found)}
        return tuple(
            x
            for x in found
            if deepest[frozenset((x.first, x.second))] is x and x.value < -_WORTH_SAYING
        )

    @property
    def standing(self) -> frozenset[str]:
        """Names of the obstacles that stand in the world."""
        return frozenset(body.name for body in self._bodies if body.is_obstacle)

    def is_convex(self, pair: int) -> bool:
        """Whether both bodies of a pair are their own convex hulls."""
        return self._near.meshes.hulls_decide[pair]

    @property
    def is_all_convex(self) -> bool:
        """Whether all bodies that are checked are their own convex hulls."""
        return all(self.is_convex(pair) for pair in range(len(self.pairs)))

    def decomposed(self, *, links: bool = False) -> tuple[HullDistances, Ints]:
        """Return distances of hulls, obstacles in convex pieces, and which pair each is of, (Q,).

        Links are hulls as a rule: they are decomposed on request, and before obstacles only.
        Without any decomposition, these are `hulls`.
        """
        names = {item.name for item in self.obstacles}
        met = [names & {self._bodies[i].name, self._bodies[j].name} for i, j in self._index]
        differing = [
            {b for b in pair if self._bodies[b].name in names or (links and before)}
            for pair, before in zip(self._index.tolist(), met, strict=True)
        ]
        bodies, first = list(self._bodies), dict[int, range]()
        for b in sorted(set[int]().union(*differing)):
            pieces = self._bodies[b].solid.pieces
            if len(pieces) > 1:
                first[b] = range(len(bodies), len(bodies) + len(pieces))
                bodies += [replace(self._bodies[b], solid=solid) for solid in pieces]
        if not first:
            return self.hulls, np.arange(len(self.pairs))
        found = [
            (pair, k, m)
            for pair, (i, j) in enumerate(self._index.tolist())
            for k in (first.get(i, [i]) if i in differing[pair] else [i])
            for m in (first.get(j, [j]) if j in differing[pair] else [j])
        ]
        of, *index = np.array(found, dtype=np.int64).T
        return HullDistances(self.robot, bodies, np.stack(index, axis=1)), of

    @cached_property
    def open_meshes(self) -> tuple[str, ...]:
        """Links and obstacles with a mesh that is neither closed, nor flat, nor as its hull.

        Whether another body is wholly inside one of these is not certain: it is decided by the
        winding number, which serves small holes. Distances from its surface are right.
        """
        found = (
            body.name
            for body in self._bodies
            if not (body.solid.is_flat or body.solid.is_closed or body.solid.is_convex)
        )
        return tuple(dict.fromkeys(found))

    @cached_property
    def moved(self) -> npt.NDArray[np.bool_]:
        """Which bodies each joint moves, (B, n): those on its link and on all beyond.

        And those that joints carry which mimic it.
        """
        found = self.robot.coupling.bounds(self._moved.astype(np.float64))
        return np.asarray(found > 0.0)

    @cached_property
    def _moved(self) -> npt.NDArray[np.bool_]:
        return of_bodies.moved_by(self._bodies, self.robot)

    @cached_property
    def lever_arms(self) -> Array:
        """Largest motion of points of the bodies per unit of each joint, (B, n).

        Row b bounds |∂x/∂q_j| over all points x of body b, in [m/rad] for revolute joints and
        [m/m] for prismatic ones, at every configuration within the joint limits. So no point moves
        farther than Σ_j lever_bj |Δq_j|.
        """
        arms = np.where(self._moved, self._axis_distances, 0.0)
        return self.robot.coupling.bounds(arms)

    @cached_property
    def pair_levers(self) -> Array:
        """Largest change of the distance of each pair per unit of each joint, (P, n).

        At every configuration within the joint limits, in the order of `pairs`: between two
        configurations the distance of disjoint bodies changes by Σ_j lever_pj |Δq_j| at most.
        Joints that move both bodies as one block have lever 0.
        """
        return self.robot.coupling.bounds(self._lever_arms)

    @cached_property
    def _lever_arms(self) -> Array:
        """Those of all joints of the model, (P, N)."""
        return of_bodies.pair_levers(self._axis_distances, self._moved, self.hulls.pairs)

    def pair_levers_up_to(self, farthest: Array, displacement: Array | None = None) -> Array:
        """Return `pair_levers` where joints go as far as `farthest` (n,) from 0, (P, n).

        A prismatic joint beyond its limits lengthens the lever arms of all revolute ones, and so
        does a displacement (P,) of a body of the pair [m].
        """
        extra: Any = of_bodies.travel_beyond(self.robot, farthest)
        if displacement is not None:
            extra = extra + displacement[:, None]
        counted = of_bodies.is_turned(self.robot) & (self._lever_arms > 0.0)
        return self.robot.coupling.bounds(self._lever_arms + np.where(counted, extra, 0.0))

    @cached_property
    def _axis_distances(self) -> Array:
        return of_bodies.axis_distances(self.robot, self._bodies)

    def samples(self, q_samples: npt.ArrayLike) -> Array:
        """Return samples (K, n) as an array.

        Raises
        ------
        RobotError
            The shape is not (K, n), or a number is not finite.
        """
        q = np.ascontiguousarray(q_samples, dtype=np.float64)
        if q.ndim != 2 or q.shape[1] != self.robot.dof or not np.isfinite(q).all():
            raise RobotError(
                f"samples have shape {q.shape}, expected (K, {self.robot.dof}) finite numbers"
            )
        return q

    def distance(self, q: npt.ArrayLike) -> Closest:
        """Return the smallest distance over all pairs at `q`.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        return self.worst(self.robot.configuration(q)[None])

    def nearest_points(self, q: npt.ArrayLike, first: str, second: str) -> Array:
        """Return the nearest points of two bodies that are a pair, in world axes, (2, 3) [m].

        Of bodies of several pieces those of the nearest ones. Where bodies overlap, points of it.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        CollisionError
            The two are no pair.
        """
        at = self.robot.configuration(q)
        numbers = [k for k, pair in enumerate(self.pairs) if pair == (first, second)]
        if not numbers:
            raise CollisionError(
                f"'{first}' and '{second}' are no pair that is checked; see `pairs`"
            )
        found = [self._near.points(at, pair) for pair in numbers]
        return min(found, key=lambda points: float(np.linalg.norm(points[1] - points[0])))

    def worst(self, q_samples: npt.ArrayLike) -> Closest:
        """Return the smallest distance over a motion (K, n); its `index` is the row.

        Raises
        ------
        RobotError
            A row is not a configuration of the arm.
        """
        q = self.samples(q_samples)
        if not len(q) or not self.pairs:
            return _NO_PAIR
        value, pair = self._near.closest(q[0], self.hulls.lower_bounds(q[:1])[0])
        # Pairs farther apart than the best need no exact distance.
        bounds, worst = self.hulls.lower_bounds(q, value), 0
        lowest = bounds.min(axis=1)
        for row in np.argsort(lowest, kind="stable").tolist():
            if lowest[row] >= value:
                break
            found = self._near.closest(q[row], bounds[row], value)
            if found[0] < value:
                (value, pair), worst = found, row
        return Closest(value, *self.pairs[pair], worst)

    def distances(
        self,
        q_samples: npt.ArrayLike,
        within: float | Array = math.inf,
        exact_below: float | Array = math.inf,
    ) -> Array:
        """Return the distance of every pair at samples (K, n), (K, P) [m], as `pairs` names them.

        Parameters
        ----------
        q_samples : (K, n)
        within : float or (K, P)
            Pairs farther apart than this need no exact number [m]: theirs is a lower bound of the
            distance that is not below `within`. -inf for exact distances of none.
        exact_below : float or (K, P)
            For pairs farther apart than this, the distance of their hulls suffices, a lower bound
            that is not below this [m]: it takes a twentieth of the time.

        Raises
        ------
        RobotError
            A row is not a configuration of the arm.
        """
        q = self.samples(q_samples)
        wanted = np.broadcast_to(np.asarray(within, dtype=np.float64), (len(q), len(self.pairs)))
        return self._near.distances(q, wanted, np.minimum(wanted, exact_below))

    def collides(self, q: Array, margin: float = 0.0) -> bool:
        """Whether some pair is closer than `margin` [m] at `q` (n,); fast for many calls.

        The convex hulls decide where they are apart by more than the margin, and where both meshes
        are convex to 0.1 % of the volume; the surfaces of other meshes are searched.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        if q.shape != (self.robot.dof,) or not math.isfinite(q.dot(q)):
            self.robot.configuration(q)
        return bool(self._near.closer(q[None], margin)[0])

    def colliding(self, q_samples: Array, margin: float = 0.0) -> npt.NDArray[np.bool_]:
        """Return the mask of configurations (K, n) at which `collides` holds, (K,).

        Raises
        ------
        RobotError
            The shape is not (K, n), or a number is not finite.
        """
        return self._near.closer(self.samples(q_samples), margin)

    def touching(self, q: npt.ArrayLike) -> tuple[Closest, ...]:
        """Return all pairs that overlap at `q`, the deepest first; see also `srdf_line`.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        values = self.distances(self.robot.configuration(q)[None], 0.0)[0]
        rows = [i for i in np.argsort(values, kind="stable").tolist() if values[i] <= 0.0]
        return tuple(Closest(float(values[i]), *self.pairs[i]) for i in rows)

    def overlap_counts(self) -> tuple[Ints, Ints]:
        """Count overlaps of bodies, and of their hulls alone, in 500 configurations, (P,) each."""
        known = [self._counts.get((i, j)) for i, j in self._index.tolist()]
        unknown = np.flatnonzero([counts is None for counts in known])
        met, alone = count_overlaps(self.robot, self.hulls, self._near.meshes, unknown)
        for pair, counts in enumerate(known):
            if counts is not None:
                met[pair], alone[pair] = counts
        return met, alone
