"""Cases of people, from the shell: what is right of each is worked out from its files, by hand."""

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.model.collision import PERHAPS, overlapping_by_design
from selfmotion.shell.documents import example_text
from selfmotion.shop.cam import Reading, one_seam
from selfmotion.shop.cam.gcode import read_gcode
from support.own_kinematics import Arm, along
from support.shell import complaint, in_full, invoke, on_circle, on_line

CASES = Path(__file__).parents[1] / "cases"
PANDA_AT = ("--frame", "0.45,0,0.3,0,0,0", "--task", "pointing")
# Digits of files, and chords of curves [m]; rounding of a motion [m, rad].
DIGITS, CHORD, ROUNDING = 1e-6, 1e-5, 1e-6


def planned(out: Path, *arguments: str | Path) -> sm.Plan:
    """Plan in the shell, verified; return the plan."""
    return reported(out, *arguments)[0]


def reported(out: Path, *arguments: str | Path) -> tuple[sm.Plan, str]:
    """Plan in the shell, verified; return the plan, and the notes that the shell prints."""
    code, text = invoke("plan", *arguments, "--json", "--out", out / "x.npz")
    assert code == 0, text
    assert json.loads(text)["certificate"]["verified"]
    return sm.load_plan(out / "x.npz"), "\n".join(json.loads(text)["remarks"])


def along_it(path: sm.paths.Path, count: int = 2001) -> np.ndarray:
    """Return where the tool is along a path, in the frame of its file: 0.45, 0, 0.3 [m]."""
    places = path.samples(np.linspace(0.0, path.duration, count)).translation
    return np.asarray(places) - [0.45, 0.0, 0.3]


def tips_of(plan: sm.Plan, count: int = 401) -> tuple[np.ndarray, np.ndarray]:
    """Return rotations and places of the tool, by kinematics of the tests' own."""
    own, t = Arm(plan.robot), np.linspace(0.0, plan.trajectory.duration, count)
    return own.place(plan.robot.tool, along(plan.trajectory, t, 0))


@pytest.mark.parametrize(
    ("name", "deepest"), [("peck", -10), ("peck_5mm", -10), ("g81_shallow", -2), ("g81_deep", -10)]
)
def test_drilled_holes_have_the_feeds_of_their_files(
    name: str, deepest: float, tmp_path: Path
) -> None:
    file = CASES / "peck_drilling" / f"{name}.nc"
    path = sm.files.read_path(file)
    heights = path.samples(np.linspace(0.0, path.duration, 4001)).translation[:, 2]
    assert heights.min() == pytest.approx(1e-3 * deepest, abs=CHORD)
    if name == "peck":
        # Three pecks of 0.6 mm are planned, not all.
        text, deepest = file.read_text(), 1.2
        file = tmp_path / "peck.nc"
        file.write_text(text.replace("Z-10", "Z1.2"))
    # What it costs is not looked at.
    asked = (*PANDA_AT, "--set", "max_evaluations=1")
    plan, notes = reported(tmp_path, "panda", "--path", file, *asked)
    assert {round(feed.asked, 6) for feed in plan.path.feeds} == {0.006667}
    assert all(feed.kept for feed in plan.path.feeds)
    assert "stock and engagement are not judged" in notes
    own = 1e3 * (tips_of(plan, 2001)[1] - [0.45, 0.0, 0.3])
    np.testing.assert_allclose(own[:, :2], np.tile([10.0, 0.0], (len(own), 1)), atol=1e-2)
    np.testing.assert_allclose(own[0, 2], own[-1, 2], atol=1e-2)
    assert own[:, 2].min() == pytest.approx(deepest, abs=0.02)


def test_a_flat_block_is_that_of_scale_one(tmp_path: Path) -> None:
    file = CASES / "flat_block" / "flat.dxf"
    line = sm.files.read_path(file, feed=0.02, seam="0 2")
    ends = [line.pose(0.0).translation, line.pose(line.duration).translation]
    np.testing.assert_allclose(ends, [[0, 0, 0], [0.06, 0, 0]], atol=DIGITS)
    asked = ("--feed", "0.02", "--set", "path.seam=0 1", *PANDA_AT)
    found = along_it(planned(tmp_path, "panda", "--path", file, *asked).path)
    plain = sm.files.read_path(file.with_name("plain.dxf"), feed=0.02, seam="0 1")
    moved = np.add(along_it(plain), [0.45, 0.0, 0.3])
    np.testing.assert_allclose(found, moved, atol=DIGITS)
    away = np.linalg.norm(found[:, :2] - [0.02, 0.01], axis=1)
    # Corners of the chords are rounded, too.
    np.testing.assert_allclose(away, 0.005, atol=5 * CHORD)
    length = np.linalg.norm(np.diff(found, axis=0), axis=1).sum()
    assert length == pytest.approx(2 * math.pi * 5e-3, rel=3e-3)


def test_words_of_sinumerik_say_the_tools_axis(tmp_path: Path) -> None:
    file = CASES / "sinumerik_words" / "arm.mpf"
    plan, notes = reported(tmp_path, "panda", "--path", file, *PANDA_AT)
    assert "no line says G20 or G21: lengths are taken for mm" in notes
    assert {round(feed.asked, 6) for feed in plan.path.feeds} == {0.033333}
    rotations, places = tips_of(plan)
    np.testing.assert_allclose(rotations[0, :, 2], [0, 0, -1], atol=DIGITS)
    np.testing.assert_allclose(rotations[-1, :, 2], [-0.34202, 0, -0.939693], atol=DIGITS)
    ends = 1e3 * (places[[0, -1]] - [0.45, 0.0, 0.3])
    np.testing.assert_allclose(ends[-1], [80, 0, 0], atol=1e-2)


TABLE = ("--feed", "0.1", "--task", "position")


@pytest.mark.parametrize("name", ["teach.mod", "cut.src", "move.script"])
def test_programs_of_others_are_named_as_such(name: str) -> None:
    file = CASES / "programs_of_others" / name
    said = complaint("plan", "panda", "--path", file, "--feed", "0.1")
    assert "is a program of a robot" in said
    assert "write its targets as a table" in said
    table = CASES / "along_the_path" / "square.csv"
    judged = complaint("check", file, "--robot", "panda", "--path", table, *TABLE)
    assert re.search(r"line \d+: '.*' is not read: selfmotion did not write this", judged)
    assert "of another one judge the recorded motion, a table of t and a column per" in judged


