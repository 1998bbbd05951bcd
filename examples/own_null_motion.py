"""A null motion of one's own: sines that vanish at both ends, so that the arm rests there."""

from dataclasses import dataclass

import numpy as np

import selfmotion as sm
from selfmotion.testing import check_null_motion


@dataclass(frozen=True)
class Sines(sm.motion.NullMotion):
    """φ_k(t) = sin(k π t / T), k = 1 … count."""

    count: int = 4

    @property
    def fewest_steps(self):
        return 4 * self.count

    def functions(self, t, duration):
        return np.sin(np.pi * np.outer(t / duration, np.arange(1, self.count + 1)))


check_null_motion(Sines())
panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
circle = sm.paths.Circle.around(panda.pose(home), radius=0.15, duration=4.0, normal=(1, 0, 0))
for name, motion in {"cubic": sm.PolynomialNullMotion(), "sines": Sines()}.items():
    plan = sm.plan(sm.Problem(panda, circle, "position", home, motion)).require()
    speed = np.abs(plan.trajectory.qd[[0, -1]]).max()
    print(f"{name}: cost {plan.report.cost:.4f}, joint speed at the ends {speed:.4f} rad/s")
