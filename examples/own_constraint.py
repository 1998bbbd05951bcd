"""A constraint of one's own: joint 2 + joint 3 of a Panda stay within a band.

`SumBand` is all there is to write: what is measured, once, with its derivative. The optimiser's
conditions and the certificate's requirement follow from it.
"""

from dataclasses import dataclass

import numpy as np

import selfmotion as sm
from selfmotion.testing import check_constraint

# The two joints' shares in what is limited.
SUM = np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class SumBand(sm.constraints.Constraint):
    """lower ≤ q2 + q3 ≤ upper [rad]."""

    lower: float
    upper: float

    def quantity(self, robot):
        return sm.certificate.Quantity.between(
            "q2 + q3",
            self.lower,
            self.upper,
            values=lambda q, qd, qdd: q @ SUM,
            derivatives=lambda q, qd, qdd: (np.tile(SUM, (len(q), 1)),),
            series=lambda segments: np.tensordot(SUM, segments.chain().joints, 1),
            unit="rad",
        )


panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
circle = sm.paths.Circle.around(panda.pose(home), radius=0.15, duration=4.0, normal=(1, 0, 0))
free = sm.plan(sm.Problem(panda, circle, task="position", start=home))
total = free.trajectory.q @ SUM
print(f"without the constraint q2 + q3 goes from {total.min():.3f} to {total.max():.3f} rad")

band = SumBand(float(total.min()) + 0.05, float(total.max()) + 0.05)
problem = sm.Problem(
    panda,
    circle,
    task="position",
    start=home,
    constraints=[sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits(), band],
)
check_constraint(band, problem)
plan = sm.plan(problem).require()
total = plan.trajectory.q @ SUM
print(f"with it from {total.min():.3f} to {total.max():.3f} rad, allowed from {band.lower:.3f} on")
print(plan.certificate.verdict)
