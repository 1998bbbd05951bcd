"""Other works beside ours on the sample problem: cost and joint speeds of each."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import selfmotion as sm

problem = sm.sample_problem()
ours = sm.plan(problem)
plans = {
    "pseudo-inverse": sm.plan_by(problem, sm.baselines.PseudoInverse()),
    "gradient projection": sm.plan_by(problem, sm.baselines.GradientProjection(gain=1.25)),
    "ours, 4 coefficients": ours,
    "Lagrangian optimum": sm.plan_by(problem, sm.baselines.LagrangianOptimum(ours)),
}
figure = Figure(figsize=(6, 4), layout="constrained")
axes = figure.subplots()
for name, plan in plans.items():
    speed = np.linalg.norm(plan.trajectory.qd, axis=1)
    axes.plot(plan.trajectory.t, speed, label=f"{name}: {plan.report.cost:.3f}")
    print(f"{name}: cost {plan.report.cost:.4f}, {plan.certificate.verdict}")
axes.set(xlabel="t [s]", ylabel="|q̇| [rad/s]", title="the sample problem, by four methods")
axes.legend()
Path("out").mkdir(exist_ok=True)
figure.savefig("out/study_other_works.png")