@pytest.mark.parametrize("name", ["a.JBI", "a.ls", "a.pgx", "a.as", "a.urp"])
def test_programs_of_all_makers_are_named_as_such(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("NOP\n")
    said = complaint("plan", "panda", "--path", tmp_path / name, "--feed", "0.1")
    assert "is a program of a robot (" in said


@pytest.mark.parametrize(
    "line", ["CYCLE832(0.05,_ORI_FINISH,1)", "TRANS X10", "ROT Z30", "R1=50", 'MSG("cut")']
)
def test_what_else_siemens_writes_is_refused_by_its_line(line: str, tmp_path: Path) -> None:
    text = f"G17 G90 G71\nTRAORI\nG1 X=0 Y=0 Z=0 F2000\n{line}\nG1 X=50\nM30\n"
    (tmp_path / "a.mpf").write_text(text)
    said = complaint("plan", "panda", "--path", tmp_path / "a.mpf", "--task", "pointing")
    # G71 is a cycle of other controls.
    assert re.search(r"line 1: G71 is not read: of what only Siemens' controls know, TRAORI", said)
    said = complaint_of(tmp_path, text.replace("G17 G90 G71", "G17 G90"))
    assert re.search(r"line 4: .* is not read: of what only Siemens' controls know", said)


def complaint_of(folder: Path, text: str) -> str:
    (folder / "b.mpf").write_text(text)
    return complaint("plan", "panda", "--path", folder / "b.mpf", "--task", "pointing")


def test_a_line_may_begin_with_the_tools_axis(tmp_path: Path) -> None:
    text = "G17 G90\nTRAORI\nG0 X=0 Y=0 Z=0\nA3=0 B3=0 C3=1 X=0\nG1 X=50 F2000\nM30\n"
    (tmp_path / "a.mpf").write_text(text)
    (cut,) = read_gcode(tmp_path / "a.mpf").values()
    np.testing.assert_allclose(1e3 * cut.positions[-1], [50, 0, 0])
    np.testing.assert_allclose(cut.values[-1][:, 2], [0, 0, -1], atol=DIGITS)


def test_a_limit_without_effort_or_speed_is_none(tmp_path: Path) -> None:
    folder = CASES / "limit_without_effort"
    known = planned(tmp_path, folder / "with_effort.urdf", *on_circle("0.03"))
    for name in ("no_effort", "continuous_velocity_only"):
        plan, notes = reported(tmp_path, folder / f"{name}.urdf", *on_circle("0.03"))
        robot = sm.load_robot(folder / f"{name}.urdf")
        assert "<limit> without effort: taken for none, torques are not limited" in notes
        if name == "no_effort":
            np.testing.assert_allclose(plan.trajectory.q, known.trajectory.q, atol=ROUNDING)
        with pytest.raises(sm.errors.ProblemError, match=r"'j1' has a <limit> without effort"):
            sm.constraints.JointTorqueLimits().of(robot)


@pytest.mark.parametrize(
    ("limit", "note"),
    [
        ('lower="-2" upper="2" velocity="0" effort="0"', "'j1': <limit> with velocity 0: taken"),
        ('lower="-2" upper="2" effort="9"', "'j1': <limit> without velocity: taken for none"),
        ('lower="-115" upper="115" velocity="2" effort="9"', "'j1': <limit> of more than 20 rad"),
    ],
)
def test_a_limit_of_zero_or_in_degrees_is_told(limit: str, note: str) -> None:
    text = (CASES / "limit_without_effort" / "with_effort.urdf").read_text()
    joint = re.compile(r'(name="j1" type=")\w+(".*?)<limit[^>]*/>', re.DOTALL)
    given = joint.sub(rf"\1revolute\2<limit {limit}/>", text, count=1)
    assert given != text
    assert any(said.startswith(note) for said in sm.load_robot(given).urdf.notes)


def test_a_planar_joint_with_limits_is_three_joints(tmp_path: Path) -> None:
    folder = CASES / "planar_base"
    text = (folder / "planar_base.urdf").read_text()
    asked = (*on_line("0.3,0,0", ""), "--feed", "0.15", "--task", "pointing")
    said = complaint("plan", folder / "planar_base.urdf", *asked)
    assert "read as base_move_x, base_move_y, base_move_yaw" in said
    limit = '<limit lower="-5" upper="5" velocity="0.5" effort="100"/></joint>'
    first = text.index('type="planar"')
    end = text.index("</joint>", first)
    (tmp_path / "base.urdf").write_text(text[:end] + limit + text[end + len("</joint>") :])
    one, other = sm.load_robot(tmp_path / "base.urdf"), sm.load_robot(folder / "three_joints.urdf")
    assert one.joint_names[:3] == ("base_move_x", "base_move_y", "base_move_yaw")
    rng = np.random.default_rng(0)
    for q in rng.uniform(-1.0, 1.0, (20, 10)):
        np.testing.assert_allclose(
            one.pose(q).homogeneous, other.pose(q).homogeneous, atol=ROUNDING
        )
    _, notes = reported(tmp_path, tmp_path / "base.urdf", *asked)
    assert "base_move_x, base_move_y, base_move_yaw" in notes


def test_a_plane_that_leans_is_left_for_no_joint_of_it() -> None:
    """Own product of transforms: x and y in the plane whose normal is the axis."""
    axis = np.array([0.3, -0.4, 0.5]) / np.linalg.norm([0.3, -0.4, 0.5])
    urdf = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="p" type="planar">'
        '<parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0.2 0 0"/>'
        '<axis xyz="0.3 -0.4 0.5"/><limit lower="-1" upper="1" velocity="1"/></joint></robot>'
    )
    robot = sm.load_robot(urdf)
    turn = pin.rpy.rpyToMatrix(0.2, 0.0, 0.0)
    for q in np.random.default_rng(1).uniform(-1.0, 1.0, (10, 3)):
        pose = robot.pose(q)
        moved = turn.T @ (pose.translation - [0, 0, 1])
        assert abs(moved @ axis) < ROUNDING
        assert np.linalg.norm(moved) == pytest.approx(float(np.hypot(q[0], q[1])), abs=ROUNDING)
        rotated = turn.T @ pose.rotation
        np.testing.assert_allclose(rotated, pin.exp3(q[2] * axis), atol=ROUNDING)


