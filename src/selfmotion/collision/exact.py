"""Distances between the robot's real collision geometry, itself and the world."""

import math
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array
from selfmotion.collision import levers
from selfmotion.collision.bodies import link_bodies, obstacle_bodies
from selfmotion.collision.distances import HullDistances, Ints
from selfmotion.collision.found import Closest, Overlap
from selfmotion.collision.meshes import MeshDistances
from selfmotion.collision.obstacles import Obstacle
from selfmotion.collision.pairs import candidate_pairs
from selfmotion.errors import RobotError
from selfmotion.robot import RobotModel

# Configurations in which a pair of links must overlap to count as touching by design.
_SAMPLES = 500
# The share of the first of them from which on an overlap is worth telling, and how many these are.
_OFTEN, _FIRST = 0.5, 100

_NO_PAIR = Closest(math.inf, "", "")


class CollisionModel:
    """Exact clearance of an arm from itself and from obstacles that stand still.

    Every body is a solid. While two bodies are apart their distance is that of the real meshes.
    When they overlap, the value is minus the depth by which their convex hulls do, an upper bound
    of the true depth; a mesh that fills its hull to 0.1 % of the volume counts as the hull. A body
    wholly inside another one overlaps it, which the distance of two surfaces alone would miss.

    Parameters
    ----------
    robot : RobotModel
        The arm. All its links count, those on locked joints too, where they are held.
    obstacles : sequence of Obstacle
        The world. The robot's immovable base is not checked against it.
    srdf : Path, optional
        File whose ``<disable_collisions>`` pairs are left out.

    Attributes
    ----------
    pairs : tuple of (str, str)
        Names of the P pairs that are checked; a link of several pieces appears repeatedly.
    overlapping : tuple of Overlap
        Pairs of links that overlap in half or more of 100 sampled configurations. Those that do
        in each of 500 are not checked.

    Raises
    ------
    CollisionError
        Two obstacles, or an obstacle and a link, have the same name; a piece of geometry is no
        body; a mesh or the SRDF cannot be read.
    RobotError
        A mesh of the robot is missing.

    Notes
    -----
    Links joined by a movable joint are not checked against each other. Without collision geometry
    in the URDF (`has_bodies` is False) there is no pair at all.

    Boxes around the hulls, then the hulls (GJK) bound the distances of the meshes from below, so
    the meshes are visited only for the few pairs that may hold the minimum.

    Not for use by several threads at once.
    """

    def __init__(
        self,
        robot: RobotModel,
        obstacles: Sequence[Obstacle] = (),
        srdf: str | Path | None = None,
    ) -> None:
        self.robot, self.obstacles = robot, tuple(obstacles)
        links = link_bodies(robot)
        self.has_bodies = len(links) > 0
        self._bodies = links + obstacle_bodies(self.obstacles, robot.urdf.links)
        self._set_pairs(_indices(candidate_pairs(self._bodies, robot.urdf, srdf)))
        overlaps = self._count_overlaps()
        always = overlaps == _SAMPLES
        found: dict[tuple[str, str], float] = {}
        for pair in np.flatnonzero(overlaps >= _OFTEN * _FIRST):
            share = min(overlaps[pair] / _FIRST, 1.0)
            found[self.pairs[pair]] = max(share, found.get(self.pairs[pair], 0.0))
        self._set_pairs(self.hulls.pairs[~always])
        self.overlapping = tuple(
            Overlap(*names, share, names in self.pairs) for names, share in found.items()
        )

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the B bodies; a link of several pieces appears repeatedly."""
        return tuple(body.name for body in self._bodies)

    @cached_property
    def open_meshes(self) -> tuple[str, ...]:
        """Links and obstacles with a mesh that is not closed.

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
        """Which bodies each joint moves, (B, n): those on its link and on all beyond."""
        return levers.moved_by(self._bodies, self.robot.dof)

    @cached_property
    def lever_arms(self) -> Array:
        """How far points of the bodies move at most per unit of each joint, (B, n).

        Row b bounds |∂x/∂q_j| over all points x of body b, in [m/rad] for revolute joints and
        [m/m] for prismatic ones, at every configuration within the joint limits. So no point moves
        farther than Σ_j lever_bj |Δq_j|.
        """
        return np.where(self.moved, self._axis_distances, 0.0)

    @cached_property
    def pair_levers(self) -> Array:
        """How much the distance of each pair changes at most per unit of each joint, (P, n).

        At every configuration within the joint limits, in the order of `pairs`: from one
        configuration to another the distance changes by Σ_j lever_pj |Δq_j| at most. Joints that
        move both bodies as one block count nothing.
        """
        return levers.pair_levers(self._axis_distances, self.moved, self.hulls.pairs)

    @cached_property
    def _axis_distances(self) -> Array:
        return levers.axis_distances(self.robot, self._bodies)

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

    def worst(self, q_samples: npt.ArrayLike) -> Closest:
        """Return the smallest distance over a motion (K, n); its `index` is the row.

        Raises
        ------
        RobotError
            A row is not a configuration of the arm.
        """
        q = self.samples(q_samples)
        bounds, worst = self.hulls.lower_bounds(q), _NO_PAIR
        lowest = bounds.min(axis=1, initial=math.inf)
        for row in np.argsort(lowest, kind="stable"):
            if lowest[row] >= worst.value:
                break
            self._place(q[row])
            worst = self._closest(bounds[row], worst, int(row))
        return worst

    def distances(self, q_samples: npt.ArrayLike, within: float = math.inf) -> Array:
        """Return the distance of every pair at samples (K, n), (K, P) [m], as `pairs` names them.

        Parameters
        ----------
        q_samples : (K, n)
        within : float
            Pairs that are farther apart than this need no exact number [m]: theirs is a lower
            bound of the distance that is not below `within`.

        Raises
        ------
        RobotError
            A row is not a configuration of the arm.
        """
        q = self.samples(q_samples)
        values = self.hulls.lower_bounds(q, within)
        for row in range(len(q)):
            near = np.flatnonzero(values[row] < within).tolist()
            if near:
                self._place(q[row])
            for pair in near:
                hulls = self.hulls.distance(pair, values[row, pair])
                far = hulls >= within
                values[row, pair] = hulls if far else self._meshes.refine(pair, hulls)
        return values

    def collides(self, q: Array, margin: float = 0.0) -> bool:
        """Whether some pair is closer than `margin` [m] at `q` (n,); made for many calls.

        The convex hulls decide alone where they are apart by more than the margin, and where both
        meshes are convex to 0.1 % of the volume; only other meshes are visited.

        Raises
        ------
        RobotError
            `q` is not a configuration of the arm.
        """
        if q.shape != (self.robot.dof,) or not math.isfinite(q.dot(q)):
            self.robot.configuration(q)
        bounds = self.hulls.lower_bounds(q[None], margin)[0]
        near = np.flatnonzero(bounds < margin)
        if not near.size:
            return False
        self._place(q)
        open_ = []
        for pair in near.tolist():
            hulls = self.hulls.distance(pair, bounds[pair])
            if hulls < margin:
                if self._meshes.hulls_decide[pair]:
                    return True
                open_.append((hulls, pair))
        return any(
            self._meshes.refine(pair, hulls, margin) < margin for hulls, pair in sorted(open_)
        )

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

    def _place(self, q: Array) -> None:
        self._meshes.follow(self.hulls.place(q))

    def _closest(self, bounds: Array, best: Closest, row: int) -> Closest:
        """Return the smaller of `best` and the smallest distance as the bodies are placed."""
        near = np.flatnonzero(bounds < best.value).tolist()
        found = sorted((self.hulls.distance(pair, bounds[pair]), pair) for pair in near)
        for hulls, pair in found:
            if hulls >= best.value:
                break
            value = self._meshes.refine(pair, hulls, best.value)
            if value < best.value:
                best = Closest(value, *self.pairs[pair], row)
        return best

    def false_alarms(self, q_samples: Array) -> tuple[Ints, Ints]:
        """Return in how many samples (K, n) bodies overlap, and in how many their hulls alone.

        Both (P,).
        """
        met, alone = (np.zeros(len(self.pairs), dtype=np.int64) for _ in range(2))
        for row, bounds in enumerate(self.hulls.lower_bounds(q_samples, 0.0)):
            self._place(q_samples[row])
            for pair in np.flatnonzero(bounds <= 0.0).tolist():
                hulls, bodies = self._overlap(pair, bounds[pair])
                met[pair] += bodies
                alone[pair] += hulls and not bodies
        return met, alone

    def _count_overlaps(self) -> Ints:
        """Return in how many samples each pair of links overlaps, (P,).

        Exact of those that overlap in each; of others up to the first 100, where that is often.
        """
        rng = np.random.default_rng(0)
        lower, upper = self.robot.finite_limits()
        q = rng.uniform(lower, upper, (_SAMPLES, self.robot.dof))
        bounds, count = self.hulls.lower_bounds(q, 0.0), np.zeros(len(self.pairs), dtype=np.int64)
        often = [not self._bodies[j].is_obstacle for j in self.hulls.pairs[:, 1].tolist()]
        possible = np.flatnonzero(often)
        for row in range(_SAMPLES):
            # Those that can still reach the share, then those that overlapped in each so far.
            least = _OFTEN * _FIRST - (_FIRST - row) if row < _FIRST else row
            possible = possible[count[possible] >= least]
            if not possible.size:
                break
            self._place(q[row])
            for pair in possible[bounds[row, possible] <= 0.0].tolist():
                count[pair] += self._overlap(pair, bounds[row, pair])[1]
        return count

    def _overlap(self, pair: int, bound: float) -> tuple[bool, bool]:
        """Return whether the hulls of a pair overlap as they are placed, and the bodies."""
        hulls = self.hulls.distance(pair, bound)
        return hulls <= 0.0, self._meshes.overlaps(pair, hulls)

    def _set_pairs(self, pairs: Ints) -> None:
        placed = [(body.joint, body.place, body.solid) for body in self._bodies]
        self.hulls = HullDistances(self.robot, placed, self.bodies, pairs)
        self._meshes = MeshDistances([body.solid for body in self._bodies], self.bodies, pairs)
        self.pairs = tuple((self.bodies[i], self.bodies[j]) for i, j in pairs.tolist())


def _indices(pairs: list[tuple[int, int]]) -> Ints:
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
