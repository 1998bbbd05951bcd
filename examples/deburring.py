"""Deburring an edge: the tool may tilt by 15°, and turns about its axis at will."""

import numpy as np

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
corner = panda.pose(start)

# Along an edge, up a chamfer, at rest in the corner between them.
t = [0.0, 3.0, 5.0]
offsets = np.array([[0.0, 0.0, 0.0], [0.0, -0.15, 0.0], [-0.05, -0.2, 0.05]])
poses = []
for offset in offsets:
    pose = corner.copy()
    pose.translation = corner.translation + offset
    poses.append(pose)
edge = sm.paths.section_at_rest(sm.paths.Waypoints.from_poses(t, poses, corners="stop"), ramp=0.4)

tilts = {
    "tool square to the edge": [],
    "turning about its axis": [sm.Relaxation("rz")],
    "and tilting by up to 15°": [sm.Relaxation("rz"), sm.Relaxation(("rx", "ry"), np.radians(15))],
}
for name, relaxations in tilts.items():
    plan = sm.plan(sm.Problem(panda, edge, start=start, relaxations=relaxations)).require()
    used = {worst.name: f"{np.degrees(worst.value):.1f}°" for worst in plan.certificate.deviations}
    print(f"{name}: cost {plan.report.cost:.4f}, used {used or 'nothing'}")
