"""A Panda on a rail: one prismatic joint more, and a seam that the arm alone cannot reach."""

from pathlib import Path

import numpy as np

import selfmotion as sm

RAIL = """
  <link name="rail"/>
  <joint name="slide" type="prismatic">
    <parent link="rail"/> <child link="panda_link0"/> <axis xyz="0 1 0"/>
    <limit lower="-0.8" upper="0.8" velocity="0.5" effort="2000"/>
  </joint>
</robot>"""

panda = sm.load_robot("panda")
file = Path("out") / "panda_on_rail.urdf"
file.parent.mkdir(exist_ok=True)
# The file is not where its meshes are: their addresses become absolute.
text = panda.urdf.text.replace("package://", f"{panda.urdf.package_dirs[0]}/")
file.write_text(text.replace("</robot>", RAIL))
arm = sm.load_robot(file, tool="panda_hand_tcp", lock=panda.locked)
print(f"{arm.name}: {arm.dof} joints, the first is '{arm.joint_names[0]}'")

begin = np.concatenate([[-0.5], sm.NAMED_ARMS["panda"].home])
first = arm.pose(begin)
last = first.copy()
last.translation = first.translation + np.array([0.0, 1.2, 0.0])
seam = sm.Line(first, last, duration=8.0)
# A metre of the rail is to count as 3 rad of a joint.
weights = [3.0**2] + [1.0] * 7
problem = sm.Problem(arm, seam, start=begin, costs=[sm.JointVelocity(weight=weights)])
plan = sm.plan(problem).require()
slide = plan.trajectory.q[:, 0]
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(f"the tool goes 1.20 m, the slide {np.ptp(slide):.2f} m")
print(plan.certificate.verdict)
