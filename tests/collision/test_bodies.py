"""Bodies that are there: every collision element counts, or is refused; insides are found."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh

from selfmotion.basics import CollisionError, RobotError
from selfmotion.model.collision import (
    Body,
    Box,
    Capsule,
    ClearanceModel,
    CollisionModel,
    Cylinder,
    Mesh,
    Solid,
    Sphere,
    link_bodies,
)
from selfmotion.model.collision.overlaps import links_of
from selfmotion.model.robot import NAMED_ARMS, RobotModel, load_robot
from support.independent_distances import mesh_of
from support.two_arms import baxter_with_both_arms

# GJK's depth of overlap [m].
DEPTH = 2e-6


SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])


TWO_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def slider(folder: Path, *collisions: str) -> RobotModel:
    """Return a robot whose link 'body' slides along z, with collision elements."""
    file = folder / "slider.urdf"
    inside = "".join(f"<collision>{text}</collision>" for text in collisions)
    file.write_text(
        f'<robot name="slider"><link name="base"/><link name="body">{inside}</link>'
        '<joint name="slide" type="prismatic"><parent link="base"/><child link="body"/>'
        '<axis xyz="0 0 1"/><limit lower="-9" upper="9" velocity="1" effort="1"/></joint></robot>'
    )
    return load_robot(file)


def geometry(text: str) -> str:
    return f"<geometry>{text}</geometry>"


@pytest.mark.parametrize("name", NAMED_ARMS)
def test_every_collision_element_of_the_named_arms_is_a_body(name: str) -> None:
    robot = load_robot(name)
    assert len(link_bodies(robot)) == robot.urdf.text.count("<collision")


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (geometry('<box size="0.3 0.3"/>'), '<box>: size is "0.3 0.3", expected 3 numbers'),
        (geometry('<box size="0.3, 0.3, 0.3"/>'), "expected 3 numbers, parted by spaces"),
        (geometry('<box size="1_0 1 1"/>'), 'size is "1_0 1 1"'),
        (geometry('<box size="-1 1 1"/>'), 'has size="-1 1 1", expected sizes above 0'),
        (geometry("<box/>"), "size is missing"),
        (geometry('<sphere radius="nan"/>'), 'radius is "nan", expected a number'),
        (geometry('<sphere radius="inf"/>'), 'radius is "inf"'),
        (geometry('<sphere radius="0"/>'), "sizes above 0"),
        (geometry('<sphere radius="0.3m"/>'), 'radius is "0.3m"'),
        (geometry('<cylinder radius="0.3"/>'), "length is missing"),
        (geometry('<cylinder radius="-1" length="-1"/>'), "sizes above 0"),
        (geometry('<capsule radius="0.2" length="0.3"/>'), "holds <capsule>, expected one of"),
        (geometry('<mesh filename="a.stl" scale="0 0 0"/>'), "numbers other than 0"),
        (geometry('<mesh filename="a.stl" scale="2"/>'), "expected 3 numbers"),
        (geometry('<mesh filename="a.stl" scale="1 nan 1"/>'), "expected 3 numbers"),
        (geometry("<mesh/>"), "has no filename"),
        (geometry(""), "holds nothing"),
        ("", "holds nothing"),
        (
            geometry('<sphere radius="1"/>') + '<origin xyz="0 0"/>',
            '<origin>: xyz is "0 0", expected 3',
        ),
        (geometry('<sphere radius="1"/>') + '<origin rpy="0 nan 0"/>', "<origin>: rpy is"),
    ],
)
def test_malformed_collision_elements_are_refused_by_name(
    tmp_path: Path, element: str, message: str
) -> None:
    good = geometry('<sphere radius="0.1"/>')
    with pytest.raises(RobotError, match="link 'body': <collision> number 2") as found:
        slider(tmp_path, good, element)
    assert message in str(found.value)


def test_a_missing_mesh_is_named_with_its_link(tmp_path: Path) -> None:
    robot = slider(tmp_path, geometry('<mesh filename="none.stl"/>'))
    with pytest.raises(RobotError, match=r"link 'body': no such mesh file: .*none\.stl"):
        CollisionModel(robot)


def test_a_body_that_is_lost_on_the_way_is_missed(tmp_path: Path, monkeypatch) -> None:
    robot = slider(tmp_path, geometry('<sphere radius="0.1"/>'), geometry('<box size="1 1 1"/>'))
    pieces = robot.geometry(pin.GeometryType.COLLISION)
    pieces.removeGeometryObject(pieces.geometryObjects[0].name)
    monkeypatch.setattr(RobotModel, "geometry", lambda *_: pieces)
    with pytest.raises(
        CollisionError, match=r"link 'body' has 2 <collision> elements, but .* 1 bod"
    ):
        CollisionModel(robot)


def written(folder: Path, points: np.ndarray, faces: np.ndarray) -> Path:
    """Write triangles as they are: no library's repairs."""
    lines = ["v " + " ".join(map(repr, map(float, point))) for point in points]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    file = folder / "mesh.obj"
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_flat_mesh_is_a_surface(tmp_path: Path, tilt: float) -> None:
    turn = pin.rpy.rpyToMatrix(tilt, 0.3 * tilt, 0.0)
    file = written(tmp_path, SQUARE @ turn.T, TWO_TRIANGLES)
    robot = slider(tmp_path, geometry('<sphere radius="0.1"/>'))
    model = CollisionModel(robot, [Mesh("floor", [0.0, 0.0, 0.0], file)])
    smooth = ClearanceModel(model, 1.0)
    for height in (0.3, 0.105 / turn[2, 2], -0.4):
        expected = abs(height) * turn[2, 2] - 0.1
        assert model.distance([height]).value == pytest.approx(expected, abs=1e-5)
        assert smooth.clearances([[height]]).values[0, 0] == pytest.approx(expected, abs=1e-5)
        assert not model.collides(np.array([height]))
    assert model.collides(np.array([0.09]))
    assert model.distance([0.05]).value == pytest.approx(0.05 * turn[2, 2] - 0.1, abs=1e-5)
    assert model.open_meshes == ()


