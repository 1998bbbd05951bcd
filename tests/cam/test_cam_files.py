"""Programs of machine tools in: what they say of a tool is where the path takes it."""

import json
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shop.cam.cldata import read_cldata
from selfmotion.shop.cam.cuts import RAPID
from selfmotion.shop.cam.gcode import read_gcode
from selfmotion.shop.cam.pose_rows import PoseRows

# A plunge, a slot with an arc of 20 mm and a tilted end, a retract; and another cut.
GCODE = """%
O1001 (SLOT)
N10 G21 G90 G94 G17 G54 G43.4 H1
N20 T1 M6
N30 G0 X0 Y0 Z50 S8000 M3
N40 Z5
N50 G1 Z-2 F600 M8
N60 X40 F1200
N70 G3 X60 Y20 I0 J20
N80 G1 Y50 B15
N90 Z5 ; out
M9
N100 G0 Z50 B0
N110 X100 Y0
G91
G1 Z-20 X10
Y30
G90 G0 Z50
M30
anything after the end
"""
CLDATA = """PARTNO/SLOT
UNITS/MM
LOADTL/1 $$ a ball
FROM/0,0,50
SPINDL/8000,RPM,CLW
RAPID
GOTO/0,0,5
FEDRAT/600,MMPM
GOTO/0,0,-2,0,0,1
FEDRAT/1200,MMPM
COOLNT/ON
GOTO/40,0,-2
GOTO/40,50,-2,$
  0.258819045,0,0.965925826
GOTO/40,50,5
RAPID
GOTO/100,0,50,0,0,1
GODLTA/10,0,-20
GODLTA/0,30,0
RAPID
GOTO/110,30,50
FINI
"""
# What rounded corners and chords of arcs may be off [m].
CORNER, CHORD = 1.01e-3, 1.1e-5


def written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_cuts_are_what_is_between_rapids(tmp_path: Path) -> None:
    cuts = read_gcode(written(tmp_path, "slot.nc", GCODE))
    assert list(cuts) == ["cut 1", "cut 2"]
    first, second = cuts.values()
    # The rapid along the tool's axis before, and the one behind.
    np.testing.assert_allclose(
        1e3 * first.positions[:4], [[0, 0, 50], [0, 0, 5], [0, 0, -2], [40, 0, -2]]
    )
    assert first.labels[:4] == ["line 5", "line 6", "line 7", "line 8"]
    assert first.feed is not None
    assert first.rapid is not None
    # From a pose on, 600 and 1200 mm/min.
    np.testing.assert_allclose(first.feed[1:4], [0.01, 0.02, 0.02])
    assert first.rapid[:4].tolist() == [True, False, False, False]
    assert [event for _, event in first.events] == ["M6", "M3", "M8", "M9"]
    np.testing.assert_allclose(
        1e3 * second.positions, [[100, 0, 50], [110, 0, 30], [110, 30, 30], [110, 30, 50]]
    )
    arc = first.positions[4:-2]
    away = np.linalg.norm(arc[:, :2] - [0.04, 0.02], axis=1)
    np.testing.assert_allclose(away, 0.02, atol=1e-12)
    middles = 0.5 * (arc[1:] + arc[:-1])
    assert np.abs(np.linalg.norm(middles[:, :2] - [0.04, 0.02], axis=1) - 0.02).max() < CHORD
    # Into the part: against the axis of the machine.
    np.testing.assert_allclose(first.values[0][:, 2], [0, 0, -1], atol=1e-12)
    tilted = np.array([np.sin(np.radians(15)), 0, np.cos(np.radians(15))])
    np.testing.assert_allclose(first.values[-1][:, 2], -tilted, atol=1e-12)
    for turn in first.values:
        np.testing.assert_allclose(turn.T @ turn, np.eye(3), atol=1e-12)
        assert np.linalg.det(turn) > 0.0


@pytest.mark.parametrize(
    ("by_radius", "by_centre"),
    [
        ("G2 X50 Y-20 R20", "G2 X50 Y-20 I0 J-20"),
        ("G3 X50 Y-20 R20", "G3 X50 Y-20 I20 J0"),
        ("G2 X50 Y-20 R-20", "G2 X50 Y-20 I20 J0"),
        ("G3 X50 Y20 Z3 R20", "G3 X50 Y20 Z3 I0 J20"),
    ],
)
def test_arcs_by_radius_and_by_centre_agree(tmp_path: Path, by_radius: str, by_centre: str) -> None:
    start = "G0 X30 Y0 Z0\nF600\n"
    one = read_gcode(written(tmp_path, "a.nc", start + by_radius))["cut 1"].positions
    other = read_gcode(written(tmp_path, "b.nc", start + by_centre))["cut 1"].positions
    np.testing.assert_allclose(one, other, atol=1e-12)
    # Clockwise bends to the right.
    legs = np.diff(one[:, :2], axis=0)
    bends = legs[:-1, 0] * legs[1:, 1] - legs[:-1, 1] * legs[1:, 0]
    assert (bends < 0.0).all() == by_radius.startswith("G2")


def test_both_languages_say_the_same(tmp_path: Path) -> None:
    lines = GCODE.replace("N70 G3 X60 Y20 I0 J20\nN80 G1 Y50 B15", "N80 G1 X40 Y50 B15")
    one = list(read_gcode(written(tmp_path, "slot.nc", lines)).values())
    other = list(read_cldata(written(tmp_path, "slot.apt", CLDATA)).values())
    assert len(one) == len(other) == 2
    for mine, theirs in zip(one, other, strict=True):
        np.testing.assert_allclose(mine.positions, theirs.positions, atol=1e-12)
        np.testing.assert_allclose(mine.values, theirs.values, atol=1e-9)
    assert one[0].feed is not None
    np.testing.assert_allclose(one[0].feed, other[0].feed)
    inches = CLDATA.replace("UNITS/MM", "UNITS/INCHES").replace(",MMPM", ",IPM")
    large = list(read_cldata(written(tmp_path, "inch.apt", inches)).values())
    np.testing.assert_allclose(large[0].positions, 25.4 * other[0].positions)


