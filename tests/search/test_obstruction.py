"""A quick 'no': never where a motion exists, at once where a pose is out of reach or in the way."""

import re

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search import SPACING, Obstruction, SinglePoses, obstruction, single_poses
from selfmotion.planning.search.obstruction import least_deviation, least_excess, nearest_place
from support.arms import PANDA_HOME, robot_named

# Remedies are as tight as their last round, and the path is moved a bit farther than it has to be.
TIGHT = 0.35
# Where Newton's method ends [m or rad].
AT_POSE = 1e-9


def looked(problem: sm.Problem) -> Obstruction | None:
    return obstruction(Formulation.of(problem), np.random.default_rng(0))


def known_motion(robot: sm.RobotModel, seed: int) -> tuple[Array, Array]:
    """Return times and a smooth motion (N, n), of every second seed one that hugs its limits."""
    rng = np.random.default_rng(seed)
    lower, upper = robot.finite_limits()
    t = np.linspace(0.0, 4.0, 61)
    share = rng.uniform(0.1, 0.9, robot.dof) if seed % 2 else rng.integers(0, 2, robot.dof)
    first = lower + (upper - lower) * share
    knots = first + np.cumsum(rng.uniform(-0.5, 0.5, (5, robot.dof)), axis=0)
    q = make_interp_spline(np.linspace(0.0, 4.0, 5), knots)(t)
    return t, np.clip(q, lower + 1e-3, upper - 1e-3)


@pytest.mark.parametrize(
    ("name", "task"), [("panda", "pose"), ("panda", "position"), ("ur5", "pointing")]
)
def test_it_never_refuses_what_a_known_motion_follows(name: str, task: str) -> None:
    """Past a ball that nearly touches it, too."""
    robot = robot_named(name)
    own = sm.obstacles.CollisionModel(robot)
    looks = 0
    for seed in range(12):
        t, q = known_motion(robot, seed)
        if own.worst(q).value < 5e-3:
            continue
        path = sm.paths.Waypoints.from_poses(t, [robot.pose(x) for x in q])
        tool = path.pose(2.0).translation
        for height in (0.06, 0.1, 0.2):
            ball = sm.obstacles.Sphere("ball", tool + np.array([0.0, 0.0, height]), 0.05)
            if sm.obstacles.CollisionModel(robot, [ball]).worst(q).value > 2e-3:
                break
        else:
            continue
        asked = {
            "constraints": [sm.constraints.JointPositionLimits()],
            "clearance": sm.constraints.Clearance([ball], 1e-3),
        }
        assert looked(sm.Problem(robot, path, task, rest=False, **asked)) is None
        looks += 1
    assert looks >= 3


def beyond(far: float) -> sm.paths.Line:
    """Return a line in the plane from within the reach of 5 m to `far` beyond it."""
    planar = robot_named("planar_3r")
    start = planar.pose([0.0, 0.5, 0.5])
    end = start.copy()
    end.translation = start.translation / np.linalg.norm(start.translation) * (5.0 + far)
    return sm.paths.Line(start, end, 5.0)


@pytest.mark.parametrize("far", [0.01, 0.2])
def test_a_pose_out_of_reach_is_named_with_the_way_back(far: float) -> None:
    """The stretched arm reaches 5 m: the least way to move the path is known in closed form."""
    planar = robot_named("planar_3r")
    found = looked(sm.Problem(planar, beyond(far), "planar"))
    assert found is not None
    assert (found.time, found.is_met) == (5.0, False)
    assert found.errors[0] == pytest.approx(far, rel=1e-3)
    assert f"misses it by {1e3 * far:.3g} mm" in found.reason
    assert "stretched" in found.reason
    shift = nearest_place(found.poses, found.times)
    assert shift is not None
    assert far <= np.linalg.norm(shift) <= far * (1.0 + TIGHT) + 1e-3
    assert "the path moved by" in found.help


def test_a_joint_in_the_way_is_named_with_how_far_it_would_have_to_go() -> None:
    """An elbow bent by 0.5 at least keeps the arm at 4 cos(0.25) + 1 m."""
    planar = robot_named("planar_3r")
    bent = 4.0 * np.cos(0.25) + 1.0
    limits = sm.constraints.JointPositionLimits([-6.0, 0.5, -6.0], [6.0, 3.0, 6.0])
    path = beyond(0.5 * (bent + 5.0) - 5.0)
    problem = sm.Problem(planar, path, "planar", constraints=[limits])
    found = looked(problem)
    assert found is not None
    excess = least_excess(found.poses, found.time)
    assert excess is not None
    # cos(q2 / 2) = ((4 cos 0.25 + 5) / 2 - 1) / 4 with the arm stretched beyond the elbow.
    needed = 0.5 - 2.0 * np.arccos((0.5 * (bent + 5.0) - 1.0) / 4.0)
    assert excess[0] == "joint2"
    assert needed * (1.0 - 1e-6) <= excess[1] <= 0.5


