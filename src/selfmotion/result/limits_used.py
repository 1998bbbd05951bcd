"""Which limits a motion uses, and for how long: whether it could be faster."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import Quantity, QuantityWithinLimits, Requirement
from selfmotion.motion import Trajectory
from selfmotion.problem import Problem
from selfmotion.result.pace_rows import PaceLimits

# A limit is used fully from this share of it on.
FULLY = 0.95
# Times that are looked at, so many per sample of the motion and at least.
_PER_SAMPLE, _FEWEST = 3, 2000
_RATES = ("speed", "acceleration", "jerk")


@dataclass(frozen=True)
class LimitsUsed:
    """For what share of a motion's time limits of its pace are used fully, by 95 % or more.

    Attributes
    ----------
    busy : float
        Some limit is: at 1 the motion is as fast as its joint path allows.
    shares : tuple of (str, float)
        Which limit is used most then, "acceleration of joint 'elbow'", and for what share of the
        time; the longest first.
    """

    busy: float
    shares: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        """Return both in words."""
        told = f"{self.busy:.1%} of the time"
        if not self.shares:
            return told
        return f"{told}: " + ", ".join(f"{name} {share:.1%}" for name, share in self.shares)


def quantities_of_pace(requirements: Sequence[Requirement]) -> tuple[Quantity, ...]:
    """Return the quantities within limits that a slower pace may keep."""
    kept = (item.quantity for item in requirements if isinstance(item, QuantityWithinLimits))
    return tuple(item for item in kept if item.of_pace and len(item.limited))


def limits_used(problem: Problem, motion: Trajectory) -> LimitsUsed:
    """Return how long a motion uses which of the limits of its pace that a problem asks for."""
    envelope = problem.envelope
    quantities = quantities_of_pace(problem.requirements)
    limits = PaceLimits(envelope.speed, envelope.acceleration, envelope.jerk, quantities)
    count = max(_PER_SAMPLE * len(motion.t), _FEWEST)
    # In the middle of equal parts of the time.
    t = motion.t[0] + motion.duration * (np.arange(count) + 0.5) / count
    used = np.concatenate(limits.shares_at(motion, t), axis=1)
    names = [f"{rate} of joint '{name}'" for rate in _RATES for name in motion.joint_names]
    names += [column.label for item in quantities for column in item.columns]
    most = np.argmax(used, axis=1)
    full = used.max(axis=1) >= FULLY
    shares = _shares(most[full], len(names)) / count
    order = np.argsort(-shares, kind="stable")
    found = tuple((names[k], float(shares[k])) for k in order if shares[k] > 0.0)
    return LimitsUsed(float(full.mean()), found)


def _shares(which: Array, count: int) -> Array:
    return np.bincount(which, minlength=count).astype(np.float64)
