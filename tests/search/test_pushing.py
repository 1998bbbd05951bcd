"""Where bodies leave little room, configurations are pushed into it along the self-motion."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import SinglePoses, carried_within, inside, pushed
from selfmotion.planning.search.pushing import Pushing
from selfmotion.problem.constraints import NO_OVERLAP
from support.arms import PANDA_HOME, robot_named

# Newton's method ends this near to its pose [m, rad].
ON_PATH = 1e-9
# How far the elbow's body is from the arm before it is pushed [m].
MEETS = 0.03
# Required distances [m].
DISTANCE = 5e-3


def beside_the_elbow(depth: float, task: str = "pose", **given: object) -> sm.Problem:
    """Return Panda's line, and a ball in which its elbow is by `depth` at the start [m]."""
    robot = robot_named("panda")
    first = robot.pose(PANDA_HOME)
    last = first.copy()
    last.translation = first.translation + np.array([0.0, 0.1, 0.0])
    elbow = robot.joint_poses(PANDA_HOME[None])[0, 3, :3]
    ball = sm.obstacles.Sphere("ball", elbow + np.array([0.0, 0.15 - depth, 0.0]), 0.05)
    clear = sm.constraints.Clearance([ball], DISTANCE)
    path = sm.paths.Line(first, last, 4.0)
    return sm.Problem(robot, path, task, clearance=clear, **given)


def poses_of(problem: sm.Problem) -> SinglePoses:
    return SinglePoses(Formulation.of(problem), np.random.default_rng(0))


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"task": "position"},
        {"relaxations": [sm.Relaxation("rx", 0.1), sm.Relaxation("z", 2e-3, axes="tool")]},
    ],
    ids=["one degree", "four degrees", "with tolerances"],
)
def test_what_meets_a_body_is_brought_out_of_it_on_its_path(given: dict) -> None:
    """By an exact model of bodies and by Pinocchio's kinematics, within limits and bands."""
    problem = beside_the_elbow(MEETS, **given)
    poses = poses_of(problem)
    model, robot = problem.clearances[0].model(problem.robot), problem.robot
    q = np.zeros((1, poses.coordinates.dof))
    q[0, : robot.dof] = PANDA_HOME
    assert model.distance(PANDA_HOME).value < DISTANCE
    free = pushed(poses, 0.0, q)
    assert len(free)
    for each in free:
        own = each[: robot.dof]
        assert model.distance(own).value >= DISTANCE
        assert (own >= robot.lower).all()
        assert (own <= robot.upper).all()
        away = robot.pose(own).translation - robot.pose(PANDA_HOME).translation
        bands = [item.band for item in problem.relaxations if not item.angular]
        assert np.linalg.norm(away) <= max(bands, default=0.0) + ON_PATH


def test_what_no_self_motion_leads_out_of_stays_nowhere() -> None:
    """A body that contains the tool itself, and an arm without bodies to push."""
    problem = beside_the_elbow(MEETS)
    ball = sm.obstacles.Sphere("ball", problem.path.pose(0.0).translation, 0.2)
    stuck = problem.changed(clearance=sm.constraints.Clearance([ball], DISTANCE))
    assert not len(pushed(poses_of(stuck), 0.0, PANDA_HOME[None]))
    alone = poses_of(problem.changed(clearance=None))
    none = np.zeros(alone.coordinates.dof, dtype=bool)
    pushing = Pushing(alone.follows, alone.bounds)
    assert not len(pushing.free(PANDA_HOME[None], lambda q: (q, q), none))


@pytest.mark.parametrize("seed", range(6))
def test_outside_of_its_window_a_tolerance_changes_nothing(seed: int) -> None:
    """What is found is what is found without it, from the same configurations."""
    off = np.random.default_rng(seed).uniform(-0.02, 0.02, 3)
    plain = beside_the_elbow(MEETS)
    ball = plain.clearances[0].obstacles[0]
    moved = sm.obstacles.Sphere("ball", ball.pose.translation + off, 0.05)
    plain = plain.changed(clearance=sm.constraints.Clearance([moved], DISTANCE))
    later = plain.changed(relaxations=[sm.Relaxation("z", 2e-3, during=(3.0, 4.0))])
    found = []
    for problem in (plain, later):
        poses = poses_of(problem)
        q = np.zeros((1, poses.coordinates.dof))
        q[0, : problem.robot.dof] = PANDA_HOME
        found.append(pushed(poses, 0.0, q)[:, : problem.robot.dof])
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


@pytest.mark.parametrize("clearance", [None, NO_OVERLAP])
def test_a_joint_with_hardly_any_range_has_narrower_limits_within_these(clearance: object) -> None:
    problem = beside_the_elbow(MEETS)
    narrow = 4e-4
    lower, upper = problem.robot.lower.copy(), problem.robot.upper.copy()
    lower[0], upper[0] = -narrow, narrow
    limits = sm.constraints.JointPositionLimits(lower, upper)
    poses = inside(poses_of(problem.changed(constraints=[limits], clearance=clearance)))
    assert (poses.bounds.lower < poses.bounds.upper).all()
    assert (poses.bounds.lower >= lower).all()
    assert (poses.bounds.upper <= upper).all()


def test_motions_through_a_configuration_are_on_the_path_within_limits() -> None:
    problem = beside_the_elbow(MEETS, relaxations=[sm.Relaxation("z", 2e-3, axes="tool")])
    poses = poses_of(problem)
    narrow = inside(poses)
    q = np.zeros((1, poses.coordinates.dof))
    q[0, : problem.robot.dof] = PANDA_HOME
    t = np.linspace(0.0, 4.0, 9)
    free = pushed(narrow, float(t[4]), narrow.project(q, float(t[4]))[0])
    motions = carried_within(narrow, free, t, 4)
    assert len(motions)
    np.testing.assert_array_equal(motions[:, 4], free[: len(motions)])
    lower, upper = poses.bounds.lower, poses.bounds.upper
    assert (motions > lower).all()
    assert (motions < upper).all()
    frames = problem.path.samples(t)
    for motion in motions:
        for own, place, turn in zip(motion, frames.translation, frames.rotation, strict=True):
            pose = problem.robot.pose(own[: problem.robot.dof])
            away = turn.T @ (pose.translation - place)
            np.testing.assert_allclose(away[:2], 0.0, atol=ON_PATH)
            np.testing.assert_allclose(pose.rotation, turn, atol=ON_PATH)
