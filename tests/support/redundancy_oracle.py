"""What a redundancy map has to show, found otherwise: by many starts, own kinematics and MuJoCo.

At each pixel Newton's method from many random configurations, in NumPy and by kinematics that
yourdfpy reads, finds all configurations with the tool in its pose and the coordinate at its value.
The plan's branch is chained through these sets: from pixel to pixel the nearest one. Limits are
compared, and distances are those that MuJoCo finds between the convex bodies.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import trimesh
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import Array, Flags, Ints
from selfmotion.problem.problem import envelope_of_problem
from selfmotion.result import Reason, RedundancyMap
from support.own_kinematics import Arm

# Random starts at each pixel, and steps of Newton's method with the longest step [rad or m].
STARTS, STEPS, LONGEST = 48, 30, 0.5
# Residual of a solution [m, rad], and distance of two that are the same one [rad or m].
SOLVED, SAME = 1e-9, 1e-4
# Motion from one pixel to the next beyond which a solution is on another branch [rad or m].
NEAR = 0.35
# Starts where none of a pixel's solutions is as near: some branches are reached from one in fifty.
MORE_STARTS = 600
# Halvings of the way from one pixel to the next where the branch goes far between them.
HALVINGS = 8
# Differences of central differences of a coordinate [s of the joints' motion].
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Coordinate:
    """A coordinate along the self-motion, written out.

    Attributes
    ----------
    kind : str
        ``"joint"``, ``"tool"`` or ``"elbow"``.
    joint : int
    """

    kind: str
    joint: int = 0

    @classmethod
    def of(cls, shown: RedundancyMap) -> "Coordinate":
        """Return that of a map, by its label."""
        if shown.label == "swivel angle":
            return cls("elbow")
        if shown.label == "rotation of the tool about its axis":
            return cls("tool")
        names = [f"joint '{name}'" for name in shown.joint_names]
        return cls("joint", names.index(shown.label))


class Kinematics:
    """The tool of an arm on a path with one task, and a coordinate of its self-motion."""

    def __init__(self, problem: sm.Problem, coordinate: Coordinate) -> None:
        self.problem, self.robot, self.coordinate = problem, problem.robot, coordinate
        self.arm = Arm(problem.robot)
        assert problem.robot.reference is None, "the oracle knows paths in the world alone"
        parents = {joint.name: joint for joint in self.arm._joint.values()}
        self._joints = [parents[name] for name in problem.robot.joint_names]

    def place(self, q: Array) -> tuple[Array, Array, Array, Array]:
        """Return rotation and place of the tool, and axes and places of the joints, (K, n, 3)."""
        known: dict[str, Any] = {}
        turn, at = self.arm.place(self.robot.tool, q, known)
        axes, places = np.empty((*q.shape, 3)), np.empty((*q.shape, 3))
        for k, joint in enumerate(self._joints):
            turned, origin = self.arm.place(joint.child, q, known)
            own = np.array([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
            axes[:, k], places[:, k] = turned @ (own / np.linalg.norm(own)), origin
        return turn, at, axes, places

    def value(self, target: Array, turn: Array, places: Array, q: Array) -> Array:
        """Return the coordinate at configurations, (K,)."""
        if self.coordinate.kind == "joint":
            return q[:, self.coordinate.joint]
        if self.coordinate.kind == "tool":
            relative = np.einsum("ji,kjl->kil", target[:3, :3], turn)
            return np.arctan2(
                relative[:, 1, 0] - relative[:, 0, 1], relative[:, 0, 0] + relative[:, 1, 1]
            )
        return swivel(*(places[:, k] for k in (1, 3, 5)))

    def residual(self, target: Array, value: Array, q: Array) -> tuple[Array, Array]:
        """Return what is left to a pose and a value of the coordinate, (K, m), and (K, m, n)."""
        turn, at, axes, places = self.place(q)
        slides = np.array([self.robot.is_prismatic(name) for name in self.robot.joint_names])
        lever = at[:, None] - places
        linear = np.where(slides[:, None], axes, np.cross(axes, lever))
        angular = np.where(slides[:, None], 0.0, axes)
        task = self.problem.task
        rows, columns = [], []
        for row in task.rows:
            if row < 3:
                rows.append(target[row, 3] - at[:, row])
                columns.append(linear[:, :, row])
        if task is sm.Task.POSE:
            miss = Rotation.from_matrix(target[:3, :3] @ turn.transpose(0, 2, 1)).as_rotvec()
            rows += list(miss.T)
            columns += list(np.moveaxis(angular, 2, 0))
        if task is sm.Task.POINTING:
            across = np.cross(turn[:, :, 2], target[:3, 2])
            for k in (0, 1):
                rows.append(np.einsum("ki,ki->k", across, turn[:, :, k]))
                columns.append(np.einsum("kni,ki->kn", angular, turn[:, :, k]))
        left = value - self.value(target, turn, places, q)
        if self.coordinate.kind != "joint":
            left = (left + np.pi) % (2.0 * np.pi) - np.pi
        return np.stack([*rows, left], axis=1), np.stack(
            [*columns, self._slope(turn, axes, places)], axis=1
        )

    def _slope(self, turn: Array, axes: Array, places: Array) -> Array:
        """Return the derivative of the coordinate by the joints, (K, n)."""
        if self.coordinate.kind == "joint":
            return np.tile(np.eye(self.robot.dof)[self.coordinate.joint], (len(turn), 1))
        if self.coordinate.kind == "tool":
            return np.einsum("kni,ki->kn", axes, turn[:, :, 2])
        found = np.zeros(axes.shape[:2])
        points = [places[:, k] for k in (1, 3, 5)]
        for j in range(axes.shape[1]):
            moved = [
                np.cross(axes[:, j], point - places[:, j]) if j < k else np.zeros_like(point)
                for point, k in zip(points, (1, 3, 5), strict=True)
            ]
            ahead, back = (
                swivel(*(p + way * STEP * v for p, v in zip(points, moved, strict=True)))
                for way in (1.0, -1.0)
            )
            found[:, j] = ((ahead - back + np.pi) % (2.0 * np.pi) - np.pi) / (2.0 * STEP)
        return found


def swivel(shoulder: Array, elbow: Array, wrist: Array) -> Array:
    """Return the angle of the elbow about the line to the wrist, from upwards, (K,)."""
    line = (wrist - shoulder) / np.linalg.norm(wrist - shoulder, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])
    across = np.cross(line, up)
    above = np.cross(across, line)
    arm = elbow - shoulder
    return np.arctan2(np.einsum("ki,ki->k", arm, across), np.einsum("ki,ki->k", arm, above))


class Bodies:
    """Distances of convex bodies by MuJoCo: hulls of the URDF's meshes, boxes, cylinders, spheres.

    Parameters
    ----------
    robot : RobotModel
    obstacles : sequence of Obstacle
        Boxes in the world.
    pairs : sequence of (str, str)
        Names of links and obstacles that have to keep apart.
    """

    def __init__(self, robot: sm.RobotModel, obstacles: Any, pairs: Any) -> None:
        self.robot = robot
        geometry = robot.geometry(pin.GeometryType.COLLISION)
        spec = mujoco.MjSpec()
        self._links, self._places = list[str](), list[Any]()
        self._joints = list[int]()
        for k, item in enumerate(geometry.geometryObjects):
            self._add(spec, f"body{k}", item.geometry, item)
            self._links.append(robot.link_of(item.parentFrame))
            self._joints.append(int(item.parentJoint))
            self._places.append(pin.SE3(item.placement))
        for obstacle in obstacles:
            spec.worldbody.add_geom(
                name=obstacle.name, type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * obstacle.size
            )
            self._links.append(obstacle.name)
            self._joints.append(0)
            self._places.append(pin.SE3(obstacle.pose))
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._shift = [pin.SE3.Identity() for _ in self._links]
        for k in range(self._model.ngeom):
            mesh = self._model.geom_dataid[k]
            if mesh >= 0:
                turn = np.empty(9)
                mujoco.mju_quat2Mat(turn, self._model.mesh_quat[mesh])
                self._shift[k] = pin.SE3(turn.reshape(3, 3), self._model.mesh_pos[mesh].copy())
        wanted = {frozenset(pair) for pair in pairs}
        self.pairs = [
            (i, j)
            for i in range(len(self._links))
            for j in range(i)
            if frozenset((self._links[i], self._links[j])) in wanted
            and self._links[i] != self._links[j]
        ]

    def _add(self, spec: Any, name: str, shape: Any, item: Any) -> None:
        kind, size = type(shape).__name__, np.zeros(3)
        types = mujoco.mjtGeom
        if kind == "Box":
            spec.worldbody.add_geom(name=name, type=types.mjGEOM_BOX, size=shape.halfSide)
        elif kind == "Sphere":
            size[0] = shape.radius
            spec.worldbody.add_geom(name=name, type=types.mjGEOM_SPHERE, size=size)
        elif kind == "Cylinder":
            size[:2] = shape.radius, shape.halfLength
            spec.worldbody.add_geom(name=name, type=types.mjGEOM_CYLINDER, size=size)
        else:
            hull = trimesh.load_mesh(item.meshPath)
            points = np.asarray(hull.convex_hull.vertices) * np.asarray(item.meshScale)
            mesh = spec.add_mesh(name=name)
            mesh.uservert = points.ravel().tolist()
            spec.worldbody.add_geom(name=name, type=types.mjGEOM_MESH, meshname=name)

    def names(self, pair: int) -> frozenset[str]:
        """Return the names of a pair."""
        return frozenset(self._links[k] for k in self.pairs[pair])

    def distances(self, q: Array, below: float) -> Array:
        """Return the distances at q (K, n) [m], at most `below`, (K, P)."""
        found = np.empty((len(q), len(self.pairs)))
        model, data = self.robot.model, self.robot.model.createData()
        ends = np.zeros(6)
        for row, configuration in enumerate(self.robot.coupling.spread(q)):
            pin.forwardKinematics(model, data, configuration)
            for k, joint in enumerate(self._joints):
                place = data.oMi[joint] * self._places[k] * self._shift[k]
                self._data.geom_xpos[k] = place.translation
                self._data.geom_xmat[k] = place.rotation.ravel()
            for pair, (i, j) in enumerate(self.pairs):
                found[row, pair] = mujoco.mj_geomDistance(
                    self._model, self._data, i, j, below, ends
                )
        return found


@dataclass(frozen=True, eq=False)
class Oracle:
    """Finds a plan's map by brute force.

    Attributes
    ----------
    problem : Problem
    shown : RedundancyMap
        The map: its times and values, and the plan's line, are looked at.
    plan : (N, n)
        The plan's configurations at its times.
    obstacles, pairs, required
        Bodies, as of `Bodies`, and the distance that they keep [m].
    """

    problem: sm.Problem
    shown: RedundancyMap
    plan: Array
    obstacles: Any = ()
    pairs: Any = ()
    required: float = 0.0
    starts: int = STARTS
    _rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    @cached_property
    def kinematics(self) -> Kinematics:
        """Kinematics in NumPy."""
        return Kinematics(self.problem, Coordinate.of(self.shown))

    def solutions(self, i: int) -> list[Array]:
        """Return all configurations found at each pixel of a time, M arrays (K, n)."""
        return self._solved(i, self.shown.coordinate, self.starts)

    def _solved(self, i: int, values: Array, starts: int) -> list[Array]:
        """Return the solutions at values (V,) of the coordinate from `starts` random ones."""
        robot = self.problem.robot
        lower, upper = robot.finite_limits()
        q = self._rng.uniform(lower, upper, (len(values) * starts, robot.dof))
        wanted = np.repeat(values, starts)
        target = self.problem.path.pose(float(self.shown.times[i])).homogeneous
        size = np.full(len(q), np.inf)
        for _ in range(STEPS):
            error, jacobian = self.kinematics.residual(target, wanted, q)
            size = np.linalg.norm(error, axis=1)
            left = size > SOLVED
            if not left.any():
                break
            gram = jacobian[left].transpose(0, 2, 1) @ jacobian[left]
            # Damped in proportion to the error: far from solutions, near singular poses.
            damping = 1e-3 * np.minimum(size[left], 1.0)[:, None, None] ** 2
            gram += damping * np.eye(robot.dof) + 1e-13 * np.eye(robot.dof)
            slope = np.einsum("kmn,km->kn", jacobian[left], error[left])
            step = np.linalg.solve(gram, slope[:, :, None])[:, :, 0]
            length = np.linalg.norm(step, axis=1, keepdims=True)
            q[left] += step * np.minimum(1.0, LONGEST / np.maximum(length, 1e-300))
        found = q.reshape(len(values), starts, -1)
        solved = (size <= 1e3 * SOLVED).reshape(len(values), starts)
        return [_unlike(found[k][solved[k]]) for k in range(len(values))]

    def branch(self, i: int) -> Array:
        """Return the plan's branch at a time, (M, n); NaN from where no solution is near."""
        values, robot = self.shown.coordinate, self.problem.robot
        sets = self.solutions(i)
        found = np.full((len(values), robot.dof), np.nan)
        begin = int(np.searchsorted(values, self.shown.plan_line[i]))
        for way in (1, -1):
            here, value = self.plan[i], float(self.shown.plan_line[i])
            k = begin if way > 0 else begin - 1
            while 0 <= k < len(values):
                nearest = _nearest(sets[k], here, robot.is_revolute)
                if nearest is None:
                    nearest = self._towards(i, here, value, float(values[k]), HALVINGS)
                if nearest is None:
                    break
                found[k], value = nearest, float(values[k])
                here = nearest
                k += way
        return found

    def _towards(self, i: int, here: Array, value: float, goal: float, left: int) -> Array | None:
        """Return the nearest solution at a value from one at another, by way of those between."""
        revolute = self.problem.robot.is_revolute
        more = self._solved(i, np.array([goal]), MORE_STARTS)[0]
        nearest = _nearest(more, here, revolute)
        if nearest is not None or left == 0:
            return nearest
        middle = 0.5 * (value + goal)
        between = self._towards(i, here, value, middle, left - 1)
        return None if between is None else self._towards(i, between, middle, goal, left - 1)

    def states(self, rows: Any = None) -> tuple[Ints, Array]:
        """Return what stops the arm at all pixels, (N, M), by limits and bodies, and q."""
        count = range(len(self.shown.times)) if rows is None else rows
        q = np.stack([self.branch(i) for i in count])
        return self.judged(q), q

    def judged(self, q: Array) -> Ints:
        """Return what stops the arm at configurations (N, M, n), (N, M)."""
        robot = self.problem.robot
        state = np.full(q.shape[:2], int(Reason.NO_CONFIGURATION))
        known = ~np.isnan(q).any(axis=2)
        envelope = envelope_of_problem(self.problem)
        inside = known & (q <= envelope.upper).all(axis=2) & (q >= envelope.lower).all(axis=2)
        state[known] = int(Reason.LIMIT)
        state[inside] = int(Reason.ALLOWED)
        if self.pairs:
            bodies = Bodies(robot, self.obstacles, self.pairs)
            names = {item.name for item in self.obstacles}
            worst = bodies.distances(q[inside], self.required + 1e-3)
            pair = np.argmin(worst, axis=1)
            near = worst.min(axis=1) < self.required
            world = np.array([bool(bodies.names(k) & names) for k in range(len(bodies.pairs))])
            said = np.where(world[pair], int(Reason.OBSTACLE), int(Reason.ITSELF))
            state[inside] = np.where(near, said, int(Reason.ALLOWED))
        return state