@pytest.mark.parametrize("name", ["slot.nc", "slot.apt"])
def test_the_path_goes_along_the_legs_at_the_feeds(tmp_path: Path, name: str) -> None:
    file = written(tmp_path, name, GCODE if name.endswith("nc") else CLDATA)
    rows = (read_gcode if name.endswith("nc") else read_cldata)(file)["cut 1"]
    path = sm.files.read_path(file, seam="cut 1")
    t = np.linspace(0.0, path.duration, 4001)
    samples = path.samples(t)
    legs = list(zip(rows.positions[:-1], rows.positions[1:], strict=True))

    def away(point: np.ndarray) -> float:
        found = []
        for begin, end in legs:
            leg = end - begin
            share = np.clip((point - begin) @ leg / (leg @ leg), 0.0, 1.0)
            found.append(float(np.linalg.norm(begin + share * leg - point)))
        return min(found)

    assert max(away(point) for point in samples.translation[::10]) < CORNER
    np.testing.assert_allclose(samples.translation[[0, -1]], rows.positions[[0, -1]], atol=1e-9)
    speeds = np.linalg.norm(samples.twist[:, :3], axis=1)
    # The rapid down to where the feed begins is as fast as rapids are.
    begun = t > t[(samples.translation[:, 2] < 5e-3 - 1e-6).argmax()]
    assert speeds[begun].max() == pytest.approx(0.02, rel=0.02)
    assert speeds.max() == pytest.approx(RAPID, rel=0.02)
    for end in (0, -1):
        assert np.abs(samples.twist[end]).max() < 1e-9


# Round the centre (20, 0) from (10, 0) up to (20, 10) and on to (30, 0), as four systems write it.
ROUND_BEGIN = "UNITS/MM\nFEDRAT/600,MMPM\nRAPID\nGOTO/10,0,5\nGOTO/10,0,0\n"
ROUND = {
    "ISO": "CIRCLE/20,0,0,0,0,-1,10\nGOTO/20,10,0\nCIRCLE/20,0,0,0,0,-1,10\nGOTO/30,0,0\n",
    "one": "CIRCLE / 20, 0, 0, 0, 0, -1\nGOTO / 30, 0, 0\n",
    "MOVARC": "MOVARC/20,0,0,0,0,-1,10,ANGLE,180\nGOTO/30,0,0\n",
    # NX: left-handed about its axis, with tolerances and its cutter behind the radius.
    "NX": "CIRCLE/20,0,0,0.0,0.0,1.0,10,0.06,0.5,25,0\nPAINT/COLOR,31\nGOTO/30,0,0\n",
    "CATIA": "AUTOPS\nINDIRV/ 0.0, 1.0, 0.0\nTLON,GOFWD/ (CIRCLE/ 20, 0, 0,$\n 10),ON,(LINE/ 20, 0,"
    " 0, 20, 10, 0)\nINDIRV/1,0,0\nTLON,GOFWD/ (CIRCLE/ 20,0,0,10),ON,2,INTOF,$\n"
    "(LINE/20,0,0,30,0,0)\n",
    "CATIA's cylinder": "INDIRV/0,1,0\nTLON,GOFWD/ (CYLNDR/20,0,0,0,0,1,10),ON,$\n(PLANE/PERPTO,$\n"
    "(PLANE/(POINT/20,0,0),PERPTO,(VECTOR/0,0,1)),(POINT/20,0,0),(POINT/30,0,0))\n",
}


