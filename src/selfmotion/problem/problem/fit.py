"""Checks of a problem's arguments, and of the fit of its path to its arm."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    FeedError,
    Ints,
    ProblemError,
    RedundancyError,
    StartError,
    shown,
)
from selfmotion.certificate import Requirement, errors_at
from selfmotion.model.follow import (
    Follow,
    Follows,
    VirtualJoints,
    row_names,
    with_tolerances,
)
from selfmotion.model.motion import FreeNullMotion, NullMotion
from selfmotion.model.path import FeedPossible, Path, check_oriented, spread_along
from selfmotion.model.robot import Chain, RobotModel
from selfmotion.model.task import POSITION_ROWS, ROW_NAMES, Damping, Relaxation, Task
from selfmotion.problem.constraints import (
    Constraint,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
    PositionDependentVelocityLimits,
)
from selfmotion.problem.costs import Cost, JointVelocity
from selfmotion.problem.problem.least_tolerance import that_would_do

# Default null motion.
ANY_NULL_MOTION = FreeNullMotion()
# Default constraints: limits that arms' makers publish, and with those of URDFs all.
OF_MAKER: tuple[Constraint, ...] = (
    JointAccelerationLimits(),
    JointJerkLimits(),
    PositionDependentVelocityLimits(),
)
KEPT: tuple[Constraint, ...] = (JointPositionLimits(), JointVelocityLimits(), *OF_MAKER)
# Stands for the usual cost of the problem's arm.
USUAL_COSTS: tuple[Cost, ...] = (JointVelocity(),)


# Parameters of a problem that are sequences, and the type of their items.
SEQUENCES = {
    "costs": Cost,
    "constraints": Constraint,
    "relaxations": Relaxation,
    "also": Follow,
}
_KINDS: dict[str, Any] = {
    "robot": RobotModel,
    "path": Path,
    "null_motion": NullMotion,
    "damping": Damping | None,
}
_EXAMPLES = {
    "robot": "RobotModel (load_robot)",
    "path": "Path (Line, Circle, Waypoints, TwistPath, …, or a class derived from Path)",
    "null_motion": "NullMotion (selfmotion.motion.FreeNullMotion(), which is the default, "
    "PolynomialNullMotion(), BSplineNullMotion(…), or a class derived from NullMotion)",
    "damping": "Damping or None",
}
# A start nearer to the path than this is on it: far above rounding, far below any tolerance.
_ON_PATH = 1e-7
# Largest correction of a start towards the path [rad or m].
START_TOLERANCE = 1e-5
# Largest error of a given end configuration [m, rad]: the certificate's tolerance for it.
_NEAR_END = 1e-6


def check_kinds(problem: object) -> None:
    """Raise ProblemError where a single parameter is of another kind."""
    for name, kind in _KINDS.items():
        found = getattr(problem, name)
        if not isinstance(found, kind):
            raise ProblemError(f"{name} is {shown(found)}, expected a {_EXAMPLES[name]}")


def check_costs(follows: Follows, given: Sequence[Cost], every: Sequence[Cost]) -> None:
    """Raise ProblemError where nothing is to be minimised, or two costs share a name."""
    if not given:
        raise ProblemError("no cost is given, so that nothing tells one motion from another")
    names = [cost.name for cost in every]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ProblemError(f"two costs are called '{twice[0]}'; give one another name=")
    for cost in given:
        cost.check(follows)


def check_judged(constraints: Sequence[Constraint], found: Sequence[Requirement]) -> None:
    """Raise ProblemError where a constraint has no requirement."""
    for item, requirement in zip(constraints, found, strict=True):
        if not isinstance(requirement, Requirement):
            raise ProblemError(
                f"constraint {type(item).__name__}: requirement() returned {requirement!r}, "
                f"expected a Requirement; without one nothing judges whether a motion keeps it"
            )


def _beyond(robot: RobotModel, start: Array) -> str:
    """Return the joint of a configuration (n,) that is beyond its limits, "" for none."""
    for k, name in enumerate(robot.joint_names):
        low, high = robot.lower[k], robot.upper[k]
        if not low <= start[k] <= high:
            unit, hint = ("m", "") if robot.is_prismatic(name) else ("rad", "; in degrees?")
            return (
                f"has joint '{name}' at {start[k]:g} {unit}, beyond its limits of {low:.4g} to "
                f"{high:.4g} {unit}{hint}, and "
            )
    return ""


def check_start(follows: Follows, start: Array, relaxations: Sequence[Relaxation]) -> None:
    """Raise StartError where a start (n,) is off one of the paths, by more than is allowed."""
    end_error = _end_error(follows, start, relaxations, at_end=False)
    if end_error is not None:
        position, rotation, text = end_error
        raise StartError(
            f"{follows.robot.name}: the start configuration {_beyond(follows.robot, start)}{text}; "
            f"leave it out, or take robot.inverse_kinematics(path.pose(0.0), task, seed=start)",
            position_miss=position,
            rotation_miss=rotation,
        )


def check_end(follows: Follows, end: Array, relaxations: Sequence[Relaxation]) -> None:
    """Raise ProblemError where a given end (n,) is off one of the paths likewise."""
    end_error = _end_error(follows, end, relaxations, at_end=True)
    if end_error is not None:
        raise ProblemError(
            f"{follows.robot.name}: the end configuration {end_error[-1]}; take "
            f"robot.inverse_kinematics(path.pose(path.duration), task, seed=q)"
        )


def _end_error(
    follows: Follows, q: Array, relaxations: Sequence[Relaxation], *, at_end: bool
) -> tuple[float, float, str] | None:
    """Return the error of an end of a motion (n,) from its path [m, rad], in words; or None.

    Relaxations are those of the first path.
    """
    for k, item in enumerate(follows.items):
        t = np.array([item.path.duration if at_end else 0.0])
        allowed = () if k else relaxations
        position, rotation = item.miss(item.path.pose(float(t[0])), q)
        if allowed:
            position, rotation = errors_at(item, t, q[None], allowed)[0].tolist()
        if max(position, rotation) > (_NEAR_END if at_end else _ON_PATH):
            end, beyond = "end" if at_end else "start", ", beyond its tolerances" if allowed else ""
            return (
                position,
                rotation,
                f"puts '{item.chain.tip_name}' {position:.3g} m and {rotation:.3g} rad off the "
                f"{end} of the path{beyond}",
            )
    return None


def first_tool(several: Sequence[Follow], robot: RobotModel) -> tuple[Follow, RobotModel]:
    """Return the first of several that follow a path, and the arm with its tool.

    Raises
    ------
    ProblemError
        There is none, or it is at a pose.
    """
    if not several:
        raise ProblemError("path is an empty list, expected a Path, or what follows one")
    first = several[0]
    if not isinstance(first.path, Path):
        raise ProblemError(
            "the first Follow is at a pose, which does not tell how long the motion lasts; "
            "begin with one that has a path, or take Dwell(pose, seconds)"
        )
    if isinstance(robot, RobotModel) and (first.tool or first.reference):
        tool = first.tool or robot.tool
        tools = (tool, *(name for name in robot.tools if name != tool))
        own = robot.reference if tool == robot.tool else None
        reference = own if first.reference is None else first.reference
        robot = replace(robot, tools=tools, reference=reference)
        robot.chain_to(tool, reference)
    return first, robot


# Share of a limit of the tool's speed that a recommended feed uses.
_BELOW = 0.98


def check_feeds(whose: str, paths: Sequence[Path], most: float) -> None:
    """Refuse feeds that paths do not keep by themselves, or that the tool may not have.

    A feed counts but for run-up, run-down and rounded corners; a motion that does not keep it there
    is never verified (`FeedProfile`). The arm is not involved.

    Parameters
    ----------
    whose : str
        Start of messages.
    paths : sequence of Path
        The paths, that of the tool first.
    most : float
        Limit of the tool's speed [m/s]; inf for none.

    Raises
    ------
    FeedError
        With the largest possible feed, and remedies for more.
    """
    for path in paths:
        for found in path.feeds:
            if not found.kept:
                possible = FeedPossible(found)
                raise FeedError(
                    f"{whose}: {possible.text(path)}",
                    asked=found.asked,
                    possible=possible.feed,
                    time=found.time,
                )
    for found in paths[0].feeds:
        # The speed along the path is a lower bound of the total speed.
        if (1.0 - found.within) * found.asked > most:
            feed = _BELOW * most
            raise FeedError(
                f"{whose}: the feed of {found.asked:g} m/s is faster than the tool may be, "
                f"{most:g} m/s (ToolLimits): ask for {feed:.3g} m/s, or allow a larger speed",
                asked=found.asked,
                possible=feed,
                time=found.time,
            )


# Entries of Jacobians below this [m, rad] are zero.
_NO_RATE = 1e-6
# A path farther away than this many reaches of the arm is in other units.
_FAR = 20.0
# Speed of joints without a limit [rad/s or m/s].
_FAST = 100.0
# A path this many times faster than the arm is in other units; below, it is planned, and may be
# slowed.
_HOPELESS = 100.0
# Reach of an arm on an endless slide, for its speed [m].
_LONG = 1e3
# Samples of a path between its marks, at most about …
_MIDDLES = 400
# … and evenly spaced ones.
_EVENLY = 9
# Distance from a mark of samples of its speed, as a share of the way to the next mark …
_BESIDE = 0.1
# … and at least, as a share of the duration.
_SHORTEST = 1e-9
# No tool accelerates more [m/s²]: the fastest arms reach a tenth of it.
_WILD = 2000.0
# Standard gravity, rounded [m/s²].
_GRAVITY = 9.81


def check_fit(follows: Follows, relaxations: Sequence[Relaxation], start: Any = None) -> None:
    """Refuse a path that an arm cannot follow in a task's rows, whatever the joint motion.

    `start` is the initial configuration of the search for a sufficient tolerance.

    Raises
    ------
    PathError
        The task prescribes orientations that the path does not have.
    ProblemError
        The arm cannot move the tool in all rows, a relaxation does not fit, or the path can only be
        meant in other units.
    RedundancyError
        There are as many rows as joints, and none is relaxed.
    """
    first = follows.items[0]
    for item in follows.items:
        check_oriented(item.path, item.task)
    check_relaxations(relaxations, first.path, first.task)
    _check_redundancy(follows, relaxations, start)
    for item in follows.items:
        reach = follows.robot.reach_of(item.chain)
        _check_units(follows.robot, item.path, reach)
        _check_pace(follows.robot, item.path, reach)


def check_relaxations(relaxations: Sequence[Relaxation], path: Path, task: Task) -> None:
    """Check that relaxations fit a path, a task, and one another.

    Raises
    ------
    ProblemError
        A row is not among those the task prescribes, a window ends after the path, two relaxations
        share a row at the same time, or positions are relaxed in different axes.
    """
    prescribed = _prescribed(path, task)
    for item in relaxations:
        free = [row for row in item.rows if row not in prescribed]
        if free:
            raise ProblemError(
                f"relaxation {item.name}: task '{task.value}' does not prescribe "
                f"{', '.join(free)}, only {', '.join(prescribed)}"
            )
        if item.in_tool_axes and not set(POSITION_ROWS) <= set(prescribed):
            raise ProblemError(
                f"relaxation {item.name}: tool axes need a task that prescribes x, y and z, which "
                f"'{task.value}' does not"
            )
        if item.window(path.duration)[1] > path.duration * (1.0 + 1e-9):
            raise ProblemError(
                f"relaxation {item.name}: its window ends at {item.window(path.duration)[1]:.6g} "
                f"s, the path at {path.duration:.6g} s"
            )
    for first, second in combinations(relaxations, 2):
        twice = set(first.rows) & set(second.rows)
        one, other = first.window(path.duration), second.window(path.duration)
        if twice and one[0] < other[1] and other[0] < one[1]:
            raise ProblemError(f"row {', '.join(sorted(twice))} is relaxed twice at the same time")
    if len({item.in_tool_axes for item in relaxations if not item.angular}) > 1:
        raise ProblemError("positions are relaxed in world axes and in tool axes; choose one")
    # Not all combinations can be virtual joints: this raises.
    VirtualJoints(task, relaxations, path.duration, 1.0)


def _prescribed(path: Path, task: Task) -> list[str]:
    """Return the rows of the deviation that the task prescribes."""
    rows = [ROW_NAMES[k] for k in task.rows]
    if task is Task.PLANAR_POSE:
        # The task's angle is about the world's z axis: rz is the same only there.
        axes = path.samples(spread_along(path, 9)).rotation[:, :, 2]
        if not np.allclose(axes, [0.0, 0.0, 1.0]):
            rows.remove("rz")
    return rows


def _check_redundancy(follows: Follows, relaxations: Sequence[Relaxation], start: Any) -> None:
    robot, task, is_relaxed = follows.robot, follows.items[0].task, bool(relaxations)
    if len(follows.items) > 1:
        _check_several(follows, relaxations)
        return
    if not robot.can_follow(task) and not _can_with(follows, relaxations):
        if is_relaxed:
            raise ProblemError(
                f"{robot.name}: task '{task.value}' prescribes {task.dimension} rows "
                f"({', '.join(task.row_names)}), and the arm cannot move '{robot.tool}' freely in "
                f"all of them with its {robot.dof} joints and what is relaxed "
                f"({', '.join(row for item in relaxations for row in item.rows)}); relax other "
                f"rows as well"
            )
        others = _redundant_tasks(robot)
        choice = (
            f"choose another task ({', '.join(others)})"
            if others
            else "no other task is left: choose a tool that more joints move"
        )
        raise ProblemError(
            f"{robot.name}: task '{task.value}' prescribes {task.dimension} rows "
            f"({', '.join(task.row_names)}), but the arm cannot move '{robot.tool}' freely in "
            f"all of them; {choice}, or relax rows that it cannot move (relaxations=)"
            f"{that_would_do(follows, start)}"
        )
    if follows.redundancy == 0 and not is_relaxed:
        others = _redundant_tasks(robot)
        choice = f"choose a task with fewer rows ({', '.join(others)}), " if others else ""
        raise RedundancyError(
            f"{robot.name}: {robot.dof} joints and task '{task.value}' with "
            f"{task.dimension} rows leave no self-motion; {choice}relax some (relaxations=), "
            f"or take an arm with more joints",
            dof=robot.dof,
            rows=task.dimension,
        )


def _can_with(follows: Follows, relaxations: Sequence[Relaxation]) -> bool:
    """Return whether the arm with tolerances as joints can move in all rows."""
    if not relaxations:
        return False
    item = follows.items[0]
    if item.task is Task.PLANAR_POSE and not _moves_in_plane(follows.robot, item.chain):
        return False
    whole = with_tolerances(follows, relaxations)
    return whole.dof - whole.redundancy >= whole.dimension


def _check_several(follows: Follows, relaxations: Sequence[Relaxation]) -> None:
    is_relaxed = bool(relaxations)
    robot, rows, left = follows.robot, follows.dimension, follows.redundancy
    what = " and ".join(f"'{item.chain.tip_name}'" for item in follows.items)
    for item in follows.items:
        if item.task is Task.PLANAR_POSE and not _moves_in_plane(robot, item.chain):
            raise ProblemError(
                f"{robot.name}: task 'planar_pose' is for frames that move in the x-y plane only, "
                f"which '{item.chain.tip_name}' does not; choose another one (Follow(task=))"
            )
    if robot.dof - left < rows and not _can_with(follows, relaxations):
        names = ", ".join(row_names(follows))
        raise ProblemError(
            f"{robot.name}: {what} have {rows} rows prescribed ({names}), but {robot.dof} joints "
            f"cannot move them freely in all of these; prescribe fewer (Follow(task=))"
        )
    if left == 0 and not is_relaxed:
        raise RedundancyError(
            f"{robot.name}: {robot.dof} joints and {rows} rows of {what} leave no self-motion; "
            f"prescribe fewer (Follow(task=)), relax some of the first (relaxations=), or take "
            f"arms with more joints",
            dof=robot.dof,
            rows=rows,
        )


def _moves_in_plane(robot: RobotModel, chain: Chain) -> bool:
    """Return whether a chain's tip moves in the x-y plane of its base: else ωz is no angle."""
    jacobians, _, _ = chain.along(robot.generic_configurations())
    return bool(np.abs(jacobians[:, 2:5]).max() <= _NO_RATE)


