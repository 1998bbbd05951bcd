"""Files of paths and motions as people have them: what they say is what is read."""

import json
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app
from selfmotion.shop.cam import Reading
from selfmotion.shop.cam.gcode import read_gcode
from support.arms import robot_named
from support.shell import complaint, invoke

# Durations of what differs by less than its tolerance [share], and rounding of a file [m].
ALIKE, ROUNDING = 0.02, 1e-9
GOOD = np.array([[0.4, -0.05, 0.3], [0.42, 0.0, 0.3], [0.4, 0.05, 0.3]])
DOWN = [0.0, 0.0, -1.0]


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


_ROWS = ["0.4 -0.05 0.3 0 0 -1", "0.42 0 0.3 0 0 -1", "0.4 0.05 0.3 0 0 -1"]
_NORMALS = "x,y,z,nx,ny,nz"
# fmt: off
TABLES: list[tuple[str, str, str | None]] = [
    ("commas", "\n".join([_NORMALS, *(row.replace(" ", ",") for row in _ROWS)]), None),
    ("spaces", "\n".join([_NORMALS.replace(",", " "), *_ROWS]), None),
    ("wide spaces", "\n".join(["x   y  z", *(f"  {row[:-7]}" for row in _ROWS)]), None),
    ("tabs", "\n".join(["x\ty\tz", *(row[:-7].replace(" ", "\t") for row in _ROWS)]), None),
    ("upper case", "X,Y,Z\n0.4,-0.05,0.3\n0.42,0,0.3\n0.4,0.05,0.3\n", None),
    ("units in brackets", "x [mm],Y (mm),z[mm]\n400,-50,300\n420,0,300\n400,50,300\n", None),
    ("decimal commas", "x;y;z\n0,4;-0,05;0,3\n0,42;0;0,3\n0,4;0,05;0,3\n", None),
    ("no header", "\n".join(_ROWS), _NORMALS),
    ("no header, commas", "\n".join(row.replace(" ", ",") for row in _ROWS), _NORMALS),
    ("a header in a comment", "\n".join([f"# {_NORMALS}", *_ROWS]), None),
    ("inches", "x_in,Y [in],z (inch)\n15.748031496062994,-1.9685039370078743,11.811023622047244\n"
     "16.53543307086614,0,11.811023622047244\n"
     "15.748031496062994,1.9685039370078743,11.811023622047244\n", None),
    ("centimetres", "x_cm,y_cm,z [cm]\n40,-5,30\n42,0,30\n40,5,30\n", None),
    ("quotes", "'x';\"y\";'z'\n'0.4';\"-0.05\";'0.3'\n0.42;0;0.3\n0.4;0.05;0.3\n", None),
    ("all in quotes", '"x","y","z"\n"0.4","-0.05","0.3"\n"0.42","0","0.3"\n'
     '"0.4","0.05","0.3"\n', None),
    ("titles of messages", "\n".join(["pose.position.x,pose.position.y,pose.position.z,"
     "pose.orientation.x,pose.orientation.y,pose.orientation.z,pose.orientation.w",
     *(row[:-7].replace(" ", ",") + ",1,0,0,0" for row in _ROWS)]), None),
    ("titles with marks", "\n".join(["pos_x,position_y,pz,quat_x,quat_y,quat_z,q_w",
     *(row[:-7].replace(" ", ",") + ",1,0,0,0" for row in _ROWS)]), None),
    ("columns left out", "\n".join(f"7 {row}" for row in _ROWS), "-,x,y,z,-,-,-"),
    ("commas at the ends", "x,y,z,\n0.4,-0.05,0.3,\n0.42,0,0.3,\n0.4,0.05,0.3,\n", None),
]


# fmt: on
@pytest.mark.parametrize("table", TABLES, ids=lambda table: table[0])
def test_tables_of_all_forms_give_one_motion(
    table: tuple[str, str, str | None], tmp_path: Path
) -> None:
    _, text, columns = table
    path = sm.files.read_path(written(tmp_path, "a.txt", text), feed=0.05, columns=columns)
    plain = sm.files.read_path(written(tmp_path, "b.csv", TABLES[0][1]), feed=0.05)
    assert path.duration == pytest.approx(plain.duration)
    t = np.linspace(0.0, min(plain.duration, path.duration), 31)
    found, wanted = path.samples(t), plain.samples(t)
    np.testing.assert_allclose(found.translation, wanted.translation, atol=ROUNDING)
    if path.oriented:
        np.testing.assert_allclose(found.rotation, wanted.rotation, atol=ROUNDING)