@pytest.mark.parametrize("system", ROUND)
def test_arcs_of_all_systems_go_the_same_way(system: str, tmp_path: Path) -> None:
    (cut,) = read_cldata(written(tmp_path, "a.apt", ROUND_BEGIN + ROUND[system])).values()
    points = 1e3 * cut.positions[1:]
    np.testing.assert_allclose(points[[0, -1]], [[10, 0, 0], [30, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(points - [20, 0, 0], axis=1), 10.0, atol=1e-9)
    assert (np.diff(points[:, 0]) > 0.0).all()
    assert points[:, 1].max() == pytest.approx(10.0, abs=1e-2)


def test_helices_go_round_as_often_as_they_say(tmp_path: Path) -> None:
    """NX counts the turn that it ends in, and so does P of G-code."""
    helix = "CIRCLE/20,0,-6,0,0,1,10,0.06,0.5,25,0,TIMES,3\nGOTO/30,0,-6\n"
    (cut,) = read_cldata(written(tmp_path, "a.cls", ROUND_BEGIN + helix)).values()
    text = "G0 X10 Y0 Z5\nG1 Z0 F600\nG2 X30 Y0 Z-6 I10 J0 P3\n"
    (other,) = read_gcode(written(tmp_path, "a.nc", text)).values()
    np.testing.assert_allclose(cut.positions, other.positions, atol=1e-12)
    points = cut.positions[1:] - [0.02, 0, 0]
    turned = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(-5.0 * np.pi)
    np.testing.assert_allclose(points[:, 2], -6e-3 * np.linspace(0, 1, len(points)), atol=1e-12)
    absolute = text.replace("I10 J0 P3", "I20 J0 P3").replace("G0 X10", "G90.1 G0 X10")
    (again,) = read_gcode(written(tmp_path, "b.nc", absolute)).values()
    np.testing.assert_allclose(again.positions, other.positions, atol=1e-12)


HOLES = {
    "G-code": "G0 X0 Y0 Z20\nG99 G83 X10 Y0 Z-5 R2 Q3 F120\nG98 X20\nG80\nG1 X30 F60\n",
    "by differences": "G0 X0 Y0 Z20\nG91\nG99 G83 X10 Z-7 R-18 Q3 F120\nG98 X10\nG80\nG1 X10 F60\n",
    "NX": "RAPID\nGOTO/0,0,20\nCYCLE/DRILL,DEEP,STEP,3,RAPTO,2,FEDTO,-5,RTRCTO,20,MMPM,120\n"
    "GOTO/10,0,0\nGOTO/20,0,0\nCYCLE/OFF\nRAPID\nGOTO/20,0,20\nFEDRAT/60\nGOTO/30,0,20\n",
    "CAMWorks": "RAPID/\nGOTO/0,0,20\nCYCLE/INIT\nCYCLE/DEEP2,FEDTO,5,1STPECK,3,SUBPECK,3,MMPM,120,"
    "RAPTO,2,RTRCTO,20\nGOTO/10,0,0\nGOTO/20,0,0\nCYCLE/OFF\nRAPID/\nGOTO/20,0,20\nFEDRAT/60\n"
    "GOTO/30,0,20\n",
    "ISO": "RAPID\nGOTO/0,0,20\nCYCLE/DEEP, 5.0, INCR, 3.0, MMPM, 120, 2.0\nGOTO/10,0,0\n"
    "GOTO/20,0,0\nCYCLE/OFF\nRAPID\nGOTO/20,0,20\nFEDRAT/60\nGOTO/30,0,20\n",
}


# Where the tool stands above the first hole, and leaves each, in each language [mm].
LEVELS = {
    "G-code": ([20], [], [], [20]),
    "by differences": ([20], [], [], [20]),
    "NX": ([20], [20], [20], [20]),
    "CAMWorks": ([20], [20], [20], [20]),
    "ISO": ([], [], [], [20]),
}


@pytest.mark.parametrize("language", HOLES)
def test_holes_are_cuts_that_come_straight_out(language: str, tmp_path: Path) -> None:
    is_gcode = language in ("G-code", "by differences")
    file = written(tmp_path, "a.nc" if is_gcode else "a.apt", HOLES[language])
    first, second, line = (read_gcode if is_gcode else read_cldata)(file).values()
    heights = [2, -1, 2, -0.5, -4, 2, -3.5, -5, 2]
    before, after, again, last = LEVELS[language]
    for hole, x, come, go in ((first, 10, before, after), (second, 20, again, last)):
        own = [*come, *heights, *go]
        wanted = np.column_stack([np.full(len(own), x), np.zeros(len(own)), own])
        np.testing.assert_allclose(1e3 * hole.positions, wanted, atol=1e-9)
        assert hole.feed is not None
        assert hole.rapid is not None
        # At the feed where it cuts, in rapids where the hole is there already.
        rapid = [True] * len(come) + [False, *[True, True, False] * 2, True] + [True] * len(go)
        assert hole.rapid[:-1].tolist() == rapid[: len(own) - 1]
        np.testing.assert_allclose(hole.feed[~hole.rapid], 0.002)
    np.testing.assert_allclose(1e3 * line.positions, [[20, 0, 20], [30, 0, 20]], atol=1e-9)


def test_other_cycles_wait_break_chips_and_come_out_at_the_feed(tmp_path: Path) -> None:
    start = "G0 X0 Y0 Z20\nG99 "

    def hole(cycle: str) -> PoseRows:
        (found,) = read_gcode(written(tmp_path, "a.nc", start + cycle)).values()
        return found

    waits, reams = hole("G82 X0 Z-5 R2 P500 F120"), hole("G85 X0 Z-5 R2 F120")
    assert waits.events == ((2, "G4 P500"),)
    assert reams.rapid is not None
    assert reams.rapid[:-1].tolist() == [True, False, False]
    chips = hole("G73 X0 Z-5 R2 Q4 F120")
    np.testing.assert_allclose(1e3 * chips.positions[:, 2], [20, 2, -2, -1.5, -5, 2], atol=1e-9)


def test_statements_of_systems_are_passed_over_or_told(tmp_path: Path) -> None:
    head = (
        "$$ CATIA APT VERSION 1.0\nPARTNO PART = 1\nUNIT / MM\nINSERT/STOP = 3\n"
        "SELECT/TOOL,2\nCSI_SET_FLUTE_LENGTH/16.\nTRNTYP/WORLD,0,0,0\n"
        "CSYS/-1,0,0,0,0,1,0,0,0,0,-1,0\nSETUP/START,1\nTLAXIS/ 0.0, 0.0, 1.0\n"
        "CUTCOM/LEFT,XYPLAN\nOPSTOP\n"
    )
    text = head + ROUND_BEGIN + "GOTO/20,0,0\nGOHOME\nGOTO/30,0,0\nGOTO/40,0,0\nREWIND/0\nEND\n"
    content = text.replace("PART = 1", "STÜCK = 1").replace("\n", "\r\n").encode("latin-1")
    (tmp_path / "a.aptsource").write_bytes(content)
    first, second = read_cldata(tmp_path / "a.aptsource").values()
    # Where home is, is not known, but it is above: up as high as the tool has been.
    np.testing.assert_allclose(
        1e3 * first.positions, [[10, 0, 5], [10, 0, 0], [20, 0, 0], [20, 0, 5]]
    )
    assert first.events == ((0, "OPSTOP"),)
    np.testing.assert_allclose(1e3 * second.positions, [[30, 0, 0], [40, 0, 0]])
    inserted, offset, home, unjudged = first.notes
    assert unjudged == "stock and engagement are not judged"
    assert "line 4: INSERT STOP = 3: lines for a control are passed over" in inserted
    assert "line 11: CUTCOM/LEFT,XYPLAN: places are taken as they are written" in offset
    assert "GOHOME goes to a place of the machine's own" in home
    for words, noted in (("CUTCOM/ON", True), ("CUTCOM/ON,LENGTH,4", True), ("CUTCOM/OFF", False)):
        file = written(tmp_path, "c.apt", f"{words}\n{ROUND_BEGIN}GOTO/20,0,0\n")
        (cut,) = read_cldata(file).values()
        assert any(f"line 1: {words}: places are taken" in note for note in cut.notes) == noted
    file = written(tmp_path, "b.ncl", ROUND_BEGIN + "GOHOME/0,0,90\nGOTO/0,0,80\n")
    _, last = read_cldata(file).values()
    np.testing.assert_allclose(1e3 * last.positions, [[0, 0, 90], [0, 0, 80]])


@pytest.mark.parametrize(
    "text",
    [
        "g21 g90\n(a (b) c)\ng0 x0 y0 z5 (open\ng1 z0 f600\nx10\n",
        "N1 G21*5\nN2 G0 X0 Y0 Z5*21\nN3 G1 Z0 F600*9\nN4 X10\n",
        "G92 X0 Y0 Z5\nG91 G1 Z-5 F600\nX10\n",
        "G15 G50.1 G67 X=0 Y=0 Z=5\nG0 X0\nG9 G1 Z0 F600\nX10 ; (Fr\xe4sen)\n\x1a",
    ],
    ids=["comments", "checksums", "zero first", "Latin-1"],
)
def test_programs_of_all_forms_give_one_cut(text: str, tmp_path: Path) -> None:
    file = tmp_path / "a.gc"
    file.write_bytes(text.encode("latin-1"))
    (cut,) = read_gcode(file).values()
    np.testing.assert_allclose(1e3 * cut.positions, [[0, 0, 5], [0, 0, 0], [10, 0, 0]], atol=1e-9)


def test_a_program_without_z_is_in_its_plane(tmp_path: Path) -> None:
    laser = "G21 G90 (Z is not said)\nM4 S0\nG0 X5 Y5\nG1 X10 F600 S255\nY10\nM5\n"
    (cut,) = read_gcode(written(tmp_path, "a.nc", laser)).values()
    np.testing.assert_allclose(1e3 * cut.positions, [[5, 5, 0], [10, 5, 0], [10, 10, 0]])
    assert cut.notes[0] == "no line says Z: it is taken for 0"


def test_a_cut_that_goes_back_rests_there(tmp_path: Path) -> None:
    text = "G0 X0 Y0 Z5\nG1 Z-5 F600\nZ5\nX10\n"
    path = sm.files.read_path(written(tmp_path, "peck.nc", text))
    times = np.linspace(0.0, path.duration, 5001)
    samples = path.samples(times)
    lowest = int(samples.translation[:, 2].argmin())
    assert samples.translation[lowest, 2] == pytest.approx(-5e-3, abs=1e-6)
    assert np.linalg.norm(samples.twist[lowest, :3]) < 1e-3


def test_tables_name_seams_and_events(tmp_path: Path) -> None:
    rows = ["seam,x,y,z,feed,event"]
    rows += [f"left,{0.02 * k},0,0,0.05,{'arc on' if k == 1 else ''}" for k in range(5)]
    rows += [f"right,{0.02 * k},0.1,0,0.05,{'arc off' if k == 4 else ''}" for k in range(5)]
    file = written(tmp_path, "seams.csv", "\n".join(rows) + "\n")
    path = sm.files.read_path(file, seam="right")
    np.testing.assert_allclose(path.pose(0.0).translation, [0, 0.1, 0], atol=1e-12)
    with pytest.raises(
        sm.errors.FileFormatError, match="has 2 seams or cuts, left to right: choose one"
    ):
        sm.files.read_path(file)
    with pytest.raises(
        sm.errors.FileFormatError, match="has no seam 'middle'; it has 'left', 'right'"
    ):
        sm.files.read_path(file, seam="middle")
    job = tmp_path / "job.toml"
    job.write_text('task = "position"\n[robot]\nname = "panda"\n[seams]\nfile = "seams.csv"\n')
    left, right = sm.files.read_seam_job(job).seams
    ((name, at),) = left.events
    assert name == "arc on"
    np.testing.assert_allclose(left.path.pose(at).translation, [0.02, 0, 0], atol=1e-4)
    assert not left.either_way
    assert right.events == (("arc off", right.path.duration),)


def test_a_seam_of_a_table_does_not_go_on_after_another_one(tmp_path: Path) -> None:
    """Two tables put together may use a name twice: the tool would weld from one to the other."""
    rows = ["seam,x,y,z"]
    rows += [f"{name},{x},{y},0" for y, name in enumerate("aba") for x in (0, 1)]
    file = written(tmp_path, "seams.csv", "\n".join(rows) + "\n")
    said = "line 6: seam 'a' goes on after rows of seam 'b'"
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file, seam="b", feed=0.1)


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("ramp", ["", "ramp = 0.3\n"])
@pytest.mark.parametrize("leads", ["", "leads = { length_mm = 30, duration = 0.7 }\n"])
def test_events_come_at_their_poses_after_ramps_and_leads(
    leads: str, ramp: str, listed: bool, tmp_path: Path
) -> None:
    rows = ["seam,x,y,z,feed,event"]
    said = {1: "arc on; gas on", 4: "arc off;"}
    rows += [f"left,{0.02 * k},0,0,0.05,{said.get(k, '')}" for k in range(6)]
    written(tmp_path, "seams.csv", "\n".join(rows) + "\n")
    text = 'task = "position"\nrobot.name = "panda"\nworkpiece.frame.position = [0, 1, 0]\n'
    options = f'file = "seams.csv"\n{ramp}{leads}'
    one = '[[seams]]\nname = "left"\n[seams.path]\nkind = "file"\nseam = "left"\n'
    (seam,) = sm.files.read_seam_job(
        written(tmp_path, "job.toml", text + (one if listed else "[seams]\n") + options)
    ).seams
    assert [name for name, _ in seam.events] == ["arc on", "gas on", "arc off"]
    for k, (_, at) in zip((1, 1, 4), seam.events, strict=True):
        place = seam.path.pose(at).translation
        np.testing.assert_allclose(place, [0.02 * k, 1, 0], atol=1e-4 if ramp else 1e-6)
    lead = seam.path.pose(0.0).translation[2]
    assert lead == pytest.approx(-0.03 if leads else 0.0, abs=1e-9)


def test_events_of_dense_poses_after_corners_come_at_their_poses(tmp_path: Path) -> None:
    """Rounded corners are shorter than the legs: places along the way are not shares of legs."""
    points = [(5e-4 * k, 0.0) for k in range(120)]
    points += [(points[-1][0], 5e-4 * k) for k in range(1, 120)]
    points += [(points[-1][0] + 5e-4 * k, points[-1][1]) for k in range(1, 120)]
    rows = ["seam,x,y,z,event"] + [
        f"one,{x:.4f},{y:.4f},0,{'arc on' if k == 300 else ''}" for k, (x, y) in enumerate(points)
    ]
    written(tmp_path, "seams.csv", "\n".join(rows) + "\n")
    job = tmp_path / "job.toml"
    job.write_text(
        'task = "position"\n[robot]\nname = "panda"\n[seams]\nfile = "seams.csv"\n'
        'feed = 0.05\ncorners = "round"\ntolerance = 0.01\n'
    )
    (seam,) = sm.files.read_seam_job(job).seams
    ((_, at),) = seam.events
    place = seam.path.pose(at).translation[:2]
    np.testing.assert_allclose(place, points[300], atol=1e-6)


def test_a_job_is_read_from_a_machine_program(tmp_path: Path) -> None:
    written(tmp_path, "slot.nc", GCODE)
    job = tmp_path / "job.toml"
    job.write_text(
        'task = "pointing"\n[robot]\nname = "panda"\n[seams]\nfile = "slot.nc"\n'
        "frame = { position = [0.4, 0, 0.3] }\ntolerance = 0.0005\n"
    )
    first, second = sm.files.read_seam_job(job).seams
    assert (first.name, second.name) == ("cut 1", "cut 2")
    assert [name for name, _ in first.events] == ["M6", "M3", "M8", "M9"]
    assert [at for name, at in first.events if name in ("M6", "M9")] == [0.0, first.path.duration]
    np.testing.assert_allclose(first.path.pose(0.0).translation, [0.4, 0.0, 0.35], atol=1e-9)
    np.testing.assert_allclose(first.path.pose(0.0).rotation[:, 2], [0, 0, -1], atol=1e-9)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("G41 D1", "G41: the cutter's radius is not added: let CAM do so"),
        ("G12", "G12 is not read: page 'Words of CAM files' of the docs"),
        ("G95", "G95: feeds by turns of a spindle are not read: let CAM write them by the minute"),
        ("G52 X3", "G52 is not read"),
        ("G55", "G55 after G54: where their zeros are"),
        ("G92 X0", "G92 X: zeros that move are not read"),
        ("G18 G2 X1 Y1 J1", "in the plane of Z and X: J is not read"),
        ("G1 U4", "word 'U4' is not read"),
        ("G1 X#101", "'G1 X#101': variables, expressions and subroutines are not read"),
        ("G84 Z-5 R1", "G84: cycles that tap or bore are not read, those that drill are"),
        ("G81 X3 R1", "G81 says no Z, expected Z and R of the hole"),
        ("G0 B0\nG81 X3 Z3 R1", "the hole ends 2 mm above where it begins"),
        ("G0 B0\nG83 X3 Z-3 R1", "drills by 0 mm at once, expected a step above 0"),
        ("G81 X3 Z-3 R1", "G81 drills along Z, and the tool is tilted"),
        ("G3 X60 Y20 I-20 J0 P1.5", "P of an arc is 1.5, expected a number of turns"),
        ("BEGIN PGM A MM", "is in Heidenhain's own language"),
        ("G1 X1 X2", "word X is there twice"),
        ("G1 X1 F0", "expected a feed above 0"),
        ("G2 X1 Y1 R0.1", "no arc of radius"),
        ("G2 X1 Y1 I7 J0", "from its centre"),
        ("G1 X1 I1 J0", "a tool axis is I, J and K, all three"),
        ("G1 X9999999", "farther than anything is"),
        ("G1 X10 R3", "R is read of arcs only"),
        ("M98", "subprograms are not read"),
        ("G0 G1 X4", "G0 and G1 are in one line"),
        ("G20 G21 X4", "G20 and G21 are in one line"),
        ("G91 X4 G90", "G91 and G90 are in one line"),
        ("G17 G18 X4", "G17 and G18 are in one line"),
        ("G54 G55 X4", "G54 and G55 are in one line"),
        ("G81 G83 X3 Z-3 R1 Q1", "G81 and G83 are in one line"),
        ("G98 G99 G81 X3 Z-3 R1", "G98 and G99 are in one line"),
        ("G93 G94 X4 F9", "G93 and G94 are in one line"),
        ("G90.1 G91.1 G2 X1 Y1 I1", "G90.1 and G91.1 are in one line"),
        ("G10 L2 P1 X100 Y0 Z0", "G10: zeros and offsets that a program sets"),
        ("G29 X50", "and ways home, are not read"),
        ("G1 X10 G4 P100", "G4 waits, and its line says a motion"),
        ("G4 X1 P100", "or two times"),
        ("G4 P1 G10", "G4 and G10 are in one line"),
        ("G4 P1 G28", "G4 waits, and its line says a motion"),
        ("G4 X1 G92", "G4 waits, and its line says a motion"),
        ("G29 G53", "and ways home, are not read"),
        ("G28 B0", "G28 B: an axis of rotation at a place of the machine's own"),
        ("G53 A0", "G53 A: an axis of rotation at a place of the machine's own"),
        ("G1 X10 L3", "L repeats the line, which is not read"),
        ("G93 G1 X10 F60\nX20", "says no F, which after G93 each line has"),
        ("G54 P2 X4", "word 'P2' of this line is not read"),
        ("G1 X40 Q2", "word 'Q2' of this line is not read"),
        ("M97 P100", "M97: subprograms are not read"),
    ],
)
def test_other_words_are_refused_by_line(tmp_path: Path, line: str, said: str) -> None:
    text = GCODE.replace("N90 Z5 ; out", line)
    with pytest.raises(sm.errors.FileFormatError, match=rf"slot\.nc: line 1[12]: .*{said}"):
        sm.files.read_path(written(tmp_path, "slot.nc", text), seam="cut 1")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("CIRCLE/1,2,3", "CIRCLE has 3 numbers, expected x,y,z of its centre"),
        ("CIRCLE/1,2,3,0,0,1,5\nGOTO/50,50,5", "the arc begins .* mm from its centre and ends"),
        ("CYCLE/TAP,FEDTO,5,RAPTO,2", "'TAP' of a cycle is not read, but DRILL, DEEP and BRKCHP"),
        ("CYCLE/DRILL,5", "expected a depth .FEDTO. and a height .RAPTO or CLEAR"),
        ("CYCLE/DEEP,FEDTO,5,RAPTO,2\nGOTO/9,9,0", "drills by 0 mm at once, expected a step"),
        ("NURBS/", "NURBS: splines are not read; let CAM write lines or arcs"),
        ("CSYS/1,0,0,5,0,1,0,0,0,0,1,0", "frames that are turned or moved are not read"),
        ("P1=POINT/1,2,3", "names and geometry of part programs are not read"),
        ("TLON,GOFWD/ (CIRCLE/1,2,3,4),ON,(LINE/1,2,3,4,5,6)", "is not read"),
        ("GOTO/1,2", "GOTO has 2 numbers"),
        ("GOTO/1,2,x", "'X' is no number"),
        ("MODE/INCR", "MODE/INCR: places by differences are not read"),
        ("GOTO/1,2,3,0,0,0", "has no direction"),
        ("FEDRAT/100,MMPR", "expected a feed, and MMPM or IPM"),
        ("UNITS/FEET", "expected MM or INCHES"),
        ("PREFUN/55", "a G word of one control, which may move anything"),
        ("INSERT G55", "words of a control that may move something"),
        ("INSERT/M8 X40", "words of a control that may move something"),
        ("INSERT X=R1", "words of a control that may move something"),
        ("INSERT TRANS X=40", "words of a control that may move something"),
        ("INSERT AROT", "words of a control that may move something"),
        ("INSERT CYCLE800(1)", "words of a control that may move something"),
        ("INSERT M8 $$ X40", "words of a control that may move something"),
        ("GOHOME/1,2,3,4", "GOHOME has 4 numbers"),
        ("SWITCH/2", "the frame of another turret"),
        ("SET/HEAD,2", "a way to read what follows"),
        ("SET/MODE,INCR", "places by differences are not read"),
        ("MODE/TURN", "a way to read what follows"),
        ("ORIGIN/0,0,5", "a zero that moves"),
        ("ROTATE/TABLE,90", "a table that turns"),
        ("OFSTNO/1\nOFSTNO/2", "OFSTNO/2 after OFSTNO/1: another zero of the control"),
        ("SETUP/START,1\nSETUP/START,2", "SETUP/2 after SETUP/1: another way to hold the part"),
        ("SETUP/FIXTURE", "statement 'SETUP/FIXTURE' is not read"),
        ("RAPID/XYZ", "statement 'RAPID/XYZ' is not read"),
        ("MSYS/0,0,0,1,0,0,0,1,0", "MSYS after places that are in none"),
        ("FEDRAT/10,IPM", "feeds are in IPM, and the file has UNITS/MM: say in which unit"),
        ("UNITS/INCH", "feeds are in MMPM, and the file has UNITS/INCHES: say in which unit"),
        ("?", "is not read"),
    ],
)
def test_other_statements_are_refused_by_line(tmp_path: Path, line: str, said: str) -> None:
    text = CLDATA.replace("GOTO/40,50,5", line)
    with pytest.raises(sm.errors.FileFormatError, match=rf"slot\.apt: line 1[56]: .*{said}"):
        sm.files.read_path(written(tmp_path, "slot.apt", text), seam="cut 1")


