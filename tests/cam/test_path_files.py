"""Tool motions from files: every way to write the same poses, and what is wrong with a row."""

import json
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml

import selfmotion as sm
from selfmotion.basics import Array
from support.arms import PANDA_HOME, robot_named
from support.shell import complaint, invoke

# Of poses that went through another way to write a rotation.
ROUNDING = 1e-12


T = np.array([0.0, 0.5, 1.2, 2.0])


@pytest.fixture(scope="module")
def poses() -> list[pin.SE3]:
    panda = robot_named("panda")
    line = sm.paths.Line(panda.pose(PANDA_HOME), panda.pose(PANDA_HOME + 0.05), 2.0)
    return [line.pose(t) for t in T]


def quaternion(pose: pin.SE3) -> Array:
    return np.roll(pin.Quaternion(pose.rotation).coeffs(), 1)


def rows(poses: list[pin.SE3], orientation: str) -> Array:
    makers = {
        "quaternion": quaternion,
        "vector": lambda pose: pin.log3(pose.rotation),
        "rpy": lambda pose: pin.rpy.matrixToRpy(pose.rotation),
        "normal": lambda pose: pose.rotation[:, 2],
        "none": lambda pose: np.zeros(0),
    }
    return np.array([[*pose.translation, *makers[orientation](pose)] for pose in poses])


def table(header: str, values: Array, mark: str = ",") -> str:
    lines = [header.replace(",", mark)]
    lines += [mark.join(repr(float(value)) for value in row) for row in values]
    return "\n".join(lines) + "\n"


def agree(path: sm.paths.Path, poses: list[pin.SE3], rotation: bool = True) -> None:
    for t, pose in zip(T, poses, strict=True):
        found = path.pose(t)
        np.testing.assert_allclose(found.translation, pose.translation, atol=ROUNDING)
        if rotation:
            np.testing.assert_allclose(found.rotation, pose.rotation, atol=ROUNDING)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
@pytest.mark.parametrize(
    ("header", "orientation"),
    [
        ("x,y,z,qw,qx,qy,qz", "quaternion"),
        ("x,y,z,rx,ry,rz", "vector"),
        ("x,y,z,roll,pitch,yaw", "rpy"),
    ],
)
def test_tables_of_all_kinds(
    poses: list[pin.SE3], tmp_path: Path, header: str, orientation: str, mark: str
) -> None:
    values = np.column_stack([T, rows(poses, orientation)])
    order = np.random.default_rng(0).permutation(values.shape[1])
    names = np.array(["t", *header.split(",")])[order]
    text = table(",".join(names), values[:, order], mark)
    file = tmp_path / "seam.csv"
    file.write_text("\ufeff# a seam\n" + text.replace("\n", "\n# a remark\n\n", 2), "utf-8")
    agree(sm.files.read_path(file), poses)


def test_units_are_said_by_the_columns(poses: list[pin.SE3], tmp_path: Path) -> None:
    values = np.column_stack([T, rows(poses, "rpy") * ([1e3] * 3 + [180 / np.pi] * 3)])
    file = tmp_path / "seam.csv"
    file.write_text(table("t,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", values))
    agree(sm.files.read_path(file), poses)


def test_a_normal_is_the_tool_axis(poses: list[pin.SE3], tmp_path: Path) -> None:
    file = tmp_path / "seam.csv"
    file.write_text(
        table("t,x,y,z,nx,ny,nz", np.column_stack([T, rows(poses, "normal") * [1, 1, 1, 3, 3, 3]]))
    )
    path = sm.files.read_path(file)
    agree(path, poses, rotation=False)
    # The rest of the orientation is made up, which matters to tasks that prescribe it.
    unit, note = path.notes
    assert unit.startswith("columns say no unit and are taken so: t for seconds; x,y,z for metres")
    assert note.startswith("nx,ny,nz say where the tool's z axis points, not how")
    for task, told in (("pose", True), ("pointing", False), ("position", False)):
        remarks = sm.Problem(robot_named("panda"), path, task, start="free").remarks
        assert (note in remarks) is told
    for t, pose in zip(T, poses, strict=True):
        np.testing.assert_allclose(path.pose(t).rotation[:, 2], pose.rotation[:, 2], atol=ROUNDING)


