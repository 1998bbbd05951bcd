"""placo: a local tracker, one quadratic program per sub-step."""

import numpy as np
import placo
from common import panda_urdf, report, rotation, start, waypoints

PATH = "panda__1cube"
t, positions, quaternions = waypoints(PATH)
robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, panda_urdf())
names = [f"panda_joint{k}" for k in range(1, 8)]


def set_joints(q: np.ndarray) -> None:
    for name, value in zip(names, q, strict=True):
        robot.set_joint(name, float(value))
    robot.update_kinematics()


def track(sub_steps: int) -> np.ndarray:
    # --8<-- [start:follow]
    set_joints(start())
    solver = placo.KinematicsSolver(robot)
    solver.mask_fbase(True)
    solver.enable_joint_limits(True)
    frame = np.eye(4)
    task = solver.add_frame_task("panda_hand", frame)
    task.configure("tool", "soft", 1.0, 1.0)
    solver.add_regularization_task(1e-6)
    motion = []
    for position, quaternion in zip(positions, quaternions, strict=True):
        frame[:3, :3], frame[:3, 3] = rotation(quaternion), position
        task.T_world_frame = frame
        for _ in range(sub_steps):
            solver.solve(True)
            robot.update_kinematics()
        motion.append([robot.get_joint(name) for name in names])
    # --8<-- [end:follow]
    return np.array(motion)


for steps in (1, 5):
    report("placo", f"{steps} sub-steps per waypoint", lambda n=steps: track(n))
