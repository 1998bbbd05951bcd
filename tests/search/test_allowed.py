"""Newton's method onto relaxed poses: what arrives is allowed, what is allowed is arrived at."""

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.follow import Follows
from selfmotion.search.allowed import Allowed
from selfmotion.search.starts import spread
from support.arms import robot_named

# Newton's method ends where a correction is below 1e-6, which leaves its square.
ON_PATH = 1e-9
# Rounding of bands.
ROUNDING = 1e-9

ARMS = [("panda", "pose"), ("ur5", "pointing"), ("ur5", "pose"), ("tiago", "pose")]
RELAXED = {
    "cone": (sm.Relaxation(("rx", "ry"), 0.17),),
    "disc": (sm.Relaxation(("x", "y"), 0.01), sm.Relaxation("z", 0.003)),
    "stick-out": (sm.Relaxation("z", 5e-3, axes="tool"), sm.Relaxation(("rx", "ry"), 0.1)),
    "free height": (sm.Relaxation("z"),),
}


def dwelling(robot: sm.RobotModel, pose: pin.SE3, task: str) -> Follows:
    return Follows.of(robot, sm.Dwell(pose, 1.0), task)


def away_from(pose: pin.SE3, actual: pin.SE3, task: str, axes: str) -> Array:
    """Return the six rows of a deviation, by Pinocchio."""
    moved = actual.translation - pose.translation
    relative = pose.rotation.T @ actual.rotation
    turned = pin.log3(relative)
    if task == "pointing":
        z = relative[:, 2]
        turned = np.cross([0.0, 0.0, 1.0], z)
        turned *= np.arctan2(np.linalg.norm(turned), z[2]) / max(np.linalg.norm(turned), 1e-300)
    return np.concatenate([pose.rotation.T @ moved if axes == "tool" else moved, turned])


@pytest.mark.parametrize("relaxed", RELAXED)
@pytest.mark.parametrize(("name", "task"), ARMS)
def test_what_arrives_is_allowed_and_what_is_allowed_is_found(
    name: str, task: str, relaxed: str
) -> None:
    """A pose away from a configuration's by what the bands allow, and nothing else."""
    robot, relaxations = robot_named(name), RELAXED[relaxed]
    lower, upper = robot.finite_limits()
    axes = "tool" if any(item.in_tool_axes for item in relaxations) else "world"
    for seed in range(3):
        rng = np.random.default_rng(seed)
        actual = robot.pose(rng.uniform(lower, upper))
        away = np.zeros(6)
        for item in relaxations:
            direction = rng.normal(size=len(item.rows))
            size = min(item.band, 0.1) * rng.uniform(0.2, 0.9)
            away[item.indices] = size * direction / np.linalg.norm(direction)
        turn = actual.rotation @ pin.exp3(away[3:]).T
        shift = turn @ away[:3] if axes == "tool" else away[:3]
        pose = pin.SE3(turn, actual.translation - shift)
        allowed = Allowed(
            dwelling(robot, pose, task), relaxations, (False, False), robot.lower, robot.upper
        )
        seeds = np.array(list(spread(robot, 60, rng)))
        q, told, arrived = allowed.project(
            seeds, 0.5, far=True, deviation=allowed.anywhere(len(seeds), 0.5, rng)
        )
        assert arrived.any()
        prescribed = np.isin(np.arange(6), sm.Task.of(task).rows)
        for here, deviation in zip(q[arrived], told[arrived], strict=True):
            assert np.all((here >= robot.lower) & (here <= robot.upper))
            found = away_from(pose, robot.pose(here), task, axes)
            for item in relaxations:
                assert np.linalg.norm(found[item.indices]) <= item.band * (1.0 + ROUNDING)
                assert np.linalg.norm(deviation[item.indices]) <= item.band
                found[item.indices] = 0.0
            assert np.abs(found[prescribed]).max() < ON_PATH


def test_only_within_its_window_and_where_the_ends_are_not_pinned() -> None:
    robot = robot_named("panda")
    pose = robot.pose(robot.dexterous_configuration())
    follows = Follows.of(robot, sm.Dwell(pose, 4.0), "pose")
    during = sm.Relaxation("x", 0.1, during=(0.0, 2.0))
    free, pinned = (
        Allowed(follows, [during], (pin, False), robot.lower, robot.upper) for pin in (False, True)
    )
    assert [len(free.relaxed(t)) for t in (0.0, 1.0, 2.0, 4.0)] == [1, 1, 0, 0]
    assert [len(pinned.relaxed(t)) for t in (0.0, 1.0, 2.0, 4.0)] == [0, 1, 0, 0]


@pytest.mark.parametrize(("name", "task"), [("panda", "pose"), ("ur5", "position")])
def test_the_nearest_configuration_misses_by_what_it_says(name: str, task: str) -> None:
    robot, rng = robot_named(name), np.random.default_rng(0)
    pose = robot.pose(robot.dexterous_configuration(task))
    far = pin.SE3(pose.rotation, pose.translation + np.array([0.0, 3.0, 0.0]))
    for target, is_there in ((pose, True), (far, False)):
        allowed = Allowed(
            dwelling(robot, target, task), (), (False, False), robot.lower, robot.upper
        )
        q, _, misses = allowed.approach(np.array(list(spread(robot, 24, rng))), 0.5)
        for here, miss in zip(q, misses, strict=True):
            np.testing.assert_allclose(
                sm.Task.of(task).miss(target, robot.pose(here)), miss, atol=1e-9
            )
        assert (misses.sum(axis=1).min() < ON_PATH) == is_there
        if not is_there:
            assert misses[:, 0].min() > 3.0 - robot.reach


def test_directions_keep_the_tool_allowed_to_first_order() -> None:
    """And there are as many as redundancy and relaxed rows leave."""
    robot, step = robot_named("ur5"), 1e-6
    q = robot.dexterous_configuration()
    pose = robot.pose(q)
    cone = RELAXED["cone"]
    allowed = Allowed(dwelling(robot, pose, "pose"), cone, (False, False), robot.lower, robot.upper)
    directions = allowed.directions(q, 0.5)
    assert directions.shape == (6, 2)
    for direction in directions.T:
        moved = away_from(pose, robot.pose(q + step * direction), "pose", "world")
        assert np.linalg.norm(moved[3:5]) > 0.1 * step
        moved[3:5] = 0.0
        assert np.abs(moved).max() < 10.0 * step**2 / 1e-6 * 1e-3


def test_what_is_no_number_misses_by_infinity() -> None:
    """Others are approached as if it was not there."""
    robot = robot_named("panda")
    rng = np.random.default_rng(5)
    pose = robot.pose(robot.dexterous_configuration())
    follows = dwelling(robot, pose, "pose")
    allowed = Allowed(follows, RELAXED["cone"], (False, False), robot.lower, robot.upper)
    seeds, away = np.array(list(spread(robot, 6, rng))), np.zeros((6, 6))
    q, _, misses = allowed.approach(seeds, 0.5, away)
    away[2, 3] = np.nan
    some, _, missed = allowed.approach(seeds, 0.5, away)
    others = [0, 1, 3, 4, 5]
    np.testing.assert_array_equal(some[others], q[others])
    np.testing.assert_array_equal(missed[others], misses[others])
    assert np.isinf(missed[2]).all()
