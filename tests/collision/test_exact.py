"""Exact clearance: against coal on the real meshes, and what has to be refused."""

import itertools
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from selfmotion.basics import CollisionError, RobotError
from selfmotion.model.collision import (
    Box,
    Capsule,
    CollisionModel,
    Cylinder,
    Mesh,
    Sphere,
    disabled_links,
    srdf_line,
)
from selfmotion.model.robot import NAMED_ARMS, RobotModel, load_robot

BOXES = (
    Box("box", [0.5, 0.2, 0.5], [0.2, 0.2, 0.2]),
    Box(
        "wall",
        pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.4, -0.5, 0.3])),
        [0.2, 0.05, 0.8],
    ),
)


# coal's iterations stop within 1e-6 of the distance, relative or absolute.
GJK = 2e-6


# A hull that is larger than its mesh by 0.1 % of the volume may touch this much earlier [m].
HULL = 5e-4


@pytest.fixture(scope="module")
def panda() -> RobotModel:
    return load_robot("panda")


def samples(robot: RobotModel, count: int, seed: int = 0) -> np.ndarray:
    lower, upper = robot.finite_limits()
    return np.random.default_rng(seed).uniform(lower, upper, (count, robot.dof))


def mesh_distances(robot: RobotModel, boxes, q) -> dict[tuple[str, str], float]:
    """Smallest distance of every two links or obstacles, from coal alone, mesh to mesh."""
    geometry = robot.geometry(pin.GeometryType.COLLISION)
    data, places = robot.model.createData(), geometry.createData()
    pin.updateGeometryPlacements(robot.model, data, geometry, places, q)
    pieces = [
        (robot.model.frames[piece.parentFrame].name, piece.geometry, places.oMg[i])
        for i, piece in enumerate(geometry.geometryObjects)
    ] + [(box.name, coal.Box(*box.size), box.pose) for box in boxes]
    found: dict[tuple[str, str], float] = {}
    for (a, shape_a, pose_a), (b, shape_b, pose_b) in itertools.combinations(pieces, 2):
        value = coal.distance(
            shape_a,
            coal.Transform3s(pose_a.rotation, pose_a.translation),
            shape_b,
            coal.Transform3s(pose_b.rotation, pose_b.translation),
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
        found[a, b] = min(value, found.get((a, b), np.inf))
    return found


@pytest.mark.parametrize("name", ["panda", "ur5", "z1"])
def test_distance_is_coals_distance_of_the_meshes(name: str) -> None:
    robot = load_robot(name)
    model = CollisionModel(robot, BOXES)
    for q in samples(robot, 8):
        expected = mesh_distances(robot, BOXES, q)
        smallest = min(expected[pair] for pair in set(model.pairs))
        clearance = model.distance(q)
        if smallest > HULL:
            assert clearance.value == pytest.approx(smallest, abs=GJK)
            assert expected[clearance.first, clearance.second] == pytest.approx(smallest, abs=GJK)
        else:
            assert clearance.value <= HULL


@pytest.mark.parametrize("name", NAMED_ARMS)
def test_collides_says_what_distance_says(name: str) -> None:
    robot = load_robot(name)
    model = CollisionModel(robot, () if name == "planar_3r" else BOXES)
    for q, margin in itertools.product(samples(robot, 40), (0.0, 0.02)):
        value = model.distance(q).value
        if abs(value - margin) > HULL:
            assert model.collides(q, margin) == (value < margin)


def test_worst_is_the_smallest_distance_and_its_row(panda: RobotModel) -> None:
    model = CollisionModel(panda, BOXES)
    there = np.linspace(*samples(panda, 2), 50)
    for motion in (there, there[::-1]):
        every = [model.distance(q) for q in motion]
        worst = model.worst(motion)
        row = int(np.argmin([clearance.value for clearance in every]))
        assert worst.index == row
        assert worst.value == pytest.approx(every[row].value, abs=GJK)
        assert (worst.first, worst.second) == (every[row].first, every[row].second)


@pytest.mark.parametrize(
    "obstacle",
    [
        Box("it", [0, 0, 0], [0.04, 0.04, 0.04]),
        Sphere("it", [0, 0, 0], 0.02),
        Cylinder("it", [0, 0, 0], 0.02, 0.04),
        Capsule("it", [0, 0, 0], 0.01, 0.02),
    ],
    ids=lambda obstacle: obstacle.shape,
)
def test_an_obstacle_wholly_inside_a_link_is_refused(panda: RobotModel, obstacle) -> None:
    """The surfaces are apart there: a distance of meshes alone calls this free."""
    q = np.array([0.3, -0.4, 0.2, -1.8, 0.1, 1.6, 0.5])
    centre = _inside_link5(panda, q)
    moved = type(obstacle)(**{**obstacle.__dict__, "pose": centre})
    model = CollisionModel(panda, [moved])
    clearance = model.distance(q)
    assert model.collides(q)
    assert clearance.value < 0
    assert (clearance.first, clearance.second) == ("panda_link5", "it")


def _inside_link5(robot: RobotModel, q: np.ndarray) -> np.ndarray:
    geometry = robot.geometry(pin.GeometryType.COLLISION)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    index = geometry.getGeometryId("panda_link5_0")
    piece = geometry.geometryObjects[index]
    place = data.oMi[piece.parentJoint] * piece.placement
    return place.act(piece.geometry.vertices().mean(axis=0))


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    """A ring about z, inner radius 0.3, outer 0.4, height 0.1: not convex."""
    file = tmp_path / "ring.stl"
    trimesh.creation.annulus(0.3, 0.4, 0.1, sections=48).export(file)
    return file


def test_the_hole_of_a_mesh_is_free_and_its_wall_is_not(panda: RobotModel, ring: Path) -> None:
    upright = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 1.5, 0.0])
    around = CollisionModel(panda, [Mesh("ring", [0.0, 0.0, 0.45], ring)])
    through = CollisionModel(panda, [Mesh("ring", [0.35, 0.0, 0.45], ring)])
    assert around.distance(upright).value > 0
    assert not around.collides(upright)
    assert through.distance(upright).value < 0
    assert through.collides(upright)