def test_a_program_without_feeds_or_cuts_says_so(tmp_path: Path) -> None:
    file = written(tmp_path, "a.nc", "G0 X0 Y0 Z0\nG1 X10\n")
    with pytest.raises(sm.errors.FileFormatError, match="says no feed"):
        sm.files.read_path(file)
    assert sm.files.read_path(file, feed=0.02).duration > 0.5
    with pytest.raises(sm.errors.FileFormatError, match="duration has no effect"):
        sm.files.read_path(file, duration=2.0)
    with pytest.raises(sm.errors.FileFormatError, match="has no cut"):
        sm.files.read_path(written(tmp_path, "b.nc", "G0 X0 Y0 Z0\nX3\n"))
    with pytest.raises(sm.errors.FileFormatError, match="cuts, and X is not known yet"):
        sm.files.read_path(written(tmp_path, "c.nc", "G1 Y3 F100\n"))


SWITCHED = """%
G21 G90 G0 X0 Y0 Z20
M3
G1 Z20 F900
G0 Z5
G1 Z0 F900
X30
G0 Z20
M9
G0 X0 Y-60
M8
G1 Z0
X30
G0 Z20
M5
M30
%
G1 X400
"""


def test_nothing_that_is_switched_is_lost_or_late(tmp_path: Path) -> None:
    """What stops is at the end of the cut before, also after the last; what starts at the next."""
    table = 'file = "slot.nc"\nframe = {position = [0.45, 0, 0.3]}\n'
    written(tmp_path, "slot.nc", SWITCHED)
    job = written(
        tmp_path, "slot.toml", f'task = "pointing"\nrobot.name = "panda"\n[seams]\n{table}'
    )
    first, second = sm.files.read_seam_job(job).seams
    assert first.events[0] == ("M3", 0.0)
    assert [name for name, _ in first.events] == ["M3", "M9"]
    assert first.events[1][1] == pytest.approx(first.path.duration)
    assert second.events[0] == ("M8", 0.0)
    assert second.events[1] == ("M5", pytest.approx(second.path.duration))
    # What is switched on by one cut is on in the next: they keep their order.
    assert list(second.after) == [first.name]
    assert not first.either_way


