"""Limits of the joints at all times."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, read_only
from selfmotion.certificate.requirement import Finding, FinishedMotion, Requirement, of_some
from selfmotion.model.robot import RobotModel

# Duration within which a change of acceleration counts as a jump [s]: no controller resolves less.
_INSTANT = 1e-6
# Excess of a joint at its limit that counts as rounding [rad or m].
_ROUNDING = 1e-12

LIMIT_NAMES = (
    "joint position limits",
    "joint velocity limits",
    "joint acceleration limits",
    "joint jerk limits",
)
# Their names in verdicts.
_COVERED = ("joint limits", "speeds", "accelerations", "jerks")


@dataclass(frozen=True, eq=False)
class JointLimits(Requirement):
    """lower ≤ x ≤ upper for x = q (order 0), q̇ (1), q̈ (2) or the jerk (3), at all times.

    Attributes
    ----------
    order : {0, 1, 2, 3}
    lower, upper : (n,)
        [rad or m] per s^order, ±inf for none; symmetric from order 1 on.
    """

    order: int
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        lower, upper = self.lower, self.upper
        # Written so that NaN is refused.
        if self.order not in range(4) or lower.shape != upper.shape or not np.all(lower <= upper):
            raise ProblemError(
                f"limits of order {self.order}: lower {lower.tolist()} and upper {upper.tolist()}, "
                f"expected order 0 to 3 and lower ≤ upper for each joint"
            )
        if self.order > 0 and not (np.all(upper > 0.0) and np.all(lower < 0.0)):
            raise ProblemError(
                f"{self.name}: lower {lower.tolist()} and upper {upper.tolist()}, expected "
                f"numbers below and above 0"
            )

    @property
    @override
    def name(self) -> str:  # type: ignore[override]  # it follows from the order
        return LIMIT_NAMES[self.order]

    @property
    @override
    def covers(self) -> tuple[str, ...]:
        limited = np.isfinite(self.upper) | np.isfinite(self.lower)
        if not limited.any():
            return ()
        # Joints that turn for ever have no end.
        every = self.order == 0 or limited.all()
        name = _COVERED[self.order]
        return (name if every else of_some(name),)

    @property
    @override
    def remarks(self) -> tuple[str, ...]:
        count = int(np.sum(~(np.isfinite(self.upper) | np.isfinite(self.lower))))
        said = f"{self.name}: {count} of {len(self.upper)} joints are not limited"
        return (said,) if count else ()

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return a margin (order 0), or the share of the limit that is used."""
        times, values = motion.trajectory.extremes(self.order)
        if self.order == 0:
            margins = np.stack([values[0] - self.lower, self.upper - values[1]])
            side, joint = np.unravel_index(int(np.argmin(margins)), margins.shape)
            amount, allowed = float(margins[side, joint]), 0.0
            kept = bool(amount >= -_ROUNDING)
        else:
            shares = values / np.stack([self.lower, self.upper])
            side, joint = np.unravel_index(int(np.argmax(shares)), shares.shape)
            amount, allowed = float(shares[side, joint]), 1.0
            kept = bool(amount <= 1.0)
            jump = self._jump(motion) if self.order == 3 and kept else None
            if jump is not None:
                return jump
        time = float(times[side, joint])
        name = motion.robot.joint_names[int(joint)]
        unit = motion.robot.unit_of(name) + _POWERS[self.order]
        limit = float((self.lower, self.upper)[int(side)][int(joint)])
        if self.order:
            text = _rate(name, amount, time, f"{abs(limit):.4g} {unit}", self.order)
        else:
            text = _position(name, amount, time, limit, unit)
        factor = 1.0 if kept or not self.order else max(amount, 0.0) ** (1.0 / self.order)
        return Finding(self.name, name, time, amount, allowed, kept, text, self.order > 0, factor)

    def _jump(self, motion: FinishedMotion) -> Finding | None:
        """Return the largest jump of q̈, which no limited jerk allows, if there is one."""
        times, jumps = motion.trajectory.acceleration_jumps()
        shares = jumps / (_INSTANT * self.upper)
        joint = int(np.argmax(shares))
        if shares[joint] <= 1.0:
            return None
        name, time = motion.robot.joint_names[joint], float(times[joint])
        text = (
            f"the acceleration of joint '{name}' jumps by {jumps[joint]:.4g} "
            f"{motion.robot.unit_of(name)}{_POWERS[2]} at t = {time:.3f} s, which no limited jerk "
            f"does: give the motion's accelerations as well, or more samples"
        )
        return Finding(self.name, name, time, float(shares[joint]), 1.0, False, text, True, np.inf)


def limits_of_joints(
    requirements: Sequence[Requirement], order: int | None = None
) -> tuple[JointLimits, ...]:
    """Return the limits of joints among requirements, of one order of derivatives or of all."""
    limits = (item for item in requirements if isinstance(item, JointLimits))
    return tuple(item for item in limits if order is None or item.order == order)


def arm_limits(robot: RobotModel, requirements: Sequence[Requirement]) -> tuple[JointLimits, ...]:
    """Return the arm's own limits of position and velocity, but for orders that others speak of.

    Limits of one's own contain the arm's, or are meant to replace them.
    """
    taken = {item.order for item in limits_of_joints(requirements)}
    own = (
        JointLimits(0, robot.lower, robot.upper),
        JointLimits(1, -robot.velocity_limit, robot.velocity_limit),
    )
    return tuple(item for item in own if item.order not in taken)


def _position(name: str, amount: float, time: float, limit: float, unit: str) -> str:
    far = f"comes as near as {amount:.3g} {unit} to" if amount >= 0.0 else ""
    far = far or f"is {-amount:.3g} {unit} beyond"
    return f"joint '{name}' {far} its limit of {limit:.4g} {unit} at t = {time:.3f} s"


def _rate(name: str, amount: float, time: float, limit: str, order: int) -> str:
    verb = ("moves", "accelerates", "jerks")[order - 1]
    return (
        f"joint '{name}' {verb} at {amount:.5g} times its limit of {limit} at t = {time:.3f} s: "
        f"give it {max(amount, 0.0) ** (1.0 / order):.5g} times the duration"
    )


# Units of derivatives.
_POWERS = ("", "/s", "/s²", "/s³")
