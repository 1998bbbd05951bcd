"""Pose of the tool along a motion, and its error from the path at all times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, Progress, series, silent
from selfmotion.certificate.bounding import BoundedFunction, MotionSegments, bounded
from selfmotion.certificate.requirement import Extreme, Tolerance
from selfmotion.model.follow import BoundTaskFrame, Follows
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.robot import WORLD, Chain, RobotModel
from selfmotion.model.task import Relaxation, Task

# Singular value below which it is not taken from an eigenvalue: above, it is right to 1e-12.
_NEAR_SINGULAR = 1e-3


def deviation_from(follow: BoundTaskFrame, t: Array, q: Array, in_tool_axes: bool) -> Array:
    """Return the deviation of the tool from the path at q (K, n) and times t (K,) [s], (K, 6).

    Rows x, y, z [m] and rx, ry, rz [rad] as `Relaxation` has them; zero where the task leaves them
    free.
    """
    return deviation_of_poses(follow, t, *poses(follow.chain, q), in_tool_axes)


def deviation_of_poses(
    follow: BoundTaskFrame, t: Array, rotation: Array, translation: Array, in_tool_axes: bool
) -> Array:
    """Return the same of poses of the tool, (K, 3, 3) and (K, 3)."""
    task = follow.task
    target = follow.path.samples(t)
    linear = task.rows[task.rows < 3]
    deviation_rows = np.zeros((len(t), 6))
    deviation_rows[:, linear] = (translation - target.translation)[:, linear]
    deviation_rows[:, 3:] = rotation_vectors(task, relative_turns(target.rotation, rotation))
    if in_tool_axes:
        deviation_rows[:, :3] = np.einsum("kji,kj->ki", target.rotation, deviation_rows[:, :3])
    return deviation_rows


def smallest_singular_values(follows: Follows, q: Array) -> Array:
    """Return the smallest singular value of all prescribed rows at q (K, n), (K,)."""
    rows = []
    for item in follows.items:
        jacobian, rotation = jacobians(item.chain, q)
        rows.append(item.task.select_along(jacobian, rotation))
    every = np.concatenate(rows, axis=1)
    squares = np.linalg.eigvalsh(every @ every.transpose(0, 2, 1))[:, 0]
    # Square roots of small eigenvalues have lost digits.
    found, near = np.sqrt(np.maximum(squares, 0.0)), squares < _NEAR_SINGULAR**2
    if near.any():
        found[near] = np.linalg.svd(every[near], compute_uv=False)[:, -1]
    return np.asarray(found)


def jacobians(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return Jacobians (K, 6, n) of the tip and its orientations, in the base's axes."""
    model, data = chain.model, chain.model.createData()
    frames = [chain.tip] if chain.base == WORLD else [chain.tip, chain.base]
    # [v, ω] of all joints, v at the world's origin.
    twists = np.empty((len(q), 6, model.nv))
    turns, places = np.empty((len(frames), len(q), 3, 3)), np.empty((len(frames), len(q), 3))
    # Views of data that each configuration overwrites.
    seen = [(pose.rotation, pose.translation) for pose in (data.oMf[frame] for frame in frames)]
    seen_twists = data.J.reshape(6, -1)
    coupling = chain.coupling
    for k, configuration in enumerate(q @ coupling.matrix.T + coupling.offsets):
        pin.computeJointJacobians(model, data, configuration)
        twists[k] = seen_twists
        for f, frame in enumerate(frames):
            pin.updateFramePlacement(model, data, frame)
            turns[f, k], places[f, k] = seen[f]
    own, *bases = (
        _at_frame(model, frame, twists, place) for frame, place in zip(frames, places, strict=True)
    )
    if not coupling.is_plain:
        own, *bases = (each @ coupling.matrix for each in (own, *bases))
    if not bases:
        return own, turns[0]
    other, turned = bases[0], turns[1].transpose(0, 2, 1)
    moving = _shifted(other, places[0] - places[1])
    jacobian = np.concatenate(
        [turned @ (own[:, :3] - moving), turned @ (own[:, 3:] - other[:, 3:])], 1
    )
    return jacobian, turned @ turns[0]


