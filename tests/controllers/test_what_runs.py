"""A program is verified where all that a controller may make of its lines is."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3, exp3
from selfmotion.shop import controllers
from selfmotion.shop.controllers import judge_program, read_program
from selfmotion.shop.controllers.program_facts import (
    Load,
    ProgramFacts,
    verified_loads,
    with_checksum,
)
from selfmotion.shop.controllers.program_texts import plain
from support.arms import robot_named
from support.industrial import two_seams
from support.shell import invoke

SECONDS = 3.0
SIGNALS = {"arc on": (7, True), "arc off": (7, False)}
# What controllers make of targets is compared with straight lines drawn at so many times.
LOOKS = 600
# Times of programs have five digits [s].
DIGITS_OF_TIME = 1e-5
# Rest, as cubics between knots leave it [rad/s].
AT_REST = 1e-12
# The writer states its deviation in six digits of a millimetre [m].
DIGITS = 1e-9


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    """A UR5 round a circle."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    circle = sm.paths.Circle.around(ur5.pose(start), 0.1, SECONDS, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(ur5, circle, "pointing", start=start, clearance=None)).require()


@pytest.fixture(scope="module")
def kept(plan: sm.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("kept") / "seam.npz"
    plan.save(file)
    return file


@pytest.fixture(scope="module")
def job() -> sm.Program:
    return two_seams()


def settings(targets: str) -> sm.files.ProgramSettings:
    return sm.files.ProgramSettings(mass=1.0, targets=targets)


def thinned_rapid(text: str, every: int) -> str:
    """Keep every so many-th target in a zone, with the time of those left out."""
    lines, seconds, count = [], 0.0, 0
    for line in text.splitlines():
        found = re.fullmatch(r"(\s*Move.*\\T:=)([\d.]+)(, )(fine|z\d+)(,.*)", line)
        if found is None:
            lines.append(line)
            continue
        seconds, count = seconds + float(found[2]), count + 1
        if found[4] == "fine" or count == every:
            lines.append(f"{found[1]}{seconds:.5f}{found[3]}{found[4]}{found[5]}")
            seconds, count = 0.0, 0
    return "\n".join([*lines, ""])


def thinned_krl(text: str, every: int) -> str:
    lines, seconds, count, target = [], 0.0, 0, ""
    for line in text.splitlines():
        if re.match(r"\s+(SPTP|SPL|SLIN) ", line):
            target = line
            continue
        found = re.fullmatch(r"(\s*TIME_BLOCK PART = )([\d.]+)", line)
        if found is None:
            if seconds and "TIME_BLOCK END" in line:
                lines += [target, f"    TIME_BLOCK PART = {seconds:.5f}"]
                seconds, count = 0.0, 0
            lines.append(line)
            continue
        seconds, count = seconds + float(found[2]), count + 1
        if count == every:
            lines += [target, f"{found[1]}{seconds:.5f}"]
            seconds, count = 0.0, 0
    return "\n".join([*lines, ""])


def thinned_urscript(text: str, every: int) -> str:
    lines, seconds, count = [], 0.0, 0
    for line in text.splitlines():
        found = re.fullmatch(r"(\s*move[lj]\(.*t=)([\d.]+)(, r=)([\d.]+)\)", line)
        if found is None:
            lines.append(line)
            continue
        seconds, count = seconds + float(found[2]), count + 1
        if float(found[4]) == 0.0 or count == every:
            lines.append(f"{found[1]}{seconds:.5f}{found[3]}{found[4]})")
            seconds, count = 0.0, 0
    return "\n".join([*lines, ""])


THINNED: dict[str, Callable[[str, int], str]] = {
    ".mod": thinned_rapid,
    ".src": thinned_krl,
    ".script": thinned_urscript,
}


def off_by_straight_lines(plan: sm.Plan, file: Path) -> float:
    """How far straight joint lines between the joints of the targets leave the path [m]."""
    program = read_program(file, plan.robot)
    names = [axis.joint for axis in program.axes]
    order = [names.index(name) for name in plan.robot.joint_names]
    worst, begin = 0.0, 0.0
    for stretch in program.segments:
        for at in np.linspace(0.0, stretch.duration, LOOKS):
            q = np.array([np.interp(at, stretch.t, column) for column in stretch.q.T])[order]
            time = min(begin + at, plan.path.duration)
            wanted = plan.path.pose(time).translation
            worst = max(worst, float(np.linalg.norm(plan.robot.pose(q).translation - wanted)))
        begin += stretch.duration
    return worst


@pytest.mark.parametrize(
    ("suffix", "targets"),
    [(suffix, "timed-poses") for suffix in THINNED] + [(".mod", "joints"), (".src", "joints")],
)
def test_targets_that_are_left_out_are_missed(
    plan: sm.Plan, kept: Path, tmp_path: Path, suffix: str, targets: str
) -> None:
    """Of a thinned program the smooth curve is near the path, straight lines are not."""
    file = tmp_path / f"seam{suffix}"
    sm.files.write_motion(plan, file, settings=settings(targets))
    text = file.read_text()
    assert invoke("check", file, "--robot", kept)[0] == 0
    file.write_text(THINNED[suffix](text, 2))
    stated = read_program(file, plan.robot).deviation.path.position
    if targets == "joints":
        assert off_by_straight_lines(plan, file) > stated + DIGITS
    code, printed = invoke("check", file, "--robot", kept)
    assert code == 1
    assert "where the controller goes straight between targets" in printed


def test_all_that_a_controller_may_make_of_targets_is_judged(plan: sm.Plan, tmp_path: Path) -> None:
    """The motions that are judged are the smooth curve, straight lines, and cut corners."""
    file = tmp_path / "seam.mod"
    sm.files.write_motion(plan, file, settings=settings("joints"))
    program = read_program(file, plan.robot)
    (stretch,) = program.segments
    smooth, lines, cut = (motion.q for motion in program.motions())
    t = np.linspace(0.0, stretch.duration, LOOKS)
    # Velocities change within a thousandth of a step at corners [of a step's length].
    near = 1e-3 * np.abs(np.diff(stretch.q, axis=0)).max()
    for k, motion in enumerate(program.motions()):
        for way in stretch.interpolated(t)[0:2][k - 1 : k]:
            np.testing.assert_allclose(motion(t), way, atol=near)
        np.testing.assert_allclose(motion(t[[0, -1]], 1), 0.0, atol=AT_REST)
    assert len(lines) > len(smooth)
    assert len(cut) > len(smooth)


@pytest.mark.parametrize("percent", [1, 99])
@pytest.mark.parametrize("share", ["VEL", "ACC"])
def test_axes_that_are_held_back_are_refused(
    plan: sm.Plan, tmp_path: Path, share: str, percent: int
) -> None:
    file = tmp_path / "seam.src"
    sm.files.write_motion(plan, file)
    slow = f"  BAS(#{share}_PTP, {percent})\n  PTP_SPLINE"
    file.write_text(file.read_text().replace("  PTP_SPLINE", slow))
    with pytest.raises(sm.errors.FileFormatError, match=rf"line \d+: BAS\(#{share}_PTP\).*holds"):
        sm.files.read_motion(file)


@pytest.mark.parametrize(
    ("speed", "held"),
    [(r"\$VEL\.CP = 2\b", "$VEL.CP = 0.05"), (r"\$VEL\.(ORI[12]) = 400", r"$VEL.\1 = 1")],
)
def test_speeds_below_what_times_ask_for_are_refused(tmp_path: Path, speed: str, held: str) -> None:
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    begin = ur5.pose(start)
    end = SE3(
        begin.rotation @ exp3(np.array([0.4, 0.0, 0.0])),
        begin.translation + np.array([0.0, 0.1, 0.05]),
    )
    turned = SE3(end.rotation, end.translation + np.array([0.05, 0.0, 0.0]))
    path = sm.paths.Joined([sm.paths.Line(begin, end, 1.0), sm.paths.Line(end, turned, 1.0)])
    plan = sm.plan(sm.Problem(ur5, path, "pointing", start=start, clearance=None)).require()
    file = tmp_path / "seam.src"
    sm.files.write_motion(plan, file, settings=settings("timed-poses"))
    text = file.read_text()
    assert "TIME_BLOCK" in text
    file.write_text(re.sub(speed, held, text))
    with pytest.raises(sm.errors.FileFormatError, match="holds the tool back from its times"):
        sm.files.read_motion(file, robot=ur5)


def test_what_times_ask_for_is_not_bound(tmp_path: Path) -> None:
    """Of a move that is faster than the usual speed the program says a higher one."""
    ur10 = robot_named("ur10")
    start = np.array([-2.0, -0.25, 0.35, -0.9, -1.2, 0.0])
    end = np.array([2.0, -0.25, 0.35, -0.9, -1.2, 0.0])
    limits = sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()
    asked = [*limits, sm.constraints.JointAccelerationLimits(15.0)]
    move = sm.move(ur10, start, end, constraints=asked, clearance=None)
    file = tmp_path / "go.src"
    sm.files.write_motion(move, file, settings=settings("poses"))
    text = file.read_text()
    fastest = np.linalg.norm(
        [ur10.jacobian(move.motion(t))[:3] @ move.motion(t, 1) for t in move.motion.t], axis=1
    ).max()
    assert fastest > 2.0
    bound = [float(value) for value in re.findall(r"\$VEL\.CP = ([\d.]+)\n  SPLINE", text)]
    assert min(bound) >= fastest
    assert sm.files.read_motion(file, robot=ur10).duration == pytest.approx(
        move.motion.duration, abs=DIGITS_OF_TIME
    )


@pytest.mark.parametrize(
    ("suffix", "old", "new"),
    [
        (".mod", r":= \[50, 10, 50, 10\]", ":= [5000, 500, 5000, 1000]"),
        (".src", r"\$VEL\.CP = 0\.05", "$VEL.CP = 2"),
        (".script", r"(movel\(.*), a=0\.12, v=0\.05", r"\1, a=1.2, v=1.5"),
    ],
)
def test_a_slow_motion_that_is_fast_is_refused(
    plan: sm.Plan, tmp_path: Path, suffix: str, old: str, new: str
) -> None:
    """Nothing has judged the motion to where the program begins, or goes on."""
    file = tmp_path / f"seam{suffix}"
    sm.files.write_motion(plan, file, settings=settings("timed-poses"))
    text = file.read_text()
    assert re.search(old, text)
    file.write_text(re.sub(old, new, text))
    with pytest.raises(sm.errors.FileFormatError, match="goes on"):
        sm.files.read_motion(file, robot=plan.robot)


def test_blends_that_overlap_are_refused(plan: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "seam.script"
    sm.files.write_motion(plan, file, settings=settings("timed-poses"))
    sm.files.read_motion(file, robot=plan.robot)
    file.write_text(re.sub(r"r=0\.001000", "r=0.100000", file.read_text()))
    with pytest.raises(sm.errors.FileFormatError, match="blends that overlap leave targets out"):
        sm.files.read_motion(file, robot=plan.robot)


def test_linear_motions_of_abb_ask_for_no_configuration(plan: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "seam.mod"
    sm.files.write_motion(plan, file, settings=settings("timed-poses"))
    text = file.read_text()
    for changed in (
        text.replace("ConfL \\Off", "ConfL \\On"),
        text.replace("    ConfL \\Off;\n", ""),
    ):
        file.write_text(changed)
        with pytest.raises(sm.errors.FileFormatError, match="ConfL"):
            sm.files.read_motion(file, robot=plan.robot)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("exchanged", ""),
        (r"\$OUT\[7\]", "$OUT[1]"),
        (r"(TRIGGER .*)FALSE", r"\1TRUE"),
    ],
)
def test_what_an_event_switches_is_what_it_was_written_to_switch(
    job: sm.Program, tmp_path: Path, old: str, new: str
) -> None:
    file = tmp_path / "weld.src"
    sm.files.write_motion(job, file, settings=sm.files.ProgramSettings(signals=SIGNALS))
    assert judge_program(file, job).verified
    text = file.read_text()
    if old == "exchanged":
        words = {"TRUE": "FALSE", "FALSE": "TRUE"}
        changed = re.sub("TRUE|FALSE", lambda found: words[found[0]], text)
    else:
        changed = re.sub(old, new, text)
    assert changed != text
    file.write_text(changed)
    found = judge_program(file, job)
    assert not found.verified
    assert any("event" in text for text in found.failures)


def test_a_plan_switches_nothing(plan: sm.Plan, kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "seam.src"
    sm.files.write_motion(plan, file)
    file.write_text(file.read_text().replace("  PTP_SPLINE", "  $OUT[7] = TRUE\n  PTP_SPLINE"))
    code, printed = invoke("check", file, "--robot", kept)
    assert code == 1
    assert "'7' is switched at 0.0000 s, and the motion has no events" in printed


@pytest.mark.parametrize(
    ("line", "old", "new"),
    [
        ("held joints", "0.8", "0.9"),
        ("outputs", "true", "false"),
        ("deviation", "0.09", "9.0"),
        ("axes", "a1 [deg]", "a2 [deg]"),
    ],
)
def test_what_a_head_states_is_not_changed_by_hand(line: str, old: str, new: str) -> None:
    facts = ProgramFacts("flange", {"rail": 0.8}, {"arc on": ("7", True)}, "STN1")
    notes = with_checksum(["axes: A1 = a1 [deg]", *facts.notes, "deviation: 0.09 mm, 0.1 rad"])
    stated = ProgramFacts.stated(notes)
    assert not stated.is_changed
    assert (stated.held, stated.outputs) == (facts.held, facts.outputs)
    changed = [note.replace(old, new) if note.startswith(line) else note for note in notes]
    assert changed != notes
    assert ProgramFacts.stated(changed).is_changed
    assert ProgramFacts.stated(notes[:-1]).is_changed
    assert ProgramFacts.stated([]) is None


def test_held_joints_have_to_stand_where_they_were(tmp_path: Path) -> None:
    """A rail that is held is in no target, and the tool is as far off as it stands elsewhere."""
    rail = """<robot name="rail"><link name="floor"/><link name="carriage"/>
    <joint name="slide" type="prismatic"><parent link="floor"/><child link="carriage"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="100"/></joint></robot>"""
    start = robot_named("ur5").dexterous_configuration("pointing")

    def planned(at: float) -> sm.Plan:
        parts, held = {"arm": "ur5", "rail": rail}, {"rail/slide": at}
        robot = sm.load_robot(parts, on={"arm": "rail/carriage"}, tool="arm/tool0", lock=held)
        begin = robot.pose(start)
        end = begin.copy()
        end.translation = end.translation + np.array([-0.05, 0.05, 0.0])
        line = sm.paths.Line(begin, end, 2.0)
        return sm.plan(sm.Problem(robot, line, "pointing", start, clearance=None)).require()

    here, there = planned(0.8), planned(0.0)
    for plan, name in ((here, "here"), (there, "there")):
        plan.save(tmp_path / f"{name}.npz")
    for suffix in (".src", ".mod"):
        file = tmp_path / f"seam{suffix}"
        sm.files.write_motion(here, file, settings=settings("joints"))
        assert '"rail/slide": 0.8' in file.read_text()
        assert invoke("check", file, "--robot", tmp_path / "here.npz")[0] == 0
        code, printed = invoke("check", file, "--robot", tmp_path / "there.npz")
        assert code == 1
        assert "joint 'rail/slide' held at 0.8, here at 0" in printed
    assert "rail/slide at 0.8 m" in controllers.held_in_words(here.robot)


def test_a_load_is_that_which_torques_were_verified_with(tmp_path: Path) -> None:
    ur5 = robot_named("ur5")
    torques = sm.constraints.JointTorqueLimits(payload=2.0, center=(0.0, 0.0, 0.05))
    limits = sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()
    asked = [*limits, sm.constraints.JointAccelerationLimits(2.0), torques]
    start = np.array([0.0, -0.9, 0.9, 0.0, 0.3, 0.0])
    move = sm.move(ur5, start, start + 0.2, constraints=asked, clearance=None)
    file = tmp_path / "go.mod"
    same = sm.files.ProgramSettings(mass=2.0, center=(0.0, 0.0, 0.05))
    sm.files.write_motion(move, file, settings=same)
    program = read_program(file, ur5)
    assert program.load is not None
    (verified,) = verified_loads(ur5, asked, program.facts.flange)
    assert program.load.is_like(verified)
    assert not list(controllers.header_faults(program, ur5, asked))
    for other in (replace(same, mass=20.0), replace(same, center=(0.0, 0.0, 0.1))):
        with pytest.raises(sm.errors.ProblemError, match="torques were verified with 2 kg"):
            sm.files.write_motion(move, file, settings=other)
    changed = replace(program, load=Load(3.0, program.load.center))
    assert any("torques" in text for text in controllers.header_faults(changed, ur5, asked))


def test_the_load_has_what_the_urdf_has_beyond_the_flange() -> None:
    """Own sum of the masses of a hand and its fingers, which ride on the flange of a Panda."""
    panda = robot_named("panda")
    (load,) = verified_loads(panda, [sm.constraints.JointTorqueLimits()], "panda_link8")
    masses = [
        float(mass)
        for name, mass in re.findall(
            r'<link name="([^"]*)">(?:(?!</link>).)*?<mass value="([^"]*)"',
            panda.urdf.text,
            re.DOTALL,
        )
        if "hand" in name or "finger" in name
    ]
    assert masses
    assert load.mass == pytest.approx(sum(masses), abs=1e-9)


def test_free_moves_are_those_of_the_job(job: sm.Program, tmp_path: Path) -> None:
    """A move elsewhere that keeps apart what has to be is another move than the one of the job."""
    file = tmp_path / "weld.src"
    sm.files.write_motion(job, file, settings=sm.files.ProgramSettings(signals=SIGNALS))
    program = read_program(file, job.robot)
    moves = [step for step in job.steps if isinstance(step.made, sm.Move)]
    name = max(moves, key=lambda step: step.motion.duration).name
    text = file.read_text()
    before = text.index(f"; step: {plain(name)}")
    after = text.index("ENDSPLINE", before)
    target = re.search(r"SPTP \{A1 (-?[\d.]+)", text[before:after])
    assert target is not None
    moved = text[before:after].replace(
        target[0], target[0].replace(target[1], f"{float(target[1]) + 2.0:.5f}"), 1
    )
    file.write_text(text[:before] + moved + text[after:])
    found = judge_program(file, job)
    assert program.deviation.moves.joint < np.radians(2.0)
    assert any("free moves are up to" in text for text in found.failures)


def test_a_timetable_is_no_motion(plan: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.FileFormatError, match="is the name of a job's timetable"):
        sm.files.write_motion(plan, tmp_path / "weld.timetable.csv")


@pytest.mark.parametrize("suffix", [".src", ".mod"])
def test_an_axis_that_no_joint_is_does_not_move(plan: sm.Plan, tmp_path: Path, suffix: str) -> None:
    """A rail that somebody wrote into each target of a program of an arm without one."""
    file = tmp_path / f"seam{suffix}"
    sm.files.write_motion(plan, file, settings=settings("joints"))
    text = file.read_text()
    sm.files.read_motion(file)
    moved = text.replace("], [9E9,", "], [500,")
    moved = re.sub(r"(\{A1 [^}]*)\}", r"\1, E1 500}", moved)
    assert moved != text
    file.write_text(moved)
    with pytest.raises(sm.errors.FileFormatError, match="axis E1 has targets"):
        sm.files.read_motion(file)


@pytest.mark.parametrize("character", ["\u2028", "\f", "\x85"])
@pytest.mark.parametrize("suffix", [".src", ".mod", ".script"])
def test_lines_end_where_controllers_end_them(
    plan: sm.Plan, tmp_path: Path, suffix: str, character: str
) -> None:
    """What Python takes for the end of a line, a controller takes for part of a comment."""
    file = tmp_path / f"seam{suffix}"
    sm.files.write_motion(plan, file, settings=settings("timed-poses"))
    text = file.read_text()
    mark = {".src": ";", ".mod": "!", ".script": "#"}[suffix]
    line = next(x for x in text.splitlines() if x.strip().startswith(f"{mark} step"))
    file.write_text(text.replace(line, f"{line}{character} hidden"), encoding="utf-8")
    with pytest.raises(sm.errors.FileFormatError, match="at which some programs end a line"):
        sm.files.read_motion(file, robot=plan.robot)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"BAS\(#VEL_PTP, 10\)", "BAS(#VEL_PTP, 100)", "VEL_PTP.* 100 %.*nothing has judged it"),
        (r"BAS\(#ACC_PTP, 10\)", "BAS(#ACC_PTP, 100)", "ACC_PTP.* 100 %.*nothing has judged it"),
        (r"  BAS\(#(VEL|ACC)_PTP, 10\)\n", "", "VEL_PTP.* 0 %.*nothing has judged it"),
        (r"  BAS\(#INITMOV, 0\)\n((?:.*\n)*?)(  PTP)", r"\1  BAS(#INITMOV, 0)\n\2", "first"),
    ],
)
def test_the_way_to_the_begin_is_as_slow_as_it_was_written(
    plan: sm.Plan, tmp_path: Path, old: str, new: str, said: str
) -> None:
    file = tmp_path / "seam.src"
    sm.files.write_motion(plan, file)
    text = file.read_text()
    changed = re.sub(old, new, text)
    assert changed != text
    file.write_text(changed)
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_motion(file)


