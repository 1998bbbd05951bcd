"""A constraint of one's own: joint 2 + joint 3 of a Panda stay within a band.

This file is all there is to write: the conditions that the optimiser follows (`BandConditions`),
and the requirement that the certificate judges the finished motion by (`BandRequirement`).
"""

from dataclasses import dataclass

import numpy as np

import selfmotion as sm
from selfmotion.testing import check_constraint

# The two joints' shares in what is limited.
SUM = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
# Aimed to be kept from the limits [rad], since the conditions are looked at in the nodes alone.
MARGIN = 1e-3


@dataclass(frozen=True)
class SumBand(sm.Constraint):
    """lower ≤ q2 + q3 ≤ upper [rad]."""

    lower: float
    upper: float

    def bind(self, follows, start, end):
        return BandConditions(self.lower, self.upper)

    def requirement(self, robot):
        return BandRequirement(self.lower, self.upper)


@dataclass(frozen=True)
class BandConditions:
    """h = (sum - upper, lower - sum) + margin ≤ 0 at each node."""

    lower: float
    upper: float
    name: str = "sum band"
    equality: bool = False
    tolerance: float = 0.5 * MARGIN

    def residual(self, samples):
        total = samples.q[samples.nodes] @ SUM
        return np.stack([total - self.upper, self.lower - total], axis=1) + MARGIN

    def tangents(self, samples, motion):
        total = np.einsum("n,knd->kd", SUM, motion.q)
        return np.stack([total, -total], axis=1)

    def describe(self, samples, row, column):
        total = samples.q[samples.nodes][row] @ SUM
        return f"q2 + q3 is {total:.3f} rad at t = {samples.t[samples.nodes][row]:.3f} s"


@dataclass(frozen=True)
class BandRequirement(sm.Requirement):
    """The same, measured on the finished motion."""

    lower: float
    upper: float
    name: str = "sum band"

    def judge(self, motion):
        total = motion.q @ SUM
        beyond = np.maximum(total - self.upper, self.lower - total)
        worst = int(np.argmax(beyond))
        time, amount = float(motion.t[worst]), float(total[worst])
        return sm.Finding(
            requirement=self.name,
            subject="joints 2 and 3",
            time=time,
            amount=amount,
            allowed=self.upper if amount > self.upper else self.lower,
            kept=bool(beyond[worst] <= 0.0),
            text=f"q2 + q3 is {amount:.4f} rad at t = {time:.3f} s, wanted {self.lower} to "
            f"{self.upper}: widen the band, or move the path",
        )


panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
circle = sm.Circle.around(panda.pose(home), radius=0.15, duration=4.0, normal=(1, 0, 0))
free = sm.plan(sm.Problem(panda, circle, task="position", start=home))
total = free.trajectory.q @ SUM
print(f"without the constraint q2 + q3 goes from {total.min():.3f} to {total.max():.3f} rad")

band = SumBand(float(total.min()) + 0.05, float(total.max()) + 0.05)
problem = sm.Problem(
    panda,
    circle,
    task="position",
    start=home,
    constraints=[sm.JointPositionLimits(), sm.JointVelocityLimits(), band],
)
check_constraint(band, problem)
plan = sm.plan(problem).require()
total = plan.trajectory.q @ SUM
print(f"with it from {total.min():.3f} to {total.max():.3f} rad, allowed from {band.lower:.3f} on")
print(plan.certificate.verdict)
