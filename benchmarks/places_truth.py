"""Whether a seam can be followed at all, by brute force: for `places.py`.

At each of many poses, inverse kinematics by damped least squares from thousands of random
configurations, deviations of relaxed rows included, in plain NumPy with products of exponentials;
solutions are carried on to the neighbouring poses, both ways; a motion is a chain of them whose
steps keep the joints' speeds. Nothing here is the product's but limits, bodies and the Jacobian at
q = 0, from which the screws are taken.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.problem.problem import envelope_of_problem

# Poses along the path, random seeds at each, and of these at poses where none of them led there.
POSES, SEEDS, MORE_SEEDS = 61, 300, 6000
ITERATIONS, ARRIVED = 60, 1e-6
# A metre counts as much as so many radians.
LEVER = 2.0
# Samples nearer to each other [rad] are one.
SAME = 0.03


class Truth(Enum):
    """What is known of a place."""

    NO_POSE = 0
    MOTION = 1
    NO_CHAIN = 2
    UNKNOWN = 3


class _Arm:
    """Forward kinematics of many configurations by products of exponentials."""

    def __init__(self, robot: sm.RobotModel) -> None:
        zero = np.zeros(robot.dof)
        jacobian, self.home_rotation, self.home = (np.array(x) for x in robot.chain.at(zero))
        self.axes = jacobian[3:].T.copy()
        self.moments = jacobian[:3].T - np.cross(self.axes, self.home)

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Return positions (K, 3), rotations (K, 3, 3) and Jacobians (K, 6, n), world axes."""
        count, n = q.shape
        turn, shift = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        axes, moments = np.empty((count, n, 3)), np.empty((count, n, 3))
        for k in range(n):
            w, v = self.axes[k], self.moments[k]
            axes[:, k] = turn @ w
            moments[:, k] = turn @ v + np.cross(shift, axes[:, k])
            skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            angle = q[:, k, None, None]
            step = np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew
            # (I - R) (w × v) + w wᵀ v θ, and v θ of a slide.
            move = (np.eye(3) - step) @ np.cross(w, v) + q[:, k, None] * (w * (w @ v))
            move += q[:, k, None] * (v if not w.any() else 0.0)
            shift = shift + np.einsum("kij,kj->ki", turn, move)
            turn = turn @ step
        position = shift + turn @ self.home
        linear = moments + np.cross(axes, position[:, None])
        jacobian = np.concatenate([linear, axes], axis=2).transpose(0, 2, 1)
        return position, turn @ self.home_rotation, jacobian


class _Asked:
    """The tool's allowed set at a pose: how far it is, and in what direction."""

    def __init__(self, problem: sm.Problem) -> None:
        self.problem, self.path = problem, problem.path
        self.pointing = problem.task is sm.Task.POINTING
        self.arm = _Arm(problem.robot)

    def residual(self, t: float, q: Array) -> tuple[Array, Array]:
        """Return what is missing to the allowed set in six rows, (K, 6), and ∂/∂q, (K, 6, n)."""
        pose = self.path.pose(t)
        position, rotation, jacobian = self.arm.at(q)
        away = position - pose.translation
        # In the axes of the path's tool: both groups of rows are seen there.
        along = np.einsum("ji,kj->ki", pose.rotation, away)
        relative = pose.rotation.T @ rotation
        turned = _pointing(relative) if self.pointing else _logarithms(relative)
        rows = np.einsum("ji,kjn->kin", pose.rotation, jacobian[:, :3])
        spins = np.einsum("ji,kjn->kin", pose.rotation, jacobian[:, 3:])
        rest = np.concatenate([along, turned], axis=1)
        slope = np.concatenate([rows, spins], axis=1)
        if self.pointing:
            slope[:, 5] = 0.0
        for item in self.problem.relaxations:
            first, last = item.window(self.path.duration)
            if not first <= t <= last:
                continue
            here = item.indices
            size = np.linalg.norm(rest[:, here], axis=1)
            over = np.maximum(size - 0.999 * item.band, 0.0)
            share = np.where(size > 0.0, over / np.maximum(size, 1e-12), 0.0)
            rest[:, here] *= share[:, None]
            slope[:, here] *= (over > 0.0)[:, None, None]
        rest[:, :3] *= LEVER
        slope[:, :3] *= LEVER
        return rest, slope

    def solved(self, t: float, seeds: Array) -> Array:
        """Return the solutions that damped least squares reaches from seeds (K, n)."""
        robot = self.problem.robot
        lower, upper = robot.finite_limits()
        q = np.clip(seeds, lower, upper)
        damping = np.full(len(q), 1e-2)
        rest, slope = self.residual(t, q)
        size = np.linalg.norm(rest, axis=1)
        for _ in range(ITERATIONS):
            if not len(q) or np.all(size < ARRIVED):
                break
            gradient = np.einsum("kin,ki->kn", slope, rest)
            stuck = ((q <= lower) & (gradient > 0)) | ((q >= upper) & (gradient < 0))
            free = slope * ~stuck[:, None, :]
            normal = free @ free.transpose(0, 2, 1) + damping[:, None, None] * np.eye(6)
            step = np.einsum("kin,ki->kn", free, np.linalg.solve(normal, rest[..., None])[..., 0])
            trial = np.clip(q - step, lower, upper)
            new, steep = self.residual(t, trial)
            there = np.linalg.norm(new, axis=1)
            better = there < size
            q[better], rest[better], slope[better] = trial[better], new[better], steep[better]
            size = np.where(better, there, size)
            damping = np.clip(np.where(better, 0.2 * damping, 5.0 * damping), 1e-12, 1e4)
        return q[size < ARRIVED]

    def free(self, q: Array) -> Array:
        """Return those of q (K, n) that keep all bodies apart."""
        for model, distance in envelope_of_problem(self.problem).bodies:
            q = q[~model.colliding(q, distance)] if len(q) else q
        return q


