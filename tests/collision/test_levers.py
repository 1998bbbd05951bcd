"""Lever arms: no point moves farther, no distance changes more, than they say; on every arm."""

import numpy as np
import pinocchio as pin
import pytest

from selfmotion.collision import Box, CollisionModel, Sphere
from selfmotion.collision.bodies import Body, link_bodies
from selfmotion.robot import NAMED_ARMS, RobotModel, load_robot
from support.two_arms import baxter_with_both_arms

WORLD = (Box("box", [0.6, 0.3, 0.5], [0.2, 0.3, 0.4]), Sphere("ball", [-0.4, 0.5, 0.9], 0.1))


ARMS = [name for name in NAMED_ARMS if name != "planar_3r"]


# Rounding of kinematics.
EXACT = 1e-12


# What distances are right to, by `test_collision_distances` [m].
DISTANCE = 1e-6


@pytest.fixture(scope="module", params=[*ARMS, "both arms of baxter"])
def model(request: pytest.FixtureRequest) -> CollisionModel:
    both = request.param not in ARMS
    return CollisionModel(baxter_with_both_arms() if both else load_robot(request.param), WORLD)


def samples(robot: RobotModel, count: int, seed: int = 0) -> np.ndarray:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.dof))


def corners(model: CollisionModel, bodies: list[Body], q: np.ndarray) -> list[np.ndarray]:
    """Return points of the bodies' real geometry at q, by Pinocchio's own placements."""
    robot = model.robot
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    found = []
    for body in bodies:
        place = data.oMi[body.joint] * body.place
        if body.solid.is_mesh:
            points = np.array(body.solid.geometry.vertices())[::7]
        else:
            low, high = body.solid.low, body.solid.high
            sides = np.random.default_rng(0).uniform(-1.0, 1.0, (30, 3))
            # In an ellipsoid within the box: inside a box, a sphere and a cylinder alike.
            sides /= np.maximum(np.linalg.norm(sides, axis=1), 1.0)[:, None]
            points = 0.5 * (low + high) + 0.5 * (high - low) * sides
        found.append(points @ place.rotation.T + place.translation)
    return found


def test_no_point_moves_farther_than_the_lever_arms_say(model: CollisionModel) -> None:
    rng, levers = np.random.default_rng(1), model.lever_arms
    lower, upper = model.robot.finite_limits()
    bodies, reached = link_bodies(model.robot), np.zeros(len(levers))
    for q in samples(model.robot, 12):
        before = corners(model, bodies, q)
        for size in (1e-3, 0.1, 1.0):
            step = size * rng.normal(size=model.robot.dof)
            if size < 0.01:
                # One joint alone shows how tight the arm is.
                step *= np.arange(model.robot.dof) == rng.integers(model.robot.dof)
            other = np.clip(q + step, lower, upper)
            allowed = levers @ np.abs(other - q)
            for b, (start, end) in enumerate(
                zip(before, corners(model, bodies, other), strict=True)
            ):
                moved = np.linalg.norm(end - start, axis=1).max()
                assert moved <= allowed[b] + EXACT
                if allowed[b] > 0.0:
                    reached[b] = max(reached[b], moved / allowed[b])
    # A bound ten times too wide would be kept as well.
    carried = levers.any(axis=1)
    assert np.median(reached[carried]) > 0.4


def test_distances_change_by_no_more_than_the_pair_levers_say(model: CollisionModel) -> None:
    rng, levers = np.random.default_rng(2), model.pair_levers
    lower, upper = model.robot.finite_limits()
    assert levers.shape == (len(model.pairs), model.robot.dof)
    for q in samples(model.robot, 6):
        others = [
            np.clip(q + size * rng.normal(size=model.robot.dof), lower, upper)
            for size in (1e-3, 0.1)
        ]
        here, *there = model.distances(np.array([q, *others]))
        for other, values in zip(others, there, strict=True):
            # A depth of hulls stands for one of meshes: it may jump where meshes begin to overlap.
            apart = (here > 0.0) & (values > 0.0)
            change = np.abs(values - here)[apart]
            assert np.all(change <= (levers @ np.abs(other - q))[apart] + DISTANCE)


def test_joints_that_move_both_bodies_or_none_do_not_count(model: CollisionModel) -> None:
    names = list(model.bodies)
    for (first, second), lever in zip(model.pairs, model.pair_levers, strict=True):
        a, b = model.moved[names.index(first)], model.moved[names.index(second)]
        assert np.array_equal(lever > 0.0, a != b)


def test_lever_arms_of_a_planar_arm_by_hand(tmp_path) -> None:
    """Links of 0.5 m with a ball of 0.1 m at their ends, on a slide of up to 2 m along x."""
    file = tmp_path / "arm.urdf"
    ball = '<origin xyz="0.5 0 0"/><geometry><sphere radius="0.1"/></geometry>'
    joint = (
        '<joint name="to_{0}" type="{1}"><parent link="{2}"/><child link="{0}"/>'
        '<origin xyz="{3} 0 0"/><axis xyz="{4}"/>'
        '<limit lower="-1" upper="2" velocity="1" effort="1"/></joint>'
    )
    chain = (
        ("a", "revolute", "base", 0, "0 0 1"),
        ("b", "prismatic", "a", 0.5, "1 0 0"),
        ("c", "revolute", "b", 0.5, "0 0 1"),
    )
    links = '<link name="base"/>' + "".join(
        f'<link name="{j[0]}"><collision>{ball}</collision></link>' for j in chain
    )
    joints = "".join(joint.format(*row) for row in chain)
    file.write_text(f'<robot name="arm">{links}{joints}</robot>')
    model = CollisionModel(load_robot(file), [Sphere("post", [-1.0, 0.0, 0.0], 0.2)])
    assert model.bodies == ("a", "b", "c", "post")
    expected = [[0.6, 0.0, 0.0], [3.1, 1.0, 0.0], [3.6, 1.0, 0.6], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(model.lever_arms, expected, atol=EXACT)
    # Of a and c, only b and c count; c's axis is nearer to the ball of c than to that of a. Joint
    # a turns the arm about the world's origin: the post is at most 1.2 m from there.
    pairs = dict(zip(model.pairs, model.pair_levers, strict=True))
    np.testing.assert_allclose(pairs["a", "c"], [0.0, 1.0, 0.6], atol=EXACT)
    np.testing.assert_allclose(pairs["c", "post"], [1.2, 1.0, 0.6], atol=EXACT)
