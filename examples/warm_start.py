"""Planning again from a plan: after the path has moved a little, or has become slower."""

from dataclasses import replace

import numpy as np

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), radius=0.15, duration=4.0, normal=(1, 0, 0))
problem = sm.Problem(panda, circle, task="position")  # the start is free: many are tried
plan = sm.plan(problem).require()
print(f"first: cost {plan.report.cost:.4f} in {plan.report.evaluations} evaluations")

shift = np.eye(4)
shift[:3, 3] = [0.0, 0.02, -0.01]
for name, path in {
    "the same": circle,
    "20 mm beside": sm.paths.Placed(circle, shift),
    "in 6 s": replace(circle, duration=6.0),
}.items():
    again = sm.plan(replace(problem, path=path), warm_start=plan).require()
    print(f"{name}: cost {again.report.cost:.4f} in {again.report.evaluations} evaluations")
