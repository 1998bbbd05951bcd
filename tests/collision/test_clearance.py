"""Clearances of hulls: conservative, with exact gradients, level far away, on every arm."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from selfmotion.basics import RobotError
from selfmotion.model.collision import (
    Box,
    Capsule,
    ClearanceModel,
    Clearances,
    CollisionModel,
    Cylinder,
    Mesh,
    Sphere,
)
from selfmotion.model.collision.distances import TOLERANCE
from selfmotion.model.robot import NAMED_ARMS, load_robot

TURNED = pin.SE3(pin.rpy.rpyToMatrix(0.4, -0.3, 0.8), np.array([0.5, -0.4, 0.6]))


WORLD = (
    Box("box", TURNED, [0.2, 0.3, 0.1]),
    Sphere("sphere", [0.6, 0.5, 0.7], 0.1),
    Cylinder("cylinder", TURNED.inverse(), 0.1, 0.3),
    Capsule("capsule", pin.SE3(TURNED.rotation, np.array([-0.4, 0.5, 0.8])), 0.05, 0.4),
)


# Where clearances begin to level off, and over which distance, by default [m].
NEAR, WIDTH = 0.02, 0.02


# What two distances of coal may differ by.
GJK = 2e-6


# Central differences with a step of 1e-6 of distances solved to 1e-9; with a step of 1e-4 of
# depths, since EPA stops within 1e-6 of them.
DIFFERENCE, DEPTH_DIFFERENCE = 1e-3, 3e-2


ARMS = [name for name in NAMED_ARMS if name != "planar_3r"]


@pytest.fixture(scope="module", params=ARMS)
def models(request) -> tuple[CollisionModel, ClearanceModel]:
    exact = CollisionModel(load_robot(request.param), WORLD)
    return exact, ClearanceModel(exact)


def samples(robot, count: int, seed: int = 1) -> np.ndarray:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.dof))


def test_gradient_is_the_central_difference(models) -> None:
    exact, _ = models
    # So wide that most pairs are near.
    model = ClearanceModel(exact, NEAR, 0.5)
    q = samples(model.robot, 6)
    clearances = model.clearances(q)
    gradient, deep = clearances.jacobian(), clearances.values < 1e-3
    wrong = np.zeros(gradient.shape, dtype=bool)
    for step, tolerance, here in ((1e-6, DIFFERENCE, ~deep), (1e-4, DEPTH_DIFFERENCE, deep)):
        for joint, unit in enumerate(np.eye(model.robot.dof)):
            ahead = model.clearances(q + step * unit).values
            behind = model.clearances(q - step * unit).values
            difference = (ahead - behind) / (2.0 * step)
            far = np.abs(difference - gradient[:, :, joint]) > tolerance
            wrong[:, :, joint] |= far & here
    assert (gradient != 0.0).any(axis=2).mean() > 0.1
    # Where the closest points jump within the step there is no derivative to agree with.
    assert wrong.any(axis=2).mean() < 2e-3


@pytest.mark.parametrize("obstacle", WORLD, ids=lambda item: item.shape)
def test_slopes_are_as_near_as_gjk_comes_to_the_bodies(obstacle) -> None:
    """Exact of flat faces and of what is rounded by a radius; of a cylinder's side, √ tolerance."""
    exact = CollisionModel(load_robot("ur5"), [obstacle])
    model = ClearanceModel(exact, 10.0, 0.5)
    near = np.array([second == obstacle.name for _, second in model.pairs])
    q, step, levers = samples(model.robot, 10), 3e-5, exact.pair_levers.max()
    found = model.clearances(q)
    apart = (found.values > 2e-3) & near
    wrong = np.zeros(apart.shape)
    for joint, unit in enumerate(np.eye(model.robot.dof)):
        ahead, behind = (model.clearances(q + side * step * unit).values for side in (1.0, -1.0))
        off = (ahead - behind) / (2.0 * step) - found.jacobian()[:, :, joint]
        wrong = np.maximum(wrong, np.abs(off))
    of_gjk = 3.0 * TOLERANCE**0.5 * levers
    assert wrong[apart].max() <= (of_gjk if obstacle.shape == "cylinder" else 1e-5)
    assert np.median(wrong[apart]) <= (of_gjk if obstacle.shape == "cylinder" else 1e-9)


