"""What a file does not say is told: the least file that each reader takes, from the shell."""

import json
import re
import shutil
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app
from selfmotion.shop.cam.path_files import _READERS
from selfmotion.shop.cam.pose_rows import CLDATA, PROGRAMS
from support.shell import invoke, on_line

CASES = Path(__file__).parents[1] / "cases"
DOWN = [[1.0, 0.0, 0.0, 0.45], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.3], [0.0, 0.0, 0.0, 1.0]]
ASIDE = [[*row[:3], row[3] + 0.05 * (k == 1)] for k, row in enumerate(DOWN)]
TURN = {"x": 1, "y": 0, "z": 0, "w": 0}
POSE = {"position": {"x": 0.45, "y": 0.0, "z": 0.3}, "orientation": TURN}
NEXT = {"position": {"x": 0.45, "y": 0.05, "z": 0.3}, "orientation": TURN}
ROOT = r"no frame is given: places of the file are in that of 'panda_link0', the arm's root"
TABLE = r"columns say no unit and are taken so: (t for seconds; )?x,y,z for metres \(else: x_mm"
UPRIGHT = r"nothing says how the tool stands: its z axis points down"
# Name of a file, its text, options of plan, and what is told of it.
FILES: list[tuple[str, str, tuple[str, ...], tuple[str, ...]]] = [
    ("a.csv", "x,y,z\n0.4,0,0.3\n0.4,0.1,0.3\n", ("--feed", "0.05"), (TABLE, ROOT)),
    ("a.txt", "t x y z\n0 0.4 0 0.3\n2 0.4 0.1 0.3\n", (), (TABLE, "t for seconds", ROOT)),
    ("a.tsv", "x\ty\tz\tfeed\n0.4\t0\t0.3\t0.05\n0.4\t0.1\t0.3\t0.05\n", (),
     (TABLE, r"feed for m/s \(else: feed_mm\)", ROOT)),
    ("b.csv", "x,y,z,roll,pitch,yaw\n0.4,0,0.3,3.1,0,0\n0.4,0.1,0.3,3.1,0,0\n", ("--feed", "0.05"),
     (TABLE, r"roll,pitch,yaw for radians about fixed axes \(else: roll_deg\)", ROOT)),
    ("c.csv", "x,y,z,rx,ry,rz\n0.4,0,0.3,3.1,0,0\n0.4,0.1,0.3,3.1,0,0\n", ("--feed", "0.05"),
     (TABLE, "rx,ry,rz are read as a rotation vector", ROOT)),
    ("d.csv", "x,y,z,nx,ny,nz\n0.4,0,0.3,0,0,-1\n0.4,0.1,0.3,0,0,-1\n",
     ("--feed", "0.05", "--task", "pose"), (TABLE, "nx,ny,nz say where the tool's z axis", ROOT)),
    ("e.csv", "X,Y,Z,A,B,C\n400,0,300,0,0,180\n400,100,300,0,0,180\n", ("--feed", "0.05"),
     ("columns A,B,C are read as KUKA's: angles about z, y and x", ROOT)),
    ("f.csv", "x,y,z,rz1,ry,rz2\n400,0,300,0,180,0\n400,50,300,0,180,0\n", ("--feed", "0.05"),
     ("IRBCAM: x,y,z in mm, rz1,ry,rz2 about z, y and z in turn", ROOT)),
    ("g.csv", "X 400; Y 0; Z 300; A 0; B 0; C 0\nX 400; Y 50; Z 300; A 0; B 0; C 0\n",
     ("--feed", "0.05"), ("igus: X, Y, Z in mm; A, B, C are passed over", ROOT)),
    ("h.csv", 'breakpoints,primitives,points\n0,movel,"[array([400, 0, 300])]"\n'
     '1,movel,"[array([400, 50, 300])]"\n', ("--feed", "0.05"),
     ("motion primitives: points in mm", ROOT)),
    ("a.json", json.dumps([{"x": 0.4, "y": 0.0, "z": 0.3}, {"x": 0.4, "y": 0.1, "z": 0.3}]),
     ("--feed", "0.05"), (TABLE, ROOT)),
    ("b.json", json.dumps([DOWN, ASIDE]), ("--feed", "0.05"),
     ("matrices say no unit: their last columns are taken for metres", ROOT)),
    ("c.json", json.dumps({"poses": [POSE, NEXT]}), ("--feed", "0.05"),
     ("ROS: poses in metres, in no frame that is named", ROOT)),
    ("d.json", json.dumps([{"point": [0.4, y, 0.3], "xaxis": [1, 0, 0], "yaxis": [0, -1, 0]}
                           for y in (0.0, 0.05)]), ("--feed", "0.05"),
     ("compas: points in metres", ROOT)),
    ("e.json", json.dumps([{**pose, "rpy": [3.1, 0, 0], "name": "a"} for pose in
                           ({"x": 0.4, "y": 0.0, "z": 0.3, "quat": TURN},
                            {"x": 0.4, "y": 0.1, "z": 0.3, "quat": TURN})]),
     ("--feed", "0.05"), (TABLE, r"\[0\]: 'rpy' is passed over beside 'quat'", ROOT)),
    ("a.yaml", f"header: {{frame_id: map}}\nposes: [{json.dumps(POSE)}, {json.dumps(NEXT)}]\n",
     ("--feed", "0.05"), ("ROS: poses in metres in frame 'map', which is taken for", ROOT)),
    ("a.yml", f"poses: [{json.dumps(POSE)}, {json.dumps(NEXT)}]\n", ("--feed", "0.05"),
     ("ROS: poses in metres, in no frame that is named", ROOT)),
    ("a.nc", "G0 X400 Y0 Z320\nZ300\nG1 Y30 F600\nG2 X430 Y60 I30 J0\nM30\n", (),
     ("no line says G20 or G21: lengths are taken for mm; G90 or G91: places are taken for abs",
      "G93 or G94: F is taken for a length by the minute",
      "G17, G18 or G19: arcs are taken to lie in the plane of X and Y", UPRIGHT, ROOT)),
    ("b.nc", "X400 Y0\nG1 Y30 F600\nM30\n", (),
     ("line 1: neither this line nor one before says G0, G1, G2 or G3: it is a rapid",
      "no line says Z: it is taken for 0", ROOT)),
    ("c.nc", "G21 G90 G94\nG0 X400 Y0 Z5\nG81 Z-2 R1 F300\nM30\n", ("--task", "pointing"),
     ("no line says G98 or G99: holes are left as high as where they were come to", UPRIGHT)),
    ("a.gcode", "G21 G90 G94\nG0 X400 Y0 Z300\nG1 Y30 E1 F600\nM84\n", (),
     ("no line says M82 or M83: E is taken to count from the start", UPRIGHT)),
    ("a.apt", "RAPID\nGOTO/400,0,320\nFEDRAT/600\nGOTO/400,0,300\nGOTO/400,40,300\nFINI\n", (),
     ("no statement says UNITS: lengths are taken for mm", UPRIGHT,
      "FEDRAT says neither MMPM nor IPM: feeds are per minute, in the unit of", ROOT)),
]  # fmt: skip


