"""A seam on a table that tilts and turns: arm and table move together, the seam kept flat."""

import numpy as np
import pinocchio as pin

import selfmotion as sm

cell = sm.load_robot(
    {"arm": "panda", "table": "positioner"},
    base={"table": pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))},
    tool="arm/panda_hand_tcp",
    reference="table/plate",
)
print(f"{cell.dof} joints: {', '.join(cell.joint_names)}")

# A ring on the plate, in the plate's own frame: the torch points down onto it.
down = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.1, 0.0, 0.03]))
ring = sm.paths.Circle.around(down, radius=0.1, duration=12.0, normal=(0, 0, 1))
problem = sm.Problem(
    cell,
    ring,
    task="pointing",  # turning about the torch is free
    # The table is heavy: a radian of it counts as four of the arm.
    costs=[sm.costs.JointVelocity(cell.part_weights({"table": 16.0}))],
    constraints=[
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        # The weld pool lies flat: the plate's normal stays within 10 degrees of upwards.
        sm.constraints.Tilt("table/plate", "z", within=np.radians(10.0), towards=(0, 0, 1)),
    ],
)
plan = sm.plan(problem).require()
table = plan.trajectory.q[:, -2:]
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(
    f"the table tilts by {np.ptp(table[:, 0]):.2f} rad and turns by {np.ptp(table[:, 1]):.2f} rad"
)
print(plan.certificate.verdict)