def test_a_list_of_seams_loses_no_events(tmp_path: Path) -> None:
    written(tmp_path, "slot.nc", SWITCHED)
    path = '[seams.path]\nkind = "file"\nfile = "slot.nc"\n'
    text = f'task = "pointing"\nrobot.name = "panda"\n[[seams]]\nname = "a"\nEVENTS{path}'
    one = SWITCHED.replace("G0 X0 Y-60", "M30")
    written(tmp_path, "slot.nc", one)
    file = written(tmp_path, "job.toml", text.replace("EVENTS", ""))
    (seam,) = sm.files.read_seam_job(file).seams
    whole = written(
        tmp_path, "whole.toml", 'task="pointing"\nrobot.name="panda"\nseams.file="slot.nc"\n'
    )
    assert seam.events == sm.files.read_seam_job(whole).seams[0].events
    assert seam.events
    assert not seam.either_way
    told = written(tmp_path, "job.toml", text.replace("EVENTS", "events = []\n"))
    assert not sm.files.read_seam_job(told).seams[0].events
    # Nor where the file is a part of the path; with other times it is refused.
    inner = '{ kind = "file", file = "slot.nc" }'
    for outer in (
        f'kind = "placed"\npath = {inner}\nframe = {{ position = [0.4, 0, 0] }}\n',
        f'kind = "weave"\npath = {inner}\namplitude = 0.001\npitch = 0.01\n',
    ):
        within = text.replace("EVENTS", "").replace(path, f"[seams.path]\n{outer}")
        (again,) = sm.files.read_seam_job(written(tmp_path, "job.toml", within)).seams
        assert again.events == seam.events
        assert not again.either_way
    for outer in (
        f'kind = "joined"\npieces = [{inner}]\n',
        f'kind = "feed"\nfeed = 0.01\npath = {inner}\n',
    ):
        within = text.replace("EVENTS", "").replace(path, f"[seams.path]\n{outer}")
        with pytest.raises(sm.errors.FileFormatError, match="event 'M3' would be lost"):
            sm.files.read_seam_job(written(tmp_path, "job.toml", within))