def test_arrays(poses: list[pin.SE3], tmp_path: Path) -> None:
    file, values = tmp_path / "seam.npy", rows(poses, "quaternion")
    np.save(file, np.column_stack([T, values]))
    agree(sm.files.read_path(file, columns="t,x,y,z,qw,qx,qy,qz"), poses)
    np.save(file, np.column_stack([T, values[:, :3], np.roll(values[:, 3:], -1, axis=1)]))
    agree(sm.files.read_path(file, columns="t,x,y,z,qx,qy,qz,qw"), poses)
    np.save(file, np.column_stack([T, values[:, :3]]))
    agree(sm.files.read_path(file), poses, rotation=False)
    for array, columns in (
        (values, "x,y,z,qw,qx,qy,qz"),
        (np.column_stack([values, T]), ["x", "y", "z", "qw", "qx", "qy", "qz", "-"]),
        (np.array([pose.homogeneous for pose in poses]), None),
    ):
        np.save(file, array)
        path = sm.files.read_path(file, duration=2.0, columns=columns)
        assert path.duration == pytest.approx(2.0)
        assert not path.samples([0.0, 2.0]).twist.any()
        for t, pose in ((0.0, poses[0]), (2.0, poses[-1])):
            np.testing.assert_allclose(path.pose(t).homogeneous, pose.homogeneous, atol=ROUNDING)


@pytest.mark.parametrize("width", [7, 8])
def test_the_order_of_quaternions_is_never_guessed(width: int, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.ones((3, width)))
    with pytest.raises(
        sm.errors.FileFormatError,
        match=r"does not say in which order .*give columns \('(t,)?x,y,z,qw.*' or '(t,)?x,y,z,qx",
    ):
        sm.files.read_path(tmp_path / "a.npy")
    with pytest.raises(sm.errors.FileFormatError, match="3 columns are named"):
        sm.files.read_path(tmp_path / "a.npy", columns="x,y,z")


def ros(poses: list[pin.SE3]) -> dict[str, object]:
    """Return a nav_msgs/Path, as `ros2 topic echo` prints it."""
    listed = []
    for t, pose in zip(T + 1700.0, poses, strict=True):
        w, x, y, z = map(float, quaternion(pose))
        place = dict(zip("xyz", map(float, pose.translation), strict=True))
        stamp = {"sec": int(t), "nanosec": round((t - int(t)) * 1e9)}
        inner = {"position": place, "orientation": {"x": x, "y": y, "z": z, "w": w}}
        listed.append({"header": {"stamp": stamp, "frame_id": "world"}, "pose": inner})
    return {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "world"}, "poses": listed}


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_what_ros_writes(poses: list[pin.SE3], tmp_path: Path, suffix: str) -> None:
    message = ros(poses)
    file = tmp_path / f"seam{suffix}"
    dump = json.dumps if suffix == ".json" else lambda m: yaml.safe_dump(m) + "---\n"
    file.write_text(dump(message))
    agree(sm.files.read_path(file), poses)
    # A PoseArray has no times.
    listed = [item["pose"] for item in message["poses"]]  # type: ignore[attr-defined]
    file.write_text(dump({"header": message["header"], "poses": listed}))
    path = sm.files.read_path(file, feed=0.02)
    t = np.linspace(0.0, path.duration, 400)
    speeds = np.linalg.norm(path.samples(t).twist[:, :3], axis=1)
    turning = np.linalg.norm(path.samples(t).twist[:, 3:], axis=1)
    # In the middle at the feed, or at the turn rate.
    share = np.maximum(speeds / 0.02, turning / 1.0)[100:300]
    np.testing.assert_allclose(share, 1.0, rtol=1e-2)
    assert max(speeds[0], speeds[-1]) <= 1e-9