@pytest.mark.parametrize(
    ("points", "faces", "message"),
    [
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]], [[0, 1, 2], [0, 1, 3]], "on one line"),
        ([[1, 1, 1]] * 3, [[0, 1, 2]], "on one line|cannot be read"),
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "corner 2 .* not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "corner 2 .* not finite"),
        (
            [[0, 0, 0], [np.inf, 0, 0], [0, np.nan, 0]],
            [[0, 1, 2]],
            r"corner 1 of its mesh is at \[inf, .*, not finite",
        ),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [], "cannot be read"),
    ],
    ids=["needle", "point", "nan", "inf", "two", "no triangles"],
)
def test_a_mesh_that_is_no_body_is_refused_by_name(
    tmp_path: Path, points, faces, message: str
) -> None:
    file = written(tmp_path, np.array(points, dtype=float), np.array(faces, dtype=int))
    robot = slider(tmp_path, geometry('<sphere radius="0.1"/>'))
    with pytest.raises(CollisionError, match=f"mesh 'it': .*({message})"):
        CollisionModel(robot, [Mesh("it", [0, 0, 0], file)])
    if "read" not in message:
        robot = slider(tmp_path, geometry(f'<mesh filename="{file}"/>'))
        with pytest.raises(CollisionError, match=f"link 'body' .*({message})"):
            CollisionModel(robot)


SHELLS = {
    # Solids with a bore or a notch, so that their hulls do not decide: wall from 3 to 9 m.
    "ring": lambda: trimesh.creation.annulus(3.0, 9.0, 20.0, sections=48),
    "cup": lambda: trimesh.util.concatenate(
        [
            trimesh.creation.annulus(3.0, 9.0, 20.0, sections=48),
            trimesh.creation.box((1.0, 1.0, 1.0)).apply_translation([0.0, 0.0, 9.0]),
        ]
    ),
}


SMALL = {
    "box": geometry('<box size="0.2 0.2 0.2"/>'),
    "sphere": geometry('<sphere radius="0.1"/>'),
    "cylinder": geometry('<cylinder radius="0.1" length="0.2"/>'),
    "convex mesh": trimesh.creation.icosphere(2, 0.1),
    "mesh": trimesh.creation.annulus(0.05, 0.1, 0.1, sections=24),
    "two meshes": trimesh.util.concatenate(
        [
            trimesh.creation.box((0.1, 0.1, 0.1)).apply_translation([x, 0.0, 0.0])
            for x in (-6.0, 0.0)
        ]
    ),
}


def link_of(folder: Path, shape) -> RobotModel:
    if isinstance(shape, str):
        return slider(folder, shape)
    shape.export(folder / "link.stl")
    return slider(folder, geometry('<mesh filename="link.stl"/>'))


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize("small", SMALL)
def test_a_link_wholly_inside_an_obstacle_overlaps_it(
    tmp_path: Path, shell: str, small: str
) -> None:
    robot = link_of(tmp_path, SMALL[small])
    SHELLS[shell]().export(tmp_path / "shell.stl")
    within = CollisionModel(robot, [Mesh("shell", [-6.0, 0.0, 0.0], tmp_path / "shell.stl")])
    in_bore = CollisionModel(robot, [Mesh("shell", [0.0, 0.0, 0.0], tmp_path / "shell.stl")])
    q = np.zeros(1)
    assert within.distance(q).value < 0.0
    assert within.distances([q])[0, 0] < 0.0
    assert within.collides(q)
    assert within.touching(q)[0].second == "shell"
    if small != "two meshes":
        assert in_bore.distance(q).value > 2.0
        assert not in_bore.collides(q)
        assert in_bore.touching(q) == ()
    else:
        assert in_bore.collides(q)


