"""A bent torch round a tube on a table that tilts and turns: bodies that ride on links."""

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import selfmotion as sm

# The torch in the frame of the flange: gun, bent neck, and where the wire meets the seam.
bent = pin.rpy.rpyToMatrix(0.0, np.radians(40.0), 0.0)
elbow = np.array([0.0, 0.0, 0.28])
torch = [
    sm.obstacles.Box("gun", [0.0, 0.0, 0.08], [0.08, 0.08, 0.16]),
    sm.obstacles.Cylinder("neck", [0.0, 0.0, 0.22], radius=0.015, length=0.12),
    sm.obstacles.Cylinder(
        "nozzle", pin.SE3(bent, elbow + 0.05 * bent[:, 2]), radius=0.012, length=0.1
    ),
]
cell = sm.load_robot(
    {"arm": "ur10", "table": "positioner"},
    base={"table": pin.SE3(np.eye(3), np.array([0.8, 0.0, 0.0]))},
    tool="arm/tool0",
    tool_offset=pin.SE3(bent, elbow + 0.115 * bent[:, 2]),
    bodies=torch,
    reference="table/plate",
)

# The part is clamped to the plate, and moves with it.
part = [
    sm.obstacles.Cylinder("tube", [0.0, 0.0, 0.09], radius=0.08, length=0.16, frame="table/plate"),
    sm.obstacles.Box("clamp", [0.19, 0.0, 0.035], [0.06, 0.06, 0.05], frame="table/plate"),
]

# The seam goes round the foot of the tube; the torch points into the corner at 45 degrees.
angle, same = np.linspace(0.0, 2.0 * np.pi, 25), np.ones(25)
seam = np.stack([0.081 * np.cos(angle), 0.081 * np.sin(angle), 0.011 * same], axis=1)
turns = Rotation.from_euler("ZY", np.stack([angle, np.radians(-135.0) * same], axis=1))
path = sm.paths.Feed(sm.paths.Waypoints(angle, seam, turns), 0.04)

problem = sm.Problem(
    cell,
    path,
    task="pointing",  # turning about the wire is free
    constraints=[
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        # The wire points downwards within 50 degrees: the weld pool stays where it is.
        sm.constraints.Tilt("arm/tool0_offset", "z", within=np.radians(50.0)),
    ],
    clearance=sm.constraints.Clearance(part, distance=2e-3),
)
plan = sm.plan(problem).require()
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
for name, near in plan.approaches.items():
    print(f"closest to {name}: {1e3 * near.value:.1f} mm, {near.name}, at {near.time:.2f} s")