def test_a_frame_of_ones_own(poses: list[pin.SE3], tmp_path: Path) -> None:
    frame = pin.SE3(pin.rpy.rpyToMatrix(np.array([0.1, 0.2, 0.3])), np.array([0.4, -0.1, 0.2]))
    local = [frame.inverse() * pose for pose in poses]
    file = tmp_path / "seam.csv"
    file.write_text(table("t,x,y,z,qw,qx,qy,qz", np.column_stack([T, rows(local, "quaternion")])))
    placed = sm.paths.Placed(sm.files.read_path(file), frame)
    agree(placed, poses)
    # Its twist is the derivative of its pose, like that of every path.
    from selfmotion.shell.testing import check_path

    check_path(placed)
    out = tmp_path / "plan.npz"
    code, text = invoke(
        "plan", "panda", "--path", file, "--frame", "0.4,-0.1,0.2,0.1,0.2,0.3", "--out", out
    )
    assert code == 0, text
    agree(sm.load_plan(out).path, poses)


HEADER = "t,x,y,z,qw,qx,qy,qz"


GOOD = ["0,.4,0,.5,1,0,0,0", "1,.4,.1,.5,1,0,0,0", "2,.4,.2,.5,1,0,0,0"]


def csv(*lines: str, header: str = HEADER) -> str:
    return "\n".join(["# a seam", header, *lines]) + "\n"


def changed(line: str, k: int = 1) -> str:
    """Return the good table with line k in place of another one; the header is line 2."""
    return csv(*GOOD[:k], line, *GOOD[k + 1 :])


RPY = "x,y,z,roll,pitch,yaw"


FIRST = "0.4,0,0.5,0,0,0"


_Q = "orientation: {x: 0, y: 0, z: 0, w: 1}"


_P = "position: {x: 0.4, y: 0, z: 0.5}"


