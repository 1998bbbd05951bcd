"""A path that no continuous motion follows: in the fewest parts, with moves in between."""

import numpy as np

import selfmotion as sm

arm = sm.load_robot("planar_3r")
# The shoulder turns by a bit more than once, elbow and wrist hardly: a hose runs along the arm.
lower, upper = [-3.2, 0.5, 0.1], [3.2, 1.1, 0.9]
# Round a tank twice and a half.
angle = np.linspace(0.0, 5.0 * np.pi, 160)
first = arm.pose([-3.2, 0.8, 0.5]).translation
turned = np.arctan2(first[1], first[0]) + angle
round_and_round = np.hypot(*first[:2]) * np.stack([np.cos(turned), np.sin(turned), 0 * turned], 1)
problem = sm.Problem(
    arm,
    sm.paths.Waypoints(2.0 * angle, round_and_round),
    task="planar",
    constraints=[
        sm.constraints.JointPositionLimits(lower, upper),
        sm.constraints.JointVelocityLimits(2.0),
        sm.constraints.JointAccelerationLimits(10.0),
    ],
)
parts = sm.plan_in_parts(problem).require()
for number, (plan, begins) in enumerate(zip(parts.plans, parts.begins, strict=True), 1):
    q = plan.trajectory.q[[0, -1], 0]
    print(f"part {number} from t = {begins:.2f} s: shoulder from {q[0]:.2f} to {q[1]:.2f} rad")
for cut, move, ending in zip(parts.cuts, parts.moves, parts.endings, strict=True):
    print(f"cut at {cut:.2f} s of the path, {move.trajectory.duration:.2f} s to go on: {ending}")
print(f"in all {parts.trajectory.duration:.2f} s, {parts.verdict}")