@pytest.mark.parametrize("code", ["utf-8-sig", "utf-16", "latin-1", "cp1252"])
def test_letters_of_other_machines_are_no_matter(code: str, tmp_path: Path) -> None:
    rows = "0,4;-0,05;0,3;180;0;0\r\n0,42;0;0,3;180;0;0\r\n"
    file = tmp_path / "a.csv"
    file.write_bytes(
        f"# Naht für Träger\r\nx;y;z;roll [°];pitch [°];yaw [°]\r\n{rows}".encode(code)
    )
    path = sm.files.read_path(file, feed=0.05)
    np.testing.assert_allclose(path.pose(0.0).translation, GOOD[0], atol=ROUNDING)
    np.testing.assert_allclose(path.pose(0.0).rotation[:, 2], DOWN, atol=ROUNDING)


def test_a_trajectory_of_a_camera_is_read(tmp_path: Path) -> None:
    text = "# timestamp tx ty tz qx qy qz qw\n5.0 0.4 0 0.3 1 0 0 0\n7.0 0.5 0 0.3 1 0 0 0\n"
    assert sm.files.read_path(written(tmp_path, "a.txt", text)).duration == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seam,event\na,b\n", "column 'x' is missing; the header is seam,event, expected x,y,z"),
        ("X,Y,Z,A,B\n", "'a': A,B,C of KUKA are yaw_deg,pitch_deg,roll_deg here"),
        (
            "X,Y,Z,A,B,C\n0.4,0,0.3,0,0,180\n0.4,0.1,0.3,0,0,180\n",
            "A,B,C are KUKA's, whose x,y,z are in mm, and all of these are below 10",
        ),
        ("x,y,z,q1,q2,q3,q4\n", "'q1': q1,q2,q3,q4 of ABB are qw,qx,qy,qz here"),
        ("x,y,z,w,p,r\n", "'w': W,P,R of Fanuc are roll_deg,pitch_deg,yaw_deg here"),
        ("id,x,y,z\n", "unknown column 'id', .*to leave a column out, call it - in columns"),
        ("x\x00,y\n", "is no text: it has a byte 0"),
        ("G21 G90\nG1 X1 F100\n", "'g21': if this is G-code, call the file .nc or .gcode"),
    ],
)
def test_tables_that_lack_or_have_more_say_what_to_do(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(written(tmp_path, "a.csv", text), feed=0.05)


def test_a_tool_that_turns_in_place_takes_time_for_it(tmp_path: Path) -> None:
    rows = ["0.4,0,0.3,180,0,0", "0.4,0,0.3,180,0,30", "0.45,0,0.3,180,0,30"]
    text = "\n".join(["x,y,z,roll_deg,pitch_deg,yaw_deg", *rows])
    file = written(tmp_path, "a.csv", text)
    with pytest.raises(sm.errors.FileFormatError, match=r"line 3: .*a feed with corners round"):
        sm.files.read_path(file, feed=0.05)
    path = sm.files.read_path(file, feed=0.05, corners="round")
    samples = path.samples(np.linspace(0.0, path.duration, 501))
    turning = np.abs(samples.twist[:, 5]) > 0.5
    assert turning.any()
    np.testing.assert_allclose(samples.translation[turning, 0], 0.4, atol=1e-3)
    angle = np.arccos(0.5 * (np.trace(samples.rotation[0].T @ samples.rotation[-1]) - 1.0))
    assert angle == pytest.approx(np.pi / 6)


def test_a_table_without_header_is_planned_with_columns(tmp_path: Path) -> None:
    file = written(tmp_path, "a.csv", "\n".join(row.replace(" ", ",") for row in _ROWS))
    asked = ("plan", "panda", "--path", file, "--task", "position", "--feed", "0.05")
    assert f"add {_NORMALS} (or say --set path.columns={_NORMALS})" in complaint(*asked)
    code, text = invoke(*asked, "--set", f"path.columns={_NORMALS}")
    assert code == 0, text


def test_normals_that_point_out_are_flipped_and_tips_held_back(tmp_path: Path) -> None:
    text = TABLES[0][1].replace(",-1", ",1")
    file = written(tmp_path, "a.csv", text)
    path = sm.files.read_path(file, feed=0.05, flip_normals=True, standoff=0.01)
    plain = sm.files.read_path(written(tmp_path, "b.csv", TABLES[0][1]), feed=0.05)
    found, wanted = path.pose(0.0), plain.pose(0.0)
    np.testing.assert_allclose(found.rotation[:, 2], DOWN, atol=ROUNDING)
    np.testing.assert_allclose(found.translation - wanted.translation, [0, 0, 0.01], atol=1e-12)
    job = tmp_path / "a.toml"
    job.write_text(
        'task = "pointing"\nrobot.name = "panda"\n[path]\nkind = "file"\nfile = "a.csv"\n'
        "feed_mm = 50\nflip_normals = true\nstandoff_mm = 10\n"
    )
    again = sm.read_problem(job).path.pose(0.0)
    np.testing.assert_allclose(again.homogeneous, found.homogeneous, atol=1e-12)


def test_normals_that_seem_to_point_out_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Above the floor an arm reaches down, not up from below it."""
    rows = "\n".join(f"0.5,{y},0.02,0,0,1" for y in (-0.1, 0.0, 0.1))
    file = written(tmp_path, "a.csv", f"x,y,z,nx,ny,nz\n{rows}\n")

    def refused(*_: object, **__: object) -> sm.Plan:
        raise sm.errors.PlanError("not planned here")

    monkeypatch.setattr("selfmotion.shell.cli.plan_commands.plan_with_progress", refused)
    job = tmp_path / "a.toml"
    job.write_text(
        'task = "pointing"\nrobot.name = "panda"\n[seams]\nfile = "b.csv"\nfeed = 0.05\n'
    )
    seams = rows.replace("0.5,", "left,0.5,")
    written(tmp_path, "b.csv", f"seam,x,y,z,nx,ny,nz\n{seams}\n")
    monkeypatch.setattr("selfmotion.shell.documents.SeamJob.plan", refused)
    for setting, is_told in (("false", True), ("true", False)):
        asked = ["job", str(job), "--set", f"seams.flip_normals={setting}"]
        printed = CliRunner().invoke(app, asked).output
        assert ("seam 'left' are out of reach as read, and in reach with" in printed) == is_told
    listed = tmp_path / "listed.toml"
    listed.write_text(
        'task = "pointing"\nrobot.name = "panda"\n[[seams]]\nname = "right"\n'
        'path = { kind = "file", file = "a.csv", feed = 0.05 }\n'
    )
    printed = CliRunner().invoke(app, ["job", str(listed)]).output
    assert "seam 'right' are out of reach as read, and in reach with" in printed
    asked = ["plan", "panda", "--path", file, "--task", "pointing", "--feed", "0.05"]
    said = "out of reach as read, and in reach with --set path.flip_normals=true"
    for more, is_told in (([], True), (["--set", "path.flip_normals=true"], False)):
        printed = CliRunner().invoke(app, [*map(str, asked), *more]).output
        assert (said in printed) == is_told


def test_a_path_that_leaves_its_straight_lines_says_by_how_much(tmp_path: Path) -> None:
    text = "x [m],y [m],z [m]\n0.40,-0.10,0.4\n0.45,-0.10,0.4\n0.45,0.10,0.4\n"
    file = written(tmp_path, "three.csv", text)
    (note,) = sm.files.read_path(file, feed=0.05).notes
    assert "by up to 40.0 mm at line 3: corners round (--set path.corners=round) keeps 1 mm" in note
    assert sm.files.read_path(file, feed=0.05, corners="round").notes == ()
    assert sm.files.read_path(file, feed=0.05, corners="stop").notes == ()
    # Not of what is smooth.
    angle = np.linspace(0.0, np.pi, 60)
    arc = np.column_stack([0.4 + 0.1 * np.sin(angle), 0.1 * np.cos(angle), np.full(60, 0.4)])
    rows = "\n".join(",".join(map(repr, row)) for row in arc.tolist())
    assert (
        sm.files.read_path(
            written(tmp_path, "arc.csv", f"x (m),y (m),z (m)\n{rows}\n"), feed=0.05
        ).notes
        == ()
    )
    placed = tmp_path / "a.toml"
    placed.write_text(
        'task = "position"\nrobot.name = "panda"\n[path]\nkind = "file"\nfile = "three.csv"\n'
        "feed = 0.05\nframe = { position = [0.0, 0.01, 0.0] }\n"
    )
    assert note in sm.read_problem(placed).remarks
    asked = ("plan", str(placed), "--json", "--set", "max_evaluations=1")
    found = CliRunner().invoke(app, asked)
    assert note in json.loads(found.stdout)["remarks"]
    assert f"note: {note}" in found.stderr


_HEAD = "G21 G90 G94\nG0 X0 Y0 Z10\nG1 Z0 F1800\n"
_SAME_LINE = {
    "stub of 1 nm": "G1 X30\nG1 X30.000001\nG1 Y30\n",
    "stub of 1 um": "G1 X30\nG1 X30.001\nG1 Y30\n",
    "stub of 0.1 mm": "G1 X30\nG1 X30.1\nG1 Y30\n",
    "stub aside": "G1 X30\nG1 X30.1 Y-0.1\nG1 X30 Y30\n",
    "stub back": "G1 X30\nG1 X29.99\nG1 Y30\n",
    "a feed for no way": "G1 X30\nG1 X30.001 F10\nG1 Y30 F1800\n",
    "chords": "".join(f"G1 X{k / 20:.2f}\n" for k in range(1, 601))
    + "".join(f"G1 Y{k / 20:.2f}\n" for k in range(1, 601)),
}


@pytest.mark.parametrize("kind", _SAME_LINE)
def test_legs_shorter_than_the_tolerance_hardly_count(kind: str, tmp_path: Path) -> None:
    def cut(text: str, corners: str) -> sm.paths.Path:
        file = written(tmp_path, "a.nc", _HEAD + text + "G0 X90\nM30\n")
        return sm.files.read_path(file, seam="cut 1", corners=corners)

    plain, path = cut("G1 X30\nG1 Y30\n", "round"), cut(_SAME_LINE[kind], "round")
    assert path.duration == pytest.approx(plain.duration, rel=ALIKE)
    assert path.duration <= cut(_SAME_LINE[kind], "stop").duration
    places = path.samples(np.linspace(0.0, path.duration, 2001)).translation
    ends = 1e-3 * np.array([[0, 0, 10], [0, 0, 0], [30, 0, 0], [30, 30, 0]])
    legs = list(pairwise(ends))
    away = np.min([_away(places, *leg) for leg in legs], axis=0)
    assert away.max() <= 1.15e-3 if kind == "stub aside" else away.max() <= 1e-3 + 1e-9


_CORNER = [(0.0, 0.0), (30.0, 0.0), (30.0, 30.0)]
_SAME_CORNER = {
    "stub of 1 nm": [*_CORNER[:2], (30.000001, 0.0), _CORNER[2]],
    "stub of 1 um before": [_CORNER[0], (29.999, 0.0), *_CORNER[1:]],
    "stub of 0.1 mm": [*_CORNER[:2], (30.1, 0.0), _CORNER[2]],
    "a place twice": [*_CORNER[:2], *_CORNER[1:]],
    "chords": [(k / 5, 0.0) for k in range(151)] + [(30.0, k / 5) for k in range(1, 151)],
}


def apt_through(file: Path, places: list[tuple[float, float]]) -> Path:
    words = [f"GOTO/{x:.7f},{y:.7f},0" for x, y in places]
    file.write_text("\n".join(["UNITS/MM", "FEDRAT/1800,MMPM", "RAPID", *words, "FINI\n"]))
    return file


def drawing_through(file: Path, places: list[tuple[float, float]]) -> Path:
    drawing = ezdxf.new("R2010", units=4)
    for begin, end in pairwise(places):
        drawing.modelspace().add_line(begin, end)
    drawing.saveas(file)
    return file


@pytest.mark.parametrize("kind", _SAME_CORNER)
@pytest.mark.parametrize("write", [apt_through, drawing_through])
def test_short_legs_hardly_count_in_apt_and_drawings(
    write: Callable[[Path, list[tuple[float, float]]], Path], kind: str, tmp_path: Path
) -> None:
    def path(places: list[tuple[float, float]], corners: str = "round") -> sm.paths.Path:
        file = write(tmp_path / f"a.{'apt' if write is apt_through else 'dxf'}", places)
        return sm.files.read_path(file, feed=0.03, corners=corners)

    found = path(_SAME_CORNER[kind])
    assert found.duration == pytest.approx(path(_CORNER).duration, rel=ALIKE)
    assert found.duration <= path(_SAME_CORNER[kind], "stop").duration
    places = found.samples(np.linspace(0.0, found.duration, 501)).translation
    ends = 1e-3 * np.array([(*place, 0.0) for place in _CORNER])
    away = np.min([_away(places, *leg) for leg in pairwise(ends)], axis=0)
    assert away.max() <= 1e-3 + ROUNDING


def _away(places: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    leg = end - begin
    share = np.clip((places - begin) @ leg / (leg @ leg), 0.0, 1.0)
    return np.asarray(np.linalg.norm(begin + share[:, None] * leg - places, axis=1))


@pytest.mark.parametrize("corners", ["blend", "round"])
def test_rows_that_are_repeated_or_all_but_repeated_hardly_count(
    corners: str, tmp_path: Path
) -> None:
    rows = ["0.4,-0.1,0.4", "0.45,-0.1,0.4", "0.45,0.1,0.4"]
    plain = sm.files.read_path(
        written(tmp_path, "a.csv", "\n".join(["x,y,z", *rows])), feed=0.05, corners=corners
    )
    for extra in (rows[1], "0.4500001,-0.1,0.4", "0.45,-0.10001,0.4"):
        text = "\n".join(["x,y,z", *rows[:2], extra, rows[2]])
        path = sm.files.read_path(written(tmp_path, "b.csv", text), feed=0.05, corners=corners)
        assert path.duration == pytest.approx(plain.duration, rel=ALIKE)
        t = np.linspace(0.0, 1.0, 101)
        one, other = (each.samples(t * each.duration).translation for each in (plain, path))
        assert np.linalg.norm(one - other, axis=1).max() < 1e-3


# A slicer's file: a loop, a retraction, a travel, and a line.
PRINTED = """; made for a test
M104 S205
M82 ;absolute extrusion
M117 Printing...
G28 ;home
G92 E0
G1 F200 E3
G92 E0
M204 X500 Y500
G0 F3600 X10 Y10 Z0.3
;TYPE:WALL-OUTER
G1 F1500 X40 Y10 E1.2
G1 X40 Y30 E2.0
G1 X10 Y30 E3.2
G1 X10 Y10 E4.0
G1 F1800 E-2.5
G0 F3600 X14 Y14
G1 F1800 E4.0
;TYPE:FILL
G1 F1500 X36 Y26 E5.0
M84
"""


@pytest.mark.parametrize("relative", [False, True])
def test_what_extrudes_is_a_cut(relative: bool, tmp_path: Path) -> None:
    text = PRINTED
    if relative:
        text = text.replace("M82 ;absolute extrusion", "M83").replace("E5.0", "E1.0")
        for now, fed in (("E2.0", "E0.8"), ("E3.2", "E1.3"), ("E4.0\nG1 F18", "E.8\nG1 F18")):
            text = text.replace(now, fed)
        text = text.replace("G1 F1800 E4.0", "G1 F1800 E6.5")
    cuts = read_gcode(written(tmp_path, "part.gcode", text))
    assert list(cuts) == ["cut 1", "cut 2"]
    loop, line = cuts.values()
    np.testing.assert_allclose(
        1e3 * loop.positions, [[10, 10, 0.3], [40, 10, 0.3], [40, 30, 0.3], [10, 30, 0.3],
                               [10, 10, 0.3]])  # fmt: skip
    np.testing.assert_allclose(1e3 * line.positions, [[14, 14, 0.3], [36, 26, 0.3]])
    assert loop.feed is not None
    np.testing.assert_allclose(loop.feed, 0.025)
    assert (4, "retract") in loop.events
    assert (0, "prime") in line.events
    assert [event for _, event in loop.events][:2] == ["M104", "M117"]
    note, *_ = loop.notes
    assert "line 5: G28 goes to a place of the machine's own" in note
    assert "not known until X, Y and Z are given" in note
    path = sm.files.read_path(tmp_path / "part.gcode", seam="cut 1")
    # 100 mm at 25 mm/s, less what three rounded corners save.
    assert path.duration == pytest.approx(4.0, rel=0.02)
    with pytest.raises(sm.errors.FileFormatError, match="line 6: G92 X: zeros that move"):
        read_gcode(written(tmp_path, "b.gcode", text.replace("G92 E0", "G92 X0 E0", 1)))


def test_what_a_printer_feeds_by_differences_is_a_cut(tmp_path: Path) -> None:
    """After G91 E counts by differences, and after G90 as M82 and M83 said."""
    text = PRINTED.replace("G1 X40 Y30 E2.0", "G91\nG1 Y20 E0.8\nG90")
    for mode in ("M82", "M83"):
        text = text.replace("M82", mode)
        loop = read_gcode(written(tmp_path, "part.gcode", text))["cut 1"]
        np.testing.assert_allclose(1e3 * loop.positions[:3, :2], [[10, 10], [40, 10], [40, 30]])
        assert len(loop.positions) == 5


def test_what_extrudes_nothing_on_its_way_cuts_at_its_feed(tmp_path: Path) -> None:
    """Programs of pumps and beams whose E only retracts."""
    lines = [
        re.sub(r" E[0-9.]+", "", line) if "X" in line else line for line in PRINTED.split("\n")
    ]
    cuts = read_gcode(written(tmp_path, "part.gcode", "\n".join(lines)))
    expected = read_gcode(written(tmp_path, "printed.gcode", PRINTED))
    for found, printed in zip(cuts.values(), expected.values(), strict=True):
        np.testing.assert_array_equal(found.positions, printed.positions)


def test_another_nozzle_of_a_printer_is_an_event(tmp_path: Path) -> None:
    text = PRINTED.replace("G1 X40 Y30 E2.0", "T1\nG1 X40 Y30 E2.0")
    loop = read_gcode(written(tmp_path, "part.gcode", text))["cut 1"]
    assert (1, "T1") in loop.events


ROTARY = "G21 G90 G94\nG0 X-25 Y-6 Z45 {0}0 C0\nG1 Z38 F300\nG1 X-20 {0}-26.5 C-5\nG0 X90\nM30\n"


@pytest.mark.parametrize("first", ["A", "B"])
@pytest.mark.parametrize("signs", [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_a_rotary_table_turns_the_part(
    first: str, signs: tuple[float, float], tmp_path: Path
) -> None:
    """Held against a part that is carried by hand: placed, turned by C, then by the first axis."""
    file, centre = written(tmp_path, "a.nc", ROTARY.format(first)), np.array([5.0, -3.0, 2.0])
    axes = [
        ("" if sign > 0 else "-") + name for name, sign in zip([first, "C"], signs, strict=True)
    ]
    options = {"rotary": "table", "rotary_axes": axes, "rotary_center": (1e-3 * centre).tolist()}
    rows = read_gcode(file, Reading.of(file, options))["cut 1"]
    start, goal = np.array([-25.0, -6.0, 38.0]), np.array([-20.0, -6.0, 38.0])
    for k, (point, rotation) in enumerate(zip(rows.positions[1:], rows.values[1:], strict=True)):
        share = k / (len(rows.positions) - 2)
        # The table itself turns against the words, but for those with a minus.
        table = [-sign * share * angle for sign, angle in zip(signs, (-26.5, -5.0), strict=True)]
        carried = Rotation.from_euler("X" if first == "A" else "Y", table[0], degrees=True)
        carried = carried * Rotation.from_euler("Z", table[1], degrees=True)
        in_machine = centre + carried.apply(1e3 * point - centre)
        np.testing.assert_allclose(in_machine, start + share * (goal - start), atol=1e-9)
        # The machine's axis stays upright, the tool points down along it.
        np.testing.assert_allclose(carried.apply(rotation[:, 2]), DOWN, atol=1e-12)
    middles = 0.5 * (rows.positions[2:] + rows.positions[1:-1])
    assert np.linalg.norm(np.diff(middles, axis=0), axis=1).max() < 2e-3


def test_rotary_words_without_what_they_turn_are_refused(tmp_path: Path) -> None:
    file = written(tmp_path, "a.nc", ROTARY.format("B"))
    with pytest.raises(
        sm.errors.FileFormatError, match=r"line 4: B turns a table or the head.*_axes"
    ):
        sm.files.read_path(file)
    asked = ("plan", "panda", "--path", file, "--task", "pointing")
    assert "say --set path.rotary=table with --set path.rotary_axes (BC, AC)" in complaint(*asked)
    known = {
        name: sm.files.read_path(file, rotary="head").pose(0.5).homogeneous for name in ("head",)
    }
    tip = written(tmp_path, "b.nc", ROTARY.format("B").replace("G94", "G94 G43.4 H1"))
    np.testing.assert_array_equal(sm.files.read_path(tip).pose(0.5).homogeneous, known["head"])
    # A way home behind the cut leaves it as it is.
    home = written(tmp_path, "d.nc", ROTARY.format("B").replace("G0 Z60", "G28 X0 Y0"))
    found = sm.files.read_path(home, rotary="head").pose(0.5).homogeneous
    np.testing.assert_array_equal(found, known["head"])
    # A table under tool centre point control turns as the head, or the other way.
    table = sm.files.read_path(file, rotary="head", rotary_axes="BC").pose(0.5).homogeneous
    np.testing.assert_allclose(table, known["head"], atol=1e-12)
    mirrored = ROTARY.format("B").replace("B-26.5 C-5", "B26.5 C5")
    other = sm.files.read_path(
        written(tmp_path, "e.nc", mirrored), rotary="head", rotary_axes="-B,-C"
    )
    np.testing.assert_allclose(other.pose(0.5).homogeneous, known["head"], atol=1e-12)
    file = written(tmp_path, "f.nc", ROTARY.format("A"))
    for options in ({"rotary": "head"}, {"rotary": "table", "rotary_center": [0, 0, 0]}):
        with pytest.raises(
            sm.errors.FileFormatError, match=r"A turns.* none of rotary_axes \(B, C"
        ):
            sm.files.read_path(file, rotary_axes="BC", **options)
    file = tmp_path / "a.nc"
    # Words of 0 turn nothing.
    assert (
        sm.files.read_path(written(tmp_path, "c.nc", "G0 X0 Y0 Z0 A0\nG1 X10 F600 A0\n")).duration
        > 0
    )
    for options, said in (
        ({"rotary": "bed"}, "expected 'head' or 'table'"),
        ({"rotary": "table"}, "rotary_center is missing"),
        ({"rotary": "table", "rotary_center": [0, 0, 0]}, "rotary_axes is None"),
        ({"rotary": "table", "rotary_center": [0, 0, 0], "rotary_axes": "BD"}, "'BD', expected"),
        ({"rotary_axes": "BC"}, "are of rotary = 'table'"),
        ({"rotary": "head", "rotary_center": [0, 0, 0]}, "is of a table whose positions are"),
    ):
        with pytest.raises(sm.errors.FileFormatError, match=said):
            sm.files.read_path(file, **options)


def test_arcs_in_all_planes_are_turned_ones_of_the_first(tmp_path: Path) -> None:
    start = "G0 X0 Y0 Z0\nF600\n"
    flat = read_gcode(written(tmp_path, "a.nc", start + "G17 G2 X10 Y10 I10 J0 Z3"))["cut 1"]
    for plane, words, order in (
        ("G18", "Z10 X10 K10 I0 Y3", [1, 2, 0]),
        ("G19", "Y10 Z10 J10 K0 X3", [2, 0, 1]),
    ):
        other = read_gcode(written(tmp_path, "b.nc", f"{start}{plane} G2 {words}"))["cut 1"]
        np.testing.assert_allclose(other.positions, flat.positions[:, order], atol=1e-12)


def test_inverse_time_says_how_long_a_line_takes(tmp_path: Path) -> None:
    text = "G0 X0 Y0 Z0\nG93\nG1 X100 F30\nG1 X150 F60\n"
    rows = read_gcode(written(tmp_path, "a.nc", text))["cut 1"]
    assert rows.feed is not None
    # 100 mm in 2 s, and 50 mm in 1 s.
    np.testing.assert_allclose(rows.feed, 0.05)


def test_lists_of_pose_arrays_are_seams(tmp_path: Path) -> None:
    def raster(y: float) -> list[dict[str, object]]:
        turned = {"x": 1.0, "y": 0.0, "z": 0.0, "w": 0.0}
        places = [{"x": 0.4 + x, "y": y, "z": 0.3} for x in (0.0, 0.1)]
        return [{"position": place, "orientation": dict(turned)} for place in places]

    arrays = [{"poses": raster(0.0)}, {"poses": raster(0.1)}]
    jobs = [{"dwell_time": 0, "paths": arrays[:1]}, {"paths": arrays[1:]}]
    nested = [[raster(0.0)], [raster(0.1)]]
    for k, document in enumerate((arrays, {"paths": arrays}, nested, jobs)):
        file = written(tmp_path, f"{k}.json", json.dumps(document))
        second = sm.files.read_path(file, seam="seam 2", feed=0.05)
        np.testing.assert_allclose(second.pose(0.0).translation, [0.4, 0.1, 0.3], atol=ROUNDING)
        with pytest.raises(
            sm.errors.FileFormatError, match="has 2 seams or cuts, seam 1 to seam 2"
        ):
            sm.files.read_path(file, feed=0.05)
    one = sm.files.read_path(written(tmp_path, "one.json", json.dumps(arrays[:1])), feed=0.05)
    assert one.duration > 0.0


def test_trajectories_of_other_tools_are_judged_alike(tmp_path: Path) -> None:
    robot = robot_named("panda")
    q = robot.dexterous_configuration()
    goal = robot.pose(q)
    goal.translation += [0.0, 0.1, 0.0]
    line = sm.paths.Line(robot.pose(q), goal, 2.0)
    plan = sm.plan(sm.Problem(robot, line, "pose", q), max_evaluations=3)
    sm.files.write_motion(plan, tmp_path / "good.yaml", rate=50.0)
    good = yaml.safe_load((tmp_path / "good.yaml").read_text())
    miss = robot_miss(robot, plan)

    def judged(document: object) -> sm.Certificate:
        file = written(tmp_path, "other.yaml", yaml.dump(document))
        return sm.certify(robot, line, "pose", sm.files.read_motion(file))

    wanted = judged(good)
    assert wanted.verified, wanted.verdict
    for k, point in enumerate(good["points"]):
        point["time_from_start"] = {"secs": k // 50, "nsecs": k % 50 * 20_000_000}
    assert judged({"trajectory": [{"joint_trajectory": good}]}).verdict == wanted.verdict
    for point in good["points"]:
        point |= {"velocities": [], "accelerations": []}
    empty = judged(good)
    for point in good["points"]:
        del point["velocities"], point["accelerations"], point["effort"]
    assert judged(good).verdict == empty.verdict
    # Straight lines between points are off the path by what they miss, and not by more.
    assert not empty.verified
    assert empty.position_error.value == pytest.approx(miss, rel=0.05)


def robot_miss(robot: sm.RobotModel, plan: sm.Plan) -> float:
    """Return how far straight lines between samples at 50 Hz are off a plan's path [m]."""
    t = np.arange(0.0, 2.0 + 1e-9, 0.02)
    q = plan.trajectory(t)
    middles = np.array([robot.pose(each).translation for each in 0.5 * (q[1:] + q[:-1])])
    wanted = plan.path.samples(0.5 * (t[1:] + t[:-1])).translation
    return float(np.linalg.norm(middles - wanted, axis=1).max())
