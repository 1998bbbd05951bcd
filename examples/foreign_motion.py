"""A motion that something else made, judged by the same certificate: inverse kinematics."""

from pathlib import Path

import numpy as np

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), radius=0.15, duration=4.0, normal=(1, 0, 0))

# What many programs do: inverse kinematics from point to point, each from the one before.
t = np.linspace(0.0, 4.0, 21)
q = [start]
for time in t[1:]:
    q.append(panda.inverse_kinematics(circle.pose(time), "pose", seed=q[-1]))
rows = [",".join(["t", *panda.joint_names])]
rows += [",".join(map(repr, row)) for row in np.column_stack([t, q]).tolist()]
file = Path("out") / "motion.csv"
file.parent.mkdir(exist_ok=True)
file.write_text("\n".join(rows) + "\n")

motion = sm.files.read_motion(file)
for tolerance in (1e-6, 1e-3):
    certificate = sm.certify(panda, circle, "pose", motion, sm.Tolerance(tolerance, tolerance))
    print(f"to {1e3 * tolerance:g} mm: {certificate.verdict}")
worst = certificate.position_error
print(f"worst between the points: {1e3 * worst.value:.3f} mm at {worst.time:.3f} s")
