"""Specification of a motion, apart from its certificate, and continuity of motions."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Saved, description_of, digest_of
from selfmotion.certificate import (
    ARRIVED,
    REST_ACCELERATION,
    USUAL,
    Requirement,
    Tolerance,
    limits_of_joints,
)
from selfmotion.model.follow import Follow
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Relaxation, Task
from selfmotion.planning.result.move import Move
from selfmotion.planning.result.plan import Plan
from selfmotion.problem.constraints import Clearance, Constraint, as_clearances, clearances_among
from selfmotion.problem.problem import Problem, arm_rest_orders, rest_orders

# Paths with other descriptions are the same if they are nearer than _SAME at their marks, and at
# these shares between each two of them, which are aperiodic.
_SHARES = np.sort(np.modf(0.5 * (np.sqrt(5.0) - 1.0) * np.arange(1, 14))[0])
# Distance of equal poses [m, and as a rotation matrix].
_SAME = 1e-9
# Rounding of times [s].
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class MotionSpecification:
    """Specification of a motion along a path.

    Attributes
    ----------
    robot : RobotModel
        With the tool that follows, in the frame of its reference.
    path : Path
    task : Task
    relaxations : sequence of Relaxation
    constraints : sequence of Constraint
        Required constraints, besides `clearance`.
    clearance : Clearance or sequence of Clearance, optional
        Smallest distance of bodies.
    tolerance : Tolerance
        Largest error from the path.
    also : sequence of Follow
        Further task frames.
    rest : bool
        Whether the arm has to rest where its paths do, unless `constraints` say how fast it is.
    """

    robot: RobotModel
    path: Path
    task: Task
    relaxations: Sequence[Relaxation] = ()
    constraints: Sequence[Constraint] = ()
    clearance: Clearance | Sequence[Clearance] | None = None
    tolerance: Tolerance = USUAL
    also: Sequence[Follow] = ()
    rest: bool = True

    def failures(self, plan: Plan) -> Iterator[str]:
        """Yield, in words, the conditions that a plan was not judged by."""
        problem = plan.problem
        yield from another_tool(problem.robot, self.robot)
        if problem.task is not self.task:
            yield f"its task is '{problem.task.value}', not '{self.task.value}'"
        if not same_path(problem.path, self.path):
            yield "it is along another path"
        if not _same_follows(problem.also, self.also):
            yield "what else follows a path is another"
        if not _same_bands(problem.relaxations, self.relaxations):
            yield "other rows are relaxed"
        clearances = as_clearances(self.clearance)
        yield from not_judged_by(problem.all_constraints, self.constraints, clearances)
        yield from self._restless(problem)
        within, wanted = plan.tolerance, self.tolerance
        if not (within.position <= wanted.position and within.rotation <= wanted.rotation):
            yield (
                f"it is judged within {within.position:.2g} m and {within.rotation:.2g} rad, "
                f"expected {wanted.position:.2g} m and {wanted.rotation:.2g} rad"
            )

    def _restless(self, judged_by: Problem) -> Iterator[str]:
        """Yield that a problem does not require rest at an end where it is required."""
        wanted = arm_rest_orders(judged_by.follows, self.constraints) if self.rest else (0, 0)
        # A damped motion is not judged by its rest.
        judged = judged_by.rest_orders if judged_by.damping is None else (0, 0)
        for end, order, found in zip(("start", "end"), wanted, judged, strict=True):
            if found < order:
                what = " without acceleration" if found else ""
                yield f"it is not judged by rest{what} at its {end}, which was asked for"


def arm_digest(robot: RobotModel) -> str:
    """Return the digest of an arm, with its tools, reference and limits; see `another_tool`."""
    limits = [getattr(robot, name) for name, _, _ in _LIMITS]
    identity = (robot.urdf.sha256, robot.joint_names, robot.tools, robot.reference, robot.locked)
    return digest_of(identity, sorted(robot.touching), limits, robot.effort_limit)


def another_tool(judged_by: RobotModel, required: RobotModel) -> Iterator[str]:
    """Yield the differences of an arm from the required one."""
    if (
        judged_by.urdf.sha256 != required.urdf.sha256
        or judged_by.joint_names != required.joint_names
    ):
        yield f"it is of another arm than {required.name}: {judged_by.name}"
    elif judged_by.tools != required.tools:
        yield f"its tool is '{', '.join(judged_by.tools)}', not '{', '.join(required.tools)}'"
    elif judged_by.reference != required.reference:
        yield f"its path is in the frame of '{judged_by.reference}', not '{required.reference}'"
    elif dict(judged_by.locked) != dict(required.locked):
        yield "other joints are locked, or elsewhere"
    elif set(judged_by.touching) != set(required.touching):
        yield "other links of it may touch"
    else:
        yield from _other_limits(judged_by, required)


# Limits of an arm that constraints use by default: attribute, in words, power of time.
_LIMITS = (
    ("lower", "lower limit", ""),
    ("upper", "upper limit", ""),
    ("velocity_limit", "limit of speed", "/s"),
    ("acceleration_limit", "limit of acceleration", "/s²"),
    ("jerk_limit", "limit of jerk", "/s³"),
)


def _other_limits(judged_by: RobotModel, required: RobotModel) -> Iterator[str]:
    """Yield a joint of an arm with other limits than that of the required one."""
    for name, words, power in _LIMITS:
        found, wanted = getattr(judged_by, name), getattr(required, name)
        others = np.flatnonzero(found != wanted)
        if others.size:
            k = int(others[0])
            joint = required.joint_names[k]
            yield (
                f"the {words} of its joint '{joint}' is {found[k]:g} "
                f"{required.unit_of(joint)}{power}, not {wanted[k]:g}"
            )
            return
    if not np.array_equal(judged_by.effort_limit, required.effort_limit):
        yield "its limits of torque are others"


def not_judged_by(
    judged: Sequence[Constraint],
    required: Sequence[Constraint],
    clearances: Sequence[Clearance] = (),
) -> Iterator[str]:
    """Yield required constraints and clearances by which a motion is not judged."""
    known = {described(item) for item in judged}
    for item in required:
        if described(item) not in known:
            yield f"it is not judged by {type(item).__name__}, which was asked for"
    apart = clearances_among(judged)
    for one in clearances:
        if not any(item.keeps_as_far(one) for item in apart):
            yield "it is not judged by the clearance that was asked for"


def described(item: Saved) -> str:
    """Return the identity of a value, as a text."""
    return json.dumps(description_of(item), sort_keys=True, default=repr)


def same_path(judged_by: Path, required: Path) -> bool:
    """Whether two paths are the same motion."""
    if judged_by is required or described(judged_by) == described(required):
        return True
    if not abs(judged_by.duration - required.duration) <= _ROUNDING:
        return False
    t = _looked_at(np.minimum(np.union1d(judged_by.marks, required.marks), judged_by.duration))
    return _apart(judged_by, t, required, np.minimum(t, required.duration)) <= _SAME


def follows_at(part: Path, t: Array, whole: Path, times: Array) -> bool:
    """Whether a path has the poses at times t (K,) that another has at its own `times` (K,)."""
    return _apart(part, t, whole, times) <= _SAME


def looked_at(path: Path) -> Array:
    """Return the times of a path's marks, and some between each two of them, (K,) [s]."""
    return _looked_at(np.asarray(path.marks))