def test_a_link_wholly_inside_an_obstacle_mesh_is_refused(panda: RobotModel, tmp_path) -> None:
    """A shell with a bore, so that its hull does not decide."""
    shell = trimesh.creation.annulus(0.01, 3.0, 6.0, sections=32)
    shell.export(tmp_path / "shell.stl")
    model = CollisionModel(panda, [Mesh("shell", [1.0, 1.0, 0.0], tmp_path / "shell.stl")])
    q = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0])
    assert model.collides(q)
    assert model.distance(q).value < 0


def test_known_collisions_are_refused(panda: RobotModel) -> None:
    model = CollisionModel(panda, BOXES)
    folded = np.array([0.0, 1.0, 0.0, -3.0, 0.0, 3.0, 0.0])
    tool = np.array([0.4, 0.2, 0.0, -1.5, 0.0, 1.5, 0.0])
    at_tool = CollisionModel(panda, [Sphere("ball", panda.pose(tool).translation, 0.03)])
    assert model.collides(folded)
    assert at_tool.collides(tool)
    assert at_tool.distance(tool).second == "ball"


def test_without_geometry_there_is_nothing_to_check() -> None:
    robot = load_robot("planar_3r")
    model = CollisionModel(robot, BOXES)
    assert not model.has_bodies
    assert model.pairs == ()
    assert model.distance(np.zeros(3)).value == np.inf
    assert not model.collides(np.zeros(3))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda r: CollisionModel(r, [BOXES[0], BOXES[0]]), "box 'box': a link or another"),
        (lambda r: CollisionModel(r, [Sphere("panda_hand", [0, 0, 0], 1)]), "a link or another"),
        (lambda r: CollisionModel(r, [Mesh("m", [0, 0, 0], "no.stl")]), "mesh 'm': no such file"),
        (lambda _: disabled_links("no.srdf"), "no.srdf: SRDF cannot be read"),
        (lambda _: disabled_links(__file__), "not well-formed XML"),
        (
            lambda r: CollisionModel(r, disabled=[("panda_link1", "panda_link33")]),
            "no link 'panda_link33'; it has 'panda_link3'",
        ),
    ],
)
def test_refuses_what_cannot_be_checked(panda: RobotModel, make, message: str) -> None:
    with pytest.raises(CollisionError, match=message):
        make(panda)


