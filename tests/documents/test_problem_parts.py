"""A workpiece in a file: what belongs to it moves with it."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3, rpy

BODIES = """
obstacles = [
  { shape = "box", name = "clamp", position = [0, 0.1, 0], rpy = [0, 0, 1], size_mm = [99, 9, 9] },
  { shape = "sphere", name = "pin", position_mm = [10, 20, -50], radius_mm = 5 },
]
"""
FRAMED = """
task = "pointing"
{more}
[robot]
name = "panda"
{reference}
[workpiece]
frame = {{ position = [{x}, 0.1, 0.2], rpy_deg = [170, {tilt}, 40] }}
{on}
{bodies}
{path}
"""
PATHS = {
    "line": '[path]\nkind = "line"\nfeed = 0.05\nby = [0.1, 0, 0]\n'
    "start = { position = [0, 0, 0] }",
    "circle in a frame": '[path]\nkind = "circle"\nradius = 0.05\nduration = 3\n'
    "start = { position = [0, 0.02, 0] }\n"
    "frame = { position = [0.01, 0, 0], rpy_deg = [0, 0, 90] }",
    "polyline": '[path]\nkind = "feed"\nfeed = 0.05\n'
    'path = { kind = "polyline", positions = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]], '
    "quaternions = [[1, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]] }",
    "placed": '[path]\nkind = "placed"\nframe = { position = [0, 0, 0.01] }\n'
    'path = { kind = "line", start = { position = [0, 0, 0] }, end = { position = [0.1, 0, 0] }, '
    "duration = 2 }",
    "file": '[path]\nkind = "file"\nfile = "seam.csv"\nfeed = 0.05',
}


def problem(folder: Path, path: str, x: float, tilt: float, **more: str) -> sm.Problem:
    (folder / "seam.csv").write_text(
        "x,y,z,nx,ny,nz\n0,0,0,0,0,1\n0.1,0,0,0,0,1\n0.2,0.1,0,0,0,1\n"
    )
    given = {"more": "", "reference": "", "on": "", "bodies": BODIES, **more}
    text = FRAMED.format(x=x, tilt=tilt, path=PATHS[path], **given)
    (folder / "cell.toml").write_text(text)
    return sm.read_problem(folder / "cell.toml")


def stands(x: float, tilt: float) -> SE3:
    angles = np.radians([170.0, tilt, 40.0])
    return SE3(rpy.rpyToMatrix(angles), np.array([x, 0.1, 0.2]))


def test_bodies_of_a_workpiece_and_of_a_tool_are_in_its_frame_by_default(tmp_path: Path) -> None:
    """Those of the world have to say where they are."""
    box = '{ shape = "box", name = "web", size_mm = [9, 9, 9] }'
    held = '[[robot.bodies]]\nshape = "sphere"\nname = "tip"\nradius_mm = 5'
    found = problem(tmp_path, "line", 0.4, 9.0, bodies=f"obstacles = [{box}]", reference=held)
    (body,) = found.clearances[0].obstacles
    np.testing.assert_allclose(body.pose.homogeneous, stands(0.4, 9.0).homogeneous, atol=1e-12)
    world = f'[[constraints]]\nkind = "Clearance"\nobstacles = [{box}]'
    with pytest.raises(sm.errors.FileFormatError, match=r"obstacles\[0\]\.position: is missing"):
        problem(tmp_path, "line", 0.4, 9.0, bodies="", on=f"\n{world}")


@pytest.mark.parametrize("path", PATHS)
def test_moving_the_workpiece_moves_all_that_belongs_to_it(tmp_path: Path, path: str) -> None:
    here, there = (problem(tmp_path, path, *at) for at in ((0.4, 10.0), (0.55, -5.0)))
    moved = stands(0.55, -5.0) * stands(0.4, 10.0).inverse()
    for t in np.linspace(0.0, here.path.duration, 7):
        wanted = moved * here.path.pose(t)
        np.testing.assert_allclose(there.path.pose(t).homogeneous, wanted.homogeneous, atol=1e-12)
    bodies = [item.clearances[0].obstacles for item in (here, there)]
    assert [body.name for body in bodies[0]] == ["clamp", "pin"]
    for one, other in zip(*bodies, strict=True):
        np.testing.assert_allclose(
            other.pose.homogeneous, (moved * one.pose).homogeneous, atol=1e-12
        )
    # Without a workpiece the file says the same by numbers in the world.
    sm.files.write_problem(here, tmp_path / "again.toml")
    again = sm.read_problem(tmp_path / "again.toml")
    np.testing.assert_allclose(
        again.path.pose(1.0).homogeneous, here.path.pose(1.0).homogeneous, atol=1e-12
    )
    for one, other in zip(bodies[0], again.clearances[0].obstacles, strict=True):
        np.testing.assert_allclose(other.pose.homogeneous, one.pose.homogeneous, atol=1e-12)


def test_bodies_join_the_clearance_that_there_is(tmp_path: Path) -> None:
    more = (
        "clearance = { distance_mm = 4, "
        'obstacles = [{ shape = "sphere", name = "lamp", position = [0, 0, 2], radius = 0.1 }] }'
    )
    found = problem(tmp_path, "line", 0.4, 0.0, more=more)
    (clearance,) = found.clearances
    assert [body.name for body in clearance.obstacles] == ["lamp", "clamp", "pin"]
    assert clearance.distance == 0.004
    lamp = clearance.obstacles[0]
    np.testing.assert_array_equal(lamp.pose.translation, [0.0, 0.0, 2.0])


def test_meshes_stand_where_their_coordinates_say(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((0.1, 0.05, 0.01)).export(tmp_path / "part.stl")
    mesh = '{ shape = "mesh", name = "part", file = "part.stl"PLACE }'
    more = "clearance = { obstacles = [MESH] }"
    poses = []
    for place in ("", ", position = [0, 0, 0]"):
        text = more.replace("MESH", mesh.replace("PLACE", place))
        found = problem(tmp_path, "line", 0.4, 0.0, more=text)
        (clearance,) = found.clearances
        poses.append(clearance.obstacles[0].pose.homogeneous)
    np.testing.assert_array_equal(*poses)
    np.testing.assert_array_equal(poses[0], np.eye(4))
    box = more.replace("MESH", '{ shape = "box", name = "b", size = [1, 1, 1] }')
    with pytest.raises(sm.errors.FileFormatError, match="position"):
        problem(tmp_path, "line", 0.4, 0.0, more=box)


def test_its_mesh_is_a_body(tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((100.0, 50.0, 10.0)).export(tmp_path / "part.stl")
    mesh = 'mesh = "part.stl"\nscale = 0.001'
    found = problem(tmp_path, "line", 0.4, 0.0, bodies=mesh)
    (body,) = found.clearances[0].obstacles
    assert (body.name, body.file, body.scale) == ("workpiece", tmp_path / "part.stl", 0.001)
    np.testing.assert_allclose(body.pose.homogeneous, stands(0.4, 0.0).homogeneous, atol=1e-12)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"on": 'on = "plate"'}, "expected robot.reference = 'plate'"),
        ({"on": "scale = 2.0"}, "scale has no effect without a mesh"),
        ({"more": "clearance = false"}, "has bodies, but clearance is false"),
        ({"bodies": BODIES.replace("radius_mm = 5", 'radius_mm = 5, frame = "panda_link3"')},
         "obstacle 'pin' rides on 'panda_link3'"),
        ({"on": "fram = 3"}, "workpiece.fram: unknown key, did you mean 'frame'"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(tmp_path: Path, more: dict[str, str], said: str) -> None:
    with pytest.raises(sm.errors.FileFormatError, match=said):
        problem(tmp_path, "line", 0.4, 0.0, **more)


def test_a_shape_needs_its_place_in_the_workpiece(tmp_path: Path) -> None:
    problem(tmp_path, "line", 0.4, 0.0)
    text = (tmp_path / "cell.toml").read_text().replace("start = { position = [0, 0, 0] }", "")
    (tmp_path / "cell.toml").write_text(text)
    with pytest.raises(sm.errors.FileFormatError, match=r"path: start is missing"):
        sm.read_problem(tmp_path / "cell.toml")


@pytest.mark.parametrize("listed", [False, True])
def test_seams_of_a_job_move_with_it_and_so_does_what_they_leave(
    tmp_path: Path, listed: bool
) -> None:
    rows = ("one,0,0", "one,0.1,0", "two,0,0.1", "two,0.1,0.1")
    table = ["seam,x,y,z,nx,ny,nz", *(f"{row},0,0,0,1" for row in rows), ""]
    (tmp_path / "seams.csv").write_text("\n".join(table))
    leaves = 'leaves = [{ shape = "sphere", name = "bead", position = [0, 0, 0], radius = 0.01 }]'
    given = '[seams]\nfile = "seams.csv"\nfeed = 0.05\nframe = { position = [0.01, 0, 0] }\n'
    if listed:
        given = (
            f'[[seams]]\nname = "one"\n{leaves}\n[seams.path]\nkind = "file"\nfile = "seams.csv"\n'
            'seam = "one"\nfeed = 0.05\nframe = { position = [0.01, 0, 0] }\n'
        )
    found = []
    for x, tilt in ((0.4, 10.0), (0.55, -5.0)):
        frame = f"frame = {{ position = [{x}, 0.1, 0.2], rpy_deg = [170, {tilt}, 40] }}\n"
        text = f'task = "pointing"\n[robot]\nname = "panda"\n[workpiece]\n{frame}{BODIES}\n{given}'
        (tmp_path / "job.toml").write_text(text)
        found.append(sm.files.read_seam_job(tmp_path / "job.toml"))
    here, there = found
    moved = stands(0.55, -5.0) * stands(0.4, 10.0).inverse()
    for one, other in zip(here.seams, there.seams, strict=True):
        for t in (0.0, 1.0, one.path.duration):
            wanted = moved * one.path.pose(t)
            np.testing.assert_allclose(
                other.path.pose(t).homogeneous, wanted.homogeneous, atol=1e-12
            )
        for body, again in zip(one.leaves, other.leaves, strict=True):
            np.testing.assert_allclose(
                again.pose.homogeneous, (moved * body.pose).homogeneous, atol=1e-12
            )
        assert len(one.leaves) == listed
    assert [body.name for body in here.settings["clearance"].obstacles] == ["clamp", "pin"]


def test_what_else_follows_rides_on_what_the_workpiece_stands_on(tmp_path: Path) -> None:
    """Both paths are in the frame of the plate, and move along with it."""
    (tmp_path / "cell.toml").write_text(TWO_TOOLS)
    problem = sm.read_problem(tmp_path / "cell.toml")
    first, second = problem.follows.items
    assert first.chain.base == second.chain.base != 0
    np.testing.assert_allclose(second.path.pose(0.0).translation, [0.0, 0.1, 0.07], atol=1e-12)
    # One with a reference of its own stays where that is.
    own = TWO_TOOLS.replace('task = "position"\npose', 'reference = "arm/panda_link0"\npose')
    (tmp_path / "own.toml").write_text(own)
    other = sm.read_problem(tmp_path / "own.toml").follows.items[1]
    np.testing.assert_allclose(other.path.pose(0.0).translation, [0.0, 0.1, 0.02], atol=1e-12)


TWO_TOOLS = """
task = "pointing"
clearance = false
[robot]
tool = ["arm/panda_hand_tcp", "other/panda_hand_tcp"]
reference = "table/plate"
[robot.parts.arm]
name = "panda"
[robot.parts.other]
name = "panda"
base = { position = [1.0, 0, 0], rpy_deg = [0, 0, 180] }
[robot.parts.table]
name = "positioner"
base = { position = [0.5, 0, 0] }
[workpiece]
on = "table/plate"
frame = { position = [0.0, 0.0, 0.05] }
[path]
kind = "circle"
start = { position = [0.1, 0, 0.0], rpy_deg = [180, 0, 0] }
radius = 0.1
normal = [0, 0, 1]
duration = 8
[[also]]
tool = "other/panda_hand_tcp"
task = "position"
pose = { position = [0.0, 0.1, 0.02], rpy_deg = [180, 0, 0] }
"""
