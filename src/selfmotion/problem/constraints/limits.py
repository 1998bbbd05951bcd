"""Limits of joint position, velocity, acceleration, jerk and torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_flag, as_number, per_joint, read_only
from selfmotion.certificate import LIMIT_NAMES, Column, JointLimits, Quantity
from selfmotion.model.robot import Dynamics, RobotModel, check_radians
from selfmotion.problem.constraints.base import Constraint, Envelope
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.bound_limits import BoundLimits

_RATES = ("position", "velocity", "acceleration", "jerk")
# Limits this many times the arm's own are in other units.
_FAR_ABOVE = 10.0
# The same of limits that no joint has, by order of derivative: unit and value.
_IMPLAUSIBLE = {1: ("rad/s", 50.0), 2: ("rad/s²", 200.0), 3: ("rad/s³", 5e4)}


@dataclass(frozen=True, eq=False)
class JointPositionLimits(Constraint):
    """Joint coordinates stay within limits.

    Parameters
    ----------
    lower, upper : (n,), optional
        [rad or m]; ±inf for none. By default only the URDF's.
    margin : float
        Target distance from them [rad or m]; at least half of it is kept.
    replace : bool
        Whether these replace the URDF's limits. By default both apply.
    """

    kept_moving: ClassVar[bool] = True

    lower: npt.ArrayLike | None = None
    upper: npt.ArrayLike | None = None
    margin: float = 1e-5
    replace: bool = False

    def __post_init__(self) -> None:
        _check_margin(self.margin)
        as_flag(self.replace, f"{type(self).__name__}: replace")

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        limits = BoundLimits.of(robot, self.requirement(robot), self.margin)
        return Conditions(limits=(limits,))

    @override
    def requirement(self, robot: RobotModel) -> JointLimits:
        return JointLimits(0, *self.limits(robot))

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return Envelope.of_limits(self.requirement(robot))

    def limits(self, robot: RobotModel) -> tuple[Array, Array]:
        """Return lower and upper limits of an arm, (n,) each [rad or m]."""
        own = []
        for side, given, arm, tighter in (
            ("lower", self.lower, robot.lower, np.maximum),
            ("upper", self.upper, robot.upper, np.minimum),
        ):
            if given is None:
                own.append(arm)
                continue
            values = per_joint(given, robot.dof, f"{robot.name}: {LIMIT_NAMES[0]}: {side}")
            check_radians(robot, values, f"{robot.name}: {LIMIT_NAMES[0]}", "limits")
            own.append(values if self.replace else read_only(tighter(values, arm)))
        lower, upper = own
        wrong = np.flatnonzero(~(lower < upper))
        if wrong.size:
            k = int(wrong[0])
            name = robot.joint_names[k]
            if lower[k] == upper[k]:
                raise ProblemError(
                    f"{robot.name}: {LIMIT_NAMES[0]}: joint '{name}' has lower = upper = "
                    f"{lower[k]:.6g}: it does not move; hold it there: lock = {{{name!r}: "
                    f"{lower[k]:.6g}}} of the robot (--set robot.lock.{name}={lower[k]:.6g})"
                )
            raise ProblemError(
                f"{robot.name}: {LIMIT_NAMES[0]}: joint '{name}': lower "
                f"{lower[k]:.6g} is not below upper {upper[k]:.6g}; the arm's own limits count as "
                f"well, unless these replace them (replace = true)"
            )
        return lower, upper


class _RateLimits(Constraint):
    """Limits of |q̇|, |q̈| or of the jerk: one's own, and those of the URDF or the arm's maker."""

    order: ClassVar[int]
    of_pace: ClassVar[bool] = True
    limit: npt.ArrayLike | None
    replace: bool

    def __post_init__(self) -> None:
        _check_margin(self.margin)
        as_flag(self.replace, f"{type(self).__name__}: replace")

    def published(self, robot: RobotModel) -> Array:
        """Return the arm's, (n,); inf where none are known."""
        known: Array = getattr(robot, f"{_RATES[self.order]}_limit")
        return known

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [rad or m, per s^order]."""
        if self.limit is None:
            return self.published(robot)
        what = f"{robot.name}: {LIMIT_NAMES[self.order]}"
        own = per_joint(self.limit, robot.dof, what, positive=True)
        return own if self.replace else read_only(np.minimum(own, self.published(robot)))

    @override
    def applies(self, robot: RobotModel) -> bool:
        return bool(np.isfinite(self.of(robot)).any())

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        limits = BoundLimits.of(robot, self.requirement(robot), self.margin)
        return Conditions(limits=(limits,))

    @override
    def requirement(self, robot: RobotModel) -> JointLimits:
        limit = self.of(robot)
        return JointLimits(self.order, -limit, limit)

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return Envelope.of_limits(self.requirement(robot))

    @override
    def for_controller(self, *, lines: bool = False) -> Constraint | None:
        return self if self.order == 1 else None

    @override
    def remarks(self, robot: RobotModel) -> tuple[str, ...]:
        """Limits far above the arm's own, or any arm's, by joint."""
        if self.limit is None:
            return ()
        (unit, most), published = _IMPLAUSIBLE[self.order], self.published(robot)
        given = per_joint(self.limit, robot.dof, f"{robot.name}: {LIMIT_NAMES[self.order]}")
        for k, name in enumerate(robot.joint_names):
            if robot.is_prismatic(name) or not np.isfinite(given[k]):
                continue
            said = ""
            if not self.replace and given[k] > _FAR_ABOVE * published[k]:
                said = f"has no effect, the arm's own limit is {published[k]:.4g} {unit}"
            elif given[k] > most:
                said = f"is more than arms do (above {most:g} {unit})"
            if said:
                kind = type(self).__name__
                return (f"{kind}: {given[k]:g} {unit} for '{name}' {said}; in degrees? limit_deg",)
        return ()


@dataclass(frozen=True, eq=False)
class JointVelocityLimits(_RateLimits):
    """Joint speeds stay below limits.

    Parameters
    ----------
    limit : (n,) or float, optional
        [rad/s or m/s]; by default only the URDF's.
    margin : float
        Share of the limit that is aimed to be left unused; at least half of it is.
    replace : bool
        Whether these replace the URDF's limits. By default both apply.
    """

    order: ClassVar[int] = 1
    kept_moving: ClassVar[bool] = True

    limit: npt.ArrayLike | None = None
    margin: float = 1e-4
    replace: bool = False


@dataclass(frozen=True, eq=False)
class JointAccelerationLimits(_RateLimits):
    """Joint accelerations stay below limits.

    Parameters
    ----------
    limit : (n,) or float, optional
        [rad/s² or m/s²]; by default those of the arm's maker, if known (URDFs give none).
    margin : float
        Share of the limit that is aimed to be left unused; at least half of it is.
    replace : bool
        Whether these replace the maker's limits. By default both apply.
    """

    order: ClassVar[int] = 2
    kept_moving: ClassVar[bool] = True
    option: ClassVar[str] = "--acceleration"

    limit: npt.ArrayLike | None = None
    margin: float = 1e-4
    replace: bool = False


@dataclass(frozen=True, eq=False)
class JointJerkLimits(_RateLimits):
    """Joint jerks, the derivatives of accelerations, stay below limits.

    Parameters
    ----------
    limit : (n,) or float, optional
        [rad/s³ or m/s³]; by default those of the arm's maker, if known (URDFs give none).
    margin : float
        Share of the limit that is aimed to be left unused; at least half of it is.
    replace : bool
        Whether these replace the maker's limits. By default both apply.
    """

    order: ClassVar[int] = 3
    kept_moving: ClassVar[bool] = True

    limit: npt.ArrayLike | None = None
    margin: float = 1e-4
    replace: bool = False


def _check_margin(margin: float) -> None:
    as_number(margin, "limits: margin", above=0.0, most=1.0)


# Clause of a message about joints that mimic others.
_WITH = " and of those that mimic it"


@dataclass(frozen=True, eq=False)
class JointTorqueLimits(Constraint):
    """Joint torques stay below limits: gravity, inertia and Coriolis forces, with a payload.

    Whether one motor drives all joints that mimic one, or each has its own, is not in a URDF. Both
    limits apply: the common torque at the mimicked joint (Cᵀτ) is below its effort, and the torque
    of each (τ) below its own. Limits given here are those of the former alone.

    Parameters
    ----------
    limit : (n,) or float, optional
        [Nm, or N of prismatic joints]; by default the URDF's efforts.
    payload : float
        Mass that the tool holds [kg].
    center : (3,)
        Its centre of mass in the tool frame [m].
    inertia : (3, 3), optional
        Its inertia about that centre, along the tool's axes [kg m²]; by default a point mass.
    margin : float
        Share of the limit that is aimed to be left unused; at least half of it is.
    """

    limit: npt.ArrayLike | None = None
    payload: float = 0.0
    center: npt.ArrayLike = (0.0, 0.0, 0.0)
    inertia: npt.ArrayLike | None = None
    margin: float = 1e-3

    def __post_init__(self) -> None:
        as_number(self.margin, "joint torque limits: margin", above=0.0, most=1.0)

    @override
    def quantity(self, robot: RobotModel) -> Quantity:
        each = self.limit is None
        dynamics = Dynamics(robot, self.payload, self.center, self.inertia, each=each)
        limit = self.of(robot)
        names = [(name, f"torque of joint '{name}'") for name in robot.joint_names]
        if each and len(robot.coupling.shared):
            own = [robot.model.names[int(k) + 1] for k in robot.coupling.shared]
            names = [(name, f"{label}{_WITH * (name in own)}") for name, label in names]
            names += [(name, f"torque of joint '{name}' alone") for name in own]
            efforts = np.asarray(robot.model.upperEffortLimit)[robot.coupling.shared]
            limit = np.append(limit, np.where(efforts > 0.0, efforts, np.inf))
        units = ["N" if robot.is_prismatic(name) else "Nm" for name, _ in names]
        return Quantity(
            "joint torque limits",
            [Column(*name, unit) for name, unit in zip(names, units, strict=True)],
            dynamics.torques,
            dynamics.derivatives,
            limit=limit,
            of_pace=True,
            series=lambda segments: dynamics.series(segments.chain()),
            covers=(_covered(robot, self.of(robot)),),
        )

    @override
    def applies(self, robot: RobotModel) -> bool:
        shared = np.asarray(robot.model.upperEffortLimit)[robot.coupling.shared]
        each = self.limit is None and bool((shared > 0.0).any())
        return each or bool(np.isfinite(self.of(robot)).any())

    @override
    def for_controller(self, *, lines: bool = False) -> Constraint | None:
        # Torques are judged along the smooth curve.
        return None if lines else self

    @property
    @override
    def load(self) -> tuple[float, Array]:
        return float(self.payload), np.asarray(self.center, dtype=np.float64).reshape(3)

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [Nm or N]."""
        if self.limit is None:
            unsaid = [name for name in robot.joint_names if name in robot.urdf.lacking_efforts]
            if unsaid:
                raise ProblemError(
                    f"{robot.name}: joint torque limits: joint '{unsaid[0]}' has a <limit> without "
                    f"effort; add it to the URDF, or give limit = …"
                )
            return robot.effort_limit
        what = f"{robot.name}: joint torque limits"
        return per_joint(self.limit, robot.dof, what, positive=True)


def _covered(robot: RobotModel, limit: Array) -> str:
    """Return the claim of a verdict: the limits of some motors may be unknown.

    Torques are those of rigid bodies: where a URDF has damping or friction, the verdict says so.
    """
    known = int(np.isfinite(limit).sum())
    claim = "torques" if known == len(limit) else f"torques of {known} of {len(limit)} joints"
    model = robot.model
    losses = np.any(model.damping) or np.any(model.upperDryFrictionLimit)
    return f"{claim} without damping and friction" if losses else claim