def test_refuses_a_mesh_file_that_is_none(panda: RobotModel, tmp_path: Path) -> None:
    file = tmp_path / "noise.stl"
    file.write_bytes(b"no mesh")
    with pytest.raises(CollisionError, match="cannot be read"):
        CollisionModel(panda, [Mesh("m", [0, 0, 0], file)])


@pytest.mark.parametrize("q", [np.zeros(6), np.full(7, np.nan)])
def test_refuses_what_is_no_configuration(panda: RobotModel, q: np.ndarray) -> None:
    model = CollisionModel(panda)
    for call in (model.distance, model.collides):
        with pytest.raises(RobotError):
            call(q)


@pytest.mark.parametrize("name", ["panda", "baxter"])
def test_hull_distances_are_finite_and_repeat(name: str) -> None:
    """Whatever was asked before: the distance at a configuration is a function of it alone."""
    robot = load_robot(name)
    hulls = CollisionModel(robot).hulls
    q = samples(robot, 20)
    bounds, pairs = hulls.lower_bounds(q), range(len(hulls.pairs))
    runs = []
    for order in (range(20), reversed(range(20))):
        rows = {}
        for k in order:
            hulls.place(q[k])
            rows[k] = [hulls.distance(pair, bounds[k, pair]) for pair in pairs]
        runs.append(np.array([rows[k] for k in range(20)]))
    assert np.abs(runs[0]).max() < 10.0
    np.testing.assert_array_equal(*runs)


def test_distances_of_all_pairs_are_exact_where_they_are_asked_for(panda: RobotModel) -> None:
    model = CollisionModel(panda, BOXES)
    q = samples(panda, 30)
    every, near = model.distances(q), model.distances(q, 0.05)
    assert every.shape == (30, len(model.pairs))
    np.testing.assert_allclose(
        every.min(axis=1), [model.distance(row).value for row in q], atol=GJK
    )
    close = every < 0.05 - GJK
    np.testing.assert_allclose(near[close], every[close], atol=GJK)
    assert np.all(near <= every + GJK)
    assert np.all(near[~close] >= 0.05 - GJK)


def test_hulls_will_do_where_exact_distances_are_not_asked_for(panda: RobotModel) -> None:
    model = CollisionModel(panda, BOXES)
    q = samples(panda, 30)
    every, near = model.distances(q), model.distances(q, 0.2, 0.05)
    hulls, bounds = np.empty_like(every), model.hulls.lower_bounds(q)
    for row, here in enumerate(q):
        model.hulls.place(here)
        hulls[row] = [model.hulls.distance(k, bound) for k, bound in enumerate(bounds[row])]
    looked_at = every < 0.2 - GJK
    exact = looked_at & (hulls < 0.05 - GJK)
    assert exact.any()
    np.testing.assert_allclose(near[exact], every[exact], atol=GJK)
    rough = looked_at & (hulls > 0.05 + GJK) & (hulls < 0.2 - GJK)
    assert np.any(every[rough] - hulls[rough] > 10.0 * GJK)
    np.testing.assert_allclose(near[rough], hulls[rough], atol=GJK)


def test_what_touches_is_named_with_the_line_that_leaves_it_out(
    panda: RobotModel, tmp_path: Path
) -> None:
    folded = np.array([0.0, 1.0, 0.0, -3.0, 0.0, 3.0, 0.0])
    model = CollisionModel(panda)
    touching = model.touching(folded)
    assert touching
    assert [item.value for item in touching] == sorted(item.value for item in touching)
    assert touching[0].value == pytest.approx(model.distance(folded).value, abs=GJK)
    lines = "".join(srdf_line(item.first, item.second) for item in touching)
    (tmp_path / "panda.srdf").write_text(f"<robot name='panda'>{lines}</robot>")
    assert (
        CollisionModel(panda, disabled=disabled_links(tmp_path / "panda.srdf")).touching(folded)
        == ()
    )


