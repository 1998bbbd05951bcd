"""A Panda on a circle: plan, look at the numbers, save, replay."""

from pathlib import Path

import selfmotion as sm
from selfmotion.replay import write_replay

out = Path("out")
panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), radius=0.15, duration=4.0, normal=(1, 0, 0))
plan = sm.plan(sm.Problem(panda, circle, task="position", start=start))
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
plan.save(out / "quickstart.npz")
write_replay(plan, out / "quickstart.html")