def _looked_at(marks: Array) -> Array:
    between = marks[:-1, None] + np.diff(marks)[:, None] * _SHARES
    return np.union1d(marks, between.ravel())


def _apart(one: Path, t: Array, other: Path, times: Array) -> float:
    """Return the largest difference of poses [m, and as a rotation matrix]."""
    here, there = one.samples(t), other.samples(times)
    places = np.abs(here.translation - there.translation).max()
    turns = np.abs(here.rotation - there.rotation).max()
    # NaN stays NaN, which is no match.
    return float(np.max([places, turns]))


def _same_follows(judged_by: Sequence[Follow], required: Sequence[Follow]) -> bool:
    if len(judged_by) != len(required):
        return False
    for one, other in zip(judged_by, required, strict=True):
        if (one.task, one.tool, one.reference) != (other.task, other.tool, other.reference):
            return False
        if isinstance(one.path, Path) != isinstance(other.path, Path):
            return False
        if isinstance(one.path, Path) and isinstance(other.path, Path):
            if not same_path(one.path, other.path):
                return False
        elif not np.array_equal(_matrix(one.path), _matrix(other.path)):
            return False
    return True


def _matrix(pose: object) -> Array:
    return np.asarray(getattr(pose, "homogeneous", pose), dtype=np.float64)


def _same_bands(judged_by: Sequence[Relaxation], required: Sequence[Relaxation]) -> bool:
    """Whether the same rows are relaxed, in the same windows up to rounding."""
    if len(judged_by) != len(required):
        return False
    for one, other in zip(judged_by, required, strict=True):
        values, wanted = one.to_dict(), other.to_dict()
        during, window = values.pop("during"), wanted.pop("during")
        if values != wanted or (during is None) != (window is None):
            return False
        if window is not None and not np.allclose(during, window, rtol=0.0, atol=_ROUNDING):
            return False
    return True


# Largest gap between the end of one motion and the start of the next, from rounding [rad or m].
_JOINED = 1e-9
# Index of the first sample.
_START = 0
# Index of the last sample.
_END = -1
# Order of derivative up to which rest is required.
_SMOOTH = 2