# File name, its text, what is asked besides, and what is said.
MALFORMED: list[tuple[str, str, str, str]] = [
    ("a.csv", "", "", "is empty, expected a header line"),
    ("a.csv", csv(), "", "has 0 poses, expected at least two"),
    ("a.csv", csv(header="seam,x,y,z"), "", "has 0 poses, expected at least two"),
    ("a.csv", csv(GOOD[0]), "", "has 1 poses, expected at least two"),
    ("a.csv", changed("1,.4,.1,.5,1,0,0"), "", "line 4 has 7 values, expected 8"),
    ("a.csv", changed("1,.4,.1,.5,1,0,0,0,0"), "", "line 4 has 9 values, expected 8"),
    ("a.csv", changed("1,.4,a,.5,1,0,0,0"), "", "line 4: y: is 'a', expected a number"),
    ("a.csv", changed("1,.4,nan,.5,1,0,0,0"), "", "line 4: the position is not finite"),
    ("a.csv", changed("1,.4,inf,.5,1,0,0,0"), "", "line 4: the position is not finite"),
    ("a.csv", changed("1,.4,0,.5,nan,0,0,0"), "", "line 4: the quaternion is not finite"),
    ("a.csv", changed("nan,.4,0,.5,1,0,0,0"), "", "line 4: the time is not finite"),
    ("a.csv", changed("1,.4,.1,.5,0,0,0,0"), "", "line 4: the quaternion is zero"),
    ("a.csv", changed("0,.4,.1,.5,1,0,0,0"), "", "line 4: time 0 s does not come after 0 s"),
    ("a.csv", changed("-1,.4,.1,.5,1,0,0,0"), "", "line 4: time -1 s does not come after"),
    ("a.csv", changed("1,.4,.1,.5,1,0,0,0", 2), "", "line 5: time 1 s does not come after 1 s"),
    ("a.csv", changed("1,.4,.9,.5,1,0,0,0"), "", "line 4: the path jumps by 0.9 m from the pose"),
    ("a.csv", changed("1,.4,.1,.5,1,0,0,0"),
     "--set path.jump=0.05", "line 4: the path jumps by 0.1 m"),
    ("a.csv", changed("1,.4,.1,.5,0,1,0,0"), "", "line 4: the path turns by 3.142 rad from"),
    ("a.csv", changed("1,400,100,500,1,0,0,0"), "", "line 4: position 400 is taken for metres"),
    ("a.csv", csv(*GOOD, header="t,x,y,z,qw,qx,qy,qx"), "", "line 2: column 'qx' appears twice"),
    ("a.csv", csv(*GOOD, header="t,x,y,q,qw,qx,qy,qz"), "", "unknown column 'q', expected t"),
    ("a.csv", csv(*GOOD, header="t,x,y,yaw,qw,qx,qy,qz"), "", "column 'z' is missing"),
    ("a.csv", csv(*GOOD, header="t,x,y,z,qw,qx,qy,yaw"), "", "has columns qw,qx,qy,qz and roll"),
    ("a.csv", csv("a", "b", header="seam"), "", "column 'x' is missing"),
    ("a.csv", csv("0,1,0,0,1", header="t,x,y,z,rx"), "", "column 'ry' is missing, expected rx"),
    ("a.csv", csv(*GOOD, header="t,x,y,z,z_mm,qx,qy,qz"), "", "column 'z' appears twice, in two"),
    ("a.csv", csv(*GOOD, header="t_mm,x,y,z,qw,qx,qy,qz"), "", "unknown column 't_mm'"),
    ("a.csv", csv("0,.4,0,.5,on", header="t,x,y,z,evnt"), "",
     "unknown column 'evnt'; nearest: 'event'"),
    ("a.csv", csv("0,.4,0,.5,first", header="t,x,y,z,note"), "", "unknown column 'note', expected"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,90,0,0", header=RPY), "--feed 0.1",
     "line 4: angle 90 is taken for radians; say roll_deg"),
    ("a.csv", csv("0.4,0,0.5,180,0,0", FIRST, header="x,y,z,rx,ry,rz"), "--feed 0.1",
     "line 3: angle 180 is taken for radians"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,0,0,0", header="x,y,z,nx,ny,nz"), "--feed 0.1",
     "line 3: the normal is zero"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,0,0,0", header=RPY), "", "has no times; give either --feed"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,0,0,0", header=RPY), "--feed 0", "feed is 0"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,0,0,0", header=RPY),
     "--set path.duration=-1", "duration is -1"),
    ("a.csv", csv(FIRST, "0.4,0.1,0.5,0,0,0", header=RPY),
     "--feed 1 --set path.duration=1", "not both"),
    ("a.csv", csv(FIRST, FIRST, header=RPY), "--feed 1", "line 4: the tool does not move from the"),
    ("a.csv", csv(*GOOD), "--feed 0.1", "has times, so that --feed has no effect"),
    ("a.csv", csv(*GOOD), "--frame 1,2", "--frame has 2 numbers, expected 6"),
    ("a.csv", "t x y q\n0 0 0 0\n", "", "unknown column 'q'"),
    ("a.csv", "0,0.4,0,0.4\n1,0.4,0.1,0.4\n", "", "line 1: has no header, only numbers; add t,x"),
    ("a.csv", csv("0,4,0,0,0,3", header="x,y,z"), "--feed 0.1", "are these decimal commas?"),
    ("a.csv", csv("0.4,0,0,0,0,1", header="x,y,z,i,j,k"),
     "--feed 0.1", "and say --set path.flip_normals"),
    ("a.csv", csv("0.4,0,0", header="x,y,z"),
     "--feed 0.1 --set path.columns=x,y", "line 3 has 3 values"),
    ("a.csv", csv("0.4,0,0", "0.4,0,1e-1", header="x,y,z"),
     "--feed 0.1 --set path.flip_normals=true",
     "--set path.flip_normals has no effect"),
    ("a.csv", csv("0.4,0,0", "0.4,0,1e-1", header="x,y,z"), "--feed 0.1 --set path.standoff=0.01",
     "--set path.standoff is along the tool's z axis"),
    ("a.yaml", "{}", "--set path.columns=x,y,z", "--set path.columns has no effect"),
    ("a.csv", csv("0.4,0,0", header="x,y,z"),
     "--set path.rotary=head", "--set path.rotary has no effect"),
    ("a.csv", csv("0.4,0,0", "0.4,0,1e-1", header="x,y,z"),
     "--set path.duration=3 --set path.corners=stop --set path.ramp=0.3",
     "ramp has no effect on a duration"),
    ("a.step", "", "", "has suffix '.step', expected one of .csv"),
    ("a.npy", "no array", "", "cannot be read as a NumPy array"),
    ("a.json", "{", "", "is not JSON"),
    ("a.json", "[]", "", "holds no message with poses"),
    ("a.json", "[{}]", "", "has no list of poses"),
    ("a.json", "{}", "", "has no list of poses, expected a nav_msgs/Path"),
    ("a.yaml", "poses: [", "", "is not YAML"),
    ("a.yaml", "poses: []", "", "has no list of poses"),
    ("a.yaml", f"poses: [{{header: {{frame_id: a}}, pose: {{{_P}, {_Q}}}}}, "
     f"{{header: {{frame_id: b}}, pose: {{{_P}, {_Q}}}}}]", "",
     "has poses in frame 'a' and in 'b', expected one"),
    ("a.yaml", "header: {frame_id: map}\n"
     f"poses: [{{header: {{frame_id: b}}, pose: {{{_P}, {_Q}}}}}]", "",
     "has poses in frame 'map' and in 'b'"),
    ("a.yaml", "poses: [3]", "", "poses[0]: position.x is missing or no number"),
    ("a.yaml", f"poses: [{{{_P}, {_Q}}}, {{{_P}}}]", "", "poses[1]: orientation.w is missing"),
    ("a.yaml", f"poses: [{{{_P}, {_Q}}}, {{position: {{x: a, y: 0, z: 0}}, {_Q}}}]", "",
     "poses[1]: position.x is missing or no number"),
    ("a.yaml", f"poses: [{{header: {{stamp: {{sec: 1}}}}, pose: {{{_P}, {_Q}}}}}]", "",
     "poses[0]: header.stamp is incomplete"),
    ("a.yaml", f"poses: [{{{_P}, {_Q}}}, {{{_P}, orientation: {{x: 0, y: 0, z: 0, w: 0}}}}]",
     "--feed 0.1", "poses[1]: the quaternion is zero"),
    ("a.yaml", f"poses: [{{{_P}, {_Q}}}]", "--feed 0.1", "has 1 poses, expected at least two"),
]  # fmt: skip


