"""Newton's method onto self-motions: projection, limits, bases carried along."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.follow import Coordinates, Follows
from selfmotion.model.kernels import carried
from selfmotion.model.robot import null_space
from selfmotion.planning.search import Manifold, spread
from selfmotion.planning.search.manifold import approach_all
from support.arms import robot_named
from support.followed import standing
from support.paths import line_of

CASES = (("panda", "position"), ("panda", "pointing"), ("tiago", "pose"), ("ur5", "pointing"))


@pytest.mark.parametrize("off", [1e-8, 1e-4, 0.1, 10.0, np.nan])
def test_compiled_kinematics_that_are_not_those_of_pinocchio_are_refused(
    off: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_named("panda")
    follows, arrays = standing(robot, sm.Task.POSITION), robot.chain.arrays
    wrong = arrays.tree.positions.copy()
    wrong[3, 0] += off
    tree = arrays.tree._replace(positions=wrong)
    monkeypatch.setattr(robot.chain, "table", arrays._replace(tree=tree).table)
    with pytest.raises(sm.errors.RobotError, match="compiled kinematics put 'panda_hand_tcp'"):
        Manifold(follows, robot.lower, robot.upper)


@pytest.mark.parametrize(("name", "task"), CASES)
def test_projection_is_onto_the_path_and_within_the_limits(name: str, task: str) -> None:
    robot, rows = robot_named(name), sm.Task.of(task)
    path = line_of(robot, task)
    manifold = Manifold(standing(robot, rows), robot.lower, robot.upper)
    seeds = np.array(list(spread(Coordinates.of(robot), 100, np.random.default_rng(0))))
    q, arrived = manifold.project(
        seeds, Follows.of(robot, path, "pose").targets(np.zeros(1))[0], far=True
    )
    # Of an arm near its limits not every seed leads there.
    assert arrived.sum() > 10
    for here in q[arrived]:
        # A correction of 1e-6 leaves an error of its square.
        assert max(rows.miss(path.pose(0.0), robot.pose(here))) < 1e-9
        assert np.all((here >= robot.lower) & (here <= robot.upper))


def test_a_joint_at_its_limit_stays_there_while_others_go_on() -> None:
    robot = robot_named("panda")
    q = robot.dexterous_configuration("position")
    upper = robot.upper.copy()
    upper[3] = q[3]
    manifold = Manifold(standing(robot, sm.Task.POSITION), robot.lower, upper)
    pose = robot.pose(q + 0.05)
    target = np.concatenate([pose.translation, pose.rotation.ravel()])
    beyond = q.copy()
    beyond[3] += 0.1
    (found,), arrived = manifold.project(beyond[None], target)
    assert arrived.all()
    assert found[3] <= upper[3]
    assert max(sm.Task.POSITION.miss(pose, robot.pose(found))) < 1e-9


def test_bases_are_carried_without_turning() -> None:
    robot = robot_named("panda")
    task = sm.Task.POSITION
    q0 = robot.dexterous_configuration(task)
    q = q0 + np.linspace(0.0, 0.5, 40)[:, None]
    jacobians = standing(robot, task).jacobians(q)
    bases = carried(null_space(jacobians[0]), jacobians)
    for here, basis in zip(q, bases, strict=True):
        np.testing.assert_allclose(robot.task_jacobian(here, task) @ basis, 0.0, atol=1e-12)
    # Between neighbours 0.03 rad apart, bases of the same planes turn about as much.
    assert np.abs(np.diff(bases, axis=0)).max() < 0.1


@pytest.mark.parametrize("short", [1e-4, 1e-6, 1e-9])
def test_from_near_by_it_arrives_at_poses_that_are_all_but_singular(short: float) -> None:
    # Nearly stretched out a planar arm reaches a point, but its steps there are long and many.
    robot = robot_named("planar_3r")
    free = np.full(robot.dof, np.inf)
    manifold = Manifold(standing(robot, sm.Task.PLANAR), -free, free)
    stretched = np.zeros(robot.dof)
    place = robot.pose(stretched).translation * (1.0 - short)
    target = np.concatenate([place, np.eye(3).ravel()])
    begun = np.array([0.05, -0.03, 0.02])
    (q,), arrived = manifold.project(begun[None], target)
    assert arrived.all()
    assert np.linalg.norm(robot.pose(q).translation - place) < 1e-9
    # What is beyond is not reached in any number of steps.
    beyond = np.concatenate([robot.pose(stretched).translation * (1.0 + 1e-3), np.eye(3).ravel()])
    assert not manifold.project(begun[None], beyond)[1].any()


def test_each_of_many_targets_is_given_the_steps_that_it_needs() -> None:
    robot = robot_named("planar_3r")
    free = np.full(robot.dof, np.inf)
    manifold = Manifold(standing(robot, sm.Task.PLANAR), -free, free)
    places = robot.pose(np.zeros(robot.dof)).translation * np.array([[0.7], [1.0 - 1e-9], [0.8]])
    targets = np.hstack([places, np.tile(np.eye(3).ravel(), (3, 1))])
    begun = np.tile([0.05, -0.03, 0.02], (3, 1))
    assert manifold.project(begun, targets)[1].all()


@pytest.mark.parametrize("away", [1.1, 2.0])
def test_what_hardly_comes_nearer_to_its_target_goes_no_further(away: float) -> None:
    """An arm that stretches towards a point beyond its reach, slower with each step."""
    robot = robot_named("planar_3r")
    free = np.full(robot.dof, np.inf)
    manifold = Manifold(standing(robot, sm.Task.PLANAR), -free, free)
    farthest = robot.pose(np.zeros(robot.dof)).translation
    target = np.concatenate([away * farthest, np.eye(3).ravel()])
    found = []
    for iterations in (60, 300):
        q, left = np.array([[0.5, -0.3, 0.2]]), np.zeros((1, 2))
        tables = manifold.chains, manifold.layout, *manifold._limits, np.zeros(3, dtype=bool)
        approach_all(q, target, *tables, iterations, left)
        found.append(q)
        nearest = (away - 1.0) * np.linalg.norm(farthest)
        assert nearest <= np.linalg.norm(left) < 1.001 * nearest
    np.testing.assert_array_equal(*found)
