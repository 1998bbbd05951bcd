"""What goes into a page: meshes, key frames, curves, the payload."""

import base64
import gzip
import json
import re
import struct
from dataclasses import replace

import coal
import collada
import numpy as np
import pinocchio as pin
import pytest
import yourdfpy

import selfmotion as sm
from selfmotion.basics import RobotError
from selfmotion.model.robot import NAMED_ARMS, load_robot
from selfmotion.shell.facts import plan_facts, with_unit
from selfmotion.shell.replay import three
from selfmotion.shell.replay.content import page_content
from selfmotion.shell.replay.links import bake
from selfmotion.shell.replay.meshes import Payload, face_codes, grid_codes, make_mesh, read_meshes
from selfmotion.shell.replay.motion import curves, key_frames
from selfmotion.shell.replay.redundancy import FEWER_PIXELS, slices
from selfmotion.shell.replay.replayed import PlanReplay, clearance_of
from support.arms import short_line
from support.files_of_people import finger
from support.replay_plans import arm_plan, planar_plan

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])


CUBE_FACES = np.array(
    [
        [[a, b, c], [a, c, d]]
        for a, b, c, d in (
            (0, 1, 3, 2),
            (4, 6, 7, 5),
            (0, 4, 5, 1),
            (2, 3, 7, 6),
            (0, 2, 6, 4),
            (1, 5, 7, 3),
        )
    ]
).reshape(-1, 3)