def _at_frame(model: pin.Model, frame: int, twists: Array, places: Array) -> Array:
    """Return the Jacobians (K, 6, m) of a frame at places (K, 3) by twists of all joints."""
    joints, columns = list(model.supports[model.frames[frame].parentJoint])[1:], model.idx_vs
    still = np.ones(model.nv, dtype=bool)
    still[[columns[joint] for joint in joints]] = False
    found = np.concatenate([_shifted(twists, places), twists[:, 3:]], axis=1)
    if still.any():
        found[:, :, still] = 0.0
    return found


def _shifted(twists: Array, offsets: Array) -> Array:
    """Return v + ω × p of twists (K, 6, m) at offsets p (K, 3), (K, 3, m)."""
    (x, y, z), (a, b, c) = offsets.T[:, :, None], twists[:, 3:].transpose(1, 0, 2)
    return np.asarray(twists[:, :3] + np.stack([b * z - c * y, c * x - a * z, a * y - b * x], 1))


def poses(chain: Chain, q: Array) -> tuple[Array, Array]:
    """Return rotations and translations of a chain's tip in its base frame at q (K, n).

    Computed by own calls: a check of a motion must not share a fault with its planner.
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
        # From (0, 0, 1) to the z axis as seen from the target, by the shortest rotation.
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
    """Return the part of deviations that exceeds the relaxations, (K, 6) [m, rad].

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
    """Return the deviation of a relaxation's rows from the path in its window, (K,).

    Zero outside the window. Parameters as in `excess`.
    """
    first, last = item.window(duration)
    inside = (t >= first) & (t <= last)
    return np.asarray(np.linalg.norm(deviation[:, item.indices], axis=1) * inside)


# How far the tool is off its path at any time: a bound, not only samples.
#
# Between the trajectory's samples, the path's own marks and the ends of relaxed windows, the
# deviation of the tool from the path is smooth, and `bounded` has the rest. The turn by an angle
# θ from the path's orientation R_d to the tool's R is measured by |R_dᵀR - I| / √2 = 2 sin(θ/2),
# in Frobenius' norm, or by that of the tool's z axis alone; it is the rotation vector where some
# of its rows are relaxed: (sin θ) n g(cos θ) with g(c) = arccos(c) / √(1 - c²) = ∫ dx / (x² + 2cx
# + 1) over x > 0, whose derivatives |g⁽ᵏ⁾|/k! are at most g(c) / (1 + c)ᵏ.

# Marks nearer to each other than this share of the duration count as one.
_SAME = 1e-12
# Accuracy of the interpolation of deviations, as a share of the tolerance.
_FINE = 1e-4
# Rotations with a cosine below this are too near to a half turn for a bound of rotation vectors.
_TURNED = -0.99
# Frobenius norm of a rotation matrix.
_FROBENIUS = 3.0**0.5


@dataclass(frozen=True, eq=False)
class PathCheck:
    """Path errors of a motion, proved or measured.

    Attributes
    ----------
    position, rotation : Extreme
        Bounds of the errors beyond the tolerances [m], [rad], and about when they are largest.
    deviations : tuple of Extreme
        Bounds of the deviation of each relaxation's rows.
    undecided : tuple of (float, float)
        Intervals [s] on which the bounds do not decide.
    proved : bool
        Whether the bounds are theorems; else the path is checked at samples only.
    samples : int
        Number of poses that were evaluated.
    """

    position: Extreme
    rotation: Extreme
    deviations: tuple[Extreme, ...]
    undecided: tuple[tuple[float, float], ...]
    proved: bool
    samples: int


def bound_errors(
    robot: RobotModel,
    follow: BoundTaskFrame,
    trajectory: Trajectory,
    tolerance: Tolerance,
    relaxations: Sequence[Relaxation],
    progress: Progress = silent,
) -> PathCheck:
    """Bound the errors of a motion on one of its paths; parameters as in `certify`."""
    path, tip = follow.path, follow.chain.tip_name
    _check_times(path, trajectory)
    errors = _PathErrors(follow, tolerance, relaxations)
    found = bounded(
        errors, robot, trajectory, smooth_between(path, trajectory, relaxations), progress
    )
    values = errors.angles(found.values)
    names = (tip, tip, *(item.label for item in relaxations))
    extremes = tuple(
        Extreme(float(value), float(time), name)
        for value, time, name in zip(values, found.times, names, strict=True)
    )
    return PathCheck(
        extremes[0], extremes[1], extremes[2:], found.undecided, found.proved, found.samples
    )


