"""Re-checks a finished trajectory by forward kinematics; shares no code with the rollout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from selfmotion.basics import (
    Array,
    ProblemError,
    Progress,
    as_called,
    as_several,
    in_angle,
    in_length,
    shown,
    silent,
    version,
)
from selfmotion.certificate.feed import FeedReached, with_feeds
from selfmotion.certificate.limits import arm_limits
from selfmotion.certificate.path_error import PathCheck, bound_errors, smallest_singular_values
from selfmotion.certificate.requirement import (
    DampedStretch,
    Extreme,
    Finding,
    FinishedMotion,
    Requirement,
    Tolerance,
    covered_by,
)
from selfmotion.certificate.verdict import Certificate
from selfmotion.model.follow import BoundTaskFrame, Follow, Follows
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path, check_oriented
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import DampingLaw, Relaxation, Task

# Samples at which the distance from singular poses, which proves nothing, is computed on a long
# motion; then at all times around its smallest values.
_MAX_POSES = 2_000
# A motion may end this much before or after its path [s], since files write times with some digits;
# then all has to be within the tolerance until both have ended.
_CLOCK = 1e-4
# Note of paths without bounds of their derivatives.
_MEASURED = "the path is checked at samples only: it gives no bounds (Path.series)"


def certify(
    robot: RobotModel,
    path: Path,
    task: Task | str,
    trajectory: Trajectory,
    tolerance: Tolerance | None = None,
    requirements: Sequence[Requirement] = (),
    *,
    also: Sequence[Follow] = (),
    relaxations: Sequence[Relaxation] = (),
    damping: DampingLaw | None = None,
    ending: str = "",
    progress: Progress = silent,
) -> Certificate:
    """Check a motion against its path, the arm's limits and further requirements.

    Parameters
    ----------
    robot, path, task, trajectory
        Motion and specification; times of the trajectory are those of the path, its joints are
        those of the arm by name, in any order.
    tolerance : Tolerance, optional
        Allowed error of the motion from the path.
    requirements : sequence of Requirement
        Further conditions. The arm's own limits of position and velocity are always judged, unless
        these contain `JointLimits` of the same order.
    also : sequence of Follow
        Further task frames on paths.
    relaxations : sequence of Relaxation
        Rows in which the tool may leave its path: only what is beyond them counts as an error.
    damping : DampingLaw, optional
        No requirement: the law by which the motion was damped near singular poses, for the report.
    ending : str
        Why the motion ends before its path does, where it is known to; such a motion is never
        verified.
    progress : callable, optional
        Called with ``("checking", chunk, chunks)`` during the check of a long motion.

    Returns
    -------
    Certificate

    Raises
    ------
    FileFormatError
        The trajectory is of other joints.
    ProblemError
        A requirement is none, or returns no finding.
    PathError
        The task prescribes orientations, but the path has none.
    """
    _check_arguments(robot, path, trajectory, ending)
    as_called(progress, "progress")
    tolerance, task = Tolerance.of(tolerance), Task.of(task)
    follows = _oriented(Follows.of(robot, path, task, as_several(also, "also", Follow)))
    trajectory = trajectory.of_joints(robot.joint_names)
    motion = FinishedMotion(robot, trajectory)
    checks = [
        bound_errors(robot, item, trajectory, tolerance, () if k else relaxations, progress)
        for k, item in enumerate(follows.items)
    ]
    path_check = checks[0]
    t = motion.t if damping is not None else _near_singular(follows, trajectory, motion.t)
    singular = smallest_singular_values(follows, trajectory(t))
    damped = () if damping is None else _damped_intervals(damping, t, singular)
    _check(requirements)
    feeds = tuple(FeedReached(feed, item) for item in follows.items for feed in item.path.feeds)
    wanted = (*arm_limits(robot, requirements), *requirements, *feeds)
    findings = tuple(_judged(item, motion) for item in wanted)
    cut = _cut_short(ending, follows, trajectory, checks, tolerance)
    off = tuple(text for check in checks for text in _off_path(check, tolerance, damped))
    # A time that differs by digits is not worth a message where the tool is off its path.
    digits = not ending and abs(trajectory.duration - path.duration) <= _CLOCK
    failures = (
        *((off or cut) if digits else cut + off),
        *(text for check in checks for text in _undecided(check)),
        *with_feeds(tuple(_violations(findings)), feeds, findings),
    )
    return Certificate(
        path_check.position,
        path_check.rotation,
        smallest_singular_value=_least(singular, t, robot.tool),
        closure=float(np.abs(trajectory.q[-1] - trajectory.q[0]).max()),
        samples=sum(check.samples for check in checks),
        tolerance=tolerance,
        findings=findings,
        failures=failures,
        covers=("path", *covered_by(wanted)),
        remarks=tuple(remark for item in wanted for remark in item.remarks),
        deviations=path_check.deviations,
        damped=damped,
        notes=() if all(check.proved for check in checks) else (_MEASURED,),
        others=tuple((check.position, check.rotation) for check in checks[1:]),
        motion=trajectory.digest,
        version=version(),
    )


def _oriented(follows: Follows) -> Follows:
    """Return task frames; PathError where orientations are prescribed that a path has not."""
    for item in follows.items:
        check_oriented(item.path, item.task)
    return follows


def _violations(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the violations: first those that no slower motion would mend."""
    broken = [item for item in findings if not item.satisfied]
    yield from (item.text for item in broken if not item.of_pace)
    # Of the others first the one that needs the longest motion, which mends the rest as well.
    slower = [item for item in broken if item.of_pace]
    yield from (item.text for item in sorted(slower, key=_required_factor, reverse=True))