def test_a_shift_excuses_only_what_it_moves(job: sm.Program, tmp_path: Path) -> None:
    """A work object that is shifted by some micrometres moves no joint target."""
    file = tmp_path / "weld.src"
    shifted = sm.files.ProgramSettings(signals=SIGNALS, targets="poses")
    sm.files.write_motion(job, file, settings=shifted)
    text = file.read_text().replace("$BASE = {X 0.00000", "$BASE = {X 0.00300")
    file.write_text(text)
    assert judge_program(file, job).shift_remark
    assert judge_program(file, job).verified
    # Aside and back, slowly, between two steps.
    before, after = text.split("  ; step: seam 1\n")
    x, rest = re.findall(r"(?:SPL|SLIN) \{X (-?[\d.]+)(,[^}]*)\}", before)[-1]
    aside = (
        "  $VEL.CP = 0.05\n  $VEL.ORI1 = 10\n  $VEL.ORI2 = 10\n"
        f"  LIN {{X {float(x) + 60.0:.5f}{rest}}}\n  LIN {{X {x}{rest}}}\n"
        "  $VEL.CP = 2\n  $VEL.ORI1 = 400\n  $VEL.ORI2 = 400\n"
    )
    file.write_text(f"{before}  ; step: seam 1\n{aside}{after}")
    found = judge_program(file, job)
    assert not found.verified
    assert any("goes slowly to where neither" in text for text in found.failures)


