"""Drake: a local tracker (DiffIK), and the whole path as one nonlinear program (SNOPT)."""

import numpy as np
from common import panda_urdf, report, rotation, start, waypoints
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

PATH = "panda__1cube"
TIME_LIMIT = 120.0  # [s]
t, positions, quaternions = waypoints(PATH)
plant = MultibodyPlant(0.0)
Parser(plant).AddModelsFromString(panda_urdf(), "urdf")
plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("panda_link0"))
plant.Finalize()
context = plant.CreateDefaultContext()
hand = plant.GetFrameByName("panda_hand")
fingers = plant.num_positions() - 7


def place(q: np.ndarray) -> None:
    plant.SetPositions(context, np.append(q, np.zeros(fingers)))


def pose(q: np.ndarray) -> np.ndarray:
    place(q)
    return hand.CalcPoseInWorld(context).GetAsMatrix4()


def targets() -> list[RigidTransform]:
    return [
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
    parameters.set_joint_position_limits(
        (plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits())
    )
    for target in targets():
        for _ in range(sub_steps):
            place(q)
            result = DoDifferentialInverseKinematics(plant, context, target, hand, parameters)
            q = q + step * np.asarray(result.joint_velocities)[:7]
        motion.append(q)
    return np.array(motion)


def jacobian(q: np.ndarray) -> np.ndarray:
    place(q)
    world = plant.world_frame()
    spatial = plant.CalcJacobianSpatialVelocity(
        context, JacobianWrtVariable.kQDot, hand, np.zeros(3), world, world
    )
    return spatial[:, :7]


def whole_path() -> np.ndarray:
    """Minimise Σ ½|Δq|²/Δt over all waypoints at once, poses as equality constraints."""
    program = MathematicalProgram()
    q = program.NewContinuousVariables(len(t), 7, "q")
    lower, upper = plant.GetPositionLowerLimits()[:7], plant.GetPositionUpperLimits()[:7]
    guess = track(5)
    program.AddBoundingBoxConstraint(start(), start(), q[0])
    for k in range(1, len(t)):
        program.AddBoundingBoxConstraint(lower, upper, q[k])
        difference = (q[k] - q[k - 1]) / np.sqrt(t[k] - t[k - 1])
        program.AddQuadraticCost(0.5 * difference @ difference, is_convex=True)
        program.AddConstraint(
            _PoseResidual(positions[k], rotation(quaternions[k])), np.zeros(6), np.zeros(6), q[k]
        )
    program.SetInitialGuess(q, guess)
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Time limit", TIME_LIMIT)
    result = SnoptSolver().Solve(program, None, options)
    return np.asarray(result.GetSolution(q))


class _PoseResidual:
    """Pose error (6,) of the hand, with its gradient for SNOPT through Drake's AutoDiff."""

    def __init__(self, position: np.ndarray, target: np.ndarray) -> None:
        self._position, self._target = position, target

    def __call__(self, q: np.ndarray) -> np.ndarray:
        from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff

        value = ExtractValue(q).ravel() if q.dtype == object else q
        actual = pose(value)
        relative = self._target @ actual[:3, :3].T
        vector = 0.5 * np.array(
            [
                relative[2, 1] - relative[1, 2],
                relative[0, 2] - relative[2, 0],
                relative[1, 0] - relative[0, 1],
            ]
        )
        error = np.concatenate([self._position - actual[:3, 3], vector])
        if q.dtype != object:
            return error
        spatial = jacobian(value)
        # ∂ of the vector part: -½ (tr(E) I - E) ω for the relative rotation E.
        turn = 0.5 * (np.trace(relative) * np.eye(3) - relative.T)
        slope = -np.vstack([spatial[3:], turn @ spatial[:3]]) @ ExtractGradient(q)
        return InitializeAutoDiff(error, slope).ravel()


for steps in (1, 5):
    report("Drake DiffIK", f"{steps} sub-steps per waypoint", lambda n=steps: track(n), pose, PATH)
report(
    "Drake + SNOPT, whole path",
    f"200 × 7 variables, pose equalities, at most {TIME_LIMIT:.0f} s",
    whole_path,
    pose,
    PATH,
    1,
)