def test_nearest_points_are_as_far_apart_as_the_bodies() -> None:
    panda = load_robot("panda")
    ball = Sphere("ball", np.array([0.5, 0.2, 0.9]), 0.05)
    model = CollisionModel(panda, [ball])
    rng = np.random.default_rng(0)
    lower, upper = panda.finite_limits()
    apart = 0
    for q in rng.uniform(lower, upper, (40, panda.dof)):
        found = model.distance(q)
        if found.value <= 0.0:
            continue
        apart += 1
        ends = model.nearest_points(q, found.first, found.second)
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(found.value, abs=1e-6)
        if found.second == "ball":
            assert np.linalg.norm(ends[1] - ball.pose.translation) == pytest.approx(0.05, abs=1e-5)
    assert apart > 10
    with pytest.raises(CollisionError, match="no pair that is checked"):
        model.nearest_points(q, "ball", "ball")


def test_groups_part_the_pairs_by_what_is_no_link(panda: RobotModel) -> None:
    """Each pair is in the group of its obstacle, or in that of the arm itself."""
    balls = [Sphere(name, [0.6, x, 0.4], 0.05) for name, x in (("a", 0.4), ("b", -0.4))]
    model = CollisionModel(panda, balls)
    groups = model.groups
    assert list(groups) == ["the arm itself", "a", "b"]
    for name, group in groups.items():
        assert group.pairs
        for pair in group.pairs:
            assert {"a", "b"} & set(pair) == ({name} if name in "ab" else set())
    every = [pair for group in groups.values() for pair in group.pairs]
    assert sorted(every) == sorted(model.pairs)


def test_what_goes_beyond_its_limits_lengthens_levers_of_what_turns() -> None:
    """Joints that slide, and those that move both bodies or none, have no longer ones."""
    robot = load_robot("tiago")
    model = CollisionModel(robot)
    farthest = np.array([max(abs(x), abs(y)) for x, y in zip(*robot.finite_limits(), strict=True)])
    slides = np.array([robot.is_prismatic(name) for name in robot.joint_names])
    beyond = farthest + np.where(slides, 0.3, 0.0)
    usual, longer = (model.pair_levers_up_to(each) for each in (farthest, beyond))
    np.testing.assert_allclose(usual, model.pair_levers)
    assert slides.any()
    np.testing.assert_array_equal(longer[:, slides], usual[:, slides])
    np.testing.assert_array_equal(longer[usual == 0.0], 0.0)
    turned = (
        longer[:, ~slides][usual[:, ~slides] > 0.0] - usual[:, ~slides][usual[:, ~slides] > 0.0]
    )
    np.testing.assert_allclose(turned, 0.3)


def test_a_mesh_in_millimetres_is_refused_with_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "cube.stl"
    trimesh.creation.box([300.0, 200.0, 100.0]).export(file)
    with pytest.raises(CollisionError, match=r"is 300 m long: scale = 0\.001"):
        Mesh("cube", [0.0, 0.0, 0.0], file).geometry()
    found = Mesh("cube", [0.0, 0.0, 0.0], file, scale=1e-3).geometry()
    corners = np.array(found.vertices()).reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(corners, axis=0), [0.3, 0.2, 0.1], rtol=1e-6)


@pytest.mark.parametrize("name", ["panda", "tiago"])
def test_joints_of_a_pair_are_those_that_move_one_body_past_the_other(name: str) -> None:
    """By Pinocchio; configurations that agree in these count as one."""
    robot, rng = load_robot(name), np.random.default_rng(0)
    model = CollisionModel(robot)
    data, q = robot.model.createData(), rng.uniform(*robot.finite_limits())

    def placed(at: np.ndarray) -> list[pin.SE3]:
        pin.forwardKinematics(robot.model, data, robot.coupling.spread(at))
        return [data.oMi[body.joint] * body.place for body in model.every_body]

    before = placed(q)
    for joint in range(robot.dof):
        after = placed(q + 0.1 * np.eye(robot.dof)[joint])
        for pair, (i, j) in enumerate(model.index):
            still = (before[i].inverse() * before[j]).isApprox(after[i].inverse() * after[j], 1e-9)
            assert model._near._moving[pair, joint] == (not still)