@pytest.mark.parametrize(
    ("text", "events"),
    [
        # On the line of a rapid: of the cut that follows, but what stops ends the one before.
        ("G0 X0 Y0 Z0\nM3\nG1 X50 F900\nM5\nG0 X50 Y30 M3\nG1 X0\nM5", [(0, 1), (0, 1)]),
        ("G0 X0 Y0 Z0\nM3\nG1 X50 F900\nG0 X50 Y30 M5\nM3\nG1 X0\nM5", [(0, 1), (0, 1)]),
        # On the line of a cut: what starts does so before it, what stops after it.
        ("G0 X0 Y0 Z0\nG1 X50 F900 M3\nX60 M5\nG0 X50 Y30\nG1 X0 M3\nX-9 M5", [(0, 1), (0, 1)]),
    ],
    ids=["start-on-rapid", "stop-on-rapid", "on-cuts"],
)
def test_effects_of_a_block_have_their_order(
    tmp_path: Path, text: str, events: list[tuple[int, int]]
) -> None:
    file = written(tmp_path, "order.nc", f"G21 G90\n{text}\nM30\n")
    cuts = list(read_gcode(file).values())
    assert len(cuts) == len(events)
    for cut, (on, off) in zip(cuts, events, strict=True):
        last = len(cut.positions) - 1
        assert cut.events == ((on * last, "M3"), (off * last, "M5"))


