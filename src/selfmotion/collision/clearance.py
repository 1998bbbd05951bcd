"""Smooth conservative clearances: what an optimiser follows."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, CollisionError, RobotError
from selfmotion.collision.capsules import LinkCapsule, link_capsules
from selfmotion.collision.exact import CollisionModel
from selfmotion.collision.obstacles import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere
from selfmotion.collision.shapes import obstacle_geometry

Ints = npt.NDArray[np.int64]

# Configurations that tell which pairs of capsules are too wide to say anything about their links.
_SAMPLES = 300
# The share of these in which a pair whose links do meet elsewhere may overlap without need.
_FALSE_ALARMS = 0.1


@dataclass(frozen=True, eq=False)
class Clearances:
    """Distances over the samples of a motion, and their derivative by the configuration.

    Attributes
    ----------
    values : (K, P)
        Signed distance of each pair at each sample [m].
    """

    values: Array
    _wrenches: Array = field(repr=False)
    _jacobians: Array = field(repr=False)
    _pair_joints: Ints = field(repr=False)
    _parents: Ints = field(repr=False)

    def pullback(self, weights: npt.ArrayLike) -> Array:
        """Return Σ_p w_kp ∂d_kp/∂q_k, (K, n), for weights (K, P).

        Raises
        ------
        ValueError
            The weights do not have the shape of `values`.
        """
        from selfmotion.collision import kernels

        w = np.ascontiguousarray(weights, dtype=np.float64)
        if w.shape != self.values.shape:
            raise ValueError(f"weights have shape {w.shape}, expected {self.values.shape}")
        return kernels.pull_back(
            w, self._wrenches, self._pair_joints, self._jacobians, self._parents
        )

    def jacobian(self) -> Array:
        """Return ∂d/∂q, (K, P, n); `pullback` is cheaper where a sum is wanted."""
        n = self._jacobians.shape[2]
        # Row b: which joints move body b.
        moves = np.zeros((n + 1, n))
        for joint in range(1, n + 1):
            moves[joint] = moves[self._parents[joint]]
            moves[joint, joint - 1] = 1.0
        first, second = self._pair_joints.T
        return np.asarray((moves[first] - moves[second]) * (self._wrenches @ self._jacobians))


class ClearanceModel:
    """Clearance of capsules around the links from each other and from obstacles.

    The capsules contain the collision geometry of their links, so the smallest distance here of
    two links is never more than the exact one. It is differentiable but where the closest points
    jump.

    Between capsules it is the distance of the centre lines minus both radii. From a box it is
    that of the centre line, inside minus the shortest way out, minus the radius. From a cylinder
    it is the same outside; inside, minus the depth of the centre line's deepest point. A mesh
    counts as the box around it along its own axes.

    That is quick, and smooth, but a few centimetres too little: where it is below `near`, the
    distance of the convex hulls (GJK, and EPA where they overlap) takes its place, and from there
    to twice as far the two are blended.

    Parameters
    ----------
    exact : CollisionModel
        Whose robot, obstacles and pairs of links are taken.
    near : float
        Capsules nearer than this [m] are replaced by hulls.

    Attributes
    ----------
    capsules : tuple of LinkCapsule
        What stands for the links.
    pairs : tuple of (str, str)
        Names for the P columns of `Clearances.values`.

    Notes
    -----
    Hulls may overlap where their links do not. Judged over 300 sampled configurations, two
    links are not paired when this happens at all though they never meet, or in more than a tenth
    of the samples; a link and an obstacle, when it happens in each. These pairs are left
    to the exact model, so a motion that is clear here still needs its verdict.

    Not for use by several threads at once.
    """

    def __init__(self, exact: CollisionModel, near: float = 0.02) -> None:
        self.robot, self._exact, self._near = exact.robot, exact, near
        self.capsules = link_capsules(self.robot)
        self._joints = np.array([capsule.joint for capsule in self.capsules], dtype=np.int64)
        self._middles = _rows([capsule.middle for capsule in self.capsules])
        self._halves = _rows([capsule.half for capsule in self.capsules])
        self._radii = np.array([capsule.radius for capsule in self.capsules], dtype=np.float64)
        self._obstacles = _Cores.of(exact.obstacles)
        self._parents = np.array(list(self.robot.model.parents), dtype=np.int64)
        self._data = self.robot.model.createData()
        # Views into the data, which Pinocchio updates: reading placements costs no call.
        moving = list(self._data.oMi)[1:]
        self._rotation_views = [place.rotation for place in moving]
        self._position_views = [place.translation for place in moving]
        own = _self_pairs(self.capsules, set(exact.pairs))
        world = [
            (i, j)
            for i, capsule in enumerate(self.capsules)
            for j in range(len(exact.obstacles))
            if capsule.joint > 0
        ]
        self._pair_capsules(own, np.array(world, dtype=np.int64).reshape(-1, 2))
        self._drop_overlapping()

    def _pair_capsules(self, own: Ints, world: Ints) -> None:
        """Set the pairs of capsules, and of capsules and obstacles, and what follows from them."""
        self._self_pairs, self._world_pairs = own, world
        links = [capsule.link for capsule in self.capsules]
        obstacles = [obstacle.name for obstacle in self._exact.obstacles]
        names = [(links[i], links[j]) for i, j in own]
        names += [(links[i], obstacles[j]) for i, j in world]
        self.pairs = tuple(dict.fromkeys(names))
        column = {pair: k for k, pair in enumerate(self.pairs)}
        self._group = np.array([column[pair] for pair in names], dtype=np.int64)
        joints = np.concatenate(
            [self._joints[own], np.pad(self._joints[world[:, :1]], ((0, 0), (0, 1)))]
        )
        self._pair_joints = np.zeros((len(self.pairs), 2), dtype=np.int64)
        self._pair_joints[self._group] = joints
        self._hulls = [
            [k for k, pair in enumerate(self._exact.pairs) if pair == names] for names in self.pairs
        ]

    def clearances(self, q_samples: npt.ArrayLike) -> Clearances:
        """Return the distances at samples (K, n).

        Raises
        ------
        RobotError
            The shape is not (K, n), or a number is not finite.
        """
        # Here, because importing numba takes longer than everything else in the package.
        from selfmotion.collision import kernels

        q = np.ascontiguousarray(q_samples, dtype=np.float64)
        if q.ndim != 2 or q.shape[1] != self.robot.dof or not np.isfinite(q).all():
            raise RobotError(
                f"samples have shape {q.shape}, expected (K, {self.robot.dof}) finite numbers"
            )
        rotations, positions, jacobians = self._kinematics(q)
        values, wrenches = kernels.evaluate(
            rotations,
            positions,
            self._joints,
            self._middles,
            self._halves,
            self._radii,
            self._self_pairs,
            self._world_pairs,
            *self._obstacles.arrays(),
        )
        values, wrenches = kernels.nearest(values, wrenches, self._group, len(self.pairs))
        self._replace_near(q, values, wrenches)
        values.setflags(write=False)
        return Clearances(values, wrenches, jacobians, self._pair_joints, self._parents)

    def _replace_near(self, q: Array, values: Array, wrenches: Array) -> None:
        """Put the distances of hulls in the place of small ones of capsules."""
        rows, columns = np.nonzero(values < 2.0 * self._near)
        if not len(rows):
            return
        contacts, placed = np.empty((len(rows), 7)), -1
        for i, (row, column) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True)):
            if row != placed:
                self._exact.place_hulls(q[row])
                placed = row
            contacts[i] = self._exact.hull_contact(self._hulls[column])
        # In touch to the last digit there is no normal, and the capsules, conservative, remain.
        sound = np.isfinite(contacts).all(axis=1)
        rows, columns, contacts = rows[sound], columns[sound], contacts[sound]
        normals, points = contacts[:, 1:4], contacts[:, 4:]
        hulls = np.hstack([normals, np.cross(points, normals)])
        capsules = values[rows, columns]
        gap = contacts[:, 0] - capsules
        share, slope = _blend(capsules / self._near)
        wrenches[rows, columns] *= (1.0 - share + gap * slope / self._near)[:, None]
        wrenches[rows, columns] += share[:, None] * hulls
        values[rows, columns] += share * gap

    def _kinematics(self, q: Array) -> tuple[Array, Array, Array]:
        count, n = q.shape
        # Row 0 of each is the world.
        rotations = np.zeros((count, 3 * (n + 1), 3))
        rotations[:, :3] = np.eye(3)
        positions = np.zeros((count, 3 * (n + 1)))
        jacobians = np.empty((count, 6, n))
        model, data = self.robot.model, self._data
        for k in range(count):
            jacobians[k] = pin.computeJointJacobians(model, data, q[k])
            np.concatenate(self._rotation_views, out=rotations[k, 3:])
            np.concatenate(self._position_views, out=positions[k, 3:])
        shape = (count, n + 1, 3)
        return rotations.reshape(*shape, 3), positions.reshape(shape), jacobians

    def _drop_overlapping(self) -> None:
        rng = np.random.default_rng(0)
        lower, upper = self.robot.finite_limits()
        q = rng.uniform(lower, upper, (_SAMPLES, self.robot.dof))
        overlap = self.clearances(q).values <= 0.0
        if not overlap.any():
            return
        truth = self._exact.overlaps(q)
        world = {obstacle.name for obstacle in self._exact.obstacles}
        useful = np.ones(len(self.pairs), dtype=bool)
        for k, pair in enumerate(self.pairs):
            met = truth[pair]
            wrong = (overlap[:, k] & ~met).mean()
            if pair[1] in world:
                useful[k] = wrong < 1.0
            else:
                useful[k] = wrong <= (_FALSE_ALARMS if met.any() else 0.0)
        kept, own = useful[self._group], len(self._self_pairs)
        self._pair_capsules(self._self_pairs[kept[:own]], self._world_pairs[kept[own:]])


def _blend(ratio: Array) -> tuple[Array, Array]:
    """Return the hulls' share of a distance, and its derivative: 1 below ratio 1, 0 above 2."""
    s = np.clip(2.0 - ratio, 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s), -6.0 * s * (1.0 - s)


