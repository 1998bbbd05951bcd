"""A cost of one's own: keep the elbow of a Panda up, and its joints slow."""

import numpy as np

import selfmotion as sm
from selfmotion.basics.arrays import Array


def elbow_down(qd: Array, q: Array, t: Array) -> Array:
    """Return G = 5 (1 + cos of the elbow's roll): large when joints 1 and 3 swing it down."""
    return 5.0 * (1.0 - np.cos(q[:, 2]))


panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
line_end = panda.pose(start)
line_end.translation = line_end.translation + np.array([0.0, 0.1, -0.05])
problem = sm.Problem(
    panda,
    sm.Line(panda.pose(start), line_end, 3.0),
    start=start,
    costs=[sm.JointVelocity(), sm.FunctionCost(elbow_down, name="elbow")],
)
plan = sm.plan(problem)
for name, before in plan.report.initial_terms.items():
    print(f"{name}: {before:.4f} → {plan.report.terms[name]:.4f}")
print(plan.certificate.verdict)
