"""What a motion along a path is held against, besides what its own certificate says."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Saved, description_of, digest_of
from selfmotion.certificate import USUAL, Tolerance
from selfmotion.constraints import Clearance, Constraint
from selfmotion.follow import Follow
from selfmotion.path import Path
from selfmotion.problem import Problem, arm_rest_orders
from selfmotion.result.plan import Plan
from selfmotion.robot import RobotModel
from selfmotion.task import Relaxation, Task

# Paths that are described otherwise are one where they are as near as this [m, and as a rotation
# matrix] at their marks, and between each two of them at these shares, which no rhythm has; times
# are the same up to rounding [s].
_SHARES = np.sort(np.modf(0.5 * (np.sqrt(5.0) - 1.0) * np.arange(1, 14))[0])
_SAME, _ROUNDING = 1e-9, 1e-9


@dataclass(frozen=True, eq=False)
class Asked:
    """What was asked of a motion along a path.

    Attributes
    ----------
    robot : RobotModel
        With the tool that follows, in the frame of its reference.
    path : Path
    task : Task
    relaxations : sequence of Relaxation
    constraints : sequence of Constraint
        What it has to be judged by, besides `clearance`.
    clearance : Clearance or None
        How far bodies have to be apart, or more.
    tolerance : Tolerance
        What the path may be missed by, or less.
    also : sequence of Follow
        What else of the arm follows a path.
    rest : bool
        Whether the arm has to rest where its paths do, unless `constraints` say how fast it is.
    """

    robot: RobotModel
    path: Path
    task: Task
    relaxations: Sequence[Relaxation] = ()
    constraints: Sequence[Constraint] = ()
    clearance: Clearance | None = None
    tolerance: Tolerance = USUAL
    also: Sequence[Follow] = ()
    rest: bool = True

    def failures(self, plan: Plan) -> Iterator[str]:
        """Yield, in words, what of it a plan was not judged by."""
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
        yield from not_judged_by(problem.all_constraints, self.constraints, self.clearance)
        yield from self._restless(problem)
        within, wanted = plan.tolerance, self.tolerance
        if not (within.position <= wanted.position and within.rotation <= wanted.rotation):
            yield (
                f"it is judged within {within.position:.2g} m and {within.rotation:.2g} rad, "
                f"expected {wanted.position:.2g} m and {wanted.rotation:.2g} rad"
            )

    def _restless(self, made: Problem) -> Iterator[str]:
        """Yield that a problem does not ask for rest at an end where it was asked for."""
        wanted = arm_rest_orders(made.follows, self.constraints) if self.rest else (0, 0)
        # A damped motion is not judged by its rest.
        judged = made.rest_orders if made.damping is None else (0, 0)
        for end, order, found in zip(("start", "end"), wanted, judged, strict=True):
            if found < order:
                what = " without acceleration" if found else ""
                yield f"it is not judged by rest{what} at its {end}, which was asked for"


def arm_digest(robot: RobotModel) -> str:
    """Return what tells arms apart, with their tools, reference and limits; see `another_tool`."""
    limits = [getattr(robot, name) for name, _, _ in _LIMITS]
    told = (robot.urdf.sha256, robot.joint_names, robot.tools, robot.reference, robot.locked)
    return digest_of(told, sorted(robot.touching), limits, robot.effort_limit)


def another_tool(made: RobotModel, asked: RobotModel) -> Iterator[str]:
    """Yield in what an arm is not the one that was asked for."""
    if made.urdf.sha256 != asked.urdf.sha256 or made.joint_names != asked.joint_names:
        yield f"it is of another arm than {asked.name}: {made.name}"
    elif made.tools != asked.tools:
        yield f"its tool is '{', '.join(made.tools)}', not '{', '.join(asked.tools)}'"
    elif made.reference != asked.reference:
        yield f"its path is in the frame of '{made.reference}', not '{asked.reference}'"
    elif dict(made.locked) != dict(asked.locked):
        yield "other joints are locked, or elsewhere"
    elif set(made.touching) != set(asked.touching):
        yield "other links of it may touch"
    else:
        yield from _other_limits(made, asked)


# What constraints take from an arm where they say no more: attribute, in words, power of time.
_LIMITS = (
    ("lower", "lower limit", ""),
    ("upper", "upper limit", ""),
    ("velocity_limit", "limit of speed", "/s"),
    ("acceleration_limit", "limit of acceleration", "/s²"),
    ("jerk_limit", "limit of jerk", "/s³"),
)


def _other_limits(made: RobotModel, asked: RobotModel) -> Iterator[str]:
    """Yield a joint of an arm that has other limits than that of the same arm as it was asked."""
    for name, words, power in _LIMITS:
        found, wanted = getattr(made, name), getattr(asked, name)
        others = np.flatnonzero(found != wanted)
        if others.size:
            k = int(others[0])
            joint = asked.joint_names[k]
            yield (
                f"the {words} of its joint '{joint}' is {found[k]:g} "
                f"{asked.unit_of(joint)}{power}, not {wanted[k]:g}"
            )
            return
    if not np.array_equal(made.effort_limit, asked.effort_limit):
        yield "its limits of torque are others"


def not_judged_by(
    judged: Sequence[Constraint], asked: Sequence[Constraint], clearance: Clearance | None
) -> Iterator[str]:
    """Yield what was asked for and is not among what a motion is judged by."""
    known = {described(item) for item in judged}
    for item in asked:
        if described(item) not in known:
            yield f"it is not judged by {type(item).__name__}, which was asked for"
    if clearance is not None and not any(keeps_as_far(item, clearance) for item in judged):
        yield "it is not judged by the clearance that was asked for"


def described(item: Saved) -> str:
    """Return what tells values apart, as a text."""
    return json.dumps(description_of(item), sort_keys=True, default=repr)


def same_path(made: Path, asked: Path) -> bool:
    """Whether two paths are the same motion."""
    if made is asked or described(made) == described(asked):
        return True
    if not abs(made.duration - asked.duration) <= _ROUNDING:
        return False
    t = _looked_at(np.minimum(np.union1d(made.marks, asked.marks), made.duration))
    return _apart(made, t, asked, np.minimum(t, asked.duration)) <= _SAME


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
    """Return by how much poses differ at most [m, and as a rotation matrix]."""
    here, there = one.samples(t), other.samples(times)
    places = np.abs(here.translation - there.translation).max()
    turns = np.abs(here.rotation - there.rotation).max()
    # NaN stays NaN, which is no match.
    return float(np.max([places, turns]))


def _same_follows(made: Sequence[Follow], asked: Sequence[Follow]) -> bool:
    if len(made) != len(asked):
        return False
    for one, other in zip(made, asked, strict=True):
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


def _same_bands(made: Sequence[Relaxation], asked: Sequence[Relaxation]) -> bool:
    """Whether the same rows are relaxed, in the same windows up to rounding."""
    if len(made) != len(asked):
        return False
    for one, other in zip(made, asked, strict=True):
        values, wanted = one.to_dict(), other.to_dict()
        during, window = values.pop("during"), wanted.pop("during")
        if values != wanted or (during is None) != (window is None):
            return False
        if window is not None and not np.allclose(during, window, rtol=0.0, atol=_ROUNDING):
            return False
    return True


def keeps_as_far(item: Constraint, apart: Clearance) -> bool:
    """Whether a constraint keeps all that a clearance does of the arm itself and its own bodies."""
    return (
        isinstance(item, Clearance)
        and item.distance >= apart.distance
        and set(item.disabled) <= set(apart.disabled)
    )