def test_a_xacro_that_calls_nothing_says_what_it_defines(tmp_path: Path) -> None:
    file = tmp_path / "only_macro.urdf.xacro"
    shutil.copy(CASES / "only_a_macro" / "only_macro.urdf.xacro", file)
    said = complaint("init", file, "--out", tmp_path / "x.toml")
    assert "defines the macro rebel_arm (params: prefix load) and calls none" in said
    (tmp_path / "robot.xacro").write_text(f'<robot><x filename="{file.name}"/></robot>')
    assert "calls the macro: robot.xacro" in complaint("init", file, "--out", tmp_path / "x.toml")


def test_a_telescope_is_begun_with_its_overlaps_left_out(tmp_path: Path) -> None:
    file = tmp_path / "t.toml"
    code, text = invoke("init", CASES / "telescope" / "tubes.urdf", "--tool", "tip", "--out", file)
    assert code == 0, text
    written = file.read_text()
    # By the boxes of the file: 100, 80, 70, 60 and 50 mm wide, 13 mm apart, 130 mm of travel each.
    for first, second in (
        ("mast", "a1"),
        ("mast", "a2"),
        ("mast", "a3"),
        ("a0", "a2"),
        ("a0", "a3"),
        ("a1", "a3"),
    ):
        assert f'["{first}", "{second}"]' in written
        assert f"# {first} - {second}: overlap in " in written
    srdf = tmp_path / "own.srdf"
    srdf.write_text('<robot name="r"><disable_collisions link1="mast" link2="a1"/></robot>')
    text = example_text(CASES / "telescope" / "tubes.urdf", file, tool="tip", srdf=srdf)
    assert 'srdf = "own.srdf"' in text
    assert '["mast", "a1"]' not in text
    assert '["mast", "a2"]' in text


WRIST = """<robot name="wrist"><link name="base"/>
<link name="yaw"><collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
<link name="pitch"/><link name="roll"><collision><origin xyz="0.151 0 0"/>
<geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<joint name="a" type="revolute"><parent link="base"/><child link="yaw"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="b" type="prismatic"><parent link="yaw"/><child link="pitch"/><axis xyz="1 0 0"/>
<limit lower="-0.1" upper="0.15" velocity="1" effort="1"/></joint>
<joint name="c" type="prismatic"><parent link="pitch"/><child link="roll"/><axis xyz="0 1 0"/>
<limit lower="0" upper="0.05" velocity="1" effort="1"/></joint>
</robot>"""


def test_links_that_overlap_in_half_of_all_configurations_are_left_out_last() -> None:
    """At b = 0 they are 1 mm apart; below -1 mm, of 0.25 m, they overlap: in 40 %, or in 60 %."""
    arm = sm.load_robot(WRIST)
    assert overlapping_by_design(arm) == {}
    assert overlapping_by_design(arm, share=PERHAPS) == {}
    further = WRIST.replace('lower="-0.1" upper="0.15"', 'lower="-0.15" upper="0.1"')
    assert overlapping_by_design(sm.load_robot(further)) == {}
    ((pair, why),) = overlapping_by_design(sm.load_robot(further), share=PERHAPS).items()
    assert pair == ("yaw", "roll")
    share = re.fullmatch(r"overlap in (\d+) % of all configurations", why)
    assert share is not None
    # 500 samples: within 3 deviations of 0.6, of 0.022 each.
    assert abs(float(share[1]) - 60.0) < 7.0


def test_an_arm_drawn_in_collision_is_no_telescope_in_silence(tmp_path: Path) -> None:
    """Upright, as it is drawn, its arm is in the box of its base; most of the time it is not."""
    body = '<collision><origin xyz="0 0 {}"/><geometry>{}</geometry></collision>'
    ball, box = '<sphere radius="0.02"/>', '<box size="0.3 0.9 0.9"/>'
    bodies = [body.format(0.45, box), "", *[body.format(0.1, ball)] * 6]
    links = "".join(f'<link name="l{k}">{own}</link>' for k, own in enumerate(bodies))
    joints = "".join(
        f'<joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="0 0 0.2"/><axis xyz="{"0 0 1" if k % 2 == 0 else "0 1 0"}"/>'
        f'<limit lower="-2.5" upper="2.5" velocity="2" effort="50"/></joint>'
        for k in range(7)
    )
    urdf, file, plan = (tmp_path / name for name in ("fat.urdf", "fat.toml", "fat.npz"))
    urdf.write_text(f'<robot name="fat">{links}{joints}</robot>')
    _, _, said = in_full("init", urdf, "--out", file)
    note = "as these links are made so, or may be: see that they are: l0 - l3: overlap in "
    assert note in " ".join(said.split())
    assert "# Left out, as these links are made so, or may be" in file.read_text()
    assert invoke("plan", file, "--out", plan)[0] == 0
    # Whoever reads the verdict alone sees that pairs were left out of it.
    assert "pairs not checked, as asked" in invoke("check", plan)[1]


TELESCOPE = ("mast,a1", "mast,a2", "mast,a3", "a0,a2", "a0,a3", "a1,a3")


def test_links_of_a_telescope_are_told_in_one_go_and_left_out_when_asked(tmp_path: Path) -> None:
    tubes = CASES / "telescope" / "tubes.urdf"
    # Half the way: what is looked at is what is said and left out.
    asked = ("--tool", "tip", *on_line("0,-0.05,0.05"), "--task", "pointing")
    start = ("--start", "0.3,0.02,0.02,0.02,0.02,0.2,0.2,0.1")
    code, text = invoke("plan", tubes, *asked, *start, "--json")
    assert code == 1
    (note,) = (note for note in json.loads(text)["remarks"] if "clearance.disabled" in note)
    for pair in TELESCOPE:
        one, other = pair.split(",")
        assert re.search(rf"{one} - {other}: these links overlap in \d+ % .*, by \d+", note)
        assert f'["{one}", "{other}"]' in note
        assert f'<disable_collisions link1="{one}" link2="{other}"' in note

    def left_out(listed: list[str] | tuple[str, ...]) -> tuple[str, str]:
        return "--set", f"clearance.disabled={json.dumps([pair.split(',') for pair in listed])}"

    out = left_out(TELESCOPE)
    plan = planned(tmp_path, tubes, *asked, *start, *out)
    (clearance,) = (c for c in plan.problem.all_constraints if c.kind == "Clearance")
    assert {",".join(pair) for pair in clearance.disabled} == set(TELESCOPE)
    # Those that are left are looked at.
    fewer = left_out(TELESCOPE[:-1])
    assert invoke("check", tmp_path / "x.npz", *out)[0] == 0
    assert invoke("check", tmp_path / "x.npz", *fewer)[0] == 1
    assert "a1 - a3 overlap by" in invoke("plan", tubes, *asked, *start, *fewer, "--verbose")[1]
    said = complaint("plan", tubes, *asked, *start, "--set", 'clearance.disabled=[["mast"]]')
    assert "disabled" in said
    assert "mast" in said
    said = complaint("plan", tubes, *asked, *start, "--set", 'clearance.disabled=[["mast", "a9"]]')
    assert "has no link 'a9'" in said
    text = example_text(tubes, tmp_path / "t.toml", tool="tip", disabled=[("mast", "tip")])
    assert '["mast", "tip"], ["mast", "a1"]' in text


