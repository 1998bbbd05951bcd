"""A plan's motion, sampled for a page: links, curves, clearance, and its self-motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d

from selfmotion.basics import Array
from selfmotion.certificate import Quantity, errors_of_poses
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import BoundTaskFrame, is_plain
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel, null_space
from selfmotion.model.task import Task
from selfmotion.planning.result import Plan
from selfmotion.planning.search import Manifold
from selfmotion.problem.problem import Problem

# Between key frames a page interpolates; it may be off by this much at most [m, and per entry of
# the rotation matrix]. Below what a screen resolves and half of what our tests ask for.
_TOLERANCE = 5e-5
# Where a motion jumps, no interval is short enough; halving stops here [s].
_SHORTEST = 1e-4
# Points of each curve: one for every two or three pixels of a wide plot.
CURVE_POINTS = 401


@dataclass(frozen=True, eq=False)
class KeyFrames:
    """Poses of the moving links over time.

    Attributes
    ----------
    t : (K,)
        Times from the start of the motion [s].
    position : (K, n, 3)
        Origin of each joint's frame in world axes [m].
    quaternion : (K, n, 4)
        Its orientation, (x, y, z, w).
    """

    t: Array
    position: Array
    quaternion: Array

    def picked(self, which: npt.NDArray[np.intp] | slice) -> "KeyFrames":
        """Return some of the key frames."""
        return KeyFrames(self.t[which], self.position[which], self.quaternion[which])

    def transforms(self, k: int) -> Array:
        """Return the homogeneous matrices of all joints at key frame `k`, (n, 4, 4)."""
        matrices: Array = _homogeneous(self.position[k], self.quaternion[k])
        return matrices


def key_frames(robot: RobotModel, trajectory: Trajectory) -> KeyFrames:
    """Sample the links' poses so densely that interpolation is right to 0.05 mm.

    Linear interpolation of positions and spherical interpolation of orientations are compared with
    forward kinematics halfway between key frames; where they differ, the interval is halved.
    """
    duration = trajectory.duration
    times = np.linspace(0.0, duration, max(9, int(np.ceil(20 * duration)) + 1))
    frames = _poses(robot, trajectory, times)
    start, end = frames.picked(slice(None, -1)), frames.picked(slice(1, None))
    while len(start.t):
        middle = _poses(robot, trajectory, 0.5 * (start.t + end.t))
        guess = _homogeneous(
            0.5 * (start.position + end.position), _halfway(start.quaternion, end.quaternion)
        )
        miss = np.abs(guess - _homogeneous(middle.position, middle.quaternion)).max(axis=(1, 2, 3))
        wrong = np.flatnonzero((miss > _TOLERANCE) & (end.t - start.t > _SHORTEST))
        start, middle, end = start.picked(wrong), middle.picked(wrong), end.picked(wrong)
        frames = _joined(frames, middle)
        start, end = _joined(start, middle), _joined(middle, end)
    return frames.picked(np.argsort(frames.t))


def _joined(a: KeyFrames, b: KeyFrames) -> KeyFrames:
    return KeyFrames(
        np.concatenate([a.t, b.t]),
        np.concatenate([a.position, b.position]),
        np.concatenate([a.quaternion, b.quaternion]),
    )


def _poses(robot: RobotModel, trajectory: Trajectory, times: Array) -> KeyFrames:
    return poses_of(robot, trajectory(clock_of(trajectory, times)), times)


def poses_of(robot: RobotModel, q: Array, times: Array) -> KeyFrames:
    """Return the poses of the links at configurations (K, n) of so many times (K,) [s]."""
    poses = robot.joint_poses(q)
    return KeyFrames(times, poses[..., :3], poses[..., 3:])


def clock_of(trajectory: Trajectory, times: Array) -> Array:
    """Turn times from the start of the motion into the trajectory's own."""
    return np.asarray(np.minimum(trajectory.t[0] + times, trajectory.t[-1]))


def _halfway(a: Array, b: Array) -> Array:
    sign = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0, -1.0, 1.0)
    middle = a + sign * b
    return np.asarray(middle / np.linalg.norm(middle, axis=-1, keepdims=True))


def _homogeneous(position: Array, quaternion: Array) -> Array:
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    matrix: Array = np.zeros((*position.shape[:-1], 4, 4))
    matrix[..., 0, 0] = 1 - 2 * (y * y + z * z)
    matrix[..., 0, 1] = 2 * (x * y - z * w)
    matrix[..., 0, 2] = 2 * (x * z + y * w)
    matrix[..., 1, 0] = 2 * (x * y + z * w)
    matrix[..., 1, 1] = 1 - 2 * (x * x + z * z)
    matrix[..., 1, 2] = 2 * (y * z - x * w)
    matrix[..., 2, 0] = 2 * (x * z - y * w)
    matrix[..., 2, 1] = 2 * (y * z + x * w)
    matrix[..., 2, 2] = 1 - 2 * (x * x + y * y)
    matrix[..., :3, 3] = position
    matrix[..., 3, 3] = 1.0
    return matrix