@pytest.mark.parametrize("case", MALFORMED, ids=lambda case: f"{case[0]}: {case[3][:40]}")
def test_malformed_files_are_one_line_and_exit_2(
    case: tuple[str, str, str, str], tmp_path: Path
) -> None:
    name, text, options, said = case
    file = tmp_path / name
    file.write_text(text)
    line = complaint("plan", "panda", "--path", file, *options.split())
    assert said in line
    if "--frame" not in options:
        assert line.startswith(f"error: {file}: ")


@pytest.mark.parametrize("corners", ["blend", "round"])
def test_an_angle_of_corners_is_of_those_where_the_tool_stops(corners: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(csv("0.4,0,0", "0.4,0,1e-1", header="x,y,z"))
    with pytest.raises(sm.errors.FileFormatError, match=f"no effect where corners are '{corners}'"):
        sm.files.read_path(tmp_path / "a.csv", feed=0.1, corners=corners, corner_angle=0.5)


@pytest.mark.parametrize("shape", [(3,), (2, 5), (2, 3, 3)])
def test_arrays_of_other_shapes(shape: tuple[int, ...], tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros(shape))
    with pytest.raises(
        sm.errors.FileFormatError, match=r"has shape .*, expected \(N, 4, 4\) poses"
    ):
        sm.files.read_path(tmp_path / "a.npy")
    matrix = np.tile(np.eye(4), (3, 1, 1))
    matrix[1, 0, 0] = -1.0
    np.save(tmp_path / "a.npy", matrix)
    with pytest.raises(
        sm.errors.FileFormatError, match="row 2: the pose: its rotation is a mirror"
    ):
        sm.files.read_path(tmp_path / "a.npy", duration=1.0)


def test_long_ways_between_poses_are_read_where_they_are_meant(tmp_path: Path) -> None:
    rows = "0,.4,0,.5", "1,.4,.9,.5", "2,.4,1,.5"
    (tmp_path / "a.csv").write_text(csv(*rows, header="t,x,y,z"))
    with pytest.raises(sm.errors.FileFormatError, match=r"jumps by 0\.9 m"):
        sm.files.read_path(tmp_path / "a.csv")
    assert sm.files.read_path(tmp_path / "a.csv", jump=1.0).duration == 2.0
    # Between both ends of a straight stroke none is missing.
    (tmp_path / "a.csv").write_text(csv(*rows[:2], header="t,x,y,z"))
    assert sm.files.read_path(tmp_path / "a.csv").duration == 1.0


# Poses in configurations of robots: lists and names, of tables and matrices, are one path.

PLACES = [[0.4, -0.05, 0.3], [0.42, 0.0, 0.3], [0.4, 0.05, 0.3]]
DOWN = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
NAMES = ("first", "second", "third")


def named(place: list[float]) -> dict[str, float]:
    return dict(zip("xyz", place, strict=True))


ROS = [{"name": "a", "position": named(place), "orientation": DOWN} for place in PLACES]
FLAT = [named(place) | {f"q{axis}": value for axis, value in DOWN.items()} for place in PLACES]
ANGLES = [{"pos": place, "rpy": [np.pi, 0.0, 0.0], "note": "weld"} for place in PLACES]
DEGREES = [named(place) | {"rx_deg": 180.0, "ry_deg": 0.0, "rz_deg": 0.0} for place in PLACES]
BOTH = [
    {"joint_states": {"j1": 0.1}, "position": named(place), "quaternion": DOWN,
     "euler": {"roll": 3.14, "pitch": 0.0, "yaw": 0.0}}
    for place in PLACES
]  # fmt: skip
MATRICES = [
    [[1.0, 0.0, 0.0, x], [0.0, -1.0, 0.0, y], [0.0, 0.0, -1.0, z], [0.0, 0.0, 0.0, 1.0]]
    for x, y, z in PLACES
]
FORMS = {
    "waypoints": {"waypoints": ROS},
    "stamped": {"waypoints": [{"pose": item} for item in ROS]},
    "names": {"frames": dict(zip(NAMES, ROS, strict=True))},
    "a node's": {"arm": {"ros__parameters": dict(zip(NAMES, FLAT, strict=True))}},
    "columns": {"poses": FLAT},
    "a list": DEGREES,
    "angles": {"points": ANGLES},
    "both": dict(zip(NAMES, BOTH, strict=True)),
    "matrices": dict(zip(NAMES, MATRICES, strict=True)),
}


@pytest.mark.parametrize("form", FORMS)
def test_lists_and_names_of_poses_are_one_path(form: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.yaml"
    file.write_text(json.dumps(FORMS[form]))
    path = sm.files.read_path(file, feed=0.05)
    for t, place in ((0.0, PLACES[0]), (path.duration, PLACES[-1])):
        np.testing.assert_allclose(path.pose(t).translation, place, atol=1e-12)
        np.testing.assert_allclose(path.pose(t).rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-9)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({"poses": {"a": [0.0, 1.0], "b": [0.0, 1.0]}}, "has no list of poses, .* or by names"),
        ({"waypoints": [named(PLACES[0]), FLAT[1]]}, "'q.' is in some poses only"),
        (
            {"a": {"position": PLACES[0], "quat": [1, 0, 0, 0]}},
            "'a': quat is a list of 4, whose order is not known",
        ),
        ({"a": {"position": {"x": "left", "y": 0, "z": 0}}}, "'a': position.x is 'left', expected"),
        ({"a": {"position": {"x": 0, "y": 0}}}, "column 'z' is missing"),
        ({"waypoints": FLAT[:1]}, "has 1 poses, expected at least two"),
    ],
)
def test_lists_that_are_none_say_what_is_read(document: object, said: str, tmp_path: Path) -> None:
    file = tmp_path / "poses.yaml"
    file.write_text(json.dumps(document))
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file, feed=0.05)