def differs(shown: Ints, found: Ints) -> Flags:
    """Return where a map says something else than the brute force, of the same columns, (K, M).

    Both look at the middles of pixels: none is left out beside borders.
    """
    # Singular poses and speeds are other checks: they are looked at after all others.
    passed = (shown == Reason.SINGULAR) | (shown == Reason.SPEED)
    return np.asarray(np.where(passed, int(Reason.ALLOWED), shown) != found)


def _unlike(q: Array) -> Array:
    """Return configurations (K, n) once each, modulo turns."""
    kept: list[Array] = []
    for one in q:
        away = [np.abs((one - other + np.pi) % (2.0 * np.pi) - np.pi).max() for other in kept]
        if not away or min(away) > SAME:
            kept.append(one)
    return np.array(kept).reshape(-1, q.shape[1])


def _nearest(q: Array, near: Array, revolute: Flags) -> Array | None:
    """Return the one of q (K, n), modulo turns, that is nearest to another, within `NEAR`."""
    turns = np.round((q - near) / (2.0 * np.pi))
    turned = q - np.where(revolute, 2.0 * np.pi * turns, 0.0)
    distance = np.linalg.norm(turned - near, axis=1)
    return turned[np.argmin(distance)] if distance.min(initial=np.inf) <= NEAR else None