@dataclass(frozen=True, eq=False)
class Curves:
    """What the plots show, on one uniform grid of M times.

    Attributes
    ----------
    t : (M,)
        Times from the start of the motion [s].
    q, qd, qdd : (M, n)
        Joint coordinates [rad or m], velocities [rad/s or m/s] and accelerations [rad/s² or m/s²].
    torque : (M, n) or None
        Joint torques [Nm or N]; None where the plan was not asked to limit them.
    manipulability : (M,)
        √det(JJᵀ) of the rows the task prescribes, in SI units.
    position_error, rotation_error : (M,)
        Distance from the prescribed tool motion in the task's rows [m], [rad]: the largest within
        1 % of the duration, because at the trajectory's samples it is next to nothing.
    tool : (M, 3)
        Position of the tool in the frame that carries its path [m]: that of a joint, or the world.
    rotation : (M, 3, 3)
        Orientation of the tool there.
    carrier : (M, 4, 4)
        Where this frame is in the world.
    ellipsoid : (M, 3, 3)
        (J_v J_vᵀ)^½ of the prescribed linear rows, world axes: maps the unit sphere of joint speeds
        to the ellipsoid of tool speeds [m/s]. No axis is thinner than a fiftieth of the longest.
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array
    torque: Array | None
    manipulability: Array
    position_error: Array
    rotation_error: Array
    tool: Array
    rotation: Array
    carrier: Array
    ellipsoid: Array

    @property
    def tool_in_world(self) -> Array:
        """Position of the tool in world axes [m], (M, 3)."""
        turned = np.einsum("kij,kj->ki", self.carrier[:, :3, :3], self.tool)
        return np.asarray(turned + self.carrier[:, :3, 3])


def torque_limits(plan: Plan) -> Quantity | None:
    """Return the torques that a plan limits, with what the tool holds; None for none."""
    asked = (item for item in plan.problem.constraints if item.load is not None)
    return next((item.quantity(plan.robot) for item in asked), None)


def curves(
    plan: Plan,
    trajectory: Trajectory,
    follow: BoundTaskFrame | None = None,
    points: int = CURVE_POINTS,
) -> Curves:
    """Evaluate `trajectory` (the plan's, or its x = 0 motion) for the plots of what is followed."""
    follow = plan.problem.follows.items[0] if follow is None else follow
    chain, task = follow.chain, follow.task
    base, world = chain.base_placement, chain.to_base()
    times = np.linspace(0.0, trajectory.duration, points)
    clock = clock_of(trajectory, times)
    q, qd, qdd = (trajectory(clock, order) for order in range(3))
    asked = torque_limits(plan)
    jacobians, turns, places = chain.along(q)
    _, frames, origins = world.along(q)
    rows = plan.problem.follows.jacobians(q)
    shapes = _velocity_ellipsoids(jacobians, task)
    errors = errors_of_poses(follow, clock, turns, places, ())
    # The reference frame of what is followed, as it is carried along, in world axes.
    carrier = np.zeros((points, 4, 4))
    carrier[:, :3, :3] = frames @ base.rotation.T
    carrier[:, :3, 3] = origins - carrier[:, :3, :3] @ base.translation
    carrier[:, 3, 3] = 1.0
    window = 2 * (points // 100) + 1
    return Curves(
        t=times,
        q=q,
        qd=qd,
        qdd=qdd,
        torque=None if asked is None else asked.values(q, qd, qdd),
        manipulability=np.prod(np.linalg.svd(rows, compute_uv=False), axis=1),
        position_error=maximum_filter1d(errors[:, 0], window),
        rotation_error=maximum_filter1d(errors[:, 1], window),
        tool=places @ base.rotation.T + base.translation,
        rotation=base.rotation @ turns,
        carrier=carrier,
        ellipsoid=frames @ shapes @ frames.transpose(0, 2, 1),
    )


def _velocity_ellipsoids(jacobians: Array, task: Task) -> Array:
    """Return the matrices (K, 3, 3) of the tool's velocity ellipsoids, of Jacobians (K, 6, n)."""
    linear = np.zeros((len(jacobians), 3, jacobians.shape[2]))
    rows = task.rows[task.rows < 3]
    linear[:, rows] = jacobians[:, rows]
    values, vectors = np.linalg.eigh(linear @ linear.transpose(0, 2, 1))
    lengths = np.sqrt(np.maximum(values, 0.0))
    # Flat where the tool cannot move; a little thickness gives the surface a normal.
    lengths = np.maximum(lengths, 0.02 * lengths[:, -1:])
    return np.asarray((vectors * lengths[:, None]) @ vectors.transpose(0, 2, 1))


# A distance query costs milliseconds, a hundred times one point of the other curves.
_POINTS = 121


@dataclass(frozen=True, eq=False)
class ClearanceCurve:
    """Clearance on a uniform grid of times.

    Attributes
    ----------
    t : (K,)
        Times from the start of the motion [s].
    value : (K,)
        Smallest distance over all pairs of bodies [m].
    pairs : tuple of (str, str)
        The pair at each time.
    points : (K, 2, 3)
        Where the two are nearest, in world axes [m].
    required : (K,)
        Distance that the clearance requires which has the pair; the largest one of several [m].
    """

    t: Array
    value: Array
    pairs: tuple[tuple[str, str], ...]
    points: Array
    required: Array


def clearance_curve(
    trajectory: Trajectory, bodies: Sequence[tuple[CollisionModel, float]]
) -> ClearanceCurve | None:
    """Return the clearance along a motion, or None where there is no pair of bodies to check.

    `bodies` are models, and the distance that is required in each [m].
    """
    watched = [(model, required) for model, required in bodies if model.pairs]
    if not watched:
        return None
    times = np.linspace(0.0, trajectory.duration, _POINTS)
    clock = np.minimum(trajectory.t[0] + times, trajectory.t[-1])
    found, points, asked = [], [], []
    for q in trajectory(clock):
        closest, required, model = min(
            ((model.distance(q), required, model) for model, required in watched),
            key=lambda item: (item[0].value, -item[1]),
        )
        found.append(closest)
        asked.append(required)
        points.append(model.nearest_points(q, closest.first, closest.second))
    return ClearanceCurve(
        times,
        np.array([each.value for each in found]),
        tuple((each.first, each.second) for each in found),
        np.array(points),
        np.array(asked),
    )


# Times of a motion at which the arm is moved along its self-motion; steps to either side of it, and
# how far the chosen joint turns in each [rad or m].
_TIMES, _STEPS, _STEP = 41, 10, 0.1
# How far links go is measured in steps so short [rad or m].
_SHORT = 1e-3
# What a step may move any joint by, as a multiple of it: beyond, it is another branch.
_FAR = 8.0


@dataclass(frozen=True, eq=False)
class SelfMotion:
    """The arm along its self-motion at several times of a motion.

    Attributes
    ----------
    joint : str
        The joint that turns by even steps.
    frames : tuple of KeyFrames
        Poses of the links over time, one for each step, from the farthest on one side to that on
        the other.
    """

    joint: str
    frames: tuple[KeyFrames, ...]


def self_motion(problem: Problem, trajectory: Trajectory) -> SelfMotion | None:
    """Return the self-motions of an arm along its motion; None where it has none.

    Where several joint motions leave the tool where it is, one is shown: a joint is turned, the
    others move as little as they have to. Steps end where a joint meets its limit.
    """
    follows = problem.follows
    if follows.redundancy < 1 or not is_plain(follows):
        return None
    robot = problem.robot
    times = np.linspace(0.0, trajectory.duration, _TIMES)
    q = trajectory(clock_of(trajectory, times))
    joint = _chosen(problem, q)
    sides = [_stepped(problem, times, q, joint, way * _STEP) for way in (-1.0, 1.0)]
    steps = [*reversed(sides[0]), q, *sides[1]]
    return SelfMotion(
        robot.joint_names[joint], tuple(poses_of(robot, step, times) for step in steps)
    )


def _chosen(problem: Problem, q: Array) -> int:
    """Return the joint by whose self-motions the links of configurations (K, n) go farthest."""
    robot, moved = problem.robot, np.zeros(problem.robot.dof)
    basis, here = null_space(problem.follows.jacobians(q)), robot.joint_poses(q)[..., :3]
    for joint in range(robot.dof):
        along = np.einsum("knr,kr->kn", basis, basis[:, joint])
        speed = np.linalg.norm(along, axis=1, keepdims=True)
        there = robot.joint_poses(q + _SHORT * along / np.maximum(speed, _SHORT))[..., :3]
        # Of a joint that hardly moves itself, steps would be long.
        moved[joint] = (np.linalg.norm(there - here, axis=2).max(axis=1) * speed[:, 0]).mean()
    return int(np.argmax(moved))


def _stepped(problem: Problem, times: Array, q: Array, joint: int, step: float) -> list[Array]:
    """Return configurations (K, n) step by step to one side; those at a limit stay there."""
    robot, follows = problem.robot, problem.follows
    manifold = Manifold(follows, robot.lower, robot.upper)
    targets, held = follows.targets(times), follows.held(times)
    found, moves = list[Array](), np.full(len(q), fill_value=True)
    for _ in range(_STEPS):
        basis = null_space(follows.jacobians(q))
        # The least joint speed at which the joint turns by one: N Nᵀ e / (eᵀ N Nᵀ e).
        along = np.einsum("knr,kr->kn", basis, basis[:, joint])
        share = along[:, joint]
        moves &= share > 1e-6
        ahead = q + step * along / np.where(moves, share, 1.0)[:, None]
        reached, arrived = manifold.project(ahead, targets, held=held)
        inside = np.all((reached >= robot.lower) & (reached <= robot.upper), axis=1)
        near = np.abs(reached - q).max(axis=1) <= _FAR * abs(step)
        moves &= arrived & inside & near
        q = np.where(moves[:, None], reached, q)
        found.append(q)
    return found
