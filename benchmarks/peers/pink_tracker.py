"""pink: a local tracker, one quadratic programme per sub-step.

Its task for joint velocities keeps them small, which is what is measured here; its task for a
posture, which its introduction takes, draws the arm elsewhere at a cost.
"""

import numpy as np
import pink
import pinocchio as pin
from common import panda_urdf, report, rotation, start, waypoints
from pink.tasks import DampingTask, FrameTask

PATH = "panda__1cube"
t, positions, quaternions = waypoints(PATH)
whole = pin.buildModelFromXML(panda_urdf())
fingers = [k for k, name in enumerate(whole.names) if "finger" in name]
model = pin.buildReducedModel(whole, fingers, pin.neutral(whole))


def track(sub_steps: int) -> np.ndarray:
    # --8<-- [start:follow]
    arm = pink.Configuration(model, model.createData(), start())
    hand = FrameTask("panda_hand", position_cost=1.0, orientation_cost=1.0)
    slow = DampingTask(cost=1e-4)
    step, motion = (t[1] - t[0]) / sub_steps, []
    for position, quaternion in zip(positions, quaternions, strict=True):
        hand.set_target(pin.SE3(rotation(quaternion), position))
        for _ in range(sub_steps):
            speeds = pink.solve_ik(arm, [hand, slow], step, solver="daqp")
            arm.integrate_inplace(speeds, step)
        motion.append(arm.q.copy())
    # --8<-- [end:follow]
    return np.array(motion)


for steps in (1, 5):
    report("pink", f"{steps} sub-steps per waypoint", lambda n=steps: track(n))