def test_clearances_level_off_smoothly_and_from_below() -> None:
    """On the way to a box: continuous in value and slope, never more than the hulls' distance."""
    robot = load_robot("panda")
    exact = CollisionModel(robot, [Box("box", [0.6, 0.3, 0.5], [0.1, 0.2, 0.3])])
    model = ClearanceModel(exact, NEAR)
    column = model.pairs.index(("panda_hand", "box"))
    q = (
        np.array([0.0, 0.2, 0.0, -1.8, 0.0, 1.9, 0.4])
        + np.linspace(0.0, 0.6, 4001)[:, None] * np.eye(7)[0]
    )
    clearances = model.clearances(q)
    values, slopes = clearances.values[:, column], clearances.jacobian()[:, column, 0]
    assert values.max() == pytest.approx(NEAR + 0.5 * WIDTH)
    assert values.min() < 0.0
    steps = np.diff(values)
    expected = 0.5 * (slopes[1:] + slopes[:-1]) * 0.6 / 4000
    # GJK's noise, and a second derivative of tens of metres where it levels off.
    assert np.abs(steps - expected).max() < 4.0 * GJK
    alone = ClearanceModel(exact, 1.0).clearances(q).values[:, column]
    assert np.all(values <= alone + GJK)
    assert values[values < NEAR] == pytest.approx(alone[values < NEAR], abs=GJK)
    far = alone > NEAR + WIDTH
    assert far.any()
    assert np.all(slopes[far] == 0.0)


def test_distances_along_motions_follow_from_the_gradients(models) -> None:
    _, model = models
    clearances = model.clearances(samples(model.robot, 4))
    tangents = np.random.default_rng(2).normal(size=(4, model.robot.dof, 3))
    expected = np.einsum("kpn,knd->kpd", clearances.jacobian(), tangents)
    assert clearances.along(tangents) == pytest.approx(expected, abs=1e-10)


def test_changes_along_motions_are_the_gradients_times_these(models) -> None:
    _, model = models
    clearances = model.clearances(samples(model.robot, 4))
    tangents = np.random.default_rng(3).normal(size=(4, model.robot.dof, 3))
    expected = clearances.jacobian() @ tangents
    assert clearances.along(tangents) == pytest.approx(expected, abs=1e-10)


def test_what_is_closer_is_known_without_slopes(models) -> None:
    """As `clearances` has it, at every margin that is not levelled off."""
    exact, model = models
    q = samples(exact.robot, 60)
    values = model.clearances(q).values
    for margin in (-0.01, 0.0, 0.01, NEAR):
        decided = np.all(np.abs(values - margin) > GJK, axis=1)
        closer = model.closer(q, margin)
        np.testing.assert_array_equal(closer[decided], (values < margin).any(axis=1)[decided])
    assert model.closer(q, NEAR).any()


def test_what_was_asked_before_changes_nothing(models) -> None:
    """Pairs that cannot have come near since then are left out, and those alone."""
    exact, _ = models
    model, rng = ClearanceModel(exact, NEAR), np.random.default_rng(3)
    q = samples(model.robot, 20)
    for size in (0.0, 1e-4, 1e-2, 0.1, 0.5, 1e-3):
        q = q + size * rng.uniform(-1.0, 1.0, q.shape)
        found, alone = model.clearances(q), ClearanceModel(exact, NEAR).clearances(q)
        np.testing.assert_allclose(found.values, alone.values, atol=GJK)
        np.testing.assert_allclose(found.jacobian(), alone.jacobian(), atol=1e-9)


def test_a_body_that_moves_is_where_it_is_now() -> None:
    """Whichever of the models that share its hull is told."""
    exact = CollisionModel(load_robot("panda"), WORLD)
    models, q = [ClearanceModel(exact, NEAR) for _ in range(2)], samples(exact.robot, 5)
    assert all((model.clearances(q).values > 0.0).any() for model in models)
    at = exact.robot.pose(q[0]).translation
    models[0].move("sphere", pin.SE3(np.eye(3), at))
    for model in models:
        meets = np.array([second == "sphere" for _, second in model.pairs])
        assert model.clearances(q).values[0, meets].min() < 0.0
        assert model.closer(q, 0.0)[0]


def test_what_is_closer_along_a_motion_is_so_at_each_sample(models) -> None:
    """Distances at a few samples decide those between."""
    _, model = models
    ends = samples(model.robot, 8, seed=5)
    share = np.linspace(0.0, 1.0, 60)[:, None]
    for first, last in pairwise(ends):
        q = first + share * (last - first)
        one_by_one = [bool(model.closer(each[None], 0.5 * NEAR)[0]) for each in q]
        np.testing.assert_array_equal(model.closer(q, 0.5 * NEAR), one_by_one)


def test_no_pair_is_closer_than_its_clearance(models) -> None:
    exact, model = models
    q = samples(model.robot, 25)
    values, distances = model.clearances(q).values, exact.distances(q, NEAR)
    columns = [i for i, pair in enumerate(exact.pairs) if pair in set(model.pairs)]
    kept = [exact.pairs[i] for i in columns]
    for pair in set(model.pairs):
        mine = [name == pair for name in model.pairs]
        theirs = [column for column, name in zip(columns, kept, strict=True) if name == pair]
        smallest = distances[:, theirs].min(axis=1)
        assert np.all(values[:, mine].min(axis=1) <= np.maximum(smallest, NEAR + WIDTH) + GJK)
        apart = values[:, mine].min(axis=1) > GJK
        if sum(mine) == len(theirs):
            assert not np.any(apart & (smallest <= 0.0))


