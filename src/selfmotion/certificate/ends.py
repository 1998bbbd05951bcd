"""Requirements on the ends of a motion: a state, rest, a closed loop."""

from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array
from selfmotion.certificate.requirement import Finding, FinishedMotion, Requirement

# Names of orders 0 to 2.
QUANTITIES = ("configuration", "velocity", "acceleration")
# Tolerance of closed paths, end configurations and end velocities [rad or m, per s].
ARRIVED = 1e-6
# The same of accelerations [rad/s² or m/s²], which are differences of velocities.
_ACCELERATED = 1e-4


@dataclass(frozen=True, eq=False)
class EndState(Requirement):
    """q(T) (order 0), q̇(T) (order 1) or q̈(T) (order 2) is as prescribed, or as at the start.

    Attributes
    ----------
    order : {0, 1, 2}
    target : (n,)
        [rad or m] per s^order.
    at_start : bool
    """

    order: int
    target: Array
    at_start: bool = False

    @property
    @override
    def name(self) -> str:  # type: ignore[override]  # it follows from the order
        return f"{'start' if self.at_start else 'end'} {QUANTITIES[self.order]}"

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Of the joint with the largest error."""
        row = 0 if self.at_start else -1
        reached = motion.trajectory(motion.trajectory.t[row], self.order)
        words = "off the one asked for" if self.order else "away from where it should"
        return _end_error(self.name, motion, reached - self.target, self.order, words, row)


# Largest acceleration of an arm at rest [rad/s² or m/s²]; more is a step of acceleration.
REST_ACCELERATION = 1e-3


@dataclass(frozen=True)
class AtRest(Requirement):
    """The arm is at rest at the start, at the end, or both: q̇ = 0, and q̈ = 0 if required.

    Attributes
    ----------
    start, end : bool
        At which ends: q̇ = 0 within 1e-6 rad/s or m/s.
    smooth : (bool, bool)
        At which of them q̈ = 0 as well, within 1e-3 rad/s² or m/s². It is judged of motions that
        state accelerations: those of a cubic spline jump at every sample.
    """

    start: bool
    end: bool
    smooth: tuple[bool, bool] = (False, False)
    name: str = "rest"

    @property
    @override
    def covers(self) -> tuple[str, ...]:
        where = "both ends" if self.start and self.end else "the start" if self.start else "the end"
        return (f"rest at {where}",)

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Return the joint that is the farthest from rest at an end."""
        given, found = motion.trajectory, list[Finding]()
        wanted = ((0, self.start, self.smooth[0]), (-1, self.end, self.smooth[1]))
        for row, rests, is_smooth in wanted:
            if rests:
                found.append(self._judged(motion, given.qd[row], row, 1))
            if rests and is_smooth and given.qdd is not None:
                found.append(self._judged(motion, given.qdd[row], row, 2))
        return max(found, key=lambda item: item.amount / item.allowed)

    def _judged(self, motion: FinishedMotion, rates: Array, row: int, order: int) -> Finding:
        """Return the finding of q̇ or q̈ (n,) at an end."""
        worst = int(np.argmax(np.abs(rates)))
        joint, amount = motion.robot.joint_names[worst], float(np.abs(rates[worst]))
        unit = motion.robot.unit_of(joint) + ("/s", "/s²")[order - 1]
        allowed = ARRIVED if order == 1 else REST_ACCELERATION
        verb = ("moves", "accelerates")[order - 1]
        text = (
            f"joint '{joint}' {verb} at {'the end' if row else 'the start'}, where it should rest: "
            f"{amount:.2g} {unit} ({allowed:g} allowed); plan it along a path that rests there, "
            f"with rest=True"
        )
        time = float(motion.trajectory.t[row])
        kept = bool(amount <= allowed)
        return Finding(self.name, joint, time, amount, allowed, kept, text, unit=unit)


@dataclass(frozen=True)
class ClosedMotion(Requirement):
    """The motion ends as it starts: q(T) = q(0), and q̇(T) = q̇(0) if required."""

    velocity: bool
    name: str = "closed path"

    @override
    def judge(self, motion: FinishedMotion) -> Finding:
        """Of the joint with the largest error."""
        q, qd = motion.trajectory.q, motion.trajectory.qd
        end_error = _end_error(self.name, motion, q[-1] - q[0], 0, "away from the start")
        if not (end_error.satisfied and self.velocity):
            return end_error
        return _end_error(self.name, motion, qd[-1] - qd[0], 1, "off that of the start")


def _end_error(
    name: str, motion: FinishedMotion, error: Array, order: int, words: str, row: int = -1
) -> Finding:
    size = np.abs(error)
    worst = int(np.argmax(size))
    joint, amount = motion.robot.joint_names[worst], float(size[worst])
    what = f" with {'an' if order == 2 else 'a'} {QUANTITIES[order]}" if order else ""
    unit = motion.robot.unit_of(joint) + ("", "/s", "/s²")[order]
    allowed = _ACCELERATED if order == 2 else ARRIVED
    text = (
        f"joint '{joint}' {'ends' if row else 'starts'}{what} {amount:.2g} {unit} {words} "
        f"({allowed:g} allowed)"
    )
    time = float(motion.trajectory.t[row])
    return Finding(name, joint, time, amount, allowed, bool(amount <= allowed), text, unit=unit)