def truth_of(problem: sm.Problem, seed: int = 0) -> Truth:
    """Return what brute force knows of a problem."""
    rng, asked = np.random.default_rng(seed), _Asked(problem)
    times = np.linspace(0.0, problem.path.duration, POSES)
    lower, upper = problem.robot.finite_limits()
    layers = []
    # From both ends inwards: places are bad there first.
    for k in sorted(range(POSES), key=lambda k: min(k, POSES - 1 - k)):
        for count in (SEEDS, MORE_SEEDS):
            found = asked.free(
                asked.solved(times[k], rng.uniform(lower, upper, (count, len(lower))))
            )
            if len(found):
                break
        if not len(found):
            return Truth.NO_POSE
        layers.append((k, found))
    ordered = [layer for _, layer in sorted(layers, key=lambda pair: pair[0])]
    steps = envelope_of_problem(problem).speed * np.diff(times)[0]
    return Truth.MOTION if _chain(asked, times, ordered, steps) else Truth.NO_CHAIN


def _chain(asked: _Asked, times: Array, layers: list[Array], steps: Array) -> bool:
    """Return whether samples, carried on to their neighbours, make a chain of short steps."""
    last = len(times) - 1
    for order in (range(1, last + 1), range(last - 1, -1, -1)):
        for k in order:
            before = layers[k - 1 if order.step > 0 else k + 1]
            carried = asked.solved(times[k], before)
            near = np.abs(carried).max(initial=0.0) >= 0.0
            fresh = asked.free(carried) if near else carried
            layers[k] = _thinned(np.concatenate([layers[k], fresh]))
    alive = layers[0]
    for layer in layers[1:]:
        short = [bool(np.any(np.all(np.abs(alive - q) <= steps, axis=1))) for q in layer]
        alive = layer[np.array(short, dtype=bool)]
        if not len(alive):
            return False
    return True


def _thinned(q: Array) -> Array:
    """Return configurations (K, n) without those that share a cell of the grid."""
    _, first = np.unique(np.round(q / SAME), axis=0, return_index=True)
    return q[np.sort(first)]


def _logarithms(rotation: Array) -> Array:
    """Return the rotation vectors of rotations (K, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(rotation).as_rotvec())


def _pointing(rotation: Array) -> Array:
    """Return the shortest rotation vectors that turn the z axis to those of rotations, (K, 3)."""
    axis = np.stack([-rotation[:, 1, 2], rotation[:, 0, 2], np.zeros(len(rotation))], axis=1)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, rotation[:, 2, 2])
    return axis * (angle / np.maximum(sine, 1e-12))[:, None]