@pytest.mark.parametrize(
    "obstacle",
    [
        Box("it", [6.0, 0.0, 0.0], [0.2, 0.2, 0.2]),
        Sphere("it", [6.0, 0.0, 0.0], 0.1),
        Cylinder("it", [6.0, 0.0, 0.0], 0.1, 0.2),
        Capsule("it", [6.0, 0.0, 0.0], 0.1, 0.2),
        "convex mesh",
        "mesh",
    ],
    ids=lambda item: item if isinstance(item, str) else item.shape,
)
def test_an_obstacle_wholly_inside_a_link_overlaps_it(tmp_path: Path, obstacle) -> None:
    robot = link_of(tmp_path, SHELLS["ring"]())
    if isinstance(obstacle, str):
        SMALL[obstacle].export(tmp_path / "inner.stl")
        obstacle = Mesh("it", [6.0, 0.0, 0.0], tmp_path / "inner.stl")
    inside = CollisionModel(robot, [obstacle])
    for height in (-5.0, 0.0, 5.0):
        assert inside.distance([height]).value < 0.0
        assert inside.collides(np.array([height]))
    moved = type(obstacle)(**{**obstacle.__dict__, "pose": np.zeros(3)})
    outside = CollisionModel(robot, [moved])
    assert outside.distance([0.0]).value > 2.0
    assert not outside.collides(np.zeros(1))


@pytest.mark.parametrize("small", ["convex mesh", "mesh"])
def test_a_mesh_wholly_inside_a_primitive_overlaps_it(tmp_path: Path, small: str) -> None:
    robot = link_of(tmp_path, SMALL[small])
    at = [0.0, 0.0, 0.0]
    for outer in (
        Box("o", at, [4, 4, 4]), Sphere("o", at, 2), Cylinder("o", at, 2, 4), Capsule("o", at, 2, 1)
    ):  # fmt: skip
        model = CollisionModel(robot, [outer])
        assert model.distance([0.3]).value < -1.0
        assert model.collides(np.array([0.3]))
        assert not model.collides(np.array([5.0]))


def test_meshes_that_are_not_closed_are_named(tmp_path: Path) -> None:
    ring = trimesh.creation.annulus(3.0, 9.0, 20.0, sections=48)
    ring.export(tmp_path / "ring.stl")
    ring.faces = ring.faces[:-1]
    ring.export(tmp_path / "torn.stl")
    robot = slider(tmp_path, SMALL["box"])
    whole = CollisionModel(robot, [Mesh("ring", [0, 0, 0], tmp_path / "ring.stl")])
    torn = CollisionModel(robot, [Mesh("ring", [0, 0, 0], tmp_path / "torn.stl")])
    assert whole.open_meshes == ()
    assert torn.open_meshes == ("ring",)


def test_a_surface_that_is_turned_inside_out_in_part_is_not_closed() -> None:
    ring = trimesh.creation.annulus(0.3, 0.9, 1.0, sections=12)
    faces = np.array(ring.faces)
    assert Solid(mesh_of(ring.vertices, faces), "ring").is_closed
    faces[0] = faces[0, ::-1]
    assert not Solid(mesh_of(ring.vertices, faces), "ring").is_closed
    mirrored = Solid(mesh_of(ring.vertices * [1, -1, 1], ring.faces), "ring")
    assert mirrored.is_closed
    assert mirrored.contains_any(np.array([[0.6, 0.0, 0.0]]))
    assert not mirrored.contains_any(np.zeros((1, 3)))


def test_triangles_of_hulls_point_outwards() -> None:
    """The volume that they enclose, with its sign: coal's depths of overlap rest on that."""
    points = np.random.default_rng(0).normal(size=(40, 3))
    hull = trimesh.convex.convex_hull(points)
    # Whichever way the mesh's own triangles turn.
    for faces in (hull.faces, hull.faces[:, ::-1]):
        solid = Solid(mesh_of(hull.vertices, faces), "hull")
        assert solid.hull.computeVolume() == pytest.approx(hull.volume, rel=1e-9)


# Lever arms: no point moves farther, no distance changes more, than they say; on every arm.

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


def test_what_is_no_mesh_has_an_inside() -> None:
    assert Solid(coal.Box(0.1, 0.2, 0.3), "box").is_closed
    assert Solid(coal.Sphere(0.1), "ball").is_closed


def test_robots_of_one_description_share_their_bodies() -> None:
    """Others have their own: of other limits, locks, or files."""
    first, again = load_robot("panda"), load_robot("panda")
    assert links_of(first) is links_of(again)
    locked = load_robot("panda", lock={"panda_joint3": 0.3})
    assert links_of(locked) is not links_of(first)


def test_a_mesh_that_changed_is_read_anew(tmp_path: Path) -> None:
    text = """<robot name="one"><link name="base"/><link name="arm"><collision><geometry>
    <mesh filename="{file}"/></geometry></collision></link><joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    file, urdf = tmp_path / "box.stl", tmp_path / "one.urdf"
    urdf.write_text(text.format(file=file))
    for size in (0.1, 0.3):
        trimesh.creation.box([size] * 3).export(file)
        (body,) = links_of(load_robot(urdf)).bodies
        assert body.solid.high == pytest.approx([size / 2.0] * 3)