@pytest.fixture
def unplanned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is planned: what is told is told before."""

    def refused(*_: object, **__: object) -> sm.Plan:
        raise sm.errors.PlanError("not planned here")

    monkeypatch.setattr("selfmotion.shell.cli.plan_commands.plan_with_progress", refused)


def told(*arguments: str | Path) -> str:
    """Return the notes that plan prints."""
    result = CliRunner().invoke(app, ["plan", *map(str, arguments)])
    assert isinstance(result.exception, sm.errors.PlanError), result.output
    return result.stderr


@pytest.mark.parametrize("file", FILES, ids=lambda file: file[0])
@pytest.mark.usefixtures("unplanned")
def test_what_a_path_does_not_say_is_told(
    file: tuple[str, str, tuple[str, ...], tuple[str, ...]], tmp_path: Path
) -> None:
    name, text, options, notes = file
    (tmp_path / name).write_text(text)
    said = told("panda", "--path", tmp_path / name, "--task", "position", *options)
    for note in notes:
        assert re.search(rf"(?m)^note: .*{note}", said), note
    # Of what is told it is told how to say it otherwise, or the file says it.
    framed = told("panda", "--path", tmp_path / name, "--task", "position", *options,
                  "--frame", "0,0,0,0,0,0")  # fmt: skip
    assert "no frame is given" not in framed


@pytest.mark.usefixtures("unplanned")
def test_what_arrays_and_drawings_do_not_say_is_told(tmp_path: Path) -> None:
    asked = ("panda", "--task", "position", "--feed", "0.05", "--path")
    np.save(tmp_path / "a.npy", [[0.4, 0.0, 0.3], [0.4, 0.1, 0.3]])
    assert re.search(TABLE, told(*asked, tmp_path / "a.npy"))
    np.save(tmp_path / "b.npy", [DOWN, ASIDE])
    assert "matrices say no unit" in told(*asked, tmp_path / "b.npy")
    drawing = ezdxf.new(units=4)
    drawing.modelspace().add_line((400, 0), (400, 50))
    drawing.saveas(tmp_path / "a.dxf")
    said = told(*asked, tmp_path / "a.dxf")
    assert "the tool's z axis points down, against that of the drawing" in said
    assert "no frame is given" in said


def test_every_reader_of_paths_is_among_these(tmp_path: Path) -> None:
    """Files of other suffixes are read alike."""
    texts = {Path(name).suffix: text for name, text, *_ in FILES[::-1]}
    for alike, suffixes in ((".nc", PROGRAMS), (".apt", CLDATA)):
        for suffix in suffixes:
            (tmp_path / f"a{suffix}").write_text(texts[alike])
            notes = sm.files.read_path(tmp_path / f"a{suffix}", seam="cut 1").notes
            assert any(note.startswith("no ") for note in notes), suffix
            texts.setdefault(suffix, "")
    assert {*texts, ".npy"} == set(_READERS)


ARM = """<robot name="arm"><link name="base"/>
{links}{joints}{more}</robot>"""


def arm(folder: Path, joint: str = "", link: str = "", more: str = "") -> Path:
    """Write an arm of seven joints that turn about their x axes."""
    links = "".join(f'<link name="l{k}">{link}</link>' for k in range(1, 8))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="{f"l{k - 1}" if k > 1 else "base"}"/>'
        f'<child link="l{k}"/><origin xyz="0 0 0.15" rpy="0 0 {0.7 * k}"/>'
        f'<limit lower="-2" upper="2" velocity="2" effort="9"/>{joint}</joint>'
        for k in range(1, 8)
    )
    (folder / "arm.urdf").write_text(ARM.format(links=links, joints=joints, more=more))
    return folder / "arm.urdf"


@pytest.mark.usefixtures("unplanned")
def test_what_an_arm_does_not_say_is_told(tmp_path: Path) -> None:
    shutil.copy(CASES / "collada_unit" / "box_m_z.dae", tmp_path / "unit.dae")
    text = (tmp_path / "unit.dae").read_text()
    (tmp_path / "bare.dae").write_text(re.sub(r"<unit[^>]*/>", "", text))
    body = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
    soft = '<safety_controller soft_lower_limit="-1" soft_upper_limit="2" k_velocity="1"/>'
    control = (
        '<ros2_control name="c" type="system"><joint name="j3"><command_interface name="position">'
        '<param name="max">1.5</param></command_interface></joint></ros2_control>'
    )
    asked = (*on_line("0.02,0,0"), "--task", "position", "--set", "clearance=false")
    axes = "'j1', 'j2', 'j3', 'j4', 'j5' and 2 more: no <axis>, which is x then"
    unit = "bodies of 'l1', 'l2', 'l3', 'l4', 'l5' and 2 more: their mesh files say no unit"
    said = told(arm(tmp_path, soft, body.format("bare.dae"), control), *asked)
    for note in (
        axes, unit, "the tool is 'l7', the only link with none behind it",
        "soft limits of <safety_controller> are narrower than <limit>, and are passed over",
        "'j3': min and max in <ros2_control> are narrower than <limit>, and are passed over",
    ):  # fmt: skip
        assert note in said
    said = told(arm(tmp_path, '<axis xyz="1 0 0"/>', body.format("unit.dae")), "--tool", "l7",
                *asked)  # fmt: skip
    for word in ("no <axis>", "say no unit", "the tool is", "passed over"):
        assert word not in said


@pytest.mark.usefixtures("unplanned")
def test_what_files_beside_an_arm_do_not_say_is_told(tmp_path: Path) -> None:
    limits = tmp_path / "joint_limits.yaml"
    limits.write_text(
        "default_velocity_scaling_factor: 0.5\njoint_limits:\n  panda_joint1: {has_velocity_limits:"
        " true, max_velocity: 1.0, max_effort: 3}\n  finger: {has_velocity_limits: false}\n"
    )
    srdf = tmp_path / "a.srdf"
    srdf.write_text(
        '<robot name="panda"><group name="arm"/><disable_default_collisions link="panda_link3"/>'
        '<disable_collisions link1="panda_link2" link2="panda_link4"/></robot>'
    )
    (tmp_path / "part.stl").write_text(STL)
    obstacles = tmp_path / "cell.json"
    obstacles.write_text(
        json.dumps([{"shape": "mesh", "name": "part", "file": "part.stl",
                     "position": [0.9, 0.9, 0.9]}])
    )  # fmt: skip
    files = (
        "--set",
        f"joint_limits={limits}",
        "--set",
        f"clearance.srdf={srdf}",
        "--set",
        f"clearance.obstacles=@{obstacles}",
    )
    said = told("panda", *on_line("0,0.02,0"), *files)
    notes = (
        "limits are read in rad and s (m for prismatic joints), as MoveIt's are",
        "default_velocity_scaling_factor 0.5 is applied",
        "left out, as the arm does not have them: finger",
        "joint_limits.yaml: ignored: max_effort",
        "passed over: <group>, <disable_default_collisions>",
        "mesh 'part': part.stl says no unit: taken for metres (else: scale)",
    )
    for note in notes:
        assert note in said
    # The same is told of a motion that is checked by them, and of the motion.
    rows = [[0.2 * k, 0.05 * k, *ELBOW] for k in range(11)]
    titles = ["t", *(f"panda_joint{k}" for k in range(1, 8))]
    table = [titles, *(map(str, row) for row in rows)]
    (tmp_path / "m.csv").write_text("\n".join(map(",".join, table)) + "\n")
    (tmp_path / "p.csv").write_text("x,y,z\n0.4,0,0.3\n0.4,0.1,0.3\n")
    path = ("--path", tmp_path / "p.csv", "--feed", "0.1", "--task", "position")
    asked = ("--robot", "panda", *path, *files, "--json")
    code, text = invoke("check", tmp_path / "m.csv", *asked)
    assert code == 1
    remarks = "\n".join(json.loads(text)["remarks"])
    for note in (
        *notes, "says no unit: taken for radians, metres of joints that slide, and seconds",
        "says no velocities: those of a cubic spline", "x,y,z for metres", "no frame is given",
    ):  # fmt: skip
        assert note in remarks


ELBOW = (-0.5, 0.0, -2.2, 0.0, 1.7, 0.8)
STL = "solid a\n" + "".join(
    "facet normal 0 0 0\nouter loop\n"
    + "".join(f"vertex {' '.join(map(str, corner))}\n" for corner in face)
    + "endloop\nendfacet\n"
    for face in (
        ((0, 0, 0), (0, 0.1, 0), (0.1, 0, 0)), ((0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)),
        ((0, 0, 0), (0, 0, 0.1), (0, 0.1, 0)), ((0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1)),
    )
) + "endsolid a\n"  # fmt: skip


@pytest.mark.usefixtures("unplanned")
@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.yaml", "offsets: {panda_joint1: 0.001}\n", "offsets for radians (metres of joints"),
        ("a.toml", "[offsets]\npanda_joint1 = 0.001\n", "position is taken for metres, rpy for"),
    ],
)
def test_units_of_calibrations_are_told(name: str, text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    job = tmp_path / "job.toml"
    job.write_text(
        f'robot = {{ name = "panda", calibration = "{name}" }}\nstart = "home"\n'
        '[path]\nkind = "line"\nby = [0.0, 0.01, 0.0]\nduration = 1.0\n'
    )
    assert said in told(job)
