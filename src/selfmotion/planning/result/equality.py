"""Equality of arms, paths, task frames and relaxed rows, up to rounding."""

import json
from collections.abc import Iterator, Sequence

import numpy as np

from selfmotion.basics import Array, Saved, description_of, digest_of
from selfmotion.model.follow import Follow
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation

# Paths with different descriptions are equal if their poses differ by at most _POSE_ROUNDING at
# their marks, and at these shares between each two marks, which are aperiodic.
_SHARES = np.sort(np.modf(0.5 * (np.sqrt(5.0) - 1.0) * np.arange(1, 14))[0])
# Difference of equal poses [m, and in the elements of a rotation matrix].
_POSE_ROUNDING = 1e-9
# Rounding of times [s].
_TIME_ROUNDING = 1e-9
# Limits of an arm that constraints use by default: attribute, in words, power of time.
_LIMITS = (
    ("lower", "lower limit", ""),
    ("upper", "upper limit", ""),
    ("velocity_limit", "limit of speed", "/s"),
    ("acceleration_limit", "limit of acceleration", "/s²"),
    ("jerk_limit", "limit of jerk", "/s³"),
)


def arm_digest(robot: RobotModel) -> str:
    """Return the digest of an arm with its tools, reference and limits; see `arm_differences`."""
    limits = [getattr(robot, name) for name, _, _ in _LIMITS]
    identity = (robot.urdf.sha256, robot.joint_names, robot.tools, robot.reference, robot.locked)
    return digest_of(identity, sorted(robot.touching), limits, robot.effort_limit)


def arm_differences(actual: RobotModel, required: RobotModel) -> Iterator[str]:
    """Yield the first difference of an arm from the required one, in words."""
    if actual.urdf.sha256 != required.urdf.sha256 or actual.joint_names != required.joint_names:
        yield f"it is of another arm than {required.name}: {actual.name}"
    elif actual.tools != required.tools:
        yield f"its tool is '{', '.join(actual.tools)}', not '{', '.join(required.tools)}'"
    elif actual.reference != required.reference:
        yield f"its path is in the frame of '{actual.reference}', not '{required.reference}'"
    elif dict(actual.locked) != dict(required.locked):
        yield "other joints are locked, or elsewhere"
    elif set(actual.touching) != set(required.touching):
        yield "other links of it may touch"
    else:
        yield from _limit_differences(actual, required)


def _limit_differences(actual: RobotModel, required: RobotModel) -> Iterator[str]:
    """Yield the first joint whose limits differ from those of the required arm."""
    for name, words, power in _LIMITS:
        limit, required_limit = getattr(actual, name), getattr(required, name)
        different = np.flatnonzero(limit != required_limit)
        if different.size:
            k = int(different[0])
            joint = required.joint_names[k]
            yield (
                f"the {words} of its joint '{joint}' is {limit[k]:g} "
                f"{required.unit_of(joint)}{power}, not {required_limit[k]:g}"
            )
            return
    if not np.array_equal(actual.effort_limit, required.effort_limit):
        yield "its limits of torque are others"


def canonical_text(item: Saved) -> str:
    """Return the JSON text of a value's description: equal for equal values."""
    return json.dumps(description_of(item), sort_keys=True, default=repr)


def same_path(actual: Path, required: Path) -> bool:
    """Whether two paths are the same motion of the tool."""
    if actual is required or canonical_text(actual) == canonical_text(required):
        return True
    if not abs(actual.duration - required.duration) <= _TIME_ROUNDING:
        return False
    marks = np.minimum(np.union1d(actual.marks, required.marks), actual.duration)
    t = _times_between(marks)
    return same_poses(actual, t, required, np.minimum(t, required.duration))


def comparison_times(path: Path) -> Array:
    """Return the times at which a path is compared: its marks, and some between them, (K,) [s]."""
    return _times_between(np.asarray(path.marks))


def _times_between(marks: Array) -> Array:
    inner = marks[:-1, None] + np.diff(marks)[:, None] * _SHARES
    return np.union1d(marks, inner.ravel())


def same_poses(one: Path, t: Array, other: Path, other_t: Array) -> bool:
    """Whether a path at times t (K,) has the poses that another has at `other_t` (K,)."""
    samples, other_samples = one.samples(t), other.samples(other_t)
    translations = np.abs(samples.translation - other_samples.translation).max()
    rotations = np.abs(samples.rotation - other_samples.rotation).max()
    # NaN stays NaN, which is no match.
    return float(np.max([translations, rotations])) <= _POSE_ROUNDING


def same_follows(actual: Sequence[Follow], required: Sequence[Follow]) -> bool:
    """Whether the same task frames follow the same paths, in the same order."""
    if len(actual) != len(required):
        return False
    for one, other in zip(actual, required, strict=True):
        if (one.task, one.tool, one.reference) != (other.task, other.tool, other.reference):
            return False
        if isinstance(one.path, Path) != isinstance(other.path, Path):
            return False
        if isinstance(one.path, Path) and isinstance(other.path, Path):
            if not same_path(one.path, other.path):
                return False
        elif not np.array_equal(_homogeneous(one.path), _homogeneous(other.path)):
            return False
    return True


def _homogeneous(pose: object) -> Array:
    """Return the 4 x 4 matrix of a pose."""
    return np.asarray(getattr(pose, "homogeneous", pose), dtype=np.float64)


def same_relaxations(actual: Sequence[Relaxation], required: Sequence[Relaxation]) -> bool:
    """Whether the same rows are relaxed within the same bands, at the same times up to rounding."""
    if len(actual) != len(required):
        return False
    for one, other in zip(actual, required, strict=True):
        values, required_values = one.to_dict(), other.to_dict()
        during, required_during = values.pop("during"), required_values.pop("during")
        if values != required_values or (during is None) != (required_during is None):
            return False
        if required_during is not None and not np.allclose(
            during, required_during, rtol=0.0, atol=_TIME_ROUNDING
        ):
            return False
    return True