@pytest.mark.parametrize("mark", ["\x85", "\u2028", "\u2029", "\v", "\f", "\x1e"])
def test_what_no_machine_ends_a_line_at_ends_none(mark: str, tmp_path: Path) -> None:
    """What follows it in a comment is part of that, in programs, cutter locations and tables."""
    gcode = f"G21 G90 G0 X0 Y0 Z0\nG1 X10 F600 ; to here{mark}G1 X90\n"
    apt = f"UNITS/MM\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\nGOTO/10,0,0\nPPRINT A{mark}GOTO/90,0,0\n"
    table = f"x_mm,y_mm,z_mm\n0,0,0\n10,0,0\n# to here{mark}90,0,0\n"
    for name, text in (("a.nc", gcode), ("a.apt", apt), ("a.csv", table)):
        file = tmp_path / name
        file.write_text(text, "utf-8")
        path = sm.files.read_path(file, feed=0.1)
        assert path.samples(np.array([path.duration])).translation[0, 0] == pytest.approx(0.01)


@pytest.mark.parametrize("text", ["PPRINT 5 $", "PARTNO A$", "INSERT M8 $"])
def test_texts_of_apt_do_not_go_on_in_the_next_line(text: str, tmp_path: Path) -> None:
    head = "UNITS/MM\nRAPID\nGOTO/0,0,0\nFEDRAT/600,MMPM\n"
    file = written(tmp_path, "a.apt", f"{head}{text}\nGOTO/10,0,0\nGOTO/10,$\n20,0\n")
    (rows,) = read_cldata(file).values()
    np.testing.assert_allclose(rows.positions[:, :2], [[0.0, 0.0], [0.01, 0.0], [0.01, 0.02]])


def test_a_way_home_has_the_axis_that_it_says(tmp_path: Path) -> None:
    head = "UNITS/MM\nMULTAX/ON\nRAPID\nGOTO/0,0,0,0,0,1\nFEDRAT/600,MMPM\nGOTO/10,0,0\n"
    text = "GOHOME/50,0,20,1,0,0\nGOTO/30,0,20\nGOTO/20,0,20\n"
    cuts = list(read_cldata(written(tmp_path, "a.apt", head + text)).values())
    np.testing.assert_allclose(cuts[-1].values[:, :, 2], [[-1.0, 0.0, 0.0]] * 3, atol=1e-12)


PRINT = "G21\nG90\nM82\nG92 E0\nG0 X0 Y0 Z0.3\nG1 X10 E1 F600\n"


@pytest.mark.parametrize("line", ["G 1 X10 Y20 E2", "N9 G1 X10 Y20 E2", "N 9 G1 X10 Y20 E2 *71"])
def test_moves_of_printers_are_read_with_spaces_and_numbers(line: str, tmp_path: Path) -> None:
    (rows,) = read_gcode(written(tmp_path, "a.gcode", f"{PRINT}{line}\n")).values()
    np.testing.assert_allclose(rows.positions[:, :2], [[0.0, 0.0], [0.01, 0.0], [0.01, 0.02]])


@pytest.mark.parametrize("line", ["M201 X500 Y500", "N9 M201 X500 Y500", "N9 M92 X80 E97", "N9"])
def test_commands_of_printers_move_nothing_whatever_letters_they_have(
    line: str, tmp_path: Path
) -> None:
    text = f"{PRINT}{line}\nG1 X10 Y20 E2\n"
    (rows,) = read_gcode(written(tmp_path, "a.gcode", text)).values()
    np.testing.assert_allclose(rows.positions[:, :2], [[0.0, 0.0], [0.01, 0.0], [0.01, 0.02]])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("M206 X5", "M206: zeros that a printer moves"),
        ("N9 M206 X5", "M206: zeros that a printer moves"),
        ("SET_GCODE_OFFSET Z=0.2", "SET_GCODE_OFFSET: zeros that a printer moves"),
        ("RESTORE_GCODE_STATE NAME=a", "RESTORE_GCODE_STATE: .* modes that it goes back to"),
        ("G10 P1 X5", "G10: zeros and offsets that a program sets"),
    ],
)
def test_zeros_that_a_printer_moves_are_refused(line: str, said: str, tmp_path: Path) -> None:
    file = written(tmp_path, "a.gcode", f"{PRINT}{line}\nG1 X20 E2\n")
    with pytest.raises(sm.errors.FileFormatError, match=f"line 7: {said}"):
        read_gcode(file)


@pytest.mark.parametrize("word", ["K0", "L0"])
def test_a_cycle_of_no_holes_drills_none(word: str, tmp_path: Path) -> None:
    text = f"G21 G90 G0 X0 Y0 Z5\nG81 X9 Z-3 R1 F60 {word}\nX20\nG80\n"
    (rows,) = read_gcode(written(tmp_path, "a.nc", text)).values()
    np.testing.assert_allclose(rows.positions[:, 0], 0.02)


def test_a_line_that_waits_changes_modes_and_switches_all_the_same(tmp_path: Path) -> None:
    text = "G21 G90 G0 X0 Y0 Z0\nG1 X10 F600\nN7 M8 G4 P1 G91 M9\nX10\nG4 P1 M30\nX90\n"
    (cut,) = read_gcode(written(tmp_path, "waits.nc", text)).values()
    np.testing.assert_allclose(cut.positions[:, 0], [0.0, 0.01, 0.02])
    assert cut.events == ((1, "M8"), (1, "G4 P1"), (1, "M9"), (2, "G4 P1"))


def test_a_feed_is_none_of_another_kind_and_changing_powers_are_told(tmp_path: Path) -> None:
    timed = "G21 G90 G0 X0 Y0 Z0\nG93 G1 X10 F60\nG94 X30\n"
    (cut,) = read_gcode(written(tmp_path, "timed.nc", timed)).values()
    assert cut.feed is None
    laser = "G21 G90 G0 X0 Y0 Z0\nM3 S900\nG1 X10 F600 S900\nX20 S0\nX30 S900\n"
    (cut,) = read_gcode(written(tmp_path, "laser.nc", laser)).values()
    assert [note for note in cut.notes if "S changes" in note] == [
        "line 4: S changes from cut to cut, and is passed over: where a laser or a spindle "
        "switches, write M codes"
    ]


def test_events_of_rows_with_times_are_at_these_times_after_a_ramp(tmp_path: Path) -> None:
    rows = [(0, 0), (60, 0), (0, 8), (60, 16), (0, 24), (60, 32)]
    table = [(float(k), *xy) for k, xy in enumerate(rows)]
    table += [(6.0 + 0.15 * k, 60, 35 + 3 * k) for k in range(24)]
    for number in range(1, len(table) - 1, 4):
        lines = [
            f"s,{t},{x},{y},300,{'arc on' if k == number else ''}"
            for k, (t, x, y) in enumerate(table)
        ]
        written(tmp_path, "rows.csv", "\n".join(["seam,t,x_mm,y_mm,z_mm,event", *lines]) + "\n")
        job = written(
            tmp_path,
            "rows.toml",
            'task="position"\ncollision=false\n[robot]\nname="panda"\n[seams]\n'
            'file="rows.csv"\nramp=0.3\n',
        )
        (seam,) = sm.files.read_seam_job(job).seams
        ((_, at),) = seam.events
        row = np.array([table[number][1], table[number][2], 300.0])
        assert np.linalg.norm(1e3 * seam.path.pose(at).translation - row) < 1e-3
        # Half a ramp is lost at the start.
        assert at == pytest.approx(table[number][0] + 0.15, abs=1e-6)


