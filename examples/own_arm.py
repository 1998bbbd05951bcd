"""An arm of one's own: its URDF, where it stands, what it holds, and a joint that is held still."""

from pathlib import Path

import selfmotion as sm

URDF = Path(__file__).parent.parent / "robots" / "planar_3r.urdf"

# A pen of 0.2 m along the last link; the arm stands on a table of 0.8 m.
pen = [[1, 0, 0, 0.2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
table = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.8], [0, 0, 0, 1]]
arm = sm.load_robot(URDF, tool="tool", base=table, tool_offset=pen)
print(f"{arm.name}: {', '.join(arm.joint_names)} move '{arm.tool}'")
for task in sm.Task:
    if arm.can_follow(task):
        print(f"  task '{task.value}' leaves {arm.redundancy(task)} degrees of self-motion")

start = arm.dexterous_configuration("planar")
circle = sm.paths.Circle.around(arm.pose(start), radius=0.3, duration=3.0, normal=(0, 0, 1))
plan = sm.plan(sm.Problem(arm, circle, task="planar", start=start)).require()
print(plan.certificate.verdict)

held = sm.load_robot(URDF, tool="tool", lock={"joint2": 0.5})
try:
    sm.Problem(held, circle, task="planar")
except sm.errors.RedundancyError as error:
    print(f"with joint2 held: {error}")