@dataclass(frozen=True, eq=False)
class _Cores:
    """Obstacles as `kernels.evaluate` takes them: a core, and the reach around it."""

    kinds: Ints
    rotations: Array
    positions: Array
    sizes: Array
    radii: Array

    @classmethod
    def of(cls, obstacles: tuple[Obstacle, ...]) -> "_Cores":
        cores = [_core(obstacle) for obstacle in obstacles]
        return cls(
            np.array([core[0] for core in cores], dtype=np.int64),
            np.array([core[1].rotation for core in cores]).reshape(-1, 3, 3),
            _rows([core[1].translation for core in cores]),
            _rows([core[2] for core in cores]),
            np.array([core[3] for core in cores], dtype=np.float64),
        )

    def arrays(self) -> tuple[Ints, Array, Array, Array, Array]:
        return self.kinds, self.rotations, self.positions, self.sizes, self.radii


def _core(obstacle: Obstacle) -> tuple[int, pin.SE3, Array, float]:
    """Return kind, placement, half lengths and reach of an obstacle's core."""
    from selfmotion.collision.kernels import BOX, CYLINDER, SEGMENT

    match obstacle:
        case Box():
            return BOX, obstacle.pose, 0.5 * obstacle.size, 0.0
        case Sphere():
            return SEGMENT, obstacle.pose, np.zeros(3), obstacle.radius
        case Capsule():
            return SEGMENT, obstacle.pose, np.array([0, 0, 0.5 * obstacle.length]), obstacle.radius
        case Cylinder():
            size = np.array([obstacle.radius, obstacle.radius, 0.5 * obstacle.length])
            return CYLINDER, obstacle.pose, size, 0.0
        case Mesh():
            vertices = obstacle_geometry(obstacle).vertices()
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            centre = obstacle.pose * pin.SE3(np.eye(3), 0.5 * (low + high))
            return BOX, centre, 0.5 * (high - low), 0.0
    raise CollisionError(f"{obstacle!r} is no obstacle")


def _self_pairs(capsules: tuple[LinkCapsule, ...], links: set[tuple[str, str]]) -> Ints:
    pairs = [
        (i, j)
        for i, first in enumerate(capsules)
        for j, second in enumerate(capsules)
        if (first.link, second.link) in links
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _rows(vectors: list[Array]) -> Array:
    return np.array(vectors, dtype=np.float64).reshape(-1, 3)