# Rotation vectors, which angles about axes are taken for silently.


def turned(file: Path, titles: str, *turns: str) -> Path:
    rows = (f"{0.05 * k},0,0,{turn}" for k, turn in enumerate(turns))
    file.write_text("\n".join([f"x,y,z,{titles}", *rows, ""]))
    return file


@pytest.mark.parametrize(
    ("titles", "second", "called"),
    [
        ("rx_deg,ry_deg,rz_deg", "180,5,0", "roll_deg,pitch_deg,yaw_deg"),
        ("rx,ry,rz", "3.14159,0.0873,0", "roll,pitch,yaw"),
        ("rx,ry,rz", "2.2,2.3,0", "roll,pitch,yaw"),
    ],
)
def test_angles_about_axes_are_no_rotation_vector(
    tmp_path: Path, titles: str, second: str, called: str
) -> None:
    file = turned(tmp_path / "seam.csv", titles, "0,0,0", second)
    said = f"line 3: rx,ry,rz .*more than half a turn; .*Call them {called};"
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file, feed=0.02)
    listed = tmp_path / "seam.yaml"
    poses = [dict(zip(["x", "y", "z", *titles.split(",")], row, strict=True))
             for row in ([0.0] * 6, [0.05, 0.0, 0.0, *map(float, second.split(","))])]  # fmt: skip
    listed.write_text(json.dumps({"poses": poses}))
    with pytest.raises(sm.errors.FileFormatError, match=r"poses\[1\]: rx,ry,rz .*half a turn"):
        sm.files.read_path(listed, feed=0.02)