def errors_at(
    follow: BoundTaskFrame, t: Array, q: Array, relaxations: Sequence[Relaxation]
) -> Array:
    """Return the errors beyond relaxations at q (K, n), at times t (K,) [s], (K, 2) [m, rad]."""
    return errors_of_poses(follow, t, *poses(follow.chain, q), relaxations)


def errors_of_poses(
    follow: BoundTaskFrame,
    t: Array,
    rotation: Array,
    translation: Array,
    relaxations: Sequence[Relaxation],
) -> Array:
    """Return the same of poses of the tool, (K, 3, 3) and (K, 3)."""
    in_tool_axes = any(item.in_tool_axes for item in relaxations)
    deviation_rows = deviation_of_poses(follow, t, rotation, translation, in_tool_axes)
    beyond = excess(relaxations, follow.path.duration, t, deviation_rows)
    return np.stack([_length(beyond[:, :3]), _length(beyond[:, 3:])], axis=1)


def _check_times(path: Path, trajectory: Trajectory) -> None:
    """Refuse a motion that starts before or after its path: a part of one would not be judged."""
    first = float(trajectory.t[0])
    if not abs(first) <= 1e-9 * path.duration:
        raise ProblemError(
            f"the motion begins at t = {first:.6g} s, its path at 0: take {first:.6g} s from its "
            f"times"
        )


def smooth_between(
    path: Path, trajectory: Trajectory, relaxations: Sequence[Relaxation] = ()
) -> Array:
    """Return the times between which the deviation is smooth, (E,): all samples and marks."""
    end = min(float(trajectory.t[-1]), path.duration)
    start = max(float(trajectory.t[0]), 0.0)
    windows = [time for item in relaxations for time in item.window(path.duration)]
    samples = np.unique(np.clip([*trajectory.t, start, end], start, end))
    near = _SAME * path.duration
    marks = np.unique(np.clip([*path.marks, *windows], start, end))
    marks = marks[np.append(True, np.diff(marks) > near)]
    # Close samples are kept: between two of them the arm may be anywhere.
    place = np.searchsorted(samples, marks)
    before, after = samples[np.maximum(place - 1, 0)], samples[place]
    return np.union1d(samples, marks[np.minimum(marks - before, after - marks) > near])


