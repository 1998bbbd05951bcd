"""An obstacle shape of one's own: a cone. It is planned round, judged, saved and loaded."""

from dataclasses import dataclass
from typing import ClassVar

import coal
import numpy as np

import selfmotion as sm


@dataclass(frozen=True, eq=False)
class Cone(sm.obstacles.Obstacle):
    """A solid cone along the pose's z axis, half its height at the pose."""

    shape: ClassVar[str] = "cone"

    radius: float  # [m]
    height: float  # [m]

    def geometry(self):
        return coal.Cone(self.radius, self.height)


panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
circle = sm.paths.Circle.around(panda.pose(home), radius=0.15, duration=4.0, normal=(1, 0, 0))
cone = Cone("cone", [0.0, 0.15, 0.6], radius=0.08, height=0.3)
free = sm.plan(sm.Problem(panda, circle, task="position", start=home))
found = sm.obstacles.CollisionModel(panda, [cone]).worst(free.trajectory.q)
print(f"without it: '{found.first}' and '{found.second}', {1e3 * found.value:.1f} mm")
limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
problem = sm.Problem(
    panda,
    circle,
    task="position",
    start=home,
    constraints=limits,
    clearance=sm.constraints.Clearance([cone], distance=0.01),
)
plan = sm.plan(problem).require()
print(f"with it: {plan.certificate.verdict}")
plan.save("out/cone.npz")
print(sm.load_plan("out/cone.npz").obstacles[0].label)
