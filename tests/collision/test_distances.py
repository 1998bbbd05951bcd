"""Distances of hulls and meshes: against support functions, closed forms and unions of boxes."""

from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest

from selfmotion.basics import CollisionError
from selfmotion.model.collision import Solid, distances as module
from selfmotion.model.collision.distances import HullDistances
from selfmotion.model.collision.mesh_distances import MeshDistances
from selfmotion.model.robot import RobotModel
from support.independent_distances import (
    KINDS,
    TOLERANCE,
    Convex,
    Trial,
    body,
    fault,
    free_body,
    mesh_of,
    random_body,
    separation,
)

HERE = pin.SE3.Identity()


@pytest.fixture(scope="module")
def free(tmp_path_factory: pytest.TempPathFactory) -> RobotModel:
    return free_body(tmp_path_factory.mktemp("free"))


@pytest.mark.parametrize("seed", range(4))
def test_distances_of_all_kinds_are_those_of_support_functions(free: RobotModel, seed: int) -> None:
    """1000 poses each of 25 pairs of kinds that keep their requests; 100,000 in benchmarks/."""
    rng = np.random.default_rng(seed)
    trial = Trial.made(free, rng, 1)
    assert trial.faults(free, rng, 40, 10.0 ** rng.uniform(-4.0, -1.0)) == []


WRONG = [
    lambda d, n, p: (-1.8e308, n, p),
    lambda d, n, p: (np.nan, n, p),
    lambda d, n, p: (0.0, n, p),
    lambda d, n, p: (d + 1e-3, n, p),
    lambda d, n, p: (d - 1e-3, n, p),
    lambda d, n, p: (d, -n, p),
    lambda d, n, p: (d, np.roll(n, 1), p),
]


@pytest.mark.parametrize(
    ("apart", "change"),
    # Points are looked at where bodies are apart.
    [(0.4, change) for change in (*WRONG, lambda d, n, p: (d, n, p + 0.1))]
    + [(0.05, change) for change in WRONG],
)
def test_the_check_by_support_functions_finds_errors(apart: float, change) -> None:
    first, second = Convex.of(coal.Box(0.2, 0.3, 0.4)), Convex.of(coal.Cylinder(0.1, 0.3))
    there = pin.SE3(np.eye(3), np.array([apart, 0.01, 0.02]))
    contact = (apart - 0.2, np.array([-1.0, 0.0, 0.0]), np.array([0.1, 0.01, 0.02]))
    rng = np.random.default_rng(0)
    assert fault(first, HERE, second, there, contact, rng) == ""
    assert fault(first, HERE, second, there, change(*contact), rng) != ""


def one_pair(free: RobotModel, first: object, second: object, there: pin.SE3) -> HullDistances:
    bodies = [body("first", 6, HERE, first), body("second", 0, there, second)]
    return HullDistances(free, bodies, np.array([[0, 1]]))


def hull_distances(model: HullDistances, q: np.ndarray) -> np.ndarray:
    bounds = model.lower_bounds(q[None])[0]
    model.place(q)
    return np.array([model.distance(i, bound) for i, bound in enumerate(bounds)])


def test_closed_forms(free: RobotModel) -> None:
    """Sphere and sphere, and sphere and box outside and inside, at random places."""
    rng = np.random.default_rng(1)
    balls = one_pair(free, coal.Sphere(0.2), coal.Sphere(0.3), HERE)
    half = np.array([0.1, 0.2, 0.3])
    box = one_pair(free, coal.Sphere(0.05), coal.Box(*(2.0 * half)), HERE)
    for _ in range(200):
        x = rng.uniform(-0.7, 0.7, 3)
        q = np.concatenate([x, rng.uniform(-3.0, 3.0, 3)])
        beyond = np.abs(x) - half
        to_box = np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0)
        for pair, expected in ((balls, np.linalg.norm(x) - 0.5), (box, to_box - 0.05)):
            assert hull_distances(pair, q)[0] == pytest.approx(expected, abs=2e-6)