@pytest.mark.parametrize("name", ["plain.srdf", "included.srdf.xacro", "arguments.srdf.xacro"])
def test_an_srdf_that_is_xacro_is_expanded(name: str, tmp_path: Path) -> None:
    folder = CASES / "srdf_xacro"
    arm = (folder / "arm.urdf", "--tool", "grasp", *on_circle("0.03"))
    plan = planned(tmp_path, *arm, "--set", f"clearance.srdf={folder / name}")
    (clearance,) = (c for c in plan.problem.all_constraints if c.kind == "Clearance")
    assert set(clearance.disabled) == {("bar", "left"), ("bar", "right")}


def test_an_srdf_is_given_the_arguments_of_its_arm_and_none_is_read_as_empty(
    tmp_path: Path,
) -> None:
    for file in (CASES / "srdf_xacro").iterdir():
        shutil.copy(file, tmp_path)
    text = (tmp_path / "arm.urdf").read_text()
    head, _, rest = text.partition("<robot")
    names = rest.replace('"bar"', '"${p}bar"').replace('"left"', '"${p}left"')
    names = names.replace('"right"', '"${p}right"')
    (tmp_path / "arm.urdf.xacro").write_text(
        f'{head}<robot xmlns:xacro="http://www.ros.org/wiki/xacro"{names.partition(">")[0]}>'
        '<xacro:arg name="p" default=""/><xacro:property name="p" value="$(arg p)"/>'
        f"{names.partition('>')[2]}"
    )
    asked = (tmp_path / "arm.urdf.xacro", "--set", "robot.arguments.p=my_", "--tool", "grasp")
    plan = planned(
        tmp_path,
        *asked,
        *on_circle("0.03"),
        "--set",
        f"clearance.srdf={tmp_path / 'arguments.srdf.xacro'}",
    )
    (clearance,) = (c for c in plan.problem.all_constraints if c.kind == "Clearance")
    assert ("my_bar", "my_left") in clearance.disabled
    empty = tmp_path / "empty.srdf"
    empty.write_text('<robot name="arm"><group name="arm"/></robot>')
    plain = (tmp_path / "arm.urdf", "--tool", "grasp", *on_circle("0.03"))
    said = complaint("plan", *plain, "--set", f"clearance.srdf={empty}")
    assert "has no <disable_collisions>" in said


def test_five_joints_follow_what_a_tolerance_lets_them(tmp_path: Path) -> None:
    arm = CASES / "five_joints_relaxed" / "arm5.urdf"
    asked = (arm, *on_line("0,0.1,0"), "--start", "0,0.6,0.9,1.0,0")
    for more in (
        ("--task", "pointing", "--set", 'relaxations=[{rows=["rx", "ry"], band=0.5}]'),
        (
            "--task",
            "pose",
            "--set",
            'relaxations=[{rows=["rx", "ry"], band=0.5}, {rows=["rz"]}]',
        ),
    ):
        rotations, places = tips_of(planned(tmp_path, *asked, *more))
        begin, end = places[0], places[-1]
        np.testing.assert_allclose(end - begin, [0, 0.1, 0], atol=ROUNDING)
        leans = np.arccos(np.clip(rotations[:, :, 2] @ rotations[0, :, 2], -1.0, 1.0))
        assert leans.max() <= 0.5 + ROUNDING
    assert "relax rows that it cannot move" in complaint("plan", *asked, "--task", "pointing")


def test_the_tolerance_that_would_do_is_told(tmp_path: Path) -> None:
    """The base joint turns by atan2(0.1, 0.558) = 0.177 rad: an axis at 2.5 rad leans by 0.106."""
    arm = CASES / "five_joints_relaxed" / "arm5.urdf"
    asked = (arm, *on_line("0,0.1,0"), "--start", "0,0.6,0.9,1.0,0", "--task", "pointing")
    said = complaint("plan", *asked)
    assert said.endswith("with relaxations (--set): rx,ry=0.11 (rad) would do from this start")
    planned(tmp_path, *asked, "--set", 'relaxations=[{rows=["rx", "ry"], band=0.11}]')
    less = 2.0 * math.asin(math.sin(0.5 * math.atan2(0.1, 0.558)) * math.sin(2.5))
    assert 0.1 < less < 0.11
    code, text = invoke(
        "plan",
        *asked,
        "--set",
        'relaxations=[{rows=["rx", "ry"], band=0.1}]',
        "--out",
        tmp_path / "y.npz",
    )
    assert code == 1
    assert "not verified" in text


def test_meshes_are_in_the_unit_that_they_say(tmp_path: Path) -> None:
    folder = CASES / "collada_unit"
    boxes = []
    near = (
        *on_circle("0.03"),
        "--set",
        f"clearance.obstacles=@{folder / 'room.json'}",
        "--set",
        "clearance.distance=0.01",
    )
    for name in ("dae_m_z", "dae_mm_z"):
        robot = planned(tmp_path, folder / f"{name}.urdf", *near).robot
        model = sm.obstacles.CollisionModel(robot)
        (body,) = (body for body in model.every_body if body.name == "l5")
        boxes.append([body.solid.low, body.solid.high])
        drawn = robot.geometry(pin.GeometryType.VISUAL).geometryObjects
        assert any(np.allclose(item.meshScale, 1.0 if name == "dae_m_z" else 1e-3)
                   for item in drawn)  # fmt: skip
    right = [[-0.05, -0.02, 0.04], [0.05, 0.02, 0.06]]
    np.testing.assert_allclose(boxes, [right, right], atol=DIGITS)
    part = sm.obstacles.Mesh("part", [0.5, 0.5, 0.3], folder / "box_mm_z.dae")
    np.testing.assert_allclose(np.ptp(np.array(part.geometry().vertices()), axis=0),
                               [0.1, 0.04, 0.02], atol=DIGITS)  # fmt: skip
    twice = sm.obstacles.Mesh("part", [0.5, 0.5, 0.3], folder / "box_mm_z.dae", scale=0.001)
    with pytest.raises(sm.errors.CollisionError, match=r"its unit is 0\.001 m, and scale is"):
        twice.geometry()


