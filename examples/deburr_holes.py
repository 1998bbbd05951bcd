"""Edges of four holes in a panel, deburred in the best order, coming and going along the tool."""

import numpy as np
import pinocchio as pin

import selfmotion as sm

xarm = sm.load_robot("xarm7")
down = np.diag([1.0, -1.0, -1.0])
panel = sm.obstacles.Box("panel", [0.45, 0.0, 0.19], [0.4, 0.4, 0.02])

seams = []
for row in range(2):
    for column in range(2):
        center = np.array([0.35 + 0.1 * row, -0.05 + 0.1 * column, 0.24])
        start = pin.SE3(down, center + np.array([0.012, 0.0, 0.0]))
        edge = sm.paths.Circle(start, center, (0, 0, 1), 3.0)
        path = sm.paths.with_leads(edge, 0.03, 0.8)
        seams.append(sm.Seam(f"hole {row}{column}", path, "pointing", either_way=False))

start = xarm.inverse_kinematics(pin.SE3(down, np.array([0.3, 0.0, 0.45])))
program = sm.plan_job(
    xarm,
    seams,
    start=start,
    end=start,
    branches=1,
    clearance=sm.constraints.Clearance([panel], distance=5e-3),
).require()
print(program)
print(
    f"moves take {program.transfer_time:.2f} s, in no other order less than {program.bound:.2f} s"
)
