"""A part in the left hand, a tool in the right one: the path rides on the part."""

import selfmotion as sm

robot = sm.load_robot("baxter", tool="right_gripper", reference="left_gripper")
print(f"{robot.dof} joints move the right hand as the left one sees it")

# Where both hands are in front of the body, the right one 10 cm before the left one's palm.
left = sm.load_robot("baxter")
part = left.pose(left.dexterous_configuration("position"))
start = robot.dexterous_configuration("pose")
first = robot.pose(start)
path = sm.Circle.around(first, radius=0.05, duration=6.0, normal=first.rotation[:, 2])
plan = sm.plan(sm.Problem(robot, path, start=start)).require()
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
