"""Six joints are enough where the turn about the tool's axis is free: a UR5 with a bent torch."""

import numpy as np

import selfmotion as sm

# Bent by 45°, so that the free turn is not that of the last joint alone.
c = np.sqrt(0.5)
torch = [[c, 0, c, 0.1], [0, 1, 0, 0], [-c, 0, c, 0.1], [0, 0, 0, 1]]
ur5 = sm.load_robot("ur5", tool_offset=torch)
start = ur5.dexterous_configuration("pointing")
circle = sm.paths.Circle.around(ur5.pose(start), radius=0.06, duration=4.0)
try:
    sm.Problem(ur5, circle)
except sm.errors.RedundancyError as error:
    print(error)

for name, configuration in {"from this start": start, "from the best one": None}.items():
    plan = sm.plan(sm.Problem(ur5, circle, task="pointing", start=configuration)).require()
    fastest = plan.certificate.velocity_ratio
    print(
        f"{name}: cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}, "
        f"{fastest.name} reaches {100 * fastest.value:.0f} % of its speed"
    )
print(plan.certificate.verdict)
