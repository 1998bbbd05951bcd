"""Smooth conservative clearances: what an optimiser follows."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.arrays import Array
from selfmotion.collision.capsules import LinkCapsule, link_capsules
from selfmotion.collision.exact import CollisionModel
from selfmotion.collision.obstacles import Box, Capsule, Cylinder, Mesh, Obstacle, Sphere
from selfmotion.collision.shapes import obstacle_geometry
from selfmotion.errors import CollisionError, RobotError

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
        """Return ∂d/∂q, (K, P, n); `pullback` is far cheaper where a sum is wanted."""
        count, pairs = self.values.shape
        gradient = np.empty((count, pairs, self._jacobians.shape[2]))
        for pair in range(pairs):
            only = np.zeros((count, pairs))
            only[:, pair] = 1.0
            gradient[:, pair] = self.pullback(only)
        return gradient


class ClearanceModel:
    """Clearance of capsules around the links from each other and from obstacles.

    The capsules contain the collision geometry of their links, so the smallest distance here of
    two links is never more than the exact one. It is differentiable but where the closest points
    jump.

    Between capsules it is the distance of the centre lines minus both radii. From a box it is
    that of the centre line, inside minus the shortest way out, minus the radius. From a cylinder
    it is the same outside; inside, minus the depth of the centre line's deepest point. A mesh
    counts as the box around it along its own axes.

    Parameters
    ----------
    exact : CollisionModel
        Whose robot, obstacles and pairs of links are taken.

    Attributes
    ----------
    capsules : tuple of LinkCapsule
        What stands for the links.
    pairs : tuple of (str, str)
        Names for the P columns of `Clearances.values`.

    Notes
    -----
    Capsules may overlap where their links do not. Judged over 300 sampled configurations, two
    links are not paired when this happens at all though they never meet, or in more than a tenth
    of the samples; a link and an obstacle, when it happens in each. These pairs are left
    to the exact model, so a motion that is clear here still needs its verdict.

    Not for use by several threads at once.
    """

    def __init__(self, exact: CollisionModel) -> None:
        self.robot = exact.robot
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
        self._self_pairs = _self_pairs(self.capsules, set(exact.pairs))
        self._world_pairs = np.array(
            [
                (i, j)
                for i, capsule in enumerate(self.capsules)
                for j in range(len(exact.obstacles))
                if capsule.joint > 0
            ],
            dtype=np.int64,
        ).reshape(-1, 2)
        self._drop_overlapping(exact)
        self.pairs = self._names(exact.obstacles)

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
        values.setflags(write=False)
        return Clearances(values, wrenches, jacobians, self._pair_joints(), self._parents)

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

    def _pair_joints(self) -> Ints:
        own = self._joints[self._self_pairs]
        world = self._joints[self._world_pairs[:, :1]]
        return np.concatenate([own, np.hstack([world, np.zeros_like(world)])])

    def _names(self, obstacles: tuple[Obstacle, ...]) -> tuple[tuple[str, str], ...]:
        links = [capsule.link for capsule in self.capsules]
        own = [(links[i], links[j]) for i, j in self._self_pairs]
        return tuple(own + [(links[i], obstacles[j].name) for i, j in self._world_pairs])

    def _drop_overlapping(self, exact: CollisionModel) -> None:
        rng = np.random.default_rng(0)
        lower, upper = self.robot.finite_limits()
        q = rng.uniform(lower, upper, (_SAMPLES, self.robot.dof))
        overlap = self.clearances(q).values <= 0.0
        if not overlap.any():
            return
        truth = exact.overlaps(q)
        names = self._names(exact.obstacles)
        world = {obstacle.name for obstacle in exact.obstacles}
        useful = np.ones(len(names), dtype=bool)
        for pair in set(names):
            # All capsules of two links together: part of them would promise what it cannot keep.
            columns = np.array([name == pair for name in names])
            met = truth[pair]
            wrong = (overlap[:, columns].any(axis=1) & ~met).mean()
            if pair[1] in world:
                useful[columns] = wrong < 1.0
            else:
                useful[columns] = wrong <= (_FALSE_ALARMS if met.any() else 0.0)
        own = len(self._self_pairs)
        self._self_pairs = self._self_pairs[useful[:own]]
        self._world_pairs = self._world_pairs[useful[own:]]


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