def test_what_stands_on_the_path_is_named() -> None:
    panda = robot_named("panda")
    pose = panda.pose(panda.dexterous_configuration())
    end = pose.copy()
    end.translation = pose.translation + np.array([0.0, 0.1, 0.0])
    ball = sm.obstacles.Sphere("ball", end.translation, 0.04)
    clearance = sm.constraints.Clearance([ball], 1e-3)
    limits = [sm.constraints.JointPositionLimits()]
    path = sm.paths.Line(pose, end, 2.0)
    problem = sm.Problem(panda, path, constraints=limits, clearance=clearance)
    found = looked(problem)
    assert found is not None
    assert found.is_met
    assert "'ball'" in found.reason
    assert "wanted: 1 mm" in found.reason
    with pytest.raises(sm.errors.NoSequenceError, match=r"'ball'.*; what would help: "):
        sm.plan(problem)


def test_what_is_relaxed_extends_reach() -> None:
    """A line that ends 1 cm beyond reach, where the tool may be 2 cm off it: as far as that."""
    planar = robot_named("planar_3r")
    for band, is_refused in ((0.02, False), (0.005, True)):
        relaxed = [sm.Relaxation(("x", "y"), band)]
        problem = sm.Problem(planar, beyond(0.01), "planar", relaxations=relaxed)
        found = looked(problem)
        assert (found is not None) == is_refused
        if found is not None:
            more = least_deviation(found.poses, found.time, ("x", "y"))
            assert more is not None
            assert 0.01 <= np.linalg.norm(more) <= 0.01 * (1.0 + TIGHT)


def test_self_motions_of_a_pose_in_a_window_make_use_of_it() -> None:
    """Six joints have none but what the window frees: all turns about the tool's axis."""
    robot = robot_named("ur5")
    pose = robot.pose(robot.dexterous_configuration("pose"))
    window = sm.Relaxation("rz", during=(1.0, 3.0))
    problem = sm.Problem(robot, sm.paths.Dwell(pose, 4.0), "pose", relaxations=[window])
    poses = SinglePoses(Formulation.of(problem), np.random.default_rng(0))
    curves = single_poses._along_curves(poses, 2.0, np.empty((0, 7)))
    tools = [robot.pose(q[: robot.dof]) for q in curves]
    away = [np.linalg.norm(tool.translation - pose.translation) for tool in tools]
    tilts = [np.linalg.norm(tool.rotation[:, 2] - pose.rotation[:, 2]) for tool in tools]
    assert max(away) < AT_POSE
    assert max(tilts) < AT_POSE
    turned = [(pose.rotation.T @ tool.rotation)[:2, 0] for tool in tools]
    angles = np.sort(np.arctan2(*np.transpose(turned)[::-1]))
    assert np.diff(angles, append=angles[0] + 2.0 * np.pi).max() < 2.0 * SPACING


def test_what_meets_something_is_within_the_limits_and_nearer_than_wanted() -> None:
    """Beyond the limits the arm may be clear of a box that it stands in, which is no help."""
    robot = robot_named("panda")
    middle, (lower, upper) = PANDA_HOME, robot.finite_limits()
    sides = np.maximum(lower, middle - 0.3), np.minimum(upper, middle + 0.3)
    path = sm.paths.Circle.around(robot.pose(middle), 0.03, 4.0, normal=(1.0, 0.0, 0.0))
    elbow = robot.chain_to("panda_link4", None).place(middle)
    elbow.rotation = np.eye(3)
    clearance = sm.constraints.Clearance([sm.obstacles.Box("box", elbow, [0.15] * 3)], 0.01)
    limits = sm.constraints.JointPositionLimits(*sides)
    found = looked(sm.Problem(robot, path, constraints=[limits], clearance=clearance))
    assert found is not None
    assert found.is_met
    met = found.found.met
    assert ((met >= sides[0]) & (met <= sides[1])).all()
    bodies = sm.obstacles.CollisionModel(robot, clearance.obstacles)
    assert all(bodies.distance(q).value < 0.01 for q in met[::20])
    told = re.search(r"([\d.]+) mm apart \(wanted: 10 mm", found.reason)
    assert told is None or float(told[1]) < 10.0
