"""A part in the left hand, a tool in the right one: the path rides on the part."""

import selfmotion as sm

robot = sm.load_robot("baxter", tool="right_gripper", reference="left_gripper")
print(f"{robot.dof} joints move the right hand as the left one sees it")

# The path is a circle before the palm, as the left hand sees it.
start = robot.dexterous_configuration("pose")
first = robot.pose(start)
path = sm.paths.Circle.around(first, radius=0.05, duration=6.0, normal=first.rotation[:, 2])
plan = sm.plan(sm.Problem(robot, path, start=start)).require()
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