PEERS = {
    "irbcam.csv": ([[0, 0, 0], [50, 0, 0], [100, 0, 0]], 0.05, [0.0, 0.0, -1.0]),
    "cpr.csv": ([[0, 0, 0], [50, 0, 0], [100, 20, 0]], None, None),
    "compas.json": ([[450, -100, 350], [450, 0, 350], [450, 100, 350]], 0.025, [0.0, 0.0, -1.0]),
    "compas_frames.json": (
        [[450, -100, 350], [450, 0, 350], [450, 100, 350]],
        None,
        [0.0, 0.0, -1.0],
    ),
    "primitives.csv": ([[450, -100, 350], [450, 0, 350], [450, 100, 350]], None, None),
}


@pytest.mark.parametrize("name", PEERS)
def test_pose_files_of_peers_are_read_with_their_conventions(name: str, tmp_path: Path) -> None:
    places, feed, down = PEERS[name]
    asked = ["panda", "--path", CASES / "tables_of_peers" / name]
    asked += ["--task", "position" if down is None else "pointing"]
    # The shell's --feed counts for what has none.
    asked += ["--feed", "0.05"] if feed is None else []
    framed = places[0][2] == 0.0
    asked += ["--frame", "0.45,0,0.3,0,0,0"] if framed else []
    plan, notes = reported(tmp_path, *asked)
    assert re.search(r"(?m)^(IRBCAM|igus|compas|compas_slicer|motion primitives): ", notes)
    assert {round(item.asked, 6) for item in plan.path.feeds} == {feed or 0.05}
    rotations, found = tips_of(plan)
    found = 1e3 * (found - ([0.45, 0.0, 0.3] if framed else np.zeros(3)))
    for place in places:
        # At a corner it is rounded by 1 mm at most, and samples are as far apart as that.
        assert np.linalg.norm(found - place, axis=1).min() < 1.1
    np.testing.assert_allclose(found[[0, -1]], [places[0], places[-1]], atol=1e-2)
    if down is not None:
        np.testing.assert_allclose(rotations[:, :, 2], np.tile(down, (401, 1)), atol=1e-5)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "x,y,z,rz1,ry,rz2,motion_type\n0,0,0,0,180,0,0\n1,0,0,0,180,0,1\n",
         "line 3: motion_type 1 is the middle of an arc of IRBCAM, whose end is missing"),
        ("a.csv", "x,y,z,rz1,ry,rz2,motion_type\n0,0,0,0,180,0,1\n1,0,0,0,180,0,0\n",
         "line 2: motion_type 1 is not read here"),
        ("a.csv", "x,y,z,rz1,ry,rz2,motion_type\n0,0,0,0,180,0,0\n1,0,0,0,180,0,3\n",
         "line 3: motion_type 3 is not read here, expected 0"),
        ("a.csv", "X 0; Y 0; Z 0; A 1\nX 1; Y 0\n", "line 2: .*as igus' programs write them"),
        ("a.csv", 'breakpoints,primitives,points,q_bp\n0,movec_fit,"[array([1, 2, 3]), array([4, '
         '5, 6])]",\n', "motion primitive 'movec_fit' with 2 points is not read, expected"),
        ("a.json", '[{"point": [0, 0, 0], "xaxis": [1, 0, 0], "yaxis": [1, 0, 0]}]',
         "xaxis and yaxis are no two axes"),
    ],
)  # fmt: skip
def test_what_peers_write_besides_is_refused(
    name: str, text: str, said: str, tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(tmp_path / name, feed=0.05)


_FRAMES = [{"point": [0.45, y, 0.35], "xaxis": [1, 0, 0], "yaxis": [0, -1, 0]}
           for y in (-0.05, 0.0, 0.05)]  # fmt: skip
# Of the forms above, written otherwise: name, text, places [mm], and the note.
ALSO = [
    ("semicolons.csv", "x;y;z;rz1;ry;rz2;velocity\n0;0;0;0;180;0;20\n40;0;0;90;180;0;20\n",
     [[0, 0, 0], [40, 0, 0]], "IRBCAM: "),
    ("numbered.csv", "index,x,y,z,rz1,ry,rz2\n1,0,0,5,0,180,0\n2,0,30,5,0,180,0\n",
     [[0, 0, 5], [0, 30, 5]], "passed over: index"),
    ("commas.csv", "X 10,5; Y 0,0; Z 3,25; A 180,0\nX 30,5; Y -4,0; Z 3,25; A 180,0\n",
     [[10.5, 0, 3.25], [30.5, -4, 3.25]], "igus: "),
    ("small.csv", "x 1.5 ; y 2 ; z 3\nx 9 ; y 2 ; z 3\n\n", [[1.5, 2, 3], [9, 2, 3]], "igus: "),
    ("dump.json", json.dumps({"dtype": "compas.data/List", "data": _FRAMES}),
     [[450, -50, 350], [450, 0, 350], [450, 50, 350]], "compas: points in metres, as compas_fab"),
    ("named.json", json.dumps({"frames": _FRAMES, "speed": 3}),
     [[450, -50, 350], [450, 0, 350], [450, 50, 350]], "passed over: 'speed'"),
    ("typed.json", json.dumps([{"dtype": "compas.geometry/Frame", "data": one} for one in _FRAMES]),
     [[450, -50, 350], [450, 0, 350], [450, 50, 350]], "compas: "),
    ("caps.csv", "Breakpoints,Primitives,Points\n0,moveJ,\"[array([1., 2., 3.])]\"\n"
     '9,moveL,"[array([1.,\n  8., 3.])]"\n', [[1, 2, 3], [1, 8, 3]], "motion primitives: "),
]  # fmt: skip


@pytest.mark.parametrize("form", ALSO, ids=lambda form: form[0])
def test_forms_of_peers_that_are_written_otherwise(
    form: tuple[str, str, list[list[float]], str], tmp_path: Path
) -> None:
    name, text, places, note = form
    (tmp_path / name).write_text(text)
    rows = one_seam(tmp_path / name, None, Reading())
    np.testing.assert_allclose(1e3 * rows.positions, places, atol=DIGITS)
    assert note in "\n".join(rows.notes)


def test_frames_in_millimetres_are_refused_by_their_form(tmp_path: Path) -> None:
    far = [{**frame, "point": [450, k, 350]} for k, frame in enumerate(_FRAMES)]
    (tmp_path / "mm.json").write_text(json.dumps(far))
    said = complaint("plan", "panda", "--path", tmp_path / "mm.json", "--feed", "0.1")
    assert "write its places in the unit of its form, or as a table with x_mm,y_mm,z_mm" in said


ARCS = {
    "irbcam.csv": (
        "x,y,z,rz1,ry,rz2,motion_type,velocity\n0,0,0,0,180,0,0,50\n50,0,0,0,180,0,0,50\n"
        "100,50,0,45,180,0,1,20\n50,100,0,90,180,0,0,20\n0,100,0,90,180,0,0,50\n"
    ),
    "primitives.csv": (
        "breakpoints,primitives,points,q_bp\n"
        '0,movej_fit,"[array([0.0, 0.0, 0.0])]",\n1,movel_fit,"[array([50.0, 0.0, 0.0])]",\n'
        '2,movec_fit,"[array([100.0, 50.0, 0.0]), array([50.0, 100.0, 0.0])]",\n'
        '3,movel_fit,"[array([0.0, 100.0, 0.0])]",\n'
    ),
}


@pytest.mark.parametrize("name", ARCS)
def test_arcs_of_peers_are_half_a_circle(name: str, tmp_path: Path) -> None:
    """A line, half a circle of 50 mm about (50, 50), by a point between its ends, and a line."""
    (tmp_path / name).write_text(ARCS[name])
    rows = one_seam(tmp_path / name, None, Reading())
    places = 1e3 * rows.positions
    np.testing.assert_allclose(places[[0, 1, -2, -1], :2],
                               [[0, 0], [50, 0], [50, 100], [0, 100]], atol=DIGITS)  # fmt: skip
    arc = places[1:-1]
    np.testing.assert_allclose(np.hypot(*(arc[:, :2] - 50).T), 50.0, atol=DIGITS)
    assert arc[:, 0].max() == pytest.approx(100.0)
    length = np.linalg.norm(np.diff(arc, axis=0), axis=1).sum()
    assert length == pytest.approx(50.0 * math.pi, rel=1e-3)
    if name == "irbcam.csv":
        assert rows.feed is not None
        np.testing.assert_allclose(rows.feed[[0, 1, len(rows.feed) // 2, -3]], [0.05, *[0.02] * 3])
        # rz1 goes from 0 to 90° as evenly as the way: by 45° where it is half way.
        turned = np.degrees(np.arctan2(rows.values[:, 1, 0], -rows.values[:, 0, 0]))
        done = np.degrees(np.arctan2(arc[:, 1] - 50, arc[:, 0] - 50)) + 90.0
        np.testing.assert_allclose(-turned[1:-1], 0.5 * done, atol=1e-6)


def test_points_of_an_arc_on_a_line_are_a_line_and_one_place_is_none(tmp_path: Path) -> None:
    flat = ARCS["irbcam.csv"].replace("100,50,0,45", "50,50,0,45")
    (tmp_path / "a.csv").write_text(flat)
    rows = one_seam(tmp_path / "a.csv", None, Reading())
    np.testing.assert_allclose(1e3 * rows.positions[:, 0], [0, 50, 50, 50, 0], atol=DIGITS)
    (tmp_path / "a.csv").write_text(ARCS["irbcam.csv"].replace("100,50,0,45", "50,0,0,45"))
    with pytest.raises(sm.errors.FileFormatError, match="line 4: an arc needs three points"):
        sm.files.read_path(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text(ARCS["irbcam.csv"].replace("100,50,0,45", "100,5_0,0,45"))
    with pytest.raises(sm.errors.FileFormatError, match="line 4: '5_0' is no number"):
        sm.files.read_path(tmp_path / "a.csv")


def test_columns_a_b_c_are_those_of_kuka(tmp_path: Path) -> None:
    """A about z, B about y, C about x, in turn: 180° about x is down, whatever A is."""
    (tmp_path / "k.csv").write_text(
        "X,Y,Z,A,B,C\n450,-100,350,0,0,180\n450,0,350,30,0,180\n450,100,350,30,10,180\n"
    )
    rows = one_seam(tmp_path / "k.csv", None, Reading())
    np.testing.assert_allclose(rows.positions[:, 1], [-0.1, 0.0, 0.1], atol=DIGITS)
    path = sm.files.read_path(tmp_path / "k.csv", feed=0.05)
    found = [path.pose(0.0).rotation, path.pose(path.duration).rotation]
    np.testing.assert_allclose(found[0], np.diag([1.0, -1.0, -1.0]), atol=DIGITS)
    about_z, about_y = pin.exp3(np.radians([0, 0, 30.0])), pin.exp3(np.radians([0, 10.0, 0]))
    right = about_z @ about_y @ pin.exp3(np.radians([180.0, 0, 0]))
    np.testing.assert_allclose(found[1], right, atol=DIGITS)
    assert any("A,B,C are read as KUKA's: angles about z, y and x" in note for note in path.notes)


def tool_along(path: sm.paths.Path, count: int = 4001) -> tuple[np.ndarray, ...]:
    """Return places, speeds and rotations along a path."""
    samples = path.samples(np.linspace(0.0, path.duration, count))
    return samples.translation, samples.twist, samples.rotation


@pytest.mark.parametrize("corners", ["stop", "round"])
def test_a_knife_points_along_its_path(corners: str, tmp_path: Path) -> None:
    square = CASES / "along_the_path" / "square.csv"
    asked = ("--set", "path.along=x", "--set", f"path.corners={corners}", "--feed", "0.03")
    plan = planned(tmp_path, "panda", "--path", square, *asked, "--frame", "0.45,0,0.3,0,0,0")
    rotations, places = tips_of(plan, 4001)
    places = 1e3 * (places - [0.45, 0.0, 0.3])
    np.testing.assert_allclose(rotations[:, 2, 2], -1.0, atol=ROUNDING)
    for leg, ahead in (
        ((places[:, 0] > 10) & (places[:, 0] < 90) & (places[:, 1] < 5), [1, 0, 0]),
        ((places[:, 1] > 10) & (places[:, 1] < 70), [0, 1, 0]),
        ((places[:, 0] > 10) & (places[:, 0] < 90) & (places[:, 1] > 75), [-1, 0, 0]),
    ):
        assert leg.any()
        np.testing.assert_allclose(rotations[leg, :, 0], np.tile(ahead, (leg.sum(), 1)), atol=1e-5)
    # In corners it turns on the spot; rounding that misses one by 1 mm begins some 5 mm before it.
    turning = np.linalg.norm(np.diff(rotations[:, :, 0], axis=0), axis=1) > 1e-5
    away = np.linalg.norm(places[:-1][turning, None] - [[100, 0, 0], [100, 80, 0]], axis=2)
    assert away.min(axis=1).max() < (0.01 if corners == "stop" else 6.0)


def test_curves_turn_on_their_way_and_a_lead_leans_the_tool(tmp_path: Path) -> None:
    angles = np.radians(np.arange(0, 181, 3))
    lines = [f"{100 * np.sin(a):.6f},{100 - 100 * np.cos(a):.6f},0" for a in angles]
    (tmp_path / "arc.csv").write_text("\n".join(["x_mm,y_mm,z_mm", *lines]) + "\n")
    lead = 0.2
    for name, column, sign in (("x", 0, 1.0), ("-y", 1, -1.0)):
        path = sm.files.read_path(
            tmp_path / "arc.csv", feed=0.05, corners="round", along=name, lead=lead
        )
        places, twists, rotations = tool_along(path)
        moving = np.linalg.norm(twists[:, :3], axis=1) > 0.02
        ahead = twists[moving, :3] / np.linalg.norm(twists[moving, :3], axis=1)[:, None]
        z, one = rotations[moving, :, 2], sign * rotations[moving, :, column]
        # Chords of three degrees: the direction is that within half of it.
        within = np.radians(1.6)
        np.testing.assert_allclose(np.einsum("kc,kc->k", z, ahead), np.sin(lead), atol=within)
        np.testing.assert_allclose(np.einsum("kc,kc->k", one, ahead), np.cos(lead), atol=within)
        np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=ROUNDING)
        assert np.linalg.norm(places[-1] - [0, 0.2, 0]) < 1e-3


@pytest.mark.parametrize(("name", "column", "sign"), [("x", 0, 1.0), ("-y", 1, -1.0)])
def test_a_tilt_leans_the_tool_to_the_left_of_where_it_goes(
    name: str, column: int, sign: float
) -> None:
    """Seen from above, where the holder is: left of +x is +y, and so round the square."""
    square, tilt = CASES / "along_the_path" / "square.csv", 0.3
    path = sm.files.read_path(square, feed=0.03, corners="stop", along=name, tilt=tilt)
    _, twists, rotations = tool_along(path)
    moving = np.linalg.norm(twists[:, :3], axis=1) > 0.02
    ahead = twists[moving, :3] / np.linalg.norm(twists[moving, :3], axis=1)[:, None]
    left = np.cross([0.0, 0.0, 1.0], ahead)
    z, one = rotations[moving, :, 2], sign * rotations[moving, :, column]
    np.testing.assert_allclose(z, np.sin(tilt) * left - [0, 0, np.cos(tilt)], atol=1e-6)
    np.testing.assert_allclose(one, ahead, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=ROUNDING)
    # With a lead as well, it still leans that way by as much.
    both = sm.files.read_path(square, feed=0.03, corners="stop", along=name, tilt=tilt, lead=-0.2)
    z = tool_along(both)[2][moving, :, 2]
    np.testing.assert_allclose(np.einsum("kc,kc->k", z, left), np.sin(tilt), atol=1e-6)
    np.testing.assert_allclose(
        np.einsum("kc,kc->k", z, ahead), -np.sin(0.2) * np.cos(tilt), atol=1e-6
    )


def test_a_tool_that_is_lifted_turns_in_the_air_and_comes_back(tmp_path: Path) -> None:
    square = CASES / "along_the_path" / "square.csv"
    asked = (
        "--set",
        "path.along=x",
        "--set",
        "path.corners=stop",
        "--feed",
        "0.03",
        "--set",
        "path.lift=0.02",
    )
    leans = ("--set", "path.lead=0.1", "--set", "path.tilt=-0.1", "--task", "pointing")
    plan = planned(
        tmp_path, "panda", "--path", square, *asked, *leans, "--frame", "0.45,0,0.3,0,0,0"
    )
    rotations, places = tips_of(plan, 4001)
    places = 1e3 * (places - [0.45, 0.0, 0.3])
    # What it does between its legs is above the corners, and no lower than it is lifted to.
    for corner in ([100, 0], [100, 80]):
        above = np.linalg.norm(places[:, :2] - corner, axis=1) < 0.01
        assert places[above, 2].max() == pytest.approx(20.0, abs=0.01)
    assert places[:, 2].min() > -0.01
    path = sm.files.read_path(square, feed=0.03, corners="stop", along="x", lift=0.02)
    places, _, rotations = tool_along(path)
    turning = np.linalg.norm(np.diff(rotations[:, :, 0], axis=0), axis=1) > 1e-6
    np.testing.assert_allclose(places[:-1][turning, 2], 0.02, atol=1e-9)
    # Feeds are asked for on the legs alone, as without it.
    plain = sm.files.read_path(square, feed=0.03, corners="stop", along="x")
    assert [x.asked for x in path.feeds] == [x.asked for x in plain.feeds]
    assert plain.samples([0.0]).translation[0, 2] == pytest.approx(0.0, abs=1e-12)


def test_a_cut_is_lifted_at_its_corner_alone(tmp_path: Path) -> None:
    """It comes down and leaves by rapids of its own, at neither of which it turns."""
    text = "G21 G90\nG0 X0 Y0 Z20\nG0 Z5\nG1 Z0 F600\nX40 F1200\nY30\nG0 Z20\nM30\n"
    (tmp_path / "knife.nc").write_text(text)
    path = sm.files.read_path(tmp_path / "knife.nc", along="x", corners="stop", lift=0.005)
    places, _, _ = tool_along(path)
    for corner, is_lifted in (([0.0, 0.0], False), ([0.04, 0.0], True), ([0.04, 0.03], False)):
        above = places[np.linalg.norm(places[:, :2] - corner, axis=1) < 1e-9, 2]
        turns_back = np.count_nonzero(np.diff(np.sign(np.diff(above))))
        assert bool(turns_back) == is_lifted
        assert not is_lifted or above.max() == pytest.approx(0.005, abs=1e-6)


def test_cuts_and_drawings_are_followed_along_too(tmp_path: Path) -> None:
    text = "G21 G90\nG0 X0 Y0 Z20\nG0 Z5\nG1 Z0 F600\nX40 F1200\nY30\nG0 Z20\nM30\n"
    (tmp_path / "knife.nc").write_text(text)
    path = sm.files.read_path(tmp_path / "knife.nc", along="x", corners="stop")
    places, _, rotations = tool_along(path)
    np.testing.assert_allclose(places[[0, -1]], [[0, 0, 0.02], [0.04, 0.03, 0.02]], atol=DIGITS)
    first, second = places[:, 0] < 0.039, places[:, 1] > 0.001
    for leg, ahead in ((first, [1, 0, 0]), (second, [0, 1, 0])):
        np.testing.assert_allclose(rotations[leg, :, 0], np.tile(ahead, (leg.sum(), 1)), atol=1e-6)
    assert {round(feed.asked, 6) for feed in path.feeds} == {0.01, 0.02}
    flat = CASES / "flat_block" / "flat.dxf"
    circle = sm.files.read_path(flat, feed=0.01, seam="0 1", along="y", corners="round")
    assert circle.duration > 2.0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"along": "x"}, "say corners stop .* or round"),
        ({"along": "z", "corners": "stop"}, "along is 'z', expected one of"),
        ({"along": "x", "corners": "stop", "duration": 3.0, "feed": None}, "for paths at a feed"),
        ({"lead": 0.2}, "lead has no effect without along"),
        ({"along": "x", "corners": "stop", "lead": 30.0}, "lead is 30 rad, expected less than"),
        ({"tilt": 0.2}, "tilt has no effect without along"),
        ({"along": "x", "corners": "stop", "tilt": -2.0}, "tilt is -2 rad, expected less than"),
        ({"lift": 0.01}, "lift has no effect without along"),
        ({"along": "x", "corners": "round", "lift": 0.01}, "lift has no effect where corners are"),
        ({"along": "x", "corners": "stop", "lift": -0.01}, "lift is -0.01"),
    ],
)
def test_what_along_cannot_be_is_said(options: dict[str, object], said: str) -> None:
    given: dict[str, Any] = {"feed": 0.03, **options}
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(CASES / "along_the_path" / "square.csv", **given)


