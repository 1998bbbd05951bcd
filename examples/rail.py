"""A Panda on a rail: one prismatic joint more, and a seam that the arm alone cannot reach."""

from pathlib import Path

import numpy as np

import selfmotion as sm

RAIL = """
<robot name="rail">
  <link name="rail"/>
  <link name="carriage"/>
  <joint name="slide" type="prismatic">
    <parent link="rail"/> <child link="carriage"/> <axis xyz="0 1 0"/>
    <limit lower="-0.8" upper="0.8" velocity="0.5" effort="2000"/>
  </joint>
</robot>"""

file = Path("out") / "rail.urdf"
file.parent.mkdir(exist_ok=True)
file.write_text(RAIL)
cell = sm.load_robot(
    {"rail": file, "arm": "panda"}, on={"arm": "rail/carriage"}, tool="arm/panda_hand_tcp"
)
print(f"{cell.name}: {cell.dof} joints, the first is '{cell.joint_names[0]}'")

begin = np.concatenate([[-0.5], sm.NAMED_ARMS["panda"].home])
first = cell.pose(begin)
last = first.copy()
last.translation = first.translation + np.array([0.0, 1.2, 0.0])
seam = sm.paths.Line(first, last, duration=8.0)
# A metre of the rail is to count as 3 rad of a joint.
weights = [3.0**2] + [1.0] * 7
problem = sm.Problem(cell, seam, start=begin, costs=[sm.costs.JointVelocity(weight=weights)])
plan = sm.plan(problem).require()
slide = plan.trajectory.q[:, 0]
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(f"the tool goes 1.20 m, the slide {np.ptp(slide):.2f} m")
print(plan.certificate.verdict)
