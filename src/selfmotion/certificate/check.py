"""Re-checks a finished trajectory by forward kinematics; shares no code with the rollout."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate.measure import deviation_from
from selfmotion.certificate.terms import (
    Certificate,
    DampedStretch,
    Extreme,
    Requirements,
    Tolerance,
)
from selfmotion.collision import CollisionModel
from selfmotion.motion import Trajectory
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import DampingLaw, Task, deviation_size, excess

# Points per interval of the trajectory's samples: odd, so that none but the samples are symmetric.
_REFINEMENT = 5


def certify(
    robot: RobotModel,
    path: Path,
    task: Task,
    trajectory: Trajectory,
    tolerance: Tolerance | None = None,
    requirements: Requirements | None = None,
) -> Certificate:
    """Check a motion against its path, the arm's limits and what else is required.

    Parameters
    ----------
    robot, path, task, trajectory
        The motion and what it should do; times of the trajectory are those of the path.
    tolerance : Tolerance, optional
    requirements : Requirements, optional

    Returns
    -------
    Certificate
    """
    tolerance, wanted = tolerance or Tolerance(), requirements or Requirements()
    t = _refined(trajectory.t)
    q, qd = trajectory(t), trajectory(t, order=1)
    in_tool_axes = any(item.in_tool_axes for item in wanted.relaxations)
    deviation, singular = deviation_from(robot, path, task, t, q, in_tool_axes)
    beyond = excess(wanted.relaxations, path.duration, t, deviation)
    distance, angle = np.linalg.norm(beyond[:, :3], axis=1), np.linalg.norm(beyond[:, 3:], axis=1)
    lower, upper, limit = wanted.limits(robot)
    tool, names = (robot.tool,), robot.joint_names
    worst = (
        _extreme(distance, t, tool, np.argmax),
        _extreme(angle, t, tool, np.argmax),
        _extreme(np.minimum(q - lower, upper - q), t, names, np.argmin),
        _extreme(np.abs(qd) / limit, t, names, np.argmax),
    )
    acceleration = None
    if wanted.acceleration is not None:
        ends, qdd = trajectory.accelerations()
        acceleration = _extreme(np.abs(qdd) / wanted.acceleration, ends, names, np.argmax)
    clearance = None if wanted.collision is None else _clearance(wanted.collision, t, q)
    closure = float(np.abs(trajectory.q[-1] - trajectory.q[0]).max())
    damped = () if wanted.damping is None else _damped_stretches(wanted.damping, t, singular)
    return Certificate(
        *worst,
        smallest_singular_value=_extreme(singular, t, tool, np.argmin),
        acceleration_ratio=acceleration,
        clearance=clearance,
        closure=closure,
        samples=len(t),
        failures=(
            *_cut_short(wanted.ending, path, trajectory),
            *_failures(*worst, tolerance, damped),
            *_unmet(wanted, acceleration, clearance, closure, trajectory),
        ),
        deviations=tuple(
            _extreme(deviation_size(item, path.duration, t, deviation), t, (item.name,), np.argmax)
            for item in wanted.relaxations
        ),
        damped=damped,
    )


def _damped_stretches(law: DampingLaw, t: Array, singular: Array) -> tuple[DampedStretch, ...]:
    """Return where the law damps, for smallest singular values (K,) at times (K,)."""
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


def _because(time: float, damped: tuple[DampedStretch, ...]) -> str:
    """Return what damping has to do with being off the path at a time; "" for nothing."""
    before = [stretch for stretch in damped if stretch.start <= time]
    if not before:
        return ""
    when = "where" if time <= before[-1].end else "after"
    return f", {when} damping was active, {before[-1]}"


def _clearance(model: CollisionModel, t: Array, q: Array) -> Extreme:
    closest = model.worst(q)
    names = f"{closest.first} - {closest.second}" if closest.first else "nothing"
    return Extreme(closest.value, float(t[closest.index]), names)


def _refined(t: Array) -> Array:
    fractions = np.arange(_REFINEMENT) / _REFINEMENT
    inner = t[:-1, None] + np.diff(t)[:, None] * fractions
    return np.append(inner.ravel(), t[-1])


def _extreme(
    values: Array, t: Array, names: tuple[str, ...], choose: Callable[[Array], np.intp]
) -> Extreme:
    table = values.reshape(len(t), -1)
    row, column = np.unravel_index(int(choose(table)), table.shape)
    return Extreme(float(table[row, column]), float(t[row]), names[int(column)])


def _cut_short(ending: str, path: Path, trajectory: Trajectory) -> tuple[str, ...]:
    if ending:
        return (ending,)
    if abs(trajectory.duration - path.duration) <= 1e-9 * path.duration:
        return ()
    return (f"the motion lasts {trajectory.duration:.6g} s, the path {path.duration:.6g} s",)


def _failures(
    position: Extreme,
    rotation: Extreme,
    margin: Extreme,
    ratio: Extreme,
    tolerance: Tolerance,
    damped: tuple[DampedStretch, ...],
) -> tuple[str, ...]:
    failures = []
    # Written so that NaN fails.
    if not position.value <= tolerance.position:
        failures.append(
            f"'{position.name}' is {position.value:.2e} m off the path at t = {position.time:.3f} "
            f"s (allowed: {tolerance.position:.0e}){_because(position.time, damped)}"
        )
    if not rotation.value <= tolerance.rotation:
        failures.append(
            f"'{rotation.name}' is {rotation.value:.2e} rad off the path at t = "
            f"{rotation.time:.3f} s (allowed: {tolerance.rotation:.0e})"
            f"{_because(rotation.time, damped)}"
        )
    if not margin.value >= 0.0:
        failures.append(
            f"joint '{margin.name}' is {-margin.value:.3g} beyond its limit at t = "
            f"{margin.time:.3f} s"
        )
    if not ratio.value <= 1.0:
        failures.append(
            f"joint '{ratio.name}' moves at {ratio.value:.5g} times its limit at t = "
            f"{ratio.time:.3f} s: give it {ratio.value:.5g} times the duration"
        )
    return tuple(failures)


# What closed paths, end configurations and end velocities may miss by [rad or m, per s].
_ARRIVED = 1e-6


def _unmet(
    wanted: Requirements,
    acceleration: Extreme | None,
    clearance: Extreme | None,
    closure: float,
    trajectory: Trajectory,
) -> tuple[str, ...]:
    failures = []
    if acceleration is not None and not acceleration.value <= 1.0:
        failures.append(
            f"joint '{acceleration.name}' accelerates at {acceleration.value:.5g} times its limit "
            f"at t = {acceleration.time:.3f} s: give it {acceleration.value**0.5:.5g} times the "
            f"duration"
        )
    if clearance is not None and not clearance.value >= wanted.clearance:
        failures.append(
            f"{clearance.name} are {clearance.value * 1e3:.2f} mm apart at t = "
            f"{clearance.time:.3f} s (wanted: {wanted.clearance * 1e3:.2f} mm)"
        )
    if wanted.closed and not closure <= _ARRIVED:
        failures.append(f"the end is {closure:.2e} (rad or m) away from the start")
    ends = (
        ("joint '{}' ends {:.2e} away from where it should", trajectory.q[-1], wanted.end),
        (
            "joint '{}' ends with a velocity {:.2e} off the one asked for",
            trajectory.qd[-1],
            wanted.end_velocity,
        ),
        (
            "joint '{}' ends with a velocity {:.2e} off that of the start",
            trajectory.qd[-1],
            trajectory.qd[0] if wanted.closed_velocity else None,
        ),
    )
    for text, actual, target in ends:
        if target is None:
            continue
        miss = np.abs(actual - target)
        if not miss.max() <= _ARRIVED:
            joint = trajectory.joint_names[int(np.argmax(miss))]
            failures.append(text.format(joint, miss.max()))
    return tuple(failures)
