"""Twelve seams of a frame on a table that tilts and turns, as one program."""

import numpy as np
import pinocchio as pin

import selfmotion as sm

cell = sm.load_robot(
    {"arm": "panda", "table": "positioner"},
    base={"table": pin.SE3(np.eye(3), np.array([0.55, 0.0, 0.0]))},
    tool="arm/panda_hand_tcp",
    reference="table/plate",
)


def corner(angle: float, radius: float) -> pin.SE3:
    """Return the torch at a place on the plate, pointing down onto it, in the plate's frame."""
    place = [radius * np.cos(angle), radius * np.sin(angle), 0.04]
    return pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array(place))


# Three short welds at each of the four corners of a square frame on the plate.
seams = []
for k, angle in enumerate(np.radians([45, 135, 225, 315])):
    for part, (near, far) in enumerate([(0.08, 0.11), (0.11, 0.14), (0.14, 0.17)]):
        line = sm.paths.Line(corner(angle, near), corner(angle, far), 3.0)
        # From the inside out, so that the frame does not warp: each after the one before.
        after = [f"corner {k}, {part - 1}"] if part else []
        events = [("arc on", 0.0), ("arc off", 3.0)]
        seams.append(sm.Seam(f"corner {k}, {part}", line, "pointing", after=after, events=events))

program = sm.plan_job(cell, seams, branches=1).require()
print(program)
longest = max((step for step in program.steps if not step.is_seam), key=lambda s: s.motion.duration)
print(f"the longest move: {longest.name}, {longest.motion.duration:.2f} s")
print(f"made from their end: {sum(step.turned for step in program.steps)} seams")
time, seam, event = program.events[0]
print(f"at {time:.2f} s, {seam}: {event}")