def test_a_load_is_the_one_that_was_written(plan: sm.Plan, kept: Path, tmp_path: Path) -> None:
    file = tmp_path / "seam.src"
    sm.files.write_motion(plan, file, settings=settings("joints"))
    text = file.read_text()
    for changed in (
        re.sub(r"  \$LOAD.*\n", "", text),
        re.sub(r"\{M 1\.0000", "{M 4.0000", text),
        re.sub(r"  ; (flange|checksum of what is stated): .*\n", "", text),
    ):
        assert changed != text
        file.write_text(changed)
        assert invoke("check", file, "--robot", kept)[0] == 1


def test_torques_are_judged_along_the_smooth_way(tmp_path: Path) -> None:
    """At the corners of straight lines a program has no acceleration that anybody knows."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    circle = sm.paths.Circle.around(ur5.pose(start), 0.1, SECONDS, normal=(1.0, 0.0, 0.0))
    limits = sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()
    asked = [*limits, sm.constraints.JointTorqueLimits(payload=1.0)]
    problem = sm.Problem(ur5, circle, "pointing", start, constraints=asked, clearance=None)
    sm.plan(problem).require().save(tmp_path / "seam.npz")
    plan, file = sm.load_plan(tmp_path / "seam.npz"), tmp_path / "seam.src"
    sm.files.write_motion(plan, file, settings=settings("joints"))
    assert invoke("check", file, "--robot", tmp_path / "seam.npz")[0] == 0


def test_a_head_with_numbers_that_are_none_is_one_that_was_changed() -> None:
    """Whole numbers beyond all floats, too."""
    for text in (f'held joints: {{"rail": 1{400 * "0"}}}', "load: [1]", 'approach: "fast"'):
        assert ProgramFacts.stated([text]).is_changed, text
