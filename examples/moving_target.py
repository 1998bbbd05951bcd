"""A Panda keeps up with a part on a conveyor; it is pushed, and a ball comes near its elbow.

The arm is simulated: it answers late, and is measured with noise.
"""

from pathlib import Path

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion import realtime
from selfmotion.replay import write_replay

panda = sm.load_robot("panda")
START = np.array(sm.NAMED_ARMS["panda"].home)
BALL = np.array([-0.15, 0.19, 0.61])


class Part:
    """A part that the conveyor carries along y, and takes back: a circle is drawn on it."""

    circle = sm.paths.Circle.around(panda.pose(START), 0.05, 100.0, normal=(0, 0, 1), turns=20)

    def path(self, t):
        """Where the part is, and how fast: what a camera would tell."""
        place, speed = 0.1 * np.sin(0.5 * t), 0.05 * np.cos(0.5 * t)
        along = np.array([0.0, 1.0, 0.0])
        return realtime.Conveyed(self.circle, speed * along, (place - speed * t) * along)

    def obstacles(self, t):
        """The ball comes down from above."""
        return {"ball": pin.SE3(np.eye(3), BALL + np.array([0.0, 0.0, max(0.0, 0.5 - 0.1 * t)]))}

    def pushed(self, t):
        """Someone leans on the arm for a second."""
        lean = np.clip(5.0 * min(t - 4.0, 5.0 - t) + 0.5, 0.0, 1.0)
        return 0.02 * lean * np.array([1, -1, 1, -1, 1, -1, 1])


constraints = [
    sm.constraints.JointPositionLimits(),
    sm.constraints.JointVelocityLimits(),
    sm.constraints.JointAccelerationLimits(),
    sm.constraints.Clearance([sm.obstacles.Sphere("ball", BALL, 0.06)], distance=0.005),
]
# Plans anew every 10 ms, from where the arm is.
replanner = realtime.Replanner(panda, "pose", constraints=constraints, horizon=2.0)
realtime.warm_up(replanner)
arm = realtime.SimulatedArm(START, replanner.cycle, realtime.Plant(lag=0.01, delay=2e-3))
record = realtime.track(replanner, arm, Part(), 8.0)

took = 1e3 * np.quantile(record.seconds, [0.5, 0.99])
before = record.error[(record.t > 1.0) & (record.t < 3.8), 0].max()
print(f"{len(record.t)} steps; half of them took {took[0]:.2f} ms or less, 99 % {took[1]:.2f} ms")
print(f"tool error: {1e3 * before:.3f} mm, and {1e3 * record.error[-1, 0]:.3f} mm at the end")
print(f"segments: {dict(record.flags)}")

shown = record.as_plan(replanner, constraints=[constraints[0], constraints[3]])
print("wrote", write_replay(shown, Path("moving_target.html"), title="A moving target"))
