"""Painting a panel in lanes: where the gun points is prescribed, how it is turned is not."""

import numpy as np

import selfmotion as sm

LANES, WIDTH, PITCH, SPEED = 4, 0.3, 0.05, 0.2  # -, m, m, m/s

xarm = sm.load_robot("xarm7")
gun = xarm.dexterous_configuration("pointing")
middle = xarm.pose(gun)

# Lanes to and fro across the tool's own plane, the gun square to it.
corners = []
for lane in range(LANES):
    side = -1.0 if lane % 2 else 1.0
    height = PITCH * (lane - 0.5 * (LANES - 1))
    corners += [[height, -0.5 * side * WIDTH, 0.0], [height, 0.5 * side * WIDTH, 0.0]]
points = np.array(corners) @ middle.rotation.T + middle.translation
length = np.linalg.norm(np.diff(points, axis=0), axis=1)
times = np.concatenate([[0.0], np.cumsum(np.maximum(length / SPEED, 0.5))])
poses = []
for point in points:
    pose = middle.copy()
    pose.translation = point
    poses.append(pose)
lanes = sm.paths.section_at_rest(
    sm.paths.Waypoints.from_poses(times, poses, corners="stop"), ramp=0.4
)

for task in ("pose", "pointing"):
    problem = sm.Problem(xarm, lanes, task=task)
    plan = sm.plan(problem, search=sm.Search(starts=12, finalists=2))
    fastest = plan.certificate.velocity_ratio
    print(
        f"{task}: redundancy {xarm.redundancy(task)}, cost {plan.report.cost:.4f}, "
        f"{fastest.name} reaches {100 * fastest.value:.0f} % of its speed"
    )
    print(f"  {plan.certificate.verdict}")
