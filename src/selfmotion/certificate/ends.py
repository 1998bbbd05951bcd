"""Conditions on the end of a motion: a configuration, a velocity, a closed loop."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.requirement import FinishedMotion, Requirement

# What closed paths, end configurations and end velocities may miss by [rad or m, per s].
ARRIVED = 1e-6


@dataclass(frozen=True, eq=False)
class EndState(Requirement):
    """q(T) (order 0) or q̇(T) (order 1) is the one asked for.

    Attributes
    ----------
    order : {0, 1}
    target : (n,)
        [rad or m], per s for order 1.
    """

    order: int
    target: Array

    @property
    def name(self) -> str:  # type: ignore[override]  # it follows from the order
        """See `Requirement.name`."""
        return ("end configuration", "end velocity")[self.order]

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the joint that misses most."""
        end = (motion.trajectory.q, motion.trajectory.qd)[self.order][-1]
        words = ("away from where it should", "off the one asked for")[self.order]
        return _miss(self.name, motion, end - self.target, self.order, words)


@dataclass(frozen=True)
class ClosedMotion(Requirement):
    """The motion ends as it began: q(T) = q(0), and q̇(T) = q̇(0) where velocity is asked for."""

    velocity: bool
    name: str = "closed path"

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the joint that misses most."""
        q, qd = motion.trajectory.q, motion.trajectory.qd
        apart = _miss(self.name, motion, q[-1] - q[0], 0, "away from the start")
        if not (apart.kept and self.velocity):
            return apart
        return _miss(self.name, motion, qd[-1] - qd[0], 1, "off that of the start")


def _miss(name: str, motion: FinishedMotion, miss: Array, order: int, words: str) -> Finding:
    size = np.abs(miss)
    worst = int(np.argmax(size))
    joint, amount = motion.robot.joint_names[worst], float(size[worst])
    with_velocity = " with a velocity" if order else ""
    text = f"joint '{joint}' ends{with_velocity} {amount:.2e} {words}"
    time = float(motion.trajectory.t[-1])
    return Finding(name, joint, time, amount, ARRIVED, bool(amount <= ARRIVED), text)
