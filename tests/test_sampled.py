"""The global search for two and more degrees of redundancy: projection, chains, and refusals."""

import numpy as np
import pytest

import selfmotion as sm
from conftest import robot_named
from selfmotion.basics.arrays import Array
from selfmotion.basics.errors import NoSequenceError
from selfmotion.search import spread, targets
from selfmotion.search.manifold import Manifold
from selfmotion.search.sampled import sampled_sequences

STEP = 0.5
CASES = (("panda", "position"), ("panda", "pointing"), ("tiago", "pose"), ("ur5", "pointing"))


def line_of(robot: sm.RobotModel, task: str, length: float = 0.2) -> sm.Line:
    pose = robot.pose(robot.dexterous_configuration(task))
    end = pose.copy()
    end.translation = pose.translation - [0.0, 0.0, length]
    return sm.Line(pose, end, 2.0)


def searched(robot: sm.RobotModel, path: sm.Path, **options: object) -> list[sm.search.Sequence]:
    values = {
        "lower": robot.lower,
        "upper": robot.upper,
        "largest_step": np.full((20, robot.dof), STEP),
        "weights": robot.joint_weights,
        "count": 2,
    }
    t = np.linspace(0.0, path.duration, 21)
    return sampled_sequences(robot, path, sm.Task.POSITION, t, **(values | options))


@pytest.mark.parametrize("off", [1e-8, 1e-4, 0.1, 10.0, np.nan])
def test_compiled_kinematics_that_are_not_those_of_pinocchio_are_refused(
    off: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = robot_named("panda")
    rotations, positions, axes, turning = robot.joint_places()
    wrong = positions.copy()
    wrong[3, 0] += off
    monkeypatch.setattr(
        sm.RobotModel, "joint_places", lambda own: (rotations, wrong, axes, turning)
    )
    with pytest.raises(sm.RobotError, match="compiled kinematics put 'panda_hand_tcp'"):
        Manifold(robot, sm.Task.POSITION, robot.lower, robot.upper)


@pytest.mark.parametrize(("name", "task"), CASES)
def test_projection_is_onto_the_path_and_within_the_limits(name: str, task: str) -> None:
    robot, rows = robot_named(name), sm.Task.of(task)
    path = line_of(robot, task)
    manifold = Manifold(robot, rows, robot.lower, robot.upper)
    seeds = np.array(list(spread(robot, 100, np.random.default_rng(0))))
    q, arrived = manifold.project(seeds, targets(path, np.zeros(1))[0], far=True)
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
    manifold = Manifold(robot, sm.Task.POSITION, robot.lower, upper)
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
    bases = Manifold(robot, task, robot.lower, robot.upper).carried_bases(q)
    for here, basis in zip(q, bases, strict=True):
        np.testing.assert_allclose(robot.task_jacobian(here, task) @ basis, 0.0, atol=1e-12)
    # Between neighbours 0.03 rad apart, bases of the same planes turn about as much.
    assert np.abs(np.diff(bases, axis=0)).max() < 0.1


def test_sequences_follow_the_path_keep_all_and_are_as_long_as_they_say() -> None:
    robot = robot_named("panda")
    path = line_of(robot, "position")
    post = sm.Sphere("post", path.pose(1.0).translation - [0.0, 0.25, 0.0], 0.05)
    model = sm.CollisionModel(robot, [post])
    found = searched(robot, path, bodies=[(model, 2e-3)])
    lengths = [sequence.length for sequence in found]
    assert lengths == sorted(lengths)
    for sequence in found:
        q: Array = sequence.q
        for time, here in zip(sequence.t, q, strict=True):
            assert max(sm.Task.POSITION.miss(path.pose(float(time)), robot.pose(here))) < 1e-9
            assert model.distance(here).value >= 2e-3
        assert np.all((q >= robot.lower) & (q <= robot.upper))
        assert np.abs(np.diff(q, axis=0)).max() <= STEP
        assert sequence.length == pytest.approx(np.abs(np.diff(q, axis=0)).sum())
    again = searched(robot, path, bodies=[(model, 2e-3)])
    assert all(np.array_equal(a.q, b.q) for a, b in zip(found, again, strict=True))


def test_it_is_not_longer_than_following_from_the_same_start() -> None:
    """Dynamic programming may always stay on the motion that it begins with."""
    robot = robot_named("panda")
    path = line_of(robot, "position")
    best = searched(robot, path)[0]
    manifold = Manifold(robot, sm.Task.POSITION, robot.lower, robot.upper)
    q, length = best.q[:1], 0.0
    for target in targets(path, best.t)[1:]:
        following, arrived = manifold.project(q, target)
        assert arrived.all()
        length += float(np.abs(following - q).sum())
        q = following
    assert best.length <= length * (1 + 1e-9)


def test_a_path_that_nothing_follows_says_when() -> None:
    robot = robot_named("panda")
    path = line_of(robot, "position", length=-3.0)
    with pytest.raises(NoSequenceError, match="no motion along the path passes t = ") as error:
        searched(robot, path)
    assert 0.0 < error.value.time < 2.0


def test_metres_are_not_added_to_radians_unasked() -> None:
    robot = robot_named("tiago")
    weights = robot.joint_weights
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    assert slides.any()
    np.testing.assert_array_equal(weights[~slides], 1.0)
    # An arm's mean lever is some tenths of a metre.
    assert np.all((weights[slides] > 1.0) & (weights[slides] < 10.0))
    path = line_of(robot, "pose")
    joint = robot.joint_names[int(np.argmax(slides))]
    with pytest.raises(sm.ProblemError, match=f"'{joint}' moves in metres.*joint_weights"):
        sm.Problem(robot, path, costs=[sm.PathLength()])
    with pytest.raises(sm.ProblemError, match=r"joint_weights are .* expected 8 numbers"):
        sm.Problem(robot, path, costs=[sm.PathLength(joint_weights=[1.0, 2.0])])
    sm.Problem(robot, path, costs=[sm.PathLength(joint_weights=weights)])
    # The usual cost says what it counts a metre as.
    (usual,) = sm.Problem(robot, path).costs
    np.testing.assert_allclose(usual.weight, weights**2)
    assert usual.name == f"joint velocity (1 m as {weights[slides][0]:.3g} rad)"
    panda = robot_named("panda")
    (plain,) = sm.Problem(panda, line_of(panda, "pose")).costs
    assert (plain.name, float(plain.weight)) == ("joint velocity", 1.0)
