"""Limits of joint position, velocity, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_flag, as_number, per_joint, read_only
from selfmotion.certificate import LIMIT_NAMES, JointLimits
from selfmotion.model.robot import RobotModel, check_radians
from selfmotion.problem.constraints.base import Constraint, Envelope
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.bound_limits import BoundLimits

_RATES = ("position", "velocity", "acceleration", "jerk")
# Limits this many times those of the arm are probably in other units.
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
        limits = []
        for side, limit, arm_limit, tighter in (
            ("lower", self.lower, robot.lower, np.maximum),
            ("upper", self.upper, robot.upper, np.minimum),
        ):
            if limit is None:
                limits.append(arm_limit)
                continue
            values = per_joint(limit, robot.dof, f"{robot.name}: {LIMIT_NAMES[0]}: {side}")
            check_radians(robot, values, f"{robot.name}: {LIMIT_NAMES[0]}", "limits")
            limits.append(values if self.replace else read_only(tighter(values, arm_limit)))
        lower, upper = limits
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
    """Limits of |q̇|, |q̈| or the jerk: of the user, and of the URDF or the maker of the arm."""

    order: ClassVar[int]
    of_pace: ClassVar[bool] = True
    limit: npt.ArrayLike | None
    replace: bool

    def __post_init__(self) -> None:
        _check_margin(self.margin)
        as_flag(self.replace, f"{type(self).__name__}: replace")

    def published(self, robot: RobotModel) -> Array:
        """Return the limits of the URDF or the arm's maker, (n,); inf where none are known."""
        limits: Array = getattr(robot, f"{_RATES[self.order]}_limit")
        return limits

    def of(self, robot: RobotModel) -> Array:
        """Return the limits for an arm, (n,) [rad or m, per s^order]."""
        if self.limit is None:
            return self.published(robot)
        what = f"{robot.name}: {LIMIT_NAMES[self.order]}"
        limits = per_joint(self.limit, robot.dof, what, positive=True)
        return limits if self.replace else read_only(np.minimum(limits, self.published(robot)))

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
        """Remark on a limit far above that of the arm, or of any arm."""
        if self.limit is None:
            return ()
        (unit, plausible), published = _IMPLAUSIBLE[self.order], self.published(robot)
        limits = per_joint(self.limit, robot.dof, f"{robot.name}: {LIMIT_NAMES[self.order]}")
        for k, name in enumerate(robot.joint_names):
            if robot.is_prismatic(name) or not np.isfinite(limits[k]):
                continue
            remark = ""
            if not self.replace and limits[k] > _FAR_ABOVE * published[k]:
                remark = f"has no effect, the arm's own limit is {published[k]:.4g} {unit}"
            elif limits[k] > plausible:
                remark = f"is more than arms do (above {plausible:g} {unit})"
            if remark:
                kind = type(self).__name__
                text = f"{kind}: {limits[k]:g} {unit} for '{name}' {remark}; in degrees? limit_deg"
                return (text,)
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
