"""Winding numbers, and boxes around bodies: their distances by dense algebra, wherever they are."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pinocchio as pin
import pytest
import trimesh

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.model.collision.distances import BoundingBoxes
from selfmotion.model.collision.kernels import separation, winding_number
from support.arms import robot_named

# Of sums of products of numbers up to a few.
ROUNDING = 1e-12


def test_winding_number_counts_a_closed_surface_once() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2).triangles
    assert winding_number(ball, np.array([0.2, 0.3, 0.1])) == pytest.approx(1.0)
    assert winding_number(ball, np.array([0.2, 1.3, 0.1])) == pytest.approx(0.0, abs=1e-12)


def along_axes(a: Array, b: Array, t: Array, g: Array, h: Array, *, edges: bool = True) -> float:
    """Return the largest gap between shadows of two boxes on the 15 axes, or on 6."""
    axes = [*a.T, *b.T]
    if edges:
        crossed = [np.cross(x, y) for x in a.T for y in b.T]
        axes += [x / np.linalg.norm(x) for x in crossed if np.linalg.norm(x) > 1e-3]
    return max(float(abs(x @ t) - g @ np.abs(a.T @ x) - h @ np.abs(b.T @ x)) for x in axes)


@pytest.mark.parametrize("seed", range(30))
def test_boxes_are_apart_by_the_largest_gap_between_their_shadows(seed: int) -> None:
    """Of boxes that are turned alike in some axis as well; edges often decide."""
    rng = np.random.default_rng(seed)
    a = np.asarray(pin.exp3(rng.normal(size=3)))
    b = np.asarray(a @ pin.exp3(rng.normal(size=3) * ([0.0, 0.0, 1.0] if seed % 3 else 1.0)))
    g, h = rng.uniform(0.1, 1.0, (2, 3))
    t = rng.normal(size=3) * rng.choice([0.3, 2.0])
    given = a, b, t, g, h
    expected = along_axes(*given)
    assert separation(*given, np.inf, np.empty((5, 3))) == pytest.approx(expected, abs=ROUNDING)
    # Where faces separate them by enough, these suffice.
    faces = along_axes(*given, edges=False)
    for limit in (faces - 0.01, faces + 0.01):
        found = separation(*given, limit, np.empty((5, 3)))
        wanted = faces if faces >= limit else expected
        assert found == pytest.approx(wanted, abs=ROUNDING)


def boxes_of(robot: sm.RobotModel, bodies: list, q: Array) -> list[tuple[Array, Array, Array]]:
    """Return axes, middle and half lengths of boxes around bodies at q, by Pinocchio."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.coupling.spread(q))
    found = []
    for body in bodies:
        place, solid = data.oMi[body.joint] * body.place, body.solid
        middle = place.act(0.5 * (np.array(solid.low) + solid.high))
        found.append((place.rotation, middle, 0.5 * (np.array(solid.high) - solid.low)))
    return found


def bound_of(one: tuple[Array, Array, Array], other: tuple[Array, Array, Array]) -> float:
    """Return the larger of the gaps of two boxes, and of the spheres around them."""
    (a, x, g), (b, y, h) = one, other
    spheres = float(np.linalg.norm(y - x) - np.linalg.norm(g) - np.linalg.norm(h))
    return max(spheres, along_axes(a, b, y - x, g, h))


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_bounds_of_all_pairs_are_those_of_their_boxes(name: str) -> None:
    robot, rng = robot_named(name), np.random.default_rng(0)
    bodies = list(sm.obstacles.CollisionModel(robot).every_body)[:6]
    pairs = np.array(list(combinations(range(len(bodies)), 2)))
    q = rng.uniform(*robot.finite_limits(), (3, robot.dof))
    boxes = BoundingBoxes(robot, bodies)
    # One is put elsewhere after that.
    moved = pin.SE3(np.asarray(pin.exp3(rng.normal(size=3))), rng.normal(size=3))
    bodies[2] = replace(bodies[2], place=moved * bodies[2].place)
    boxes.move(2, bodies[2])
    sharp, limit = boxes.lower_bounds(q, pairs), 0.1
    near = boxes.lower_bounds(q, pairs, limit)
    for k, here in enumerate(q):
        placed = boxes_of(robot, bodies, here)
        expected = [bound_of(placed[i], placed[j]) for i, j in pairs]
        np.testing.assert_allclose(sharp[k], expected, atol=1e-9)
    assert (near <= sharp + ROUNDING).all()
    np.testing.assert_array_equal(near >= limit, sharp >= limit)
    np.testing.assert_allclose(near[sharp < limit], sharp[sharp < limit], atol=ROUNDING)