def _redundant_tasks(robot: RobotModel) -> list[str]:
    """Return the tasks that the arm can follow and that leave self-motion."""
    return [x.value for x in Task if x.dimension < robot.dof and robot.can_follow(x)]


def _check_units(robot: RobotModel, path: Path, reach: float) -> None:
    """Raise ProblemError for a path that can only be meant in millimetres."""
    times = np.linspace(0.0, path.duration, 9)
    distances = np.linalg.norm(path.samples(times).translation, axis=1)
    if np.isfinite(reach) and distances.min() > _FAR * reach:
        raise ProblemError(
            f"{robot.name}: the path is {distances.min():.4g} m away from the arm's root "
            f"and more, the arm reaches {reach:.4g} m; positions are in metres"
        )


def _check_pace(robot: RobotModel, path: Path, reach: float) -> None:
    """Raise ProblemError for a path that no arm could follow at a hundred times its speed."""
    fastest = np.minimum(robot.velocity_limit, _FAST)
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    bound = float(np.sum(np.where(slides, fastest, fastest * min(reach, _LONG))))
    times = _inside(path)
    speeds = np.linalg.norm(path.samples(times).twist[:, :3], axis=1)
    k = int(np.argmax(speeds))
    # Written so that NaN is refused too.
    if not speeds[k] <= _HOPELESS * bound:
        raise ProblemError(
            f"{robot.name}: the path is too fast: {speeds[k]:.3g} m/s at t = {times[k]:.3g} s, "
            f"while its joints move the tool at {bound:.3g} m/s at most; durations are in seconds"
        )
    # In a kink nothing is said of accelerations: so not across a mark.
    away = np.abs(times[:, None] - np.asarray(path.marks)[_nearest(path, times)]).min(axis=1)
    step = np.maximum(_BESIDE * away, _SHORTEST * path.duration)
    early, late = (path.samples(times + side * step).twist[:, :3] for side in (-1.0, 1.0))
    pushes = np.where(step < away, np.linalg.norm(late - early, axis=1) / (2.0 * step), 0.0)
    k = int(np.argmax(pushes))
    if pushes[k] > _WILD:
        raise ProblemError(
            f"{robot.name}: the path is too fast: it accelerates at {pushes[k]:.3g} m/s² at t = "
            f"{times[k]:.3g} s, which is {pushes[k] / _GRAVITY:.0f} times gravity; durations are "
            f"in seconds, lengths in metres"
        )


def _inside(path: Path) -> Array:
    """Return sample times: middles between some marks of a path, and evenly spread ones."""
    marks = np.asarray(path.marks)
    middles = 0.5 * (marks[:-1] + marks[1:])
    some = middles[:: 1 + len(middles) // _MIDDLES]
    evenly = (np.arange(_EVENLY) + 0.5) / _EVENLY * path.duration
    return np.union1d(some, evenly)


def _nearest(path: Path, times: Array) -> Ints:
    """Return the numbers of the marks before and after times (K,), (K, 2)."""
    marks = np.asarray(path.marks)
    after = np.clip(np.searchsorted(marks, times), 1, len(marks) - 1)
    return np.stack([after - 1, after], axis=1)
