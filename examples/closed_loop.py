"""A circle to be repeated for ever: the arm ends as it began, as tracking alone does not."""

import numpy as np

import selfmotion as sm

panda = sm.load_robot("panda")
home = np.array(sm.NAMED_ARMS["panda"].home)
circle = sm.paths.Circle.around(panda.pose(home), radius=0.15, duration=5.0, normal=(1, 0, 0))
problem = sm.Problem(
    panda,
    circle,
    task="pointing",
    start=home,
    constraints=[
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.ClosedPath(),
    ],
)
tracked = sm.plan_by(problem, sm.baselines.PseudoInverse())
plan = sm.plan(problem).require()
for name, each in {"pseudo-inverse": tracked, "plan": plan}.items():
    drift = np.abs(each.trajectory.q[-1] - each.trajectory.q[0]).max()
    print(f"{name}: cost {each.report.cost:.4f}, a joint is {drift:.2e} rad off after one round")
for price in plan.report.active:
    print(f"closing costs {price.saving:.2e}: {price.easing}")
print(plan.certificate.verdict)
