"""Tesseract's TrajOpt on its own puzzle piece with positioner: the whole path as one programme.

Start, terms, coefficients and solver are those of `puzzle_piece_auxillary_axes_example.cpp`: pose
constraints in the moving frame of the part (5 for positions, 2 for two rotations, 0 for turning
about the grinder), a cost of 1 on the squared differences of velocities, accelerations and jerks of
each joint between waypoints, and a collision cost of 1 within 25 mm at the waypoints. The vector of
coefficients of its planner's profile cannot be set from Python, so that the same terms are given to
TrajOpt itself; its number of iterations is TrajOpt's own.
"""

import csv
import json
import sys
import time
from pathlib import Path

import numpy as np
import tesseract_robotics
import tesseract_robotics.tesseract_motion_planners_trajopt as trajopt
from tesseract_robotics.tesseract_common import GeneralResourceLocator, Isometry3d
from tesseract_robotics.tesseract_environment import Environment

DATA = Path(__file__).parent.parent / "data"
FOLDER = DATA / "puzzle_cell__part"
JOINTS = [*(f"joint_a{k}" for k in range(1, 8)), "joint_aux1", "joint_aux2"]
START = [-0.785398, 0.4, 0.0, -1.9, 0.0, 1.0, 0.0, 0.0, 0.0]
MARGIN, COLLISION = 0.025, 1.0
CONTACTS = """contact_manager_plugins:
  search_paths: [{folder}]
  search_libraries: [{library}]
  discrete_plugins:
    default: BulletDiscreteBVHManager
    plugins: {{BulletDiscreteBVHManager: {{class: BulletDiscreteBVHManagerFactory}}}}
  continuous_plugins:
    default: BulletCastBVHManager
    plugins: {{BulletCastBVHManager: {{class: BulletCastBVHManagerFactory}}}}
"""


def environment(out: Path) -> Environment:
    """Return the cell, with the pairs of links left out that the problem leaves out."""
    libraries = Path(tesseract_robotics.__file__).parent.parent / "tesseract_robotics.libs"
    found = next(libraries.glob("libtesseract_collision_bullet_factories*.so"))
    contacts = out / "contacts.yaml"
    library = found.stem.removeprefix("lib")
    contacts.write_text(CONTACTS.format(folder=libraries, library=library))
    pairs = json.loads((FOLDER / "problem.json").read_text())["disabled_pairs"]
    joints = "".join(f'<joint name="{name}"/>' for name in JOINTS)
    apart = "".join(
        f'<disable_collisions link1="{a}" link2="{b}" reason="given"/>' for a, b in pairs
    )
    config = f'<contact_managers_plugin_config filename="file://{contacts.resolve()}"/>'
    groups = f'{config}<group name="all">{joints}</group>{apart}'
    srdf = f'<robot name="puzzle_cell" version="1.0.0">{groups}</robot>'
    environment = Environment()
    urdf = (DATA / "puzzle_cell.urdf").read_text()
    if not environment.init(urdf, srdf, GeneralResourceLocator()):
        raise RuntimeError("tesseract cannot read the cell")
    environment.setState(JOINTS, np.array(START))
    return environment


def targets() -> list[Isometry3d]:
    with (FOLDER / "path.csv").open() as stream:
        rows = [[float(x) for x in row] for row in list(csv.reader(stream))[1:]]
    found = []
    for _, *place, w, x, y, z in rows:
        pose = np.eye(4)
        pose[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        pose[:3, 3] = place
        found.append(Isometry3d(pose))
    return found


def solve(environment: Environment, poses: list[Isometry3d], *, collisions: bool) -> np.ndarray:
    """Return the joints at the waypoints, (W, 9)."""
    count = len(poses)
    info = trajopt.ProblemConstructionInfo(environment)
    info.basic_info.n_steps, info.basic_info.manip = count, "all"
    info.basic_info.use_time = False
    info.basic_info.convex_solver = trajopt.ModelType(trajopt.ModelType.OSQP)
    info.kin = environment.getJointGroup("all")
    info.init_info.type = trajopt.InitInfo.STATIONARY
    for k, pose in enumerate(poses):
        term = trajopt.DynamicCartPoseTermInfo()
        term.name, term.timestep = f"pose {k}", k
        term.source_frame, term.target_frame = "grinder_frame", "part"
        term.target_frame_offset = pose
        term.pos_coeffs, term.rot_coeffs = np.full(3, 5.0), np.array([2.0, 2.0, 0.0])
        term.term_type = trajopt.TermType_TT_CNT
        info.cnt_infos.append(term)
    for kind in (trajopt.JointVelTermInfo, trajopt.JointAccTermInfo, trajopt.JointJerkTermInfo):
        term = kind()
        term.name, term.term_type = kind.__name__, trajopt.TermType_TT_COST
        term.coeffs, term.targets = np.ones(len(JOINTS)), np.zeros(len(JOINTS))
        term.first_step, term.last_step = 0, count - 1
        info.cost_infos.append(term)
    if collisions:
        term = trajopt.CollisionTermInfo()
        term.name, term.term_type = "collision", trajopt.TermType_TT_COST
        term.first_step, term.last_step = 0, count - 1
        term.evaluator_type = trajopt.CollisionEvaluatorType_SINGLE_TIMESTEP
        term.info = trajopt.createSafetyMarginDataVector(count, MARGIN, COLLISION)
        info.cost_infos.append(term)
    problem = trajopt.ConstructProblem(info)
    # The wheel's own wrapper passes a None that its library refuses.
    library = trajopt._tesseract_motion_planners_trajopt_python
    return np.array(library.OptimizeProblem(problem).traj)[:, : len(JOINTS)]


def main() -> None:
    out = Path(sys.argv[1]).parent
    for collisions in (False, True):
        cell, poses = environment(out), targets()
        began = time.process_time()
        q = solve(cell, poses, collisions=collisions)
        result = {
            "name": "Tesseract, TrajOpt",
            "settings": f"its example's, collisions {'on' if collisions else 'off'}",
            "seconds": time.process_time() - began,
            "joints": JOINTS,
            "q": q.tolist(),
        }
        sys.stdout.write(json.dumps(result) + "\n")


main()
