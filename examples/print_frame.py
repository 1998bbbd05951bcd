"""Strokes of a pyramid, extruded one after the other: what is made stands in the way."""

import itertools

import numpy as np
import pinocchio as pin

import selfmotion as sm

# A nozzle of 80 mm, held by the hand; its tip is the tool.
offset = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.08]))
nozzle = sm.obstacles.Capsule("nozzle", [0.0, 0.0, -0.04], 0.003, 0.07)
arm = sm.load_robot("panda", "panda_hand_tcp", tool_offset=offset, bodies=[nozzle])

top = np.array([0.5, 0.0, 0.14])
feet = [
    top + np.array([0.05 * x, 0.05 * y, -0.06]) for x, y in [(1, 1), (-1, 1), (-1, -1), (1, -1)]
]


def pole(name: str, first: np.ndarray, last: np.ndarray) -> sm.obstacles.Capsule:
    """Return what stands there of a stroke: its middle, since others are joined to its ends."""
    along = (last - first) / np.linalg.norm(last - first)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along).toRotationMatrix()
    length = float(np.linalg.norm(last - first)) - 0.03
    return sm.obstacles.Capsule(name, pin.SE3(turn, 0.5 * (first + last)), 0.0015, length)


ends = [*itertools.pairwise([*feet, feet[0]]), *((foot, top) for foot in feet)]
down = np.diag([1.0, -1.0, -1.0])
seams = [
    sm.Seam(
        f"stroke {k}",
        sm.paths.Line(
            pin.SE3(down, first), pin.SE3(down, last), np.linalg.norm(last - first) / 0.02
        ),
        "position",
        # The nozzle leans by up to 45 degrees; turning about it is free.
        constraints=[sm.constraints.Tilt(arm.tool, within=np.pi / 4)],
        # The four that rise to the top stand on those of the ground.
        after=[] if k < 4 else [f"stroke {(k - 4) % 4}", f"stroke {(k - 5) % 4}"],
        leaves=[pole(f"pole {k}", first, last)],
    )
    for k, (first, last) in enumerate(ends)
]
program = sm.plan_job(
    arm, seams, branches=1, clearance=sm.constraints.Clearance(distance=1e-3)
).require()
print(program)
print(f"stroke by stroke: {', '.join(name.removeprefix('stroke ') for name in program.order)}")
last = program.plans[program.order[-1]]
print(f"the last one keeps clear of {len(last.obstacles)} others: {last.certificate.verdict}")
