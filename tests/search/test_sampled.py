"""The global search for two and more degrees of redundancy: projection, chains, and refusals."""

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array, NoSequenceError, silent
from selfmotion.model.follow import Follows
from selfmotion.planning.search import Manifold
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.sampled import _STARTS, _TRIES, _starts, sampled_layers
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.sequences import best_sequences
from support.arms import robot_named
from support.followed import standing
from support.paths import line_of

STEP = 0.5
# Of sums of joint angles [rad].
ROUNDING = 1e-12


def searched(
    robot: sm.RobotModel,
    path: sm.paths.Path,
    bodies: tuple[tuple[sm.obstacles.CollisionModel, float], ...] = (),
) -> list[sm.planning.search.Sequence]:
    t = np.linspace(0.0, path.duration, 21)
    follows, limits = Follows.of(robot, path, sm.Task.POSITION), (robot.lower, robot.upper)
    waypoints, steps = OnPath(follows, t, *limits), np.full((20, robot.dof), STEP)
    weights = robot.joint_weights
    layers = sampled_layers(waypoints, t, steps, limits, bodies, weights, 0, silent)
    return best_sequences(layers, 2, None, silent)


def test_sequences_follow_the_path_keep_all_and_are_as_long_as_they_say() -> None:
    robot = robot_named("panda")
    path = line_of(robot, "position")
    post = sm.obstacles.Sphere("post", path.pose(1.0).translation - [0.0, 0.25, 0.0], 0.05)
    model = sm.obstacles.CollisionModel(robot, [post])
    found = searched(robot, path, bodies=((model, 2e-3),))
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
    again = searched(robot, path, bodies=((model, 2e-3),))
    assert all(np.array_equal(a.q, b.q) for a, b in zip(found, again, strict=True))


def test_it_is_not_longer_than_following_from_the_same_start() -> None:
    """Dynamic programming may always stay on the motion that it begins with."""
    robot = robot_named("panda")
    path = line_of(robot, "position")
    best = searched(robot, path)[0]
    manifold = Manifold(standing(robot, sm.Task.POSITION), robot.lower, robot.upper)
    q, length = best.q[:1], 0.0
    for target in Follows.of(robot, path, "pose").targets(best.t)[1:]:
        following, arrived = manifold.project(q, target)
        assert arrived.all()
        length += float(np.abs(following - q).sum())
        q = following
    assert best.length <= length * (1 + 1e-9)


@pytest.mark.parametrize(
    ("name", "task"), [("panda", "pose"), ("xarm7", "pose"), ("ur5", "pointing")]
)
def test_a_quarter_of_what_is_drawn_anywhere_comes_onto_the_path(name: str, task: str) -> None:
    """However far that is from there: so all starts that are wanted are found."""
    robot = robot_named(name)
    path, limits = line_of(robot, task), (robot.lower, robot.upper)
    waypoints = OnPath(Follows.of(robot, path, task), np.array([0.0, 1.0, 2.0]), *limits)
    bounds = SearchBounds(*limits, robot.is_revolute, ())
    found = _starts(waypoints, bounds, 1, np.random.default_rng(0))
    assert len(found) == _STARTS
    for q in found:
        assert max(sm.Task.of(task).miss(path.pose(1.0), robot.pose(q))) < 1e-9


def test_samples_stray_from_what_is_reached_to_all_sides_and_by_weights(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A joint that counts much strays little."""
    robot = robot_named("panda")
    path, limits = line_of(robot, "position"), (robot.lower, robot.upper)
    t = np.array([0.0, 0.1])
    waypoints = OnPath(Follows.of(robot, path, "position"), t, *limits)
    project, guesses = OnPath.project, list[Array]()

    def seen(self: OnPath, q: Array, i: int, **given: bool) -> tuple[Array, Array]:
        guesses.append(q)
        return project(self, q, i, **given)

    monkeypatch.setattr(OnPath, "project", seen)
    weights = np.where(np.arange(robot.dof) == 2, 1e9, 1.0)
    steps = np.full((1, robot.dof), STEP)
    sampled_layers(waypoints, t, steps, limits, (), weights, 0, silent)
    count = len(guesses[-1]) // (1 + _TRIES)
    parents, strays = guesses[-1][:count], guesses[-1][count:]
    away = strays - np.repeat(parents, _TRIES, axis=0)
    assert count > 10
    assert np.abs(away[:, 2]).max() < 1e-6
    others = np.delete(away, 2, axis=1)
    # Of a hundred normal numbers the mean is within half of their standard deviation.
    assert (np.abs(others.mean(axis=0)) < 0.5 * others.std(axis=0)).all()
    assert others.std(axis=0).min() > 0.1
    assert np.abs(others).max() <= 0.5 * STEP + ROUNDING


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
    with pytest.raises(sm.errors.ProblemError, match=f"'{joint}' moves in metres.*joint_weights"):
        sm.Problem(robot, path, costs=[sm.costs.PathLength()])
    with pytest.raises(sm.errors.ProblemError, match=r"joint_weights are .* expected 8 numbers"):
        sm.Problem(robot, path, costs=[sm.costs.PathLength(joint_weights=[1.0, 2.0])])
    sm.Problem(robot, path, costs=[sm.costs.PathLength(joint_weights=weights)])
    # The usual cost says what it counts a metre as.
    (usual,) = sm.Problem(robot, path).costs
    # By the limits of speed: what it turns in the time of a metre, ten radians at most.
    limits = robot.velocity_limit
    by_speed = np.minimum(limits[~slides].mean() / limits[slides], 10.0)
    np.testing.assert_allclose(usual.weight, np.where(slides, by_speed**2, 1.0))
    assert usual.name == f"joint velocity (1 m as {by_speed[0]:.3g} rad)"
    panda = robot_named("panda")
    (plain,) = sm.Problem(panda, line_of(panda, "pose")).costs
    assert (plain.name, float(plain.weight)) == ("joint velocity", 1.0)


def test_joints_that_stand_at_their_limits_are_nodes_within_these() -> None:
    rng = np.random.default_rng(0)
    lower = -rng.uniform(0.1, 3.0, 5000)
    upper = rng.uniform(0.1, 3.0, 5000)
    bounds = SearchBounds(lower, upper, np.ones(5000, dtype=bool), ())
    # A turn there and back rounds some of them beyond.
    assert (bounds.representative(upper) > upper).any()
    nodes = bounds.layer(np.stack([lower, upper]))
    assert np.all((nodes >= lower) & (nodes <= upper))
    np.testing.assert_allclose(np.sort(nodes, axis=0), np.stack([lower, upper]), atol=1e-14)
