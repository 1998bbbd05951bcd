"""A seam in the corner of a frame of square bars that is one STL: the torch reaches in."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import selfmotion as sm

HERE = Path(__file__).parent

# Twelve bars of 40 mm, as a CAD system wrote them: one closed mesh, all of it hollow.
place = pin.SE3(np.eye(3), np.array([0.30, -0.25, 0.02]))
frame = sm.obstacles.Mesh("frame", place, HERE / "frame.stl")
torch = sm.obstacles.Cylinder("torch", [0.0, 0.0, 0.165], 0.01, 0.13, frame="panda_hand")
panda = sm.load_robot("panda", tool_offset=pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.15])))

# Round the foot of an upright bar, seen from within the frame: 4 mm off, 45 degrees downwards.
along = np.array([0.5, 0.5, -np.sqrt(0.5)])
across = np.array([-np.sqrt(0.5), np.sqrt(0.5), 0.0])
turn = np.column_stack([across, np.cross(along, across), along])
corners = np.array([[0.46, 0.395, 0.04], [0.46, 0.36, 0.04], [0.495, 0.36, 0.04]]) - 0.004 * along
poses = [pin.SE3(turn, corner) for corner in corners]
seam = sm.paths.Placed(
    sm.paths.Feed(sm.paths.Polyline.from_poses(poses, tolerance=1e-3), 0.01), place
)

problem = sm.Problem(
    panda,
    seam,
    task="pointing",
    constraints=[sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()],
    clearance=sm.constraints.Clearance([frame, torch], distance=2e-3),
)
plan = sm.plan(problem).require()
print(f"cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
near = plan.approaches["frame"]
print(f"closest to the frame: {1e3 * near.value:.1f} mm, {near.name}, at {near.time:.2f} s")