def test_an_answer_that_contradicts_the_boxes_is_asked_for_again(
    free: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = one_pair(free, coal.Box(0.2, 0.2, 0.2), coal.Cylinder(0.1, 0.2), HERE)
    q = np.array([[0.3, 0.0, 0.0, 0.0, 0.0, 0.0]])
    bound = pair.lower_bounds(q)
    pair.place(q[0])
    right = pair.distance(0, bound[0, 0])
    assert right == pytest.approx(0.1, abs=1e-6)
    for wrong in (-1.8e308, 0.0, np.nan, 3.0):
        with monkeypatch.context() as context:
            answer = SimpleNamespace(min_distance=wrong)
            context.setattr(module.pin, "computeDistance", lambda *_, given=answer: given)
            assert pair.distance(0, bound[0, 0]) == pytest.approx(right, abs=1e-6)
            zero = np.zeros(1, dtype=np.int64)
            contacts = pair.contacts(q, zero, zero, bound[0])
            assert contacts.values == pytest.approx([right], abs=1e-6)
            context.setattr(module.coal, "distance", lambda *_: 0.0)
            with pytest.raises(CollisionError, match=r"'first' and 'second': coal finds"):
                pair.distance(0, bound[0, 0])


def test_boxes_bound_the_distances_and_tell_something(free: RobotModel) -> None:
    rng = np.random.default_rng(2)
    trial = Trial.made(free, rng, 2)
    q = rng.uniform(-1.0, 1.0, (30, 6))
    bounds = trial.distances.lower_bounds(q)
    spheres = trial.distances.lower_bounds(q, -np.inf)
    exact = np.array([hull_distances(trial.distances, x) for x in q])
    assert np.all(bounds <= exact + TOLERANCE)
    assert np.all(spheres <= bounds)
    boxes = [i for i, (a, b) in enumerate(trial.distances.pairs) if a < 2 and 10 <= b < 12]
    overlap = exact[:, boxes] < 0.0
    assert overlap.any()
    # Of boxes themselves the depth is exact.
    np.testing.assert_allclose(bounds[:, boxes][overlap], exact[:, boxes][overlap], atol=1e-5)


def l_shape() -> tuple[object, list[tuple[object, pin.SE3]]]:
    """Return the mesh of an L, and the two boxes that it is made of."""
    rim = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]) * 0.5
    points = np.vstack([np.column_stack([rim, np.full(6, z)]) for z in (0.0, 0.5)])
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    side = [[k, (k + 1) % 6, 6 + k] for k in range(6)]
    side += [[(k + 1) % 6, 6 + (k + 1) % 6, 6 + k] for k in range(6)]
    faces = np.vstack([cap[:, ::-1], cap + 6, side])
    low, high = pin.SE3(HERE), pin.SE3(HERE)
    low.translation, high.translation = np.array([0.5, 0.25, 0.25]), np.array([0.25, 0.5, 0.25])
    boxes = [(coal.Box(1.0, 0.5, 0.5), low), (coal.Box(0.5, 1.0, 0.5), high)]
    return mesh_of(points, faces), boxes


@pytest.mark.parametrize("kind", [*KINDS, "mesh"])
def test_a_mesh_is_as_far_as_the_nearer_of_the_boxes_it_is_made_of(
    free: RobotModel, kind: str
) -> None:
    rng = np.random.default_rng(7)
    mesh, boxes = l_shape()
    other = l_shape()[0] if kind == "mesh" else random_body(kind, rng)
    parts = boxes if kind == "mesh" else [(other, HERE)]
    solids = [Solid(mesh, "mesh"), Solid(other, "other")]
    assert not solids[0].is_convex
    assert solids[0].is_closed
    pair = one_pair(free, mesh, other, HERE)
    meshes = MeshDistances(solids, ("mesh", "other"), pair.pairs)
    hollow = 0
    for _ in range(300):
        q = np.concatenate([rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0, 3)])
        hulls = hull_distances(pair, q)[0]
        value = meshes.refine(pair.place(q), 0, hulls)
        pose = free.pose(q)
        expected = min(
            coal.distance(
                box, transform(pose * at), part, transform(there),
                coal.DistanceRequest(), coal.DistanceResult(),
            )
            for box, at in boxes
            for part, there in parts
        )  # fmt: skip
        hollow += hulls <= 0.0 < expected
        if expected > TOLERANCE:
            assert value == pytest.approx(expected, abs=TOLERANCE)
        elif expected < -TOLERANCE:
            assert value < 0.0
    assert hollow > 0


def transform(place: pin.SE3) -> object:
    return coal.Transform3s(place.rotation, place.translation)


def test_separation_along_an_axis_by_hand() -> None:
    box, there = Convex.of(coal.Box(0.2, 0.2, 0.2)), pin.SE3(HERE)
    there.translation = np.array([0.5, 0.0, 0.0])
    along = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(separation(box, HERE, box, there, along), [0.3, -0.7])
