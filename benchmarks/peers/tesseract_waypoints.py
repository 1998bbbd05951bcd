"""Tesseract's TrajOpt: the whole path as one programme, poses as constraints.

The cost is its own of joint velocities, which is the one measured here. Constraints weigh by their
coefficients: those of its puzzle example, and others that were tuned for this path by hand.
"""

import numpy as np
import tesseract_robotics.tesseract_motion_planners_trajopt as trajopt
from common import panda_urdf, report, rotation, start, waypoints
from tesseract_robotics.tesseract_common import GeneralResourceLocator, Isometry3d
from tesseract_robotics.tesseract_environment import Environment

PATH = "panda__1cube"
JOINTS = [f"panda_joint{k}" for k in range(1, 8)]
COEFFICIENTS = {"its puzzle example's coefficients": (5.0, 2.0), "coefficients of 50": (50.0, 50.0)}
# OSQP's steps go by the clock: no two runs are alike.
RUNS = 3
_, positions, quaternions = waypoints(PATH)
joints = "".join(f'<joint name="{name}"/>' for name in JOINTS)
environment = Environment()
environment.init(
    panda_urdf(),
    f'<robot name="panda" version="1.0.0"><group name="arm">{joints}</group></robot>',
    GeneralResourceLocator(),
)
environment.setState(JOINTS, start())


def target(k: int) -> Isometry3d:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(quaternions[k]), positions[k]
    return Isometry3d(pose)


targets = [target(k) for k in range(len(positions))]


def whole_path(position: float, turn: float) -> np.ndarray:
    count = len(targets)
    # --8<-- [start:follow]
    info = trajopt.ProblemConstructionInfo(environment)
    info.basic_info.n_steps, info.basic_info.manip = count, "arm"
    info.basic_info.use_time = False
    info.basic_info.fixed_timesteps = np.array([0], dtype=np.int32)
    info.basic_info.convex_solver = trajopt.ModelType(trajopt.ModelType.OSQP)
    info.kin = environment.getJointGroup("arm")
    info.init_info.type = trajopt.InitInfo.STATIONARY
    for k in range(1, count):
        pose = trajopt.CartPoseTermInfo()
        pose.name, pose.timestep = f"pose {k}", k
        pose.source_frame, pose.target_frame = "panda_hand", "panda_link0"
        pose.target_frame_offset = targets[k]
        pose.pos_coeffs, pose.rot_coeffs = np.full(3, position), np.full(3, turn)
        pose.term_type = trajopt.TermType_TT_CNT
        info.cnt_infos.append(pose)
    speed = trajopt.JointVelTermInfo()
    speed.name, speed.term_type = "speed", trajopt.TermType_TT_COST
    speed.coeffs, speed.targets = np.ones(7), np.zeros(7)
    speed.first_step, speed.last_step = 0, count - 1
    info.cost_infos.append(speed)
    # --8<-- [end:follow]
    # The wheel's own wrapper passes a None that its library refuses.
    library = trajopt._tesseract_motion_planners_trajopt_python
    problem = trajopt.ConstructProblem(info)
    return np.array(library.OptimizeProblem(problem).traj)[:, : len(JOINTS)]


for settings, pair in COEFFICIENTS.items():
    for run in range(1, RUNS + 1):
        report("Tesseract's TrajOpt", f"{settings}, run {run}", lambda p=pair: whole_path(*p), 1)