# Operations as NX writes them, each in its machine coordinate system.
OPERATION = """TOOL PATH/{name},TOOL,MILL
TLDATA/MILL,10.0,0.0,75.0,0.0,0.0
MSYS/{frame}
PAINT/PATH
RAPID
GOTO/0.0,0.0,20.0,0.0,0.0,1.0
FEDRAT/MMPM,600.0
GOTO/0.0,0.0,0.0
CIRCLE/20.0,0.0,0.0,0.0,0.0,1.0,20.0,0.06,0.5,10.0,0.0
GOTO/40.0,0.0,0.0
END-OF-PATH
"""


def test_operations_in_other_frames_are_where_these_are(tmp_path: Path) -> None:
    """Against the frames' matrices: places of the second, seen from the first."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(0)
    for frames in (Rotation.random(2, rng=rng), Rotation.from_euler("z", [[0.0], [np.pi / 2]])):
        origins = 200.0 * rng.normal(size=(2, 3))
        text = "UNITS/MM\n"
        for name, turn, origin in zip("AB", frames.as_matrix(), origins, strict=True):
            values = [*origin, *turn[:, 0], *turn[:, 1]]
            text += OPERATION.format(name=name, frame=",".join(f"{x:.10f}" for x in values))
        first, second = read_cldata(written(tmp_path, "part.cls", text)).values()
        one, other = (
            np.vstack([np.column_stack([turn, origin]), [0, 0, 0, 1]])
            for turn, origin in zip(frames.as_matrix(), origins, strict=True)
        )
        between = np.linalg.inv(one) @ other
        own = np.column_stack([1e3 * first.positions, np.ones(len(first.positions))])
        wanted = (own @ between.T)[:, :3]
        np.testing.assert_allclose(1e3 * second.positions[-len(wanted) :], wanted, atol=1e-6)
        np.testing.assert_allclose(second.values[-1][:, 2], -between[:3, 2], atol=1e-8)
        assert any("MSYS: another machine coordinate system" in note for note in first.notes)


def test_files_that_contradict_themselves_are_asked_for_their_unit(tmp_path: Path) -> None:
    text = "FEDRAT/IPM,10\nRAPID\nGOTO/0,0,1,0,0,1\nGOTO/0,0,0\nGOTO/4,0,0\n"
    file = written(tmp_path, "part.cls", text)
    with pytest.raises(
        sm.errors.FileFormatError,
        match=r"line 1: feeds are in IPM, and the file has no UNITS: .*unit = 'in'",
    ):
        sm.files.read_path(file)
    for unit, metre in (("in", 25.4e-3), ("mm", 1e-3)):
        path = sm.files.read_path(file, unit=unit)
        end = path.pose(path.duration).translation
        np.testing.assert_allclose(end, [4 * metre, 0, 0], atol=1e-12)
        assert path.feeds[0].asked == pytest.approx(10 * 25.4e-3 / 60)
    file = written(tmp_path, "part.cls", text.replace("IPM,10", "MMPM,100"))
    rows = read_cldata(file)["cut 1"]
    assert "no statement says UNITS: lengths are taken for mm" in rows.notes
    np.testing.assert_allclose(rows.positions[-1], [4e-3, 0, 0])


def test_what_a_program_does_not_say_is_told(tmp_path: Path) -> None:
    text = "T1 M6\nG0 X0 Y0 Z5\n/G1 Z0 F600\nG1 X10\nT2 M6\nG0 X0\nG1 Y9\n"
    notes = "\n".join(read_gcode(written(tmp_path, "a.nc", text))["cut 1"].notes)
    for said in ("no line says G20 or G21", "line 3: lines that may be skipped", "T2 after T1"):
        assert said in notes


@pytest.mark.parametrize("where", ["beside", "in each"])
def test_words_that_may_move_poses_are_refused_and_others_told(where: str, tmp_path: Path) -> None:
    poses = [{"x": 0.4, "y": 0.1 * k, "z": 0.3} for k in range(3)]

    def reads(key: str, value: object) -> sm.paths.Path:
        document: dict[str, object] = {"poses": poses}
        if where == "beside":
            document |= {key: value}
        else:
            document = {"poses": [{**pose, key: value} for pose in poses]}
        return sm.files.read_path(written(tmp_path, "a.json", json.dumps(document)), feed=0.05)

    for key, value in (("unit", "mm"), ("tool_offset", {"z": 0.1}), ("frame", "tool")):
        with pytest.raises(
            sm.errors.FileFormatError, match=f"'{key}' is .*which may move the poses"
        ):
            reads(key, value)
    assert not any("passed over" in note for note in reads("name", "seam").notes)
    assert any("passed over: 'gripper'" in note for note in reads("gripper", "open").notes)


@pytest.mark.parametrize(("feed", "is_noted"), [("600", True), ("MMPM,600", False)])
def test_a_feed_without_a_unit_is_noted(feed: str, is_noted: bool, tmp_path: Path) -> None:
    text = f"UNITS/MM\nRAPID\nGOTO/0,0,5\nFEDRAT/{feed}\nGOTO/0,0,0\nGOTO/40,0,0\n"
    rows = read_cldata(written(tmp_path, "part.cls", text))["cut 1"]
    assert any("FEDRAT says neither MMPM nor IPM" in note for note in rows.notes) is is_noted


def test_another_tool_is_told_by_the_beginnings_of_their_names(tmp_path: Path) -> None:
    first, second = "1,BALL" + 60 * "A", "2,FLAT" + 60 * "B"
    text = CLDATA.replace("LOADTL/1 $$ a ball", f"LOADTL/{first}").replace(
        "GODLTA/10", f"LOADTL/{second}\nGODLTA/10"
    )
    rows = read_cldata(written(tmp_path, "tools.apt", text)).values()
    notes = {note for one in rows for note in one.notes}
    said = f"LOADTL/{second[:40]}: another tool than {first[:40]}: the tip of the arm's tool"
    assert any(said in note for note in notes), notes