@pytest.mark.parametrize("half", ["3.1416,0,0", "3.142,0,0", "2.22144,2.22144,0"])
def test_half_a_turn_with_few_digits_is_one(tmp_path: Path, half: str) -> None:
    file = turned(tmp_path / "seam.csv", "rx,ry,rz", half, half)
    assert sm.files.read_path(file, feed=0.02).duration > 0.0


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("x,y,z", "x,y,z for metres (else: x_mm, x_cm, x_in)"),
        ("X [m],Y [m],Z [m]", ""),
        ("x_mm,y_mm,z_mm,feed", "feed for m/s (else: feed_mm)"),
        ("x_mm,y_mm,z_mm,feed_mm", ""),
        ("x_m,y,z", None),
        ("x [mm],y [mm],z [mm],roll,pitch,yaw", "roll,pitch,yaw for radians about fixed axes"),
        ("x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", ""),
    ],
)
def test_what_columns_without_a_unit_are_taken_for_is_noted(
    header: str, said: str | None, tmp_path: Path
) -> None:
    count = header.count(",") + 1
    lines = [",".join(["0.1", "0.2", str(0.01 * k), *["0.1"] * (count - 3)]) for k in range(1, 4)]
    file = tmp_path / "seam.csv"
    file.write_text("\n".join([header, *lines]) + "\n")
    options = {} if "feed" in header else {"feed": 0.05}
    if said is None:
        with pytest.raises(sm.errors.FileFormatError, match="unknown column 'x_m'"):
            sm.files.read_path(file, **options)
        return
    notes = [x for x in sm.files.read_path(file, **options).notes if "say no unit" in x]
    assert bool(notes) == bool(said)
    assert not said or said in notes[0]


