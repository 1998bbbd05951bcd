"""Re-checks a finished trajectory by forward kinematics; shares no code with the rollout."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from selfmotion.arrays import Array
from selfmotion.collision import CollisionModel
from selfmotion.damping import DampingLaw
from selfmotion.errors import ProblemError
from selfmotion.path import Path
from selfmotion.relaxation import Relaxation, deviation_sizes, excess
from selfmotion.robot import RobotModel
from selfmotion.task import Task
from selfmotion.trajectory import Trajectory

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

# Points per interval of the trajectory's samples: odd, so that none but the samples are symmetric.
_REFINEMENT = 5


@dataclass(frozen=True)
class Tolerance:
    """What a verified motion may miss the path by, at any time.

    Attributes
    ----------
    position : float
        [m].
    rotation : float
        [rad].
    """

    position: float = 1e-6
    rotation: float = 1e-6

    def __post_init__(self) -> None:
        for name in ("position", "rotation"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ProblemError(f"tolerance: {name} is {value}, expected a number > 0")


@dataclass(frozen=True, eq=False)
class Requirements:
    """What a verified motion must keep besides the path; None: the URDF's limits, or nothing.

    Attributes
    ----------
    lower, upper : (n,) or None
        Position limits [rad or m].
    velocity : (n,) or None
        Speed limits [rad/s or m/s].
    acceleration : (n,) or None
        Acceleration limits [rad/s² or m/s²]; without them none are checked.
    end : (n,) or None
        q(T) [rad or m].
    end_velocity : (n,) or None
        q̇(T) [rad/s or m/s].
    closed, closed_velocity : bool
        Whether q(T) = q(0) is wanted, and q̇(T) = q̇(0).
    collision : CollisionModel or None
        Bodies to keep apart; without it clearance is not checked.
    clearance : float
        Smallest distance between bodies [m].
    relaxations : tuple of Relaxation
        Rows in which the tool may leave the path: only what is beyond them counts as an error.
    damping : DampingLaw or None
        No requirement: how the motion was damped near singular poses, to tell where and what for.
    ending : str
        Why the motion ends before its path does, where it is known to; such a motion is never
        verified.
    """

    lower: Array | None = None
    upper: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    end: Array | None = None
    end_velocity: Array | None = None
    closed: bool = False
    closed_velocity: bool = False
    collision: CollisionModel | None = None
    clearance: float = 0.0
    relaxations: tuple[Relaxation, ...] = ()
    damping: DampingLaw | None = None
    ending: str = ""


@dataclass(frozen=True)
class Extreme:
    """The worst value of a quantity along a motion.

    Attributes
    ----------
    value : float
    time : float
        When [s].
    name : str
        Of what: a joint, a frame, a pair of bodies.
    """

    value: float
    time: float
    name: str


@dataclass(frozen=True)
class DampedStretch:
    """A stretch of time over which the inverse was damped.

    Attributes
    ----------
    start, end : float
        [s].
    singular_value : float
        Smallest singular value σ of the task Jacobian on it [m, rad].
    factor : float
        Largest damping λ on it [m, rad].
    """

    start: float
    end: float
    singular_value: float
    factor: float

    def __str__(self) -> str:
        """Return the stretch in words."""
        return (
            f"{self.start:.3f} to {self.end:.3f} s (smallest singular value "
            f"{self.singular_value:.3g}, λ up to {self.factor:.3g})"
        )


@dataclass(frozen=True)
class Certificate:
    """What forward kinematics says about a finished motion, on a grid finer than its samples.

    Attributes
    ----------
    position_error : Extreme
        Largest distance of the tool from the path, in the prescribed rows and beyond what is
        relaxed [m].
    rotation_error : Extreme
        Largest angle from the path's orientation, likewise [rad].
    limit_margin : Extreme
        Smallest distance of a joint from its position limits [rad or m]; negative beyond them.
    velocity_ratio : Extreme
        Largest |q̇| relative to the joint's limit; above 1 it is exceeded.
    smallest_singular_value : Extreme
        Of the task Jacobian: distance from singular poses.
    acceleration_ratio : Extreme or None
        Largest |q̈| relative to the limits asked for; None without any.
    clearance : Extreme or None
        Smallest distance between bodies [m], with their names; None where it was not asked for.
    closure : float
        max |q(T) - q(0)| [rad or m].
    samples : int
        Number of times looked at.
    failures : tuple of str
        What speaks against the motion; empty for a verified one.
    deviations : tuple of Extreme
        For each relaxation the largest deviation of its rows from the path, in its window [m or
        rad].
    damped : tuple of DampedStretch
        Where the inverse was damped, in order of time.
    """

    position_error: Extreme
    rotation_error: Extreme
    limit_margin: Extreme
    velocity_ratio: Extreme
    smallest_singular_value: Extreme
    acceleration_ratio: Extreme | None
    clearance: Extreme | None
    closure: float
    samples: int
    failures: tuple[str, ...]
    deviations: tuple[Extreme, ...] = ()
    damped: tuple[DampedStretch, ...] = ()

    @property
    def verified(self) -> bool:
        """Whether the motion follows the path within tolerance and keeps the joint limits."""
        return not self.failures

    @property
    def verdict(self) -> str:
        """One line: verified, or what is wrong."""
        if self.verified:
            return (
                f"verified: at most {self.position_error.value:.1e} m and "
                f"{self.rotation_error.value:.1e} rad off the path"
                f"{', beyond what is relaxed' if self.deviations else ''}{self._damping_text}"
            )
        return "not verified: " + "; ".join(self.failures)

    @property
    def _damping_text(self) -> str:
        return f"; damped {' and '.join(map(str, self.damped))}" if self.damped else ""


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
    deviation, singular = _deviation(robot, path, task, t, q, in_tool_axes)
    beyond = excess(wanted.relaxations, path.duration, t, deviation)
    distance, angle = np.linalg.norm(beyond[:, :3], axis=1), np.linalg.norm(beyond[:, 3:], axis=1)
    lower = robot.lower if wanted.lower is None else wanted.lower
    upper = robot.upper if wanted.upper is None else wanted.upper
    limit = robot.velocity_limit if wanted.velocity is None else wanted.velocity
    tool, names = (robot.tool,), robot.joint_names
    worst = (
        _extreme(distance, t, tool, np.argmax),
        _extreme(angle, t, tool, np.argmax),
        _extreme(np.minimum(q - lower, upper - q), t, names, np.argmin),
        _extreme(np.abs(qd) / limit, t, names, np.argmax),
    )
    acceleration = None
    if wanted.acceleration is not None:
        # In the middle between samples the cubic's second derivative is the most accurate.
        middle = 0.5 * (trajectory.t[:-1] + trajectory.t[1:])
        share = np.abs(trajectory(middle, order=2)) / wanted.acceleration
        acceleration = _extreme(share, middle, names, np.argmax)
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
            _extreme(size, t, (item.name,), np.argmax)
            for item, size in zip(
                wanted.relaxations,
                deviation_sizes(wanted.relaxations, path.duration, t, deviation),
                strict=True,
            )
        ),
        damped=damped,
    )


def _deviation(
    robot: RobotModel, path: Path, task: Task, t: Array, q: Array, in_tool_axes: bool
) -> tuple[Array, Array]:
    """Return how the tool deviates from the path, (K, 6), and the smallest singular value, (K,).

    Rows x, y, z [m] and rx, ry, rz [rad] as `Relaxation` has them; zero where the task leaves them
    free.
    """
    rotation, translation, jacobian = _kinematics(robot, q)
    target = path.samples(t)
    linear = task.rows[task.rows < 3]
    miss = np.zeros((len(t), 6))
    miss[:, linear] = (translation - target.translation)[:, linear]
    miss[:, 3:] = _turns(task, target.rotation, rotation)
    if in_tool_axes:
        miss[:, :3] = np.einsum("kji,kj->ki", target.rotation, miss[:, :3])
    rows = jacobian
    if task.tool_axes:
        turned = rotation.transpose(0, 2, 1) @ jacobian[:, 3:]
        rows = np.concatenate([jacobian[:, :3], turned], axis=1)
    values = np.linalg.svd(rows[:, task.rows], compute_uv=False)
    return miss, values[:, -1].astype(np.float64)


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


def _kinematics(robot: RobotModel, q: Array) -> tuple[Array, Array, Array]:
    model, data, tool = robot.model, robot.model.createData(), robot.tool_id
    rotation, translation = np.empty((len(q), 3, 3)), np.empty((len(q), 3))
    jacobian = np.empty((len(q), 6, robot.dof))
    for k, configuration in enumerate(q):
        pin.computeJointJacobians(model, data, configuration)
        pose = pin.updateFramePlacement(model, data, tool)
        rotation[k], translation[k] = pose.rotation, pose.translation
        jacobian[k] = pin.getFrameJacobian(model, data, tool, _AXES)
    return rotation, translation, jacobian


def _turns(task: Task, target: Array, actual: Array) -> Array:
    """Return the rotation vectors from target to actual in target's axes, (K, 3) [rad].

    Those of the whole orientation, or of the tool's z axis alone; zero where no angle counts.
    """
    if not np.any(task.rows >= 3):
        return np.zeros((len(actual), 3))
    relative = target.transpose(0, 2, 1) @ actual
    if task.tool_axes:
        # From (0, 0, 1) to the z axis as seen from the target, by the shortest way.
        axis = relative[:, :, 2]
        normal = np.stack([-axis[:, 1], axis[:, 0], np.zeros(len(axis))], axis=1)
        cosine = axis[:, 2]
    else:
        normal = 0.5 * np.stack(
            [
                relative[:, 2, 1] - relative[:, 1, 2],
                relative[:, 0, 2] - relative[:, 2, 0],
                relative[:, 1, 0] - relative[:, 0, 1],
            ],
            axis=1,
        )
        cosine = 0.5 * (np.trace(relative, axis1=1, axis2=2) - 1.0)
    sine = np.linalg.norm(normal, axis=1)
    # Half a turn has no sine to scale; its axis does not matter, its angle does.
    normal[sine == 0.0] = [1.0, 0.0, 0.0]
    angle = np.arctan2(sine, cosine)
    return np.asarray(normal * (angle / np.where(sine > 0.0, sine, 1.0))[:, None])


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
            f"joint '{ratio.name}' moves at {ratio.value:.3g} times its limit at t = "
            f"{ratio.time:.3f} s: give it {ratio.value:.3g} times the duration"
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
            f"joint '{acceleration.name}' accelerates at {acceleration.value:.3g} times its limit "
            f"at t = {acceleration.time:.3f} s: give it {acceleration.value**0.5:.3g} times the "
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
