"""A Panda on a base that drives: a planar joint is x, y and a turn, and the base drives along."""

from pathlib import Path

import numpy as np

import selfmotion as sm

BASE = """
<robot name="base">
  <link name="floor"/>
  <link name="deck"/>
  <joint name="drive" type="planar">
    <parent link="floor"/> <child link="deck"/> <origin xyz="0 0 0.4"/> <axis xyz="0 0 1"/>
    <limit lower="-5" upper="5" velocity="0.5" effort="500"/>
  </joint>
</robot>"""

file = Path("out") / "base.urdf"
file.parent.mkdir(exist_ok=True)
file.write_text(BASE)
robot = sm.load_robot(
    {"base": file, "arm": "panda"}, on={"arm": "base/deck"}, tool="arm/panda_hand_tcp"
)
print(f"{robot.dof} joints, of which the base has {', '.join(robot.joint_names[:3])}")

begin = np.concatenate([[0.0, 0.0, 0.0], sm.NAMED_ARMS["panda"].home])
first = robot.pose(begin)
last = first.copy()
# A seam beside the base, twice as long as the arm reaches.
last.translation = first.translation + np.array([0.0, 1.8, 0.0])
seam = sm.paths.Feed(sm.paths.Line(first, last, duration=1.0), 0.15)
# A metre of the base is to count as 3 rad of a joint.
weights = [3.0**2] * 2 + [1.0] * 8
problem = sm.Problem(
    robot, seam, task="pointing", start=begin, costs=[sm.costs.JointVelocity(weight=weights)]
)
plan = sm.plan(problem).require()
x, y, yaw = plan.trajectory.q[:, :3].T
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(f"the tool goes 1.80 m, the base {np.ptp(y):.2f} m and turns by {np.ptp(yaw):.2f} rad")
print(plan.certificate.verdict)
