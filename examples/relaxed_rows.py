"""What it is worth to relax rows of the tool's motion: a Panda on a circle of 0.15 m in 4 s."""

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), 0.15, 4.0, normal=(1.0, 0.0, 0.0))

variants = {
    "the whole pose": [],
    "± 5 mm along the tool axis": [sm.Relaxation("z", 5e-3, axes="tool")],
    "a cone of 0.2 rad": [sm.Relaxation(("rx", "ry"), 0.2)],
    "any turn about the axis from 1 to 3 s": [sm.Relaxation("rz", during=(1.0, 3.0))],
    "rotation free": [sm.Relaxation(("rx", "ry", "rz"))],
}
for name, relaxations in variants.items():
    plan = sm.plan(sm.Problem(panda, circle, start=start, relaxations=relaxations)).require()
    used = ", ".join(f"{worst.name} {worst.value:.3g}" for worst in plan.certificate.deviations)
    print(f"{name:<38} cost {plan.report.cost:.4f}   largest deviation: {used or 'none'}")