def triangle_areas(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize("most", [(4, FEWER_PIXELS[1] + 2), (5, 3)])
def test_a_slice_has_at_most_the_pixels_asked_for_and_further_ones_fewer(most):
    robot = sm.load_robot("panda")
    start = robot.dexterous_configuration("position")
    plan = sm.plan(sm.Problem(robot, short_line(robot, start), "position", start))
    first, second = slices(plan, most, count=2)
    fewer = (min(most[0], FEWER_PIXELS[0]), min(most[1], FEWER_PIXELS[1]))
    assert first.cost.shape == most
    assert second.cost.shape == fewer


def test_a_cube_is_split_at_its_edges():
    mesh = make_mesh(CUBE, CUBE_FACES)
    assert len(mesh.faces) == 12
    assert len(mesh.grid) == 24


def test_a_smooth_surface_shares_its_vertices():
    vertices, faces = three.tube(np.linspace([0, 0, 0], [1, 0, 0], 5), 0.1, sides=24)
    soup = make_mesh(vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    assert len(soup.grid) == len(vertices)


def test_degenerate_triangles_are_kept():
    faces = np.vstack([CUBE_FACES, [[0, 0, 1], [2, 2, 2]]])
    assert len(make_mesh(CUBE, faces).faces) == len(faces)


@pytest.mark.parametrize("name", [name for name in NAMED_ARMS if name != "planar_3r"])
def test_every_triangle_is_kept_where_the_file_has_it(name):
    """Against coal, which reads the same files by assimp: box, area, and no triangle fewer."""
    seen = set()
    for item in load_robot(name).geometry(pin.GeometryType.VISUAL).geometryObjects:
        if not isinstance(item.geometry, coal.BVHModelBase) or item.meshPath in seen:
            continue
        seen.add(item.meshPath)
        parts = read_meshes(item.meshPath, item.name)
        scale = np.asarray(item.meshScale).reshape(3)
        vertices = np.concatenate([part.vertices for part in parts]) * scale
        expected = np.array(item.geometry.vertices())
        np.testing.assert_allclose(vertices.min(axis=0), expected.min(axis=0), atol=2e-5)
        np.testing.assert_allclose(vertices.max(axis=0), expected.max(axis=0), atol=2e-5)
        assert sum(len(part.faces) for part in parts) >= item.geometry.num_tris
        for part in parts:
            assert part.color is None or all(0.0 <= value <= 1.0 for value in part.color)


@pytest.mark.filterwarnings("ignore:the matrix subclass:PendingDeprecationWarning")
@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_each_triangle_is_where_the_collada_file_has_it(name):
    """Count and area against pycollada; coal's own triangles of such files are mixed up."""
    for item in load_robot(name).geometry(pin.GeometryType.VISUAL).geometryObjects:
        file = collada.Collada(item.meshPath, ignore=[collada.common.DaeError])
        parts = [
            part.triangleset() if hasattr(part, "triangleset") else part
            for geometry in file.scene.objects("geometry")
            for part in geometry.primitives()
            if not isinstance(part, collada.lineset.BoundLineSet)
        ]
        expected = np.concatenate([triangle_areas(p.vertex, p.vertex_index) for p in parts])
        expected *= file.assetInfo.unitmeter**2
        baked = [
            triangle_areas(mesh.vertices, mesh.faces)
            for mesh in read_meshes(item.meshPath, item.name)
        ]
        # Triangles without area may be left out: there is nothing to see of them.
        assert np.sum(expected > 0) <= sum(map(len, baked)) <= len(expected)
        assert sum(map(np.sum, baked)) == pytest.approx(expected.sum(), rel=1e-4)


def test_an_unreadable_mesh_is_refused_by_name():
    with pytest.raises(RobotError, match=r"hand_0.*/nowhere/hand\.dae"):
        read_meshes("/nowhere/hand.dae", "visual 'hand_0'")


def test_coal_stands_in_where_trimesh_fails(tmp_path):
    # Ends as files do that were cut to length.
    odd = tmp_path / "odd.dae"
    odd.write_text("<COLLADA></COLLADA>" + "\0" * 9)
    item = load_robot("xarm7").geometry(pin.GeometryType.VISUAL).geometryObjects[0]
    (expected,) = read_meshes(item.meshPath, item.name)
    (part,) = read_meshes("/nowhere/base.stl", item.name, item.geometry, 0.5)
    (other,) = read_meshes(str(odd), item.name, item.geometry, 0.5)
    assert len(part.faces) == len(other.faces) == len(expected.faces)
    np.testing.assert_allclose(np.ptp(part.vertices, axis=0), 2 * np.ptp(expected.vertices, axis=0))


def test_mesh_files_used_twice_are_packed_once():
    arm = bake(load_robot("panda"), Payload())
    fingers = [v for v in arm.visuals if "finger" in v.name]
    used = {v.geometry["mesh"] for v in fingers}
    assert len(fingers) == 2 * len(used)


def test_codes_can_be_undone():
    rng = np.random.default_rng(1)
    grid = rng.integers(0, 2**16, (50, 3)).astype(np.uint16)
    np.testing.assert_array_equal(np.cumsum(grid_codes(grid), axis=1, dtype=np.uint16).T, grid)
    faces = make_mesh(rng.random((30, 3)), rng.integers(0, 30, (40, 3))).faces
    unused, restored = 0, []
    for code in face_codes(faces):
        restored.append(unused - code)
        unused += code == 0
    np.testing.assert_array_equal(restored, faces.ravel())


def test_payload_layout():
    payload = Payload()
    content = {"a": payload.array([1.5, 2.5], "f8"), "b": payload.array([[1], [2], [3]], "u2")}
    data = gzip.decompress(base64.b64decode(payload.pack(content)))
    (length,) = struct.unpack_from("<I", data)
    text = json.loads(data[4 : 4 + length])
    assert text["a"] == {"$": 0}
    start = -(-(4 + length) // 8) * 8
    kind, offset, count = text["arrays"][1]
    assert (kind, count) == ("Uint16Array", 3)
    assert list(np.frombuffer(data, "<u2", count, start + offset)) == [1, 2, 3]


@pytest.mark.parametrize("name", ["planar_3r", "panda"])
def test_key_frames_interpolate_to_a_tenth_of_a_millimetre(name):
    plan = planar_plan() if name == "planar_3r" else arm_plan(name)
    frames = key_frames(plan.robot, plan.trajectory)
    assert frames.t[0] == 0.0
    assert frames.t[-1] == plan.trajectory.duration
    assert np.all(np.diff(frames.t) > 0)
    data = plan.robot.model.createData()
    for t in np.random.default_rng(2).uniform(0, frames.t[-1], 200):
        pin.forwardKinematics(plan.robot.model, data, plan.trajectory(t))
        for joint in range(plan.robot.dof):
            place = np.array(
                [np.interp(t, frames.t, frames.position[:, joint, k]) for k in range(3)]
            )
            np.testing.assert_allclose(place, data.oMi[joint + 1].translation, atol=1e-4)


def test_curves_know_a_path_that_is_missed():
    plan = planar_plan()
    good = curves(plan, plan.trajectory)
    assert good.position_error.max() < 1e-5
    np.testing.assert_allclose(good.q[0], plan.trajectory.q[0])
    motion = plan.trajectory
    late = sm.Trajectory(motion.t, motion.q, motion.qd, motion.joint_names)
    late.q.setflags(write=True)
    late.q[:, 0] += 0.01
    missed = curves(plan, late)
    reach = np.linalg.norm(missed.tool[:, :2], axis=1)
    assert np.all(missed.position_error > 0.00999 * reach)
    assert missed.position_error.max() == pytest.approx(0.01 * reach.max(), rel=1e-3)


def test_each_pair_is_held_to_the_distance_that_its_own_clearance_requires():
    """The closest one of all; of several clearances that have it, to the largest distance."""
    plan = arm_plan("panda")
    tool = plan.robot.pose(plan.trajectory.q[0]).translation
    ball, far = (
        sm.obstacles.Sphere(name, tool + np.array([0.0, 0.0, away]), 0.05)
        for name, away in (("ball", -0.06), ("far", -0.9))
    )
    asked = [
        sm.constraints.Clearance([far], 1e-3),
        sm.constraints.Clearance([ball, far], 3e-3),
        sm.constraints.Clearance([far], 2e-3),
    ]
    curve = clearance_of(replace(plan, problem=replace(plan.problem, clearance=asked)))
    alone = clearance_of(replace(plan, problem=replace(plan.problem, clearance=asked[0])))
    assert any("ball" in pair for pair in curve.pairs)
    np.testing.assert_array_equal(curve.required, 3e-3)
    np.testing.assert_array_equal(alone.required, 1e-3)
    # So it is in the other order.
    turned = clearance_of(replace(plan, problem=replace(plan.problem, clearance=asked[::-1])))
    np.testing.assert_array_equal(turned.required, curve.required)
    np.testing.assert_array_equal(turned.value, curve.value)
    only = [replace(asked[1], obstacles=[ball], distance=5e-4), asked[0]]
    own = clearance_of(replace(plan, problem=replace(plan.problem, clearance=only)))
    for pair, required in zip(own.pairs, own.required, strict=True):
        assert required == (5e-4 if "ball" in pair else 1e-3)


def test_what_is_relaxed_is_not_shown_as_an_error():
    plan = arm_plan("panda")
    leaning = sm.plan(replace(plan.problem, relaxations=[sm.Relaxation(("rx", "ry"), 0.1)]))
    for each, relaxed in ((plan, False), (leaning, True)):
        content = page_content([PlanReplay(each)], ["plan"], Payload(), triads=0)
        assert content["plans"][0]["curves"]["relaxed"] is relaxed
    (worst,) = leaning.certificate.deviations
    name = "off the path, as relaxed (rx, ry)"
    told = {item.label: item for item in plan_facts(leaning)}
    assert told[name].number == with_unit(worst.value, "rad")
    assert name not in {item.label for item in plan_facts(plan)}


def test_manipulability_is_the_root_of_the_determinant():
    plan = arm_plan("panda")
    drawn = curves(plan, plan.trajectory, points=5)
    for q, value in zip(drawn.q, drawn.manipulability, strict=True):
        jacobian = plan.robot.jacobian(q)
        assert value == pytest.approx(np.sqrt(np.linalg.det(jacobian @ jacobian.T)))


def test_tube_keeps_its_radius():
    angle = np.linspace(0, 4, 60)
    line = np.stack([np.cos(angle), np.sin(angle), 0.2 * angle], axis=1)
    vertices, faces = three.tube(line, 0.05, sides=8)
    distance = np.linalg.norm(vertices.reshape(60, 8, 3) - line[:, None], axis=2)
    np.testing.assert_allclose(distance, 0.05, atol=1e-12)
    assert faces.max() == len(vertices) - 1


def test_a_tube_follows_a_path_that_turns_back():
    there = np.linspace([0.0, 0, 0], [1.0, 0, 0], 11)
    vertices, _ = three.tube(np.vstack([there, there[-2::-1]]), 0.05)
    assert np.all(np.isfinite(vertices))
    np.testing.assert_allclose(np.linalg.norm(vertices[:, 1:], axis=1), 0.05, atol=1e-12)


def test_colors_span_the_scale():
    colors = three.colors_of(np.array([-1.0, 0.0, 1.0, 2.0]), 0.0, 1.0)
    np.testing.assert_allclose(255 * colors[0], [0x44, 0x01, 0x54])
    np.testing.assert_array_equal(colors[0], colors[1])
    np.testing.assert_array_equal(colors[2], colors[3])


def test_joints_that_mimic_move_what_is_drawn_of_them(tmp_path):
    """Each link's visual is where yourdfpy puts the link, by the node that carries it."""
    bar = (
        '<visual><origin xyz="0.05 0 0"/><geometry><box size="0.1 0.02 0.02"/></geometry></visual>'
    )
    file = tmp_path / "finger.urdf"
    file.write_text(re.sub(r'(<link name="l\d">)', rf"\1{bar}", finger()))
    robot = load_robot(file, tool="side")
    start = np.array([0.3, 0.4, 0.5, 0.2])
    path = sm.paths.Line(robot.pose(start), robot.pose(start), 1.0)
    plan = sm.plan(sm.Problem(robot, path, "position", start))
    content = page_content([PlanReplay(plan)], ["a"], Payload(), triads=3)
    assert content["movers"] == ["j1", "j2", "j3", "j4", "j5"]
    assert [joint["name"] for joint in content["joints"]] == ["j1", "j2", "j3", "j5"]
    poses = key_frames(robot, plan.trajectory).transforms(0)
    other = yourdfpy.URDF.load(str(file), load_meshes=False)
    other.update_cfg(dict(zip(robot.joint_names, plan.trajectory(0.0), strict=True)))
    for visual in bake(robot, Payload()).visuals:
        node = content["links"][visual.link].split("/")[-2]
        assert (node == "base") == (visual.joint < 0)
        carried = np.eye(4) if visual.joint < 0 else poses[content["movers"].index(node)]
        wanted = other.get_transform(visual.link)[:3, 3]
        wanted = wanted + 0.05 * other.get_transform(visual.link)[:3, 0]
        np.testing.assert_allclose((carried @ visual.matrix)[:3, 3], wanted, atol=1e-6)