def _required_factor(item: Finding) -> float:
    """Return the factor by which a motion has to be longer, if known."""
    return item.factor if np.isfinite(item.factor) else 0.0


def _check_arguments(robot: RobotModel, path: Path, trajectory: Trajectory, ending: str) -> None:
    for name, value, kind in (
        ("robot", robot, RobotModel),
        ("path", path, Path),
        ("trajectory", trajectory, Trajectory),
        ("ending", ending, str),
    ):
        if not isinstance(value, kind):
            raise ProblemError(f"certify: {name} is {shown(value)}, expected a {kind.__name__}")


def _check(requirements: Sequence[Requirement]) -> None:
    if not isinstance(requirements, list | tuple):
        raise ProblemError(f"requirements are {shown(requirements)}, expected a list of them")
    for item in requirements:
        if not isinstance(item, Requirement):
            raise ProblemError(
                f"requirements: {shown(item)} is no Requirement; derive a class of your own from "
                f"selfmotion.certificate.Requirement, or take constraint.requirement(robot)"
            )


def _judged(requirement: Requirement, motion: FinishedMotion) -> Finding:
    found = requirement.judge(motion)
    if not isinstance(found, Finding):
        raise ProblemError(
            f"requirement '{requirement.name}': judge() returned {found!r}, expected a Finding"
        )
    return found


def _damped_intervals(law: DampingLaw, t: Array, singular: Array) -> tuple[DampedStretch, ...]:
    """Return the intervals of damping, for smallest singular values (K,) at times (K,)."""
    factor = law.factor(singular)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], factor > 0.0, [0]])))
    return tuple(
        DampedStretch(
            start=float(t[first]),
            end=float(t[after - 1]),
            singular_value=float(singular[first:after].min()),
            factor=float(factor[first:after].max()),
        )
        for first, after in edges.reshape(-1, 2)
    )


def _damping_cause(time: float, damped: tuple[DampedStretch, ...]) -> str:
    """Return damping as the cause of an error of the path at a time; "" for none."""
    before = [interval for interval in damped if interval.start <= time]
    if not before:
        return ""
    when = "where" if time <= before[-1].end else "after"
    return f", {when} damping was active, {before[-1]}"