@pytest.fixture(scope="module")
def retimed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The line of the case, in the least time at 0.2 rad/s²."""
    folder = tmp_path_factory.mktemp("retimed")
    line = (*on_line("0,0.2,0"), "--task", "position", "--start", "home")
    code, text = invoke("plan", "panda", *line, "--out", folder / "l.npz")
    assert code == 0, text
    fast = ("--acceleration", "0.2", "--out", folder / "rt.npz")
    code, text = invoke("retime", folder / "l.npz", *fast)
    assert code == 0, text
    return folder


@pytest.mark.parametrize("rate", [125, 250, 500, 1000])
@pytest.mark.parametrize("suffix", ["csv", "yaml"])
def test_a_retimed_plan_keeps_its_limits_at_the_rate_of_a_controller(
    rate: int, suffix: str, retimed: Path
) -> None:
    file = retimed / f"{rate}.{suffix}"
    code, text = invoke("export", retimed / "rt.npz", "--out", file, "--rate", rate)
    assert code == 0, text
    assert "read back: verified" in text
    motion = sm.files.read_motion(file)
    np.testing.assert_allclose(np.diff(motion.t), 1.0 / rate, atol=2e-9)
    if rate == 500:
        # Its own plan judges it, as slow as it was written.
        code, text = invoke("check", file, "--robot", retimed / "rt.npz", "--json")
        assert (code, json.loads(text)["verified"]) == (0, True)
    # By quintics worked out here, between the samples as well.
    h, u = 1.0 / rate, np.linspace(0.0, 1.0, 41)[:, None, None]
    assert motion.qdd is not None
    rows = [np.stack([a[:-1], a[1:]]) for a in (motion.q, motion.qd * h, motion.qdd * h * h)]
    (p0, p1), (v0, v1), (a0, a1) = rows
    c3 = 10 * (p1 - p0) - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * (p1 - p0) + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * (p1 - p0) - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
    bends = (a0 + 6 * c3 * u + 12 * c4 * u**2 + 20 * c5 * u**3) / h**2
    assert np.abs(bends).max() <= 0.2 * (1.0 + 1e-5)
    assert motion.duration < 1.05 * sm.load_plan(retimed / "rt.npz").trajectory.duration


def test_a_plan_retimed_for_a_rate_is_its_own_file(retimed: Path) -> None:
    asked = ("--acceleration", "0.2", "--rate", "500", "--out", retimed / "own.npz")
    code, text = invoke("retime", retimed / "l.npz", *asked)
    assert code == 0, text
    plan = sm.load_plan(retimed / "own.npz")
    np.testing.assert_allclose(np.diff(plan.trajectory.t), 2e-3, atol=1e-9)
    code, text = invoke("export", retimed / "own.npz", "--out", retimed / "o.csv", "--rate", "500")
    assert code == 0, text
    assert "times as long" not in text
    written = sm.files.read_motion(retimed / "o.csv")
    np.testing.assert_allclose(written.q, plan.trajectory.q, atol=1e-12)
    # A plan whose time was asked for stays as it is.
    code, text = invoke("export", retimed / "l.npz", "--out", retimed / "l.csv", "--rate", "125")
    assert code == 0, text
    assert sm.files.read_motion(retimed / "l.csv").duration == pytest.approx(4.0)


def test_messages_of_ros_say_which_frame_they_are_in(tmp_path: Path) -> None:
    pose = "{position: {x: 0.4, y: %s, z: 0.3}, orientation: {x: 1.0, y: 0.0, z: 0.0, w: 0.0}}"
    stamped = [
        "{header: {stamp: {sec: 0, nanosec: 0}, frame_id: map}, pose: " + pose % y + "}"
        for y in (0.0, 0.1)
    ]
    (tmp_path / "p.yaml").write_text(
        "header: {frame_id: map}\nposes: [" + ", ".join(stamped) + "]\n"
    )
    path = sm.files.read_path(tmp_path / "p.yaml", feed=0.05)
    assert any("poses in metres in frame 'map'" in note for note in path.notes)
    np.testing.assert_allclose(path.pose(0.0).rotation[:, 2], [0, 0, -1], atol=DIGITS)
