"""Out to ROS 2: a JointTrajectory at 100 Hz, read back and judged as the controller will run it."""

from pathlib import Path

import yaml

import selfmotion as sm

panda = sm.load_robot("panda")
start = panda.dexterous_configuration()
circle = sm.paths.Circle.around(panda.pose(start), radius=0.1, duration=4.0, normal=(1, 0, 0))
problem = sm.Problem(panda, circle, start=start)
plan = sm.plan(problem).require()

file = Path("out") / "trajectory.yaml"
sm.files.write_motion(plan, file, rate=100)
message = yaml.safe_load(file.read_text())
print(f"joints: {', '.join(message['joint_names'])}")
print(f"{len(message['points'])} points; the second one:")
for key, value in message["points"][1].items():
    print(f"  {key}: {value}")

# What the controller makes of these points: quintic splines through them.
found = problem.certify(sm.files.read_motion(file), plan.tolerance)
print(found.verdict)
for rate in (10, 25, 50):
    sm.files.write_motion(plan, file, rate=rate)
    miss = problem.certify(sm.files.read_motion(file), plan.tolerance).position_error.value
    print(f"at {rate} Hz: at most {1e6 * miss:.3f} µm off the path")