def test_smallest_distance_is_below_the_exact_one() -> None:
    """Panda against the world alone, where no pair is left out."""
    exact = CollisionModel(load_robot("panda"), WORLD)
    model = ClearanceModel(exact)
    world = np.array([pair[1] in {o.name for o in WORLD} for pair in model.pairs])
    for q in samples(model.robot, 50):
        clearance = exact.distance(q)
        if clearance.second in {o.name for o in WORLD} and clearance.value > 0:
            assert model.clearances(q[None]).values[:, world].min() <= clearance.value + GJK


def test_few_clear_configurations_are_refused() -> None:
    """What being conservative costs on Panda: under a tenth of the free configurations."""
    exact = CollisionModel(load_robot("panda"), WORLD)
    model = ClearanceModel(exact)
    q = samples(model.robot, 400)
    free = np.array([not exact.collides(row) for row in q])
    np.testing.assert_array_equal(exact.colliding(q), ~free)
    refused = model.clearances(q).values.min(axis=1) <= 0
    assert (refused & free).sum() < 0.1 * free.sum()


def test_a_known_collision_is_refused() -> None:
    robot = load_robot("panda")
    q = np.array([0.4, 0.2, 0.0, -1.5, 0.0, 1.5, 0.0])
    at_hand = CollisionModel(robot, [Sphere("ball", robot.pose(q).translation, 0.03)])
    model = ClearanceModel(at_hand)
    values = model.clearances(q[None]).values[0]
    worst = model.pairs[int(values.argmin())]
    assert values.min() < 0
    assert worst[1] == "ball"


def test_a_mesh_counts_as_its_convex_hull(tmp_path: Path) -> None:
    trimesh.creation.box([200.0, 300.0, 100.0]).apply_translation([10.0, 20.0, 30.0]).export(
        tmp_path / "part.stl"
    )
    robot = load_robot("panda")
    offset = TURNED * pin.SE3(np.eye(3), np.array([0.01, 0.02, 0.03]))
    mesh = ClearanceModel(CollisionModel(robot, [Mesh("it", TURNED, tmp_path / "part.stl", 1e-3)]))
    box = ClearanceModel(CollisionModel(robot, [Box("it", offset, [0.2, 0.3, 0.1])]))
    q = samples(robot, 5)
    # STL keeps seven digits.
    assert mesh.clearances(q).values == pytest.approx(box.clearances(q).values, abs=GJK)


def test_an_arm_without_geometry_has_no_pairs() -> None:
    model = ClearanceModel(CollisionModel(load_robot("planar_3r"), WORLD))
    clearances = model.clearances(np.zeros((4, 3)))
    assert model.pairs == ()
    assert clearances.values.shape == (4, 0)
    assert clearances.along(np.zeros((4, 3, 2))).shape == (4, 0, 2)
    assert clearances.jacobian().shape == (4, 0, 3)


def test_refuses_wrong_shapes() -> None:
    model = ClearanceModel(CollisionModel(load_robot("ur10")))
    for q in (np.zeros(6), np.zeros((2, 5)), np.full((2, 6), np.nan)):
        with pytest.raises(RobotError, match="samples have shape"):
            model.clearances(q)


def test_pairs_of_convex_bodies_alone_are_exact(tmp_path: Path) -> None:
    """Two walls in one mesh are not their hull; each of them is."""
    walls = [trimesh.creation.box([0.1, 0.02, 0.1]), trimesh.creation.box([0.02, 0.1, 0.1])]
    walls[1].apply_translation([0.3, 0.3, 0.0])
    both = trimesh.util.concatenate(walls)
    items = []
    for name, mesh in (("wall", walls[0]), ("walls", both)):
        mesh.export(tmp_path / f"{name}.stl")
        items.append(Mesh(name, [0.6, 0.6, 0.6], tmp_path / f"{name}.stl"))
    robot = load_robot("panda")
    model = ClearanceModel(CollisionModel(robot, items))
    exact = {pair: model.is_exact(column) for column, pair in enumerate(model.pairs)}
    convex = {kept for pair, kept in exact.items() if "wall" in pair}
    # Of the arm's own meshes some are convex, others are not.
    assert True in convex
    assert not any(kept for pair, kept in exact.items() if "walls" in pair)


@pytest.mark.parametrize("count", [0, 9])
def test_slopes_of_some_pairs_are_those_of_all(count: int) -> None:
    rng, shape = np.random.default_rng(0), (5, 4)
    rows, columns = np.unravel_index(np.sort(rng.permutation(20)[:count]), shape)
    found = Clearances(np.ones(shape), rows, columns, rng.normal(size=(count, 3)))
    every, (samples, pairs) = found.jacobian(), np.indices(shape).reshape(2, -1)
    np.testing.assert_array_equal(found.slopes_at(samples, pairs), every[samples, pairs])
    assert np.count_nonzero(every.any(axis=2)) == count
