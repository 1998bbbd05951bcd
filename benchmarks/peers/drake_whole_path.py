"""Drake: a local tracker (DiffIK), and the whole path as one nonlinear program.

A pose is six rows of Drake's own constraints of position: the hand's origin is that of the target,
a point of its x axis is on the target's, one of its y axis in the target's plane of x and y.
"""

import numpy as np
from common import panda_urdf, report, rotation, start, waypoints
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DoDifferentialInverseKinematics,
    PositionConstraint,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import IpoptSolver, MathematicalProgram, SnoptSolver, SolverOptions

PATH = "panda__1cube"
TIME_LIMIT = 120.0  # [s]
FREE = np.inf
# A point of the hand [m], and how far it may be off along the target's axes.
ROWS = (
    ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ([1.0, 0.0, 0.0], [FREE, 0.0, 0.0]),
    ([0.0, 1.0, 0.0], [FREE, FREE, 0.0]),
)
t, positions, quaternions = waypoints(PATH)
plant = MultibodyPlant(0.0)
# The fingers stay as they are.
Parser(plant).AddModelsFromString(panda_urdf().replace('"prismatic"', '"fixed"'), "urdf")
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
plant.Finalize()
context = plant.CreateDefaultContext()
world, hand = plant.world_frame(), plant.GetFrameByName("panda_hand")
lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
targets = [
    RigidTransform(RotationMatrix(rotation(u)), p)
    for u, p in zip(quaternions, positions, strict=True)
]


def track(sub_steps: int) -> np.ndarray:
    q, motion = start(), []
    parameters = DifferentialInverseKinematicsParameters(
        plant.num_positions(), plant.num_velocities()
    )
    step = float(t[1] - t[0]) / sub_steps
    parameters.set_time_step(step)
    parameters.set_joint_position_limits((lower, upper))
    for target in targets:
        for _ in range(sub_steps):
            plant.SetPositions(context, q)
            result = DoDifferentialInverseKinematics(plant, context, target, hand, parameters)
            q = q + step * np.asarray(result.joint_velocities)
        motion.append(q)
    return np.array(motion)


def whole_path(solver: SnoptSolver | IpoptSolver, options: SolverOptions) -> np.ndarray:
    """Minimise Σ ½|Δq|²/Δt over all waypoints at once, poses as equality constraints."""
    # --8<-- [start:follow]
    program = MathematicalProgram()
    q = program.NewContinuousVariables(len(t), 7, "q")
    program.AddBoundingBoxConstraint(start(), start(), q[0])
    for k in range(1, len(t)):
        program.AddBoundingBoxConstraint(lower, upper, q[k])
        difference = (q[k] - q[k - 1]) / np.sqrt(t[k] - t[k - 1])
        program.AddQuadraticCost(0.5 * difference @ difference, is_convex=True)
        for point, free in ROWS:
            least, most = np.subtract(point, free), np.add(point, free)
            pose = PositionConstraint(
                plant, world, targets[k], least, most, hand, np.array(point), context
            )
            program.AddConstraint(pose, q[k])
    program.SetInitialGuess(q, track(5))
    result = solver.Solve(program, None, options)
    motion = result.GetSolution(q)
    # --8<-- [end:follow]
    return np.asarray(motion)


for steps in (1, 5):
    report("Drake DiffIK", f"{steps} sub-steps per waypoint", lambda n=steps: track(n))
for name, solver, option in (
    ("SNOPT", SnoptSolver(), "Time limit"),
    ("IPOPT", IpoptSolver(), "max_wall_time"),
):
    options = SolverOptions()
    options.SetOption(solver.solver_id(), option, TIME_LIMIT)
    report(
        f"Drake + {name}, whole path",
        f"200 × 7 variables, pose equalities, at most {TIME_LIMIT:.0f} s",
        lambda solver=solver, options=options: whole_path(solver, options),
        1,
    )
