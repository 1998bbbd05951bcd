"""Four strokes of a paint gun at one feed from begin to end, in a program as fast as can be."""

import numpy as np

import selfmotion as sm

LENGTH, PITCH, STROKES, MOST = 0.72, 0.06, 4, 0.8  # m, m, -, m/s

ur10 = sm.load_robot("ur10")
limits = [
    sm.constraints.JointPositionLimits(),
    sm.constraints.JointVelocityLimits(),
    sm.constraints.JointAccelerationLimits(8.0),
]
# The gun points down, may lean by 15° each way, and turn about its axis as it likes.
leaning = [sm.Relaxation(("rx", "ry"), band=np.radians(15))]


def pose(x: float, y: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.diag([1.0, -1.0, -1.0]), [x, y, 0.15]
    return matrix


def plan_at(feed: float) -> sm.Program:
    seams = []
    for k, x in enumerate(0.5 + PITCH * np.arange(STROKES)):
        line = sm.paths.Line(pose(x, -0.5 * LENGTH), pose(x, 0.5 * LENGTH), 1.0)
        stroke = sm.paths.with_run_ups(sm.paths.Feed(line, feed, acceleration=4.0))
        gun = [("gun on", stroke.begin), ("gun off", stroke.end)]
        seams.append(sm.Seam(f"stroke {k + 1}", stroke.path, "pointing", leaning, events=gun))
    return sm.plan_job(ur10, seams, branches=1, constraints=limits)


found = sm.job.highest_feed(plan_at, MOST)
painting = sum(LENGTH / found.feed for _ in range(STROKES))
print(f"{found.feed:g} m/s: {found.program.verdict}")
print(f"{found.program.duration:.2f} s, {painting:.2f} s of it painting")
