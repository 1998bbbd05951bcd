"""A Panda follows a policy that tells poses for the next second, three times a second.

The policy is a stand-in for a learned one: it is late, and its poses are noisy. Each chunk overlaps
the one before, which holds until the new one is joined. In the end the policy stops: the arm comes
to rest.
"""

import numpy as np
import pinocchio as pin

import selfmotion as sm
from selfmotion import realtime

panda = sm.load_robot("panda")
START = np.array(sm.NAMED_ARMS["panda"].home)
EVERY, LATE, SILENT = 0.3, 0.05, 3.0  # s
rng = np.random.default_rng(0)


def policy(t):
    """Return poses every 0.1 s from when the picture was taken, and their times."""
    times = t - LATE + 0.1 * np.arange(11)
    poses = []
    for time in times:
        here = panda.pose(START)
        here.translation += [0.05 * np.sin(time), 0.1 * (1.0 - np.cos(time)), 0.0]
        here.translation += 5e-4 * rng.standard_normal(3)
        here.rotation = pin.exp3(np.array([0.0, 0.0, 0.2 * np.sin(time)])) @ here.rotation
        poses.append(here)
    return poses, times


replanner = realtime.Replanner(panda, "pose")
realtime.warm_up(replanner)
t, told, q, qd, commands = 0.0, -EVERY, START, np.zeros(7), []
while t < SILENT + 1.5:
    poses, times = None, None
    if t - told >= EVERY and t < SILENT:
        told, (poses, times) = t, policy(t)
    segment = replanner.step(t, q, qd, chunk=poses, times=times)
    t += replanner.period
    now = segment.index(t)
    q, qd = segment.q[now], segment.qd[now]  # in earnest: what is measured by then
    commands.append(segment.qdd[:now])

qdd = np.concatenate(commands)
jerk = np.abs(np.diff(qdd, axis=0) / replanner.cycle / panda.jerk_limit).max()
print(
    f"largest share of a limit of acceleration: {np.abs(qdd / panda.acceleration_limit).max():.2f}"
)
print(f"largest share of a limit of jerk: {jerk:.2f}")
print(f"at the end: {segment.flag.value}, {segment.reasons[0]}, at {np.abs(qd).max():g} rad/s")
