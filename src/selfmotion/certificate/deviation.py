"""Where a motion takes the tool, by forward kinematics; shares no code with the rollout."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array
from selfmotion.follow import BoundFollow, Follows
from selfmotion.robot import WORLD, Chain
from selfmotion.task import Relaxation, Task

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def deviation_from(follow: BoundFollow, t: Array, q: Array, in_tool_axes: bool) -> Array:
    """Return how the tool deviates from the path, (K, 6).

    Rows x, y, z [m] and rx, ry, rz [rad] as `Relaxation` has them; zero where the task leaves them
    free.
    """
    task = follow.task
    rotation, translation = poses(follow.chain, q)
    target = follow.path.samples(t)
    linear = task.rows[task.rows < 3]
    miss = np.zeros((len(t), 6))
    miss[:, linear] = (translation - target.translation)[:, linear]
    miss[:, 3:] = rotation_vectors(task, relative_turns(target.rotation, rotation))
    if in_tool_axes:
        miss[:, :3] = np.einsum("kji,kj->ki", target.rotation, miss[:, :3])
    return miss


def smallest_singular_values(follows: Follows, q: Array) -> Array:
    """Return the smallest singular value of all prescribed rows at q (K, n), (K,)."""
    rows = []
    for item in follows.items:
        jacobian, rotation = jacobians(item.chain, q)
        rows.append(item.task.select_along(jacobian, rotation))
    values = np.linalg.svd(np.concatenate(rows, axis=1), compute_uv=False)
    return values[:, -1].astype(np.float64)


def jacobians(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return Jacobians (K, 6, n) of the tip and its orientations, in the base's axes."""
    model, data = chain.model, chain.model.createData()
    frames = [chain.tip] if chain.base == WORLD else [chain.tip, chain.base]
    world = np.empty((len(frames), len(q), 6, model.nv))
    turns, places = np.empty((len(frames), len(q), 3, 3)), np.empty((len(frames), len(q), 3))
    placed = [data.oMf[frame] for frame in frames]
    # Views of what each placement sets.
    seen = [(pose.rotation, pose.translation) for pose in placed]
    coupling = chain.coupling
    for k, configuration in enumerate(q @ coupling.matrix.T + coupling.offsets):
        pin.computeJointJacobians(model, data, configuration)
        for f, frame in enumerate(frames):
            pin.updateFramePlacement(model, data, frame)
            world[f, k] = pin.getFrameJacobian(model, data, frame, _AXES).reshape(6, -1)
            turns[f, k], places[f, k] = seen[f]
    world = world @ coupling.matrix
    if chain.base == WORLD:
        return world[0], turns[0]
    own, other = world
    apart, turned = places[0] - places[1], turns[1].transpose(0, 2, 1)
    moving = other[:, :3] + np.cross(other[:, 3:], apart[:, :, None], axis=1)
    jacobian = np.concatenate(
        [turned @ (own[:, :3] - moving), turned @ (own[:, 3:] - other[:, 3:])], 1
    )
    return jacobian, turned @ turns[0]


def poses(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return rotations and translations of a chain's tip in its base frame at q (K, n).

    By calls of its own: what checks a motion must not share a fault with what made it.
    """
    model, data, tip, base = chain.model, chain.model.createData(), chain.tip, chain.base
    rotation, translation = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
    pose = data.oMf[tip]
    seen_rotation, seen_translation = pose.rotation, pose.translation
    for k, configuration in enumerate(q @ chain.coupling.matrix.T + chain.coupling.offsets):
        pin.forwardKinematics(model, data, configuration)
        pin.updateFramePlacement(model, data, tip)
        rotation[k], translation[k] = seen_rotation, seen_translation
        if base != WORLD:
            frame = pin.updateFramePlacement(model, data, base)
            relative = frame.actInv(pose)
            rotation[k], translation[k] = relative.rotation, relative.translation
    return rotation, translation


def relative_turns(target: Array, actual: Array) -> Array:
    """Return the rotations from target to actual in target's axes, (K, 3, 3)."""
    return np.asarray(target.transpose(0, 2, 1) @ actual)


def rotation_vectors(task: Task, relative: Array) -> Array:
    """Return the rotation vectors of turns (…, 3, 3), (…, 3) [rad].

    Those of the whole orientation, or of the tool's z axis alone; zero where no angle counts.
    """
    if not task.angular:
        return np.zeros(relative.shape[:-1])
    if task.tool_axes:
        # From (0, 0, 1) to the z axis as seen from the target, by the shortest way.
        axis = relative[..., 2]
        normal = np.stack([-axis[..., 1], axis[..., 0], np.zeros(axis.shape[:-1])], axis=-1)
        cosine = axis[..., 2]
    else:
        normal = 0.5 * np.stack(
            [
                relative[..., 2, 1] - relative[..., 1, 2],
                relative[..., 0, 2] - relative[..., 2, 0],
                relative[..., 1, 0] - relative[..., 0, 1],
            ],
            axis=-1,
        )
        cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    sine = np.linalg.norm(normal, axis=-1)
    # Half a turn has no sine to scale; its axis does not matter, its angle does.
    normal[sine == 0.0] = [1.0, 0.0, 0.0]
    angle = np.arctan2(sine, cosine)
    return np.asarray(normal * (angle / np.where(sine > 0.0, sine, 1.0))[..., None])


def excess(relaxations: Sequence[Relaxation], duration: float, t: Array, deviation: Array) -> Array:
    """Return what deviations are beyond the relaxations, (K, 6) [m, rad].

    Parameters
    ----------
    relaxations : sequence of Relaxation
    duration : float
        Of the path [s].
    t : (K,)
        Times [s].
    deviation : (K, 6)
        Rows x, y, z, rx, ry, rz, in the relaxations' axes.
    """
    beyond = deviation.copy()
    for item in relaxations:
        size = deviation_size(item, duration, t, deviation)
        share = np.maximum(size - item.band, 0.0) / np.where(size > 0.0, size, 1.0)
        first, last = item.window(duration)
        outside = (t < first) | (t > last)
        beyond[:, item.indices] *= np.where(outside, 1.0, share)[:, None]
    return beyond


def deviation_size(item: Relaxation, duration: float, t: Array, deviation: Array) -> Array:
    """Return how far the rows of a relaxation are off the path in its window, (K,).

    Zero outside the window. Parameters as in `excess`.
    """
    first, last = item.window(duration)
    inside = (t >= first) & (t <= last)
    return np.asarray(np.linalg.norm(deviation[:, item.indices], axis=1) * inside)