class CheckedMotion(NamedTuple):
    """One of several motions of an arm, each after the one before.

    Attributes
    ----------
    name : str
        In words: ``"'top'"``, ``"part 1"``.
    motion : Trajectory
    accelerates : (bool, bool)
        Whether it may accelerate at its start and its end: only where its tool's own motion does.
    """

    name: str
    motion: Trajectory
    accelerates: tuple[bool, bool] = (False, False)

    @classmethod
    def of(cls, name: str, judged_by: Plan | Move) -> "CheckedMotion | None":
        """Return a plan or a move as a piece; None for a move that was not found."""
        if isinstance(judged_by, Plan):
            return cls(
                name, judged_by.trajectory, _accelerates(judged_by.problem, judged_by.requirements)
            )
        return None if judged_by.trajectory is None else cls(name, judged_by.trajectory)


def _accelerates(problem: Problem, requirements: Sequence[Requirement]) -> tuple[bool, bool]:
    limited = any(
        item.order > _SMOOTH and np.isfinite(item.upper).any()
        for item in limits_of_joints(requirements)
    )
    if limited:
        # No limited jerk makes a step of acceleration.
        return False, False
    orders = [rest_orders(item.path, item.task) for item in problem.follows.items]
    start, end = (min(order[k] for order in orders) < _SMOOTH for k in (0, 1))
    return start, end


def gaps(
    robot: RobotModel, motions: Sequence[CheckedMotion], allowed: float = _JOINED
) -> Iterator[str]:
    """Yield where from one piece to the next the arm jumps, moves or accelerates.

    Configurations have to agree within `allowed`, by default 1e-9 rad or m; at both sides the arm
    has to rest, within 1e-6 rad/s or m/s and 1e-3 rad/s² or m/s². All of them have accelerations,
    or none: otherwise some would be other motions between the samples of the whole than those
    judged.
    """
    yield from _mixed(motions)
    for one, other in pairwise(motions):
        last, first = one.motion.q[_END], other.motion.q[_START]
        yield from _jump(robot, one.name, other.name, last, first, allowed)
        yield from moving_end(robot, one, _END)
        yield from moving_end(robot, other, _START)


def _mixed(motions: Sequence[CheckedMotion]) -> Iterator[str]:
    cubic = [motion_.name for motion_ in motions if motion_.motion.qdd is None]
    if cubic and len(cubic) < len(motions):
        yield (
            f"{cubic[0]} states no accelerations, and others do, so that it is another motion "
            f"between its samples in the whole; give its accelerations (Trajectory(qdd=…)), and "
            f"judge it again"
        )


def _jump(
    robot: RobotModel, one: str, other: str, last: Array, first: Array, allowed: float = _JOINED
) -> Iterator[str]:
    apart = np.abs(first - last)
    worst = int(np.argmax(apart))
    # Written so that NaN is a jump.
    if not apart[worst] <= allowed:
        joint = robot.joint_names[worst]
        yield (
            f"from {one} to {other} joint '{joint}' would jump by {apart[worst]:.3g} "
            f"{robot.unit_of(joint)} ({allowed:g} allowed); plan one of them again, from where the "
            f"other is"
        )


def elsewhere(
    robot: RobotModel, motion_: CheckedMotion, end: int, required: Array, allowed: float = _JOINED
) -> Iterator[str]:
    """Yield the ends, start (0) or end (-1), of a motion that are not at a configuration (n,)."""
    apart = np.abs(motion_.motion.q[end] - required)
    worst = int(np.argmax(apart))
    if not apart[worst] <= allowed:
        joint, verb = robot.joint_names[worst], "end" if end else "begin"
        yield (
            f"{motion_.name} does not {verb} where it was asked to: joint '{joint}' is "
            f"{apart[worst]:.3g} {robot.unit_of(joint)} away ({allowed:g} allowed); plan it again, "
            f"{'to' if end else 'from'} there"
        )


def moving_end(robot: RobotModel, motion_: CheckedMotion, end: int) -> Iterator[str]:
    """Yield where a piece does not rest at its start (0) or its end (-1)."""
    motion, verb = motion_.motion, "end" if end else "begin"
    rates = ((1, "moves", ARRIVED, ""), (2, "accelerates", REST_ACCELERATION, "²"))
    for order, what, allowed, power in rates:
        # Without accelerations in a file, the controller interpolates, and rest cannot be judged.
        if order == _SMOOTH and (motion.qdd is None or motion_.accelerates[end]):
            continue
        rate = np.abs(motion(motion.t[end], order))
        worst = int(np.argmax(rate))
        if not rate[worst] <= allowed:
            joint = robot.joint_names[worst]
            yield (
                f"{motion_.name} does not {verb} at rest: joint '{joint}' {what} at "
                f"{rate[worst]:.2g} {robot.unit_of(joint)}/s{power} ({allowed:g} allowed); plan it "
                f"along a path that rests there, with rest=True"
            )
            return
