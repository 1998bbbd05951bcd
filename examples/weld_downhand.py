"""A ring on a cone, welded downhand: the table turns once round, the torch stays upright."""

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import selfmotion as sm

cell = sm.load_robot(
    {"arm": "ur10", "table": "positioner"},
    base={"table": pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.1]))},
    tool="arm/tool0",
    tool_offset=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.3])),
    reference="table/plate",
)

# In the frame of the plate: the torch is square to the cone, 40 degrees off the axis of the ring.
lean = 0.7
angle, same = np.linspace(0.0, 2.0 * np.pi, 97), np.ones(97)
ring = np.stack([0.08 * np.cos(angle), 0.08 * np.sin(angle), 0.06 * same], axis=1)
square = Rotation.from_euler("ZY", np.stack([angle, (np.pi + lean) * same], axis=1))
path = sm.paths.Waypoints(12.0 * angle / angle[-1], ring, square)

problem = sm.Problem(
    cell,
    path,
    task="pointing",  # turning about the wire is free
    constraints=[
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        # Downhand: the wire points downwards within 3 degrees, so that the part has to turn.
        sm.constraints.Tilt("arm/tool0", "z", within=np.radians(3.0)),
    ],
    rest=False,
)
plan = sm.plan(problem).require()
table = plan.trajectory.q[:, -2:]
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(
    f"the table tilts to {np.abs(table[:, 0]).max():.2f} rad and turns by "
    f"{np.ptp(table[:, 1]):.2f} rad"
)
print(plan.certificate.verdict)
