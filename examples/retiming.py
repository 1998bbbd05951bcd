"""As fast as the joints allow: the same joint path in the least time within limits."""

import numpy as np

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), radius=0.15, duration=6.0, normal=(1, 0, 0))
plan = sm.plan(sm.Problem(panda, circle, task="position", start=start)).require()
fast = sm.retime(plan, acceleration=5.0)
for name, each in {"planned": plan, "retimed": fast}.items():
    motion = each.trajectory
    print(
        f"{name}: {motion.duration:.2f} s, at most {np.abs(motion.qd).max():.2f} rad/s and "
        f"{np.abs(motion.extremes(2)[1]).max():.2f} rad/s²"
    )
print(fast.certificate.verdict)