def test_what_was_noted_of_a_file_is_known_of_what_is_made_of_its_path(tmp_path: Path) -> None:
    file = turned(tmp_path / "seam.csv", "rx,ry,rz", "3,0,0", "3,0.1,0")
    path = sm.files.read_path(file, feed=0.02)
    unit, note = path.notes
    assert "rx,ry,rz for radians (else: rx_deg)" in unit
    assert "read as a rotation vector" in note
    assert "roll,pitch,yaw" in note
    for made in (
        sm.paths.Placed(path, np.eye(4)),
        sm.paths.with_leads(path, 0.02, 1.0),
        sm.paths.Reversed(path),
    ):
        assert made.notes == path.notes
    (tmp_path / "seams.csv").write_text(
        "seam," + file.read_text().replace("\n0", "\na,0", 1).replace("\n0.05", "\na,0.05", 1)
    )
    job = tmp_path / "job.toml"
    job.write_text(
        '[robot]\nname = "panda"\n[seams]\nfile = "seams.csv"\nfeed = 0.02\n'
        "frame = { position = [0.45, 0, 0.3] }\n"
    )
    assert any(note in remark for remark in sm.files.read_seam_job(job).remarks)
    # Other orientations are what their titles say.
    others = sm.files.read_path(
        turned(tmp_path / "a.csv", "roll,pitch,yaw", "3,0,0", "3,0.1,0"), feed=0.02
    ).notes
    assert not any("rotation vector" in said for said in others)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", '"x' + 200_000 * "a" + ',b",y,z\n0,0,0\n', "line 1: has 200009 characters"),
        (
            "b.csv",
            'breakpoints,primitives,points,q_bp\n1,"' + 70_000 * "m\n" + '",[],[]\n',
            "is no table: field larger",
        ),
        (
            "c.csv",
            'breakpoints,primitives,points\n1,"a\nb",[]\n',
            r"line 3: motion primitive 'a.nb' with 0",
        ),
        (
            "d.json",
            json.dumps([{"point": [10**400, 0, 0], "xaxis": [1, 0, 0], "yaxis": [0, 1, 0]}]),
            r"\[0\]: point is no list of three numbers",
        ),
    ],
    ids=["long-title", "long-cell", "cell-of-two-lines", "large-number"],
)
def test_what_no_program_writes_is_refused_in_one_line(
    name: str, text: str, said: str, tmp_path: Path
) -> None:
    file = tmp_path / name
    file.write_text(text)
    with pytest.raises(sm.errors.FileFormatError, match=said) as caught:
        sm.files.read_path(file, feed=0.1)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "title", ["x [m/s]", "x (mm/s)", "x [rad]", "roll [m]", "nx [mm]", "t [m]"]
)
def test_a_unit_of_another_quantity_is_no_unit_of_a_column(title: str, tmp_path: Path) -> None:
    """A table of speeds is none of positions."""
    name = title.split()[0]
    header = "x,y,z,nx,ny,nz,roll,t".replace(name, title, 1)
    file = tmp_path / "seam.csv"
    file.write_text(f"{header}\n" + "0,0,0,0,0,1,0,0\n" * 2)
    with pytest.raises(sm.errors.FileFormatError, match="unknown column") as refused:
        sm.files.read_path(file)
    assert name in str(refused.value)