class _PathErrors(BoundedFunction):
    """Errors of position and rotation beyond relaxations, and the deviation of each.

    The first block is the position's deviation, the second one the rotation's: its rotation vector
    if some of its rows are relaxed, else the result of `relative_turns`.
    """

    def __init__(
        self, follow: BoundTaskFrame, tolerance: Tolerance, relaxations: Sequence[Relaxation]
    ) -> None:
        self._chain, self._relaxations = follow.chain, relaxations
        self._path, self._task = follow.path, follow.task
        self._as_vectors = any(item.angular for item in relaxations)
        self._in_tool_axes = any(item.in_tool_axes for item in relaxations)
        self.blocks = np.array([0, 3])
        self.of = np.array([0, 1, *(int(item.angular) for item in relaxations)])
        # No rotation is above half a turn.
        rotation = tolerance.rotation if tolerance.rotation < np.pi else np.inf
        if rotation < np.pi and not self._as_vectors:
            rotation = 2.0 * np.sin(0.5 * rotation)
        self.allowed = np.array([tolerance.position, rotation, *(np.inf for _ in relaxations)])
        self.wanted = _FINE * self.allowed[:2]

    def angles(self, values: Array) -> Array:
        """Return bounds (2 + R,), the rotation's in radians."""
        if not self._as_vectors:
            values[1] = 2.0 * np.arcsin(np.minimum(0.5 * values[1], 1.0))
        return values

    @override
    def series(self, segments: MotionSegments) -> Array | None:
        path = segments.path_series(self._path)
        if path is None:
            return None
        place, turn = segments.chain().relative(self._chain)
        offset = place + path.translation
        turned = series.product(path.rotation, turn)
        if self._in_tool_axes or self._as_vectors:
            deviation_rows, relative = self._samples_between(segments, np.zeros(1))
            offset[0] = _length(deviation_rows[:, 0]) + series.after_first(offset)
            offset = series.product(path.rotation, offset)
        if not self._task.angular:
            return np.stack([offset, np.zeros_like(offset)])
        if self._as_vectors:
            return np.stack([offset, _vector_series(turned, self._cosine(relative[:, 0]))])
        share = 1.0 if self._task.tool_axes else _FROBENIUS / 2.0**0.5
        return np.stack([offset, share * turned])

    @override
    def values(self, segments: MotionSegments, u: Array) -> Array:
        deviation_rows, relative = self._samples_between(segments, u)
        if not self._task.angular:
            turns = np.zeros((*deviation_rows.shape[:2], 1))
        elif self._as_vectors:
            turns = rotation_vectors(self._task, relative)
        elif self._task.tool_axes:
            turns = relative[..., 2] - [0.0, 0.0, 1.0]
        else:
            turns = (relative - np.eye(3)).reshape(*deviation_rows.shape[:2], 9) / 2.0**0.5
        return np.concatenate([deviation_rows, turns], axis=2)

    @override
    def sizes(self, values: Array, segments: MotionSegments) -> Array:
        if not self._relaxations:
            return np.stack([_length(values[..., :3]), _length(values[..., 3:])], axis=2)
        shape = values.shape[:2]
        deviation = np.zeros((*shape, 6))
        deviation[..., :3] = values[..., :3]
        turns = values[..., 3:] if self._as_vectors else np.zeros((*shape, 3))
        deviation[..., 3:] = turns
        flat = deviation.reshape(-1, 6)
        # The windows of an interval are those of its middle.
        t, last = np.repeat(segments.middle, shape[1]), self._path.duration
        beyond = excess(self._relaxations, last, t, flat).reshape(*shape, 6)
        turned = beyond[..., 3:] if self._as_vectors else values[..., 3:]
        sizes = [_length(beyond[..., :3]), _length(turned)]
        sizes += [deviation_size(x, last, t, flat).reshape(shape) for x in self._relaxations]
        return np.stack(sizes, axis=2)

    def _samples_between(self, segments: MotionSegments, u: Array) -> tuple[Array, Array]:
        """Return the position's deviation (I, P, 3) and R_dᵀR (I, P, 3, 3) at places u (P,)."""
        target = self._path.samples(segments.times(u).ravel())
        rotation, translation = poses(self._chain, segments.motion(u))
        rows = self._task.rows[self._task.rows < 3]
        deviation_rows = np.zeros((len(translation), 3))
        deviation_rows[:, rows] = (translation - target.translation)[:, rows]
        if self._in_tool_axes:
            deviation_rows = np.einsum("kji,kj->ki", target.rotation, deviation_rows)
        relative = relative_turns(target.rotation, rotation)
        shape = len(segments.middle), len(u)
        return deviation_rows.reshape(*shape, 3), relative.reshape(*shape, 3, 3)

    def _cosine(self, relative: Array) -> Array:
        """Return the cosine of the angle of turns (I, 3, 3), (I,)."""
        if self._task.tool_axes:
            return relative[:, 2, 2]
        return np.asarray(0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0))


def _vector_series(turned: Array, cosine: Array) -> Array:
    """Return the majorant of rotation vectors of turns with a majorant and a cosine in the middle.

    inf where the turn may come near half a turn.
    """
    spread = 1.5 * turned
    low = np.clip(cosine, -1.0, 1.0) - series.after_first(spread)
    known = low > _TURNED
    low = np.where(known, np.clip(low, -1.0, 1.0), 0.0)
    factor = np.where(low < 1.0, np.arccos(low) / np.sqrt(np.maximum(1.0 - low**2, 1e-300)), 1.0)
    outer = factor / (1.0 + low) ** np.arange(len(turned))[:, None]
    found = series.product(turned, series.composed(outer, spread))
    return np.where(known, found, np.inf)


def _length(rows: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", rows, rows)))