def _near_singular(follows: Follows, trajectory: Trajectory, t: Array) -> Array:
    """Return those of times t (K,) around which the arm may be nearest to a singular pose.

    Around values that are, minus their change nearby, below the least of all: of several loops each
    has a minimum.
    """
    every = 1 + len(t) // _MAX_POSES
    if every == 1:
        return t
    few = smallest_singular_values(follows, trajectory(t[::every]))
    change = np.abs(np.diff(few, append=few[-1]))
    nearby = np.maximum(change, np.maximum(np.append(change[1:], 0.0), np.append(0.0, change[:-1])))
    may_be = few - nearby < few.min()
    may_be[np.argmin(few)] = True
    # All samples between one of these and its neighbours.
    between = np.repeat(may_be | np.append(may_be[1:], False), every)[: len(t)]
    between[1:] |= between[:-1].copy()
    return np.asarray(t[between])


def _least(values: Array, t: Array, name: str) -> Extreme:
    worst = int(np.argmin(values))
    return Extreme(float(values[worst]), float(t[worst]), name)


def _undecided(check: PathCheck) -> tuple[str, ...]:
    intervals = check.undecided
    if not intervals:
        return ()
    first, last = intervals[0]
    more = len(intervals) - 1
    others = f", and on {more} other interval{'s' if more > 1 else ''}" if more else ""
    return (
        f"whether '{check.position.name}' is on its path from t = {first:.6g} to {last:.6g} s is "
        f"not decided{others}: the path or the motion is not smooth there",
    )


def _cut_short(
    ending: str,
    follows: Follows,
    trajectory: Trajectory,
    checks: Sequence[PathCheck],
    tolerance: Tolerance,
) -> tuple[str, ...]:
    if ending:
        return (ending,)
    duration = follows.items[0].path.duration
    excess = trajectory.duration - duration
    if abs(excess) <= 1e-9 * duration:
        return ()
    pairs = zip(follows.items, checks, strict=True)
    if abs(excess) <= min(_CLOCK, duration) and all(
        _ends_within(item, trajectory, excess, found, tolerance) for item, found in pairs
    ):
        return ()
    return (
        f"the motion lasts {trajectory.duration:.6g} s, the path {duration:.6g} s: "
        f"{abs(excess):.2g} s too {'long' if excess > 0.0 else 'short'}",
    )


def _ends_within(
    item: BoundTaskFrame,
    trajectory: Trajectory,
    excess: float,
    check: PathCheck,
    tolerance: Tolerance,
) -> bool:
    """Whether the remainder of what lasts longer, path or tip, is within the tolerance."""
    if excess < 0.0:
        path = item.path.samples([item.path.duration + excess, item.path.duration])
        rotation, translation = path.rotation, path.translation
    else:
        _, rotation, translation = item.chain.along(trajectory(trajectory.t[-1] - [excess, 0.0]))
    moved = float(np.linalg.norm(translation[1] - translation[0]))
    # ‖R₁ − R₀‖ = √8 sin(θ/2), accurate for small angles.
    angle = float(np.linalg.norm(rotation[1] - rotation[0])) / np.sqrt(8.0)
    turned = 2.0 * float(np.arcsin(min(angle, 1.0)))
    return (
        check.position.value + moved <= tolerance.position
        and check.rotation.value + turned <= tolerance.rotation
    )


def _off_path(
    check: PathCheck, tolerance: Tolerance, damped: tuple[DampedStretch, ...]
) -> tuple[str, ...]:
    position, rotation, failures = check.position, check.rotation, []
    off = "off the path, beyond its tolerances," if check.deviations else "off the path"
    # Written so that NaN fails.
    if not position.value <= tolerance.position:
        failures.append(
            f"'{position.name}' is {in_length(position.value, 3)} {off} at t = "
            f"{position.time:.3f} s (allowed: {in_length(tolerance.position, 3)})"
            f"{_damping_cause(position.time, damped)}"
        )
    if not rotation.value <= tolerance.rotation:
        failures.append(
            f"'{rotation.name}' is {in_angle(rotation.value, 3)} {off} at t = "
            f"{rotation.time:.3f} s (allowed: {in_angle(tolerance.rotation, 3)})"
            f"{_damping_cause(rotation.time, damped)}"
        )
    return tuple(failures)
