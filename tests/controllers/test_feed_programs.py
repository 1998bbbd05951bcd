"""Seams at a feed as poses with speeds, judged by an interpolation and kinematics of ours.

See `support.played_programs` for the oracle.
"""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3, Quaternion, exp3
from selfmotion.shop.controllers import judge_program, program_deviation, read_program
from selfmotion.shop.controllers.arcs import arc_through
from selfmotion.shop.controllers.controller_axes import axes_of
from selfmotion.shop.controllers.feed_segments import ZONE, FeedSegment, nominal_target_times
from selfmotion.shop.controllers.ramps import Ramps
from support.arms import robot_named
from support.industrial import industrial_arm
from support.played_programs import Off, off, read_poses
from support.shell import in_full, invoke

FILES = ("weld.mod", "weld.src", "weld.script")
ROUND = {"weld.mod": "MoveC ", "weld.src": "SCIRC ", "weld.script": "movec("}
SLIDES = {"E1": True, "E2": False}
FEED = 0.03
# What is prescribed is kept within this, by default.
WITHIN = sm.Tolerance(1e-4, 1e-3)
# Newton's method of the oracle, its chords, and digits of its numbers, leave this [m, rad].
ROUNDED = 2e-8


def settings(name: str, **more: object) -> sm.files.ProgramSettings:
    signals = {"gun on": (7, True), "gun off": (7, False)}
    if name.endswith(".mod"):
        signals = {"gun on": ("doGun", True), "gun off": ("doGun", False)}
    given = {"mass": 3.0, "signals": signals, "targets": "poses", **more}
    return sm.files.ProgramSettings(**given)


def named(plan: sm.Plan | sm.Program) -> dict[str, str]:
    """Return joint → axis as six axes and external ones are counted."""
    return {axis.joint: axis.name for axis in axes_of(plan.robot, sm.files.ProgramSettings())}


def measured(plan: sm.Plan, file: Path) -> Off:
    """Return how far the oracle finds a program off its plan, where the tool has gone as far."""
    read = read_poses(file, SLIDES)
    return off(plan.robot, read, plan.trajectory, None, "flange", named(plan), (), 400)


class Written(Protocol):
    """What a program is in a file; computed once for all tests that read or change it."""

    def __call__(self, made: sm.Plan | sm.Program, name: str, targets: str = "poses") -> str: ...


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    @cache
    def text(made: sm.Plan | sm.Program, name: str, targets: str = "poses") -> str:
        file = tmp_path_factory.mktemp("written") / name
        sm.files.write_motion(made, file, settings=settings(name, targets=targets))
        return file.read_text()

    return text


@pytest.fixture(scope="module")
def abb(tmp_path_factory: pytest.TempPathFactory) -> sm.RobotModel:
    return industrial_arm(tmp_path_factory.mktemp("abb"), "abb")


@pytest.fixture(scope="module")
def line(abb: sm.RobotModel) -> sm.Plan:
    """A straight seam of an arm of six axes whose rotation about the tool's axis is free."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    end = SE3(begin.rotation, begin.translation + np.array([0.02, 0.15, -0.03]))
    seam = sm.paths.Feed(sm.paths.Line(begin, end, 3.0), FEED)
    return sm.plan(sm.Problem(abb, seam, "pointing", start, clearance=None)).require()


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> sm.Plan:
    """A full turn of an arm on a rail, which is its redundancy."""
    kuka = industrial_arm(tmp_path_factory.mktemp("kuka"), "kuka", rail=True)
    start = np.append(0.3, np.radians([10.0, -80.0, 100.0, 20.0, 60.0, 15.0]))
    circle = sm.paths.Circle.around(kuka.pose(start), 0.06, 4.0, normal=(0.0, 0.3, 1.0))
    seam = sm.paths.Feed(circle, FEED)
    return sm.plan(sm.Problem(kuka, seam, "pose", start, clearance=None)).require()


@pytest.mark.parametrize("name", FILES)
def test_a_straight_seam_is_one_motion_at_its_feed(
    line: sm.Plan, written: Written, tmp_path: Path, name: str
) -> None:
    file = tmp_path / name
    file.write_text(written(line, name))
    count, stated, found = program_deviation(line, file)
    assert count == 1
    (stretch,) = read_poses(file, SLIDES).stretches
    np.testing.assert_allclose(stretch.speeds, [FEED], rtol=1e-6)
    # The tool is where it should be, its axis is, and all else is off by what is stated.
    far = measured(line, file)
    assert far.position <= stated.path.position + ROUNDED
    assert stated.path.position < WITHIN.position
    assert far.axis <= WITHIN.rotation
    assert far.joint <= stated.path.joint + ROUNDED
    assert found.path.joint <= stated.path.joint
    # Times are those of who asks for them.
    file.write_text(written(line, name, targets="timed-poses"))
    assert program_deviation(line, file)[0] > 20
    assert program_deviation(line, file)[1].path.joint <= WITHIN.rotation


def test_the_shell_says_what_of_a_seam_at_its_feed_it_does_not_judge(
    line: sm.Plan, tmp_path: Path
) -> None:
    file, cell = tmp_path / "weld.mod", tmp_path / "cell.toml"
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
    sm.files.write_problem(replace(line.problem, constraints=limits), cell)
    line.save(tmp_path / "plan.npz")
    asked = ("--set", "targets=poses", "--set", "mass=3")
    code, text = invoke("export", tmp_path / "plan.npz", "--out", file, *asked)
    assert code == 0, text
    assert "1 target, between which" in text
    assert "seams are at their feeds, with ramps of the controller's own" in text
    code, text = invoke("check", file, "--robot", cell)
    assert code == 0, text
    assert "how the controller runs up and down, and so when it is where, is its own" in text
    assert "(0.1 mm and 1 mrad are allowed)" in text
    code, text = invoke("check", file, "--robot", cell, "--json")
    assert "how the controller runs up and down" in json.loads(text)["not_judged"]


@pytest.mark.parametrize("name", FILES[:2])
def test_a_full_turn_is_two_circular_motions(
    ring: sm.Plan, written: Written, tmp_path: Path, name: str
) -> None:
    file = tmp_path / name
    file.write_text(written(ring, name))
    count, stated, found = program_deviation(ring, file)
    assert count == file.read_text().count(ROUND[name]) == 2
    far = measured(ring, file)
    assert far.position <= stated.path.position + ROUNDED
    assert far.rotation <= min(stated.path.rotation + ROUNDED, WITHIN.rotation)
    assert far.joint <= stated.path.joint + ROUNDED
    assert found.path.position <= stated.path.position < 5e-6
    # Through another point it is another circle.
    lines = file.read_text().splitlines()
    k = next(k for k, text in enumerate(lines) if ROUND[name].strip() in text)
    y = re.search(r"(MoveC \[\[\S+ |SCIRC \{X \S+ Y )(-?[\d.]+)", lines[k])
    assert y is not None
    lines[k] = lines[k].replace(y[0], f"{y[1]}{float(y[2]) + 0.5:.4f}", 1)
    file.write_text("\n".join([*lines, ""]))
    assert program_deviation(ring, file)[2].path.position > 1e-4


def test_a_tool_that_turns_along_goes_round_as_well(ring: sm.Plan, tmp_path: Path) -> None:
    """Its orientation turns evenly about the circle's axis, as each maker says that it does."""
    start = ring.trajectory.q[0]
    circle = sm.paths.Circle.around(
        ring.robot.pose(start), 0.05, 4.0, normal=(0.1, 0.0, 1.0), turns=0.4, turn_tool=True
    )
    problem = sm.Problem(ring.robot, sm.paths.Feed(circle, FEED), "pose", start, clearance=None)
    plan = sm.plan(problem).require()
    for name in FILES[:2]:
        file = tmp_path / name
        sm.files.write_motion(plan, file, settings=settings(name))
        assert program_deviation(plan, file)[0] == file.read_text().count(ROUND[name]) == 1
        far = measured(plan, file)
        assert far.position < 1e-6
        # Three points of four digits of a millimetre tell how far a circle of 50 mm has turned.
        assert far.rotation < 1e-7 / 0.05


@pytest.mark.parametrize("name", FILES)
def test_a_seam_that_was_touched_up_is_judged(
    line: sm.Plan, written: Written, tmp_path: Path, name: str
) -> None:
    """Its end half a millimetre elsewhere, and the file is off by as much."""
    file = tmp_path / name
    file.write_text(written(line, name))
    lines = file.read_text().splitlines()
    k = [k for k, text in enumerate(lines) if re.match(r"\s+(MoveL|SLIN|movel)\b", text)][-1]
    x = re.search(r"(MoveL \[\[|\{X |, p\[)(-?[\d.]+)", lines[k])
    assert x is not None
    more = 5e-4 * (1.0 if name == "weld.script" else 1e3)
    lines[k] = lines[k].replace(x[0], f"{x[1]}{float(x[2]) + more:.9f}", 1)
    file.write_text("\n".join([*lines, ""]))
    _, stated, found = program_deviation(line, file)
    assert found.path.position == pytest.approx(5e-4, rel=0.05)
    assert found.path.position > stated.path.position


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("weld.mod", ":= [30, 500", ":= [40, 500"),
        ("weld.src", "$VEL.CP = 0.03", "$VEL.CP = 0.04"),
        ("weld.script", "v=0.03,", "v=0.04,"),
    ],
)
def test_another_speed_than_the_feed_is_refused(
    line: sm.Plan, written: Written, tmp_path: Path, name: str, old: str, new: str
) -> None:
    file, cell = tmp_path / name, tmp_path / "cell.toml"
    sm.files.write_problem(line.problem, cell)
    file.write_text(written(line, name))
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(
        sm.errors.FileFormatError, match=r"'path' is at 40 mm/s .* its path at 30 mm/s: nothing has"
    ):
        invoke("check", file, "--robot", cell)
    # So slow that it takes longer than was planned.
    file.write_text(text.replace(old, new.replace("40", "20").replace("0.04", "0.02")))
    with pytest.raises(sm.errors.FileFormatError, match="after a change of speeds plan anew"):
        sm.files.read_motion(file, robot=line.robot)
    file.write_text(re.sub(r".*planned time.*\n", "", text))
    with pytest.raises(sm.errors.FileFormatError, match=r"needs the comment 'planned time: … s'"):
        sm.files.read_motion(file, robot=line.robot)


@pytest.mark.parametrize(
    ("name", "old", "new", "told"),
    [
        ("weld.mod", "_f1, z0", "_f1, z200", "zone is z200, expected fine or z0"),
        ("weld.mod", ":=weld_w", ":=wobj0", "work object is 'wobj0', expected 'weld_w'"),
        ("weld.mod", r"weld_t\WObj", r"tool0\WObj", "tool is 'tool0', expected 'weld_t'"),
        ("weld.mod", r"    CirPathMode \ObjectFrame;", "", r"MoveC needs CirPathMode"),
        ("weld.mod", "[30, 500,", "[30, 5,", r"has 5, 5000, 1000 for turning .* at least 500"),
        ("weld.mod", 'TRUE, ""', 'FALSE, "STN1"', "its work object is carried by an axis"),
        ("weld.src", "  SPLINE", "  BAS(#VEL_CP, 1)\n  SPLINE", "is not read"),
        ("weld.src", "  SPLINE", "  BAS(#BASE, 3)\n  SPLINE", "is not read"),
        ("weld.src", "$VEL.ORI1 = 400", "$VEL.ORI1 = 4", r"\$VEL.ORI1 is 4°/s, expected at least"),
        ("weld.src", "  $CIRC_TYPE = #BASE", "", r"SCIRC needs \$ORI_TYPE = #VAR and"),
        ("weld.script", "r=0.000000", "r=0.050000", "r is 0.050000 m, expected 0 to 0.0003"),
    ],
)
def test_what_makes_another_motion_of_a_file_is_refused(
    ring: sm.Plan,
    line: sm.Plan,
    written: Written,
    tmp_path: Path,
    name: str,
    old: str,
    new: str,
    told: str,
) -> None:
    plan, file = line if name == "weld.script" else ring, tmp_path / name
    file.write_text(written(plan, name))
    text = file.read_text()
    assert old in text
    read_program(file, plan.robot)
    file.write_text(text.replace(old, new))
    with pytest.raises(sm.errors.FileFormatError, match=told):
        read_program(file, plan.robot)


@pytest.mark.parametrize(("share", "is_read"), [(1e-3, False), (0.9, True), (2.0, True)])
def test_a_feed_that_is_never_reached_is_refused(
    line: sm.Plan, written: Written, tmp_path: Path, share: float, is_read: bool
) -> None:
    """Ramps are the controller's; but with so little acceleration there is nothing between them."""
    file = tmp_path / "weld.script"
    file.write_text(written(line, file.name))
    text, slowed = file.read_text(), lambda found: f"a={share * float(found[1]):.6g}{found[2]}"
    changed, count = re.subn(r"a=([\d.e-]+)(, v=[\d.e-]+, r=)", slowed, text)
    assert count > 0
    file.write_text(changed)
    if is_read:
        read_program(file, line.robot)
        return
    with pytest.raises(sm.errors.FileFormatError, match="never is at its speed"):
        read_program(file, line.robot)


def test_the_least_acceleration_that_is_named_is_read_and_less_is_not(
    line: sm.Plan, written: Written, tmp_path: Path
) -> None:
    file = tmp_path / "weld.script"
    file.write_text(written(line, file.name))
    text = file.read_text()

    def with_acceleration(value: float) -> None:
        found = rf"a={value:.6g}\1"
        file.write_text(re.sub(r"a=[\d.e-]+(, v=[\d.e-]+, r=)", found, text))
        read_program(file, line.robot)

    with pytest.raises(sm.errors.FileFormatError, match="never is at its speed") as refused:
        with_acceleration(1e-6)
    least = float(re.search(r"expected ([\d.e-]+) or more", str(refused.value))[1])
    with_acceleration(least)
    with pytest.raises(sm.errors.FileFormatError, match="never is at its speed"):
        with_acceleration(0.97 * least)


def test_only_one_work_object_and_one_tool_are_read(
    line: sm.Plan, written: Written, tmp_path: Path
) -> None:
    """Poses of another one than the last would be somewhere else."""
    file = tmp_path / "weld.mod"
    file.write_text(written(line, "weld.mod"))
    text = file.read_text()
    for kind in ("tooldata", "wobjdata"):
        (one,) = [item for item in text.splitlines() if f"PERS {kind}" in item]
        file.write_text(text.replace(one, f"{one.replace('weld_', 'other_')}\n{one}"))
        told = f"there is a {kind} 'other_{kind[0]}' already, expected one"
        with pytest.raises(sm.errors.FileFormatError, match=told):
            read_program(file, line.robot)


def test_smooth_segments_beside_round_ones_are_refused(
    ring: sm.Plan, written: Written, tmp_path: Path
) -> None:
    file = tmp_path / "weld.src"
    file.write_text(written(ring, "weld.src"))
    text = file.read_text()
    arc = re.findall(r"    SCIRC \{[^}]*\}, (\{[^}]*\})\n", text)[0]
    file.write_text(text.replace("  ENDSPLINE", f"    SPL {arc}\n  ENDSPLINE"))
    with pytest.raises(sm.errors.FileFormatError, match="SPL beside SLIN or SCIRC is not judged"):
        read_program(file, ring.robot)


@pytest.fixture(scope="module")
def strokes_program() -> sm.Program:
    """Two strokes with run-ups, whose events are where their feed begins and ends."""
    ur10 = robot_named("ur10")
    start = ur10.dexterous_configuration("pointing")
    first, seams = ur10.pose(start), []
    for k in range(2):
        begin, end = first.copy(), first.copy()
        begin.translation = first.translation + np.array([0.0, 0.04 * k, 0.0])
        end.translation = begin.translation + np.array([0.0, 0.0, 0.15])
        stroke = sm.paths.with_run_ups(
            sm.paths.Feed(sm.paths.Line(begin, end, 1.0), 0.1, acceleration=2.0)
        )
        switched = [("gun on", stroke.begin), ("gun off", stroke.end)]
        seams.append(sm.Seam(f"stroke {k}", stroke.path, "pointing", events=switched))
    return sm.plan_job(ur10, seams, order="given", branches=1, clearance=None).require()


@pytest.mark.parametrize("name", FILES)
def test_strokes_switch_where_their_feed_begins(
    strokes_program: sm.Program, written: Written, tmp_path: Path, name: str
) -> None:
    """Each in three motions: run-up, the stroke between its events, run-down."""
    ur10, program = robot_named("ur10"), strokes_program
    file = tmp_path / name
    file.write_text(written(program, name))
    strokes = [
        stretch for stretch in read_program(file, ur10).segments if isinstance(stretch, FeedSegment)
    ]
    assert [len(stretch.speeds) for stretch in strokes] == [3, 3]
    found = judge_program(file, program)
    assert found.verified, found.verdict
    read = read_poses(file, SLIDES)
    moves = tuple(step.name.replace("→", "->") for step in program.steps if not step.is_seam)
    far = off(ur10, read, program.trajectory, "base", "tool0", named(program), moves)
    assert far.position <= program_deviation(program, file)[1].path.position + ROUNDED
    assert far.axis <= WITHIN.rotation


def test_the_shell_judges_strokes_as_python_does(
    strokes_program: sm.Program, written: Written, tmp_path: Path
) -> None:
    file, job = tmp_path / "weld.script", tmp_path / "paint.program"
    file.write_text(written(strokes_program, file.name))
    strokes_program.save(job)
    code, text = invoke("check", file, "--robot", job, "--json")
    assert code == 0, text
    verdict = json.loads(text)["verdict"]
    assert verdict == judge_program(file, strokes_program).verdict
    assert "seams at their feeds are judged with the ramps of the plan" in verdict


def test_leads_take_their_time_with_ramps(abb: sm.RobotModel, tmp_path: Path) -> None:
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    # Where the lead begins the arm is at its start.
    begin = abb.pose(start) * SE3(np.eye(3), np.array([0.0, 0.0, 0.05]))
    end = SE3(begin.rotation, begin.translation + np.array([0.0, 0.1, 0.0]))
    seam = sm.paths.with_leads(sm.paths.Feed(sm.paths.Line(begin, end, 3.0), FEED), 0.05, 1.0)
    plan = sm.plan(sm.Problem(abb, seam, "pointing", constraints=(), clearance=None)).require()
    file = tmp_path / "weld.mod"
    sm.files.write_motion(plan, file, settings=settings("weld.mod"))
    stretches = read_poses(file, SLIDES).stretches
    speeds = [float(stretch.speeds[0]) for stretch in stretches]
    np.testing.assert_allclose(speeds, [0.05 / 0.75, FEED, 0.05 / 0.75], rtol=1e-4)
    far = measured(plan, file)
    assert far.position <= program_deviation(plan, file)[1].path.position + ROUNDED


def test_clearances_decide_how_far_the_arm_may_be_off(abb: sm.RobotModel, tmp_path: Path) -> None:
    """Where the seam's certificate does not hold of few poses there are more, or times."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    end = SE3(begin.rotation, begin.translation + np.array([0.0, 0.2, 0.0]))
    seam = sm.paths.Feed(sm.paths.Line(begin, end, 3.0), FEED)
    plan = sm.plan(sm.Problem(abb, seam, "pointing", start, clearance=None)).require()
    file = tmp_path / "weld.mod"
    sm.files.write_motion(plan, file, settings=settings("weld.mod"))
    free = program_deviation(plan, file)[1].path.joint
    # Joint 6 has as much room as its own plan takes, and no more.
    q = plan.trajectory.q
    room = 0.01 * free
    limits = sm.constraints.JointPositionLimits(q.min(axis=0) - room, q.max(axis=0) + room)
    held = sm.Problem(abb, seam, "pointing", start, constraints=[limits], clearance=None)
    tight = replace(plan, problem=held)
    tight = replace(tight, certificate=tight.check()).require()
    sm.files.write_motion(tight, file, settings=settings("weld.mod"))
    motion = read_program(file, abb).motions(seam)[0]
    assert (motion.q >= q.min(axis=0) - room - 1e-6).all()
    assert (motion.q <= q.max(axis=0) + room + 1e-6).all()


@pytest.mark.parametrize("seconds", [1.05, 1.5, 4.0])
def test_even_ramps_take_what_is_planned(seconds: float) -> None:
    ramps = Ramps(1.0, seconds)
    times = np.linspace(0.0, seconds, 501)
    passed = ramps.nominal_times(times)
    assert passed[0] == 0.0
    assert passed[-1] == pytest.approx(1.0, abs=1e-12)
    assert (np.diff(passed) > 0.0).all()
    np.testing.assert_allclose(ramps.times(passed), times, atol=1e-6)
    # At both ends it rests, and it is fastest in the middle.
    rates = np.gradient(passed, times)
    assert max(rates[0], rates[-1]) < 0.1 * rates.max()
    assert rates[250] == pytest.approx(rates.max(), rel=1e-2)


def test_an_arc_is_the_circle_through_three_points() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        turn, radius = exp3(rng.normal(size=3)), float(rng.uniform(0.01, 2.0))
        angle, center = float(rng.uniform(0.1, 3.4)), rng.normal(size=3)

        ways = angle * np.array([0.0, float(rng.uniform(0.2, 0.8)), 1.0, 0.3])
        flat = np.stack([np.cos(ways), np.sin(ways), 0.0 * ways], axis=1)
        points = center + radius * flat @ turn.T
        arc = arc_through(*points[:3])
        assert arc is not None
        assert arc.length == pytest.approx(radius * angle, rel=1e-9)
        np.testing.assert_allclose(arc.at(np.array([0.3]))[0], points[3], atol=1e-9)
    first, last = np.zeros(3), np.array([1.0, 2.0, 3.0])
    assert arc_through(first, 0.4 * last, last) is None


def test_slow_motions_to_a_shifted_seam_are_judged(tmp_path: Path) -> None:
    """Moves from a stretched arm are joint targets: from there it goes slowly to shifted poses."""
    # A seam of any name is a seam.
    ur10 = robot_named("ur10")
    first = ur10.pose(ur10.dexterous_configuration("pointing"))
    last = SE3(first.rotation, first.translation + np.array([0.0, 0.1, 0.0]))
    seam = sm.Seam("slowly", sm.paths.Feed(sm.paths.Line(first, last, 1.0), 0.05), "pointing")
    home, low = ur10.home, sm.obstacles.Box("floor", [0.0, 0.0, -1.0], [3.0, 3.0, 0.1])
    clear = sm.constraints.Clearance([low], 0.01)
    made = sm.plan_job(ur10, [seam], start=home, end=home, branches=1, clearance=clear)
    program, file = made.require(), tmp_path / "weld.mod"
    sm.files.write_motion(program, file, settings=settings("weld.mod"))
    text = file.read_text()
    assert text.count("MoveAbsJ") > 10
    assert len(re.findall(r"MoveL .*_f1", text)) == 1
    file.write_text(text.replace('TRUE, "", [[0.0000,', 'TRUE, "", [[30.0000,'))
    found = judge_program(file, program)
    assert found.verified, found.verdict
    slow = [step for step in found.steps if step.name.startswith("slowly to")]
    assert [step.name for step in slow] == ["slowly to 'slowly'", "slowly to 'slowly → job end'"]
    # By what the moves have to keep: a floor that a seam may come nearer to than they.
    floor = sm.obstacles.Box("floor", [0.0, 0.0, 0.0], [3.0, 3.0, 0.1])
    steps = [
        replace(step, made=replace(step.made, constraints=(sm.constraints.Clearance([floor]),)))
        if isinstance(step.made, sm.Move)
        else step
        for step in program.steps
    ]
    strict = judge_program(file, replace(program, steps=tuple(steps)))
    told = {step.name: step.verified for step in strict.steps}
    assert not told["slowly to 'slowly'"]
    assert told["slowly"]


def test_an_event_in_a_ramp_keeps_its_time(tmp_path: Path) -> None:
    """Where the tool is then only the controller knows: the seam has times, and is told why."""
    ur5 = robot_named("ur5")
    first = ur5.pose(ur5.dexterous_configuration("pointing"))
    last = SE3(first.rotation, first.translation + np.array([0.0, 0.0, 0.1]))
    path = sm.paths.Feed(sm.paths.Line(first, last, 1.0), 0.2)
    events = [("gun on", 0.1), ("gun off", path.duration - 0.1)]
    seam = sm.Seam("seam", path, "pointing", events=events)
    made = sm.plan_job(ur5, [seam], order="given", branches=1, clearance=None)
    program, file = made.require(), tmp_path / "weld.mod"
    program.save(tmp_path / "a.program")
    sm.files.write_motion(program, file, settings=settings("weld.mod"))
    read = read_program(file, ur5)
    assert read.feed_tolerance is None
    assert read.timed_reasons == (
        "an event is where the tool is slower than its feed, or it is at no feed",
    )
    assert judge_program(file, program).verified
    (tmp_path / "cell.toml").write_text(
        'mass = 3\ntargets = "poses"\n'
        '[signals]\n"gun on" = ["doGun", true]\n"gun off" = ["doGun", false]\n'
    )
    asked = ("--out", file, "--settings", tmp_path / "cell.toml")
    code, text = invoke("export", tmp_path / "a.program", *asked)
    assert code == 0, text
    assert "a seam has times all the same: an event is where the tool is slower" in text


@pytest.mark.parametrize("name", FILES)
def test_feeds_that_change_are_a_motion_each(abb: sm.RobotModel, tmp_path: Path, name: str) -> None:
    """However much faster one is than the other: the way is the same."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    end = SE3(begin.rotation, begin.translation + np.array([0.02, 0.15, -0.03]))
    line, slower = sm.paths.Line(begin, end, 3.0), [(1.2, FEED), (1.5, 2.0 * FEED)]
    seam = sm.paths.Feed(line, 2.0 * FEED, stretches=slower)
    plan = sm.plan(sm.Problem(abb, seam, "pointing", start, clearance=None)).require()
    file = tmp_path / name
    sm.files.write_motion(plan, file, settings=settings(name))
    (stretch,) = read_poses(file, SLIDES).stretches
    np.testing.assert_allclose(stretch.speeds, [2.0 * FEED, FEED, 2.0 * FEED], rtol=1e-6)
    assert measured(plan, file).position <= program_deviation(plan, file)[1].path.position + ROUNDED
    read_program(file, abb).motions(seam)[0]
    # Without the targets where they change all of it is as fast as at its ends.
    whole = stretch_of(file, abb)
    alone = replace(
        whole,
        t=nominal_target_times(whole.positions[[0, -1]], whole.vias[:1], whole.speeds[:1]),
        q=whole.q[[0, -1]],
        positions=whole.positions[[0, -1]],
        quaternions=whole.quaternions[[0, -1]],
        speeds=whole.speeds[:1],
        vias=whole.vias[:1],
    )
    with pytest.raises(sm.errors.FileFormatError, match=r"at 60 mm/s .* its path at 30 mm/s"):
        alone.along(seam, 0.0)


def stretch_of(file: Path, robot: sm.RobotModel) -> FeedSegment:
    (stretch,) = read_program(file, robot).segments
    assert isinstance(stretch, FeedSegment)
    return stretch


def test_lines_are_judged_as_lines(abb: sm.RobotModel, tmp_path: Path) -> None:
    """Straight motions in place of a circular one are as far off as their chords."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    circle = sm.paths.Circle.around(abb.pose(start), 0.1, 4.0, normal=(0.0, 0.0, 1.0), turns=0.2)
    limits = [sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits()]
    seam = sm.paths.Feed(circle, FEED)
    problem = sm.Problem(abb, seam, "pointing", start, constraints=limits, clearance=None)
    plan = sm.plan(problem).require()
    file, cell, count = tmp_path / "weld.mod", tmp_path / "cell.toml", 8
    sm.files.write_problem(plan.problem, cell)
    sm.files.write_motion(plan, file, settings=settings("weld.mod"))
    text, whole = file.read_text(), stretch_of(file, abb)
    (arc,) = [item for item in text.splitlines() if "MoveC" in item]
    # Through as many points of it.
    times = np.linspace(0.0, whole.t[-1], 2 * count + 1)
    lines, place = [], arc_through(whole.positions[0], whole.vias[0], whole.positions[1])
    assert place is not None
    turn = re.findall(r"\], (\[[^\[\]]*\]), \[0, 0", text)[-1]
    for k, (x, y, z) in enumerate(1e3 * place.at(times / whole.t[-1])[2::2], 1):
        pose = (
            f"[[{x:.4f}, {y:.4f}, {z:.4f}], {turn}, [0, 0, 0, 0], [9E9, 9E9, 9E9, 9E9, 9E9, 9E9]]"
        )
        zone = "fine" if k == count else "z0"
        lines.append(f"    MoveL {pose}, weld_f1, {zone}, weld_t\\WObj:=weld_w;")
    file.write_text(text.replace(arc, "\n".join(lines)))
    far = 0.1 * (1.0 - np.cos(0.2 * np.pi / count))
    assert far > 3.0 * WITHIN.position
    code, told = invoke("check", file, "--robot", cell)
    assert code == 1, told
    assert told.startswith("not verified: 'torch' is")


@pytest.mark.parametrize("targets", ["poses", "timed-poses"])
@pytest.mark.parametrize("name", FILES)
def test_a_begin_that_was_changed_is_not_verified(
    line: sm.Plan, written: Written, tmp_path: Path, name: str, targets: str
) -> None:
    """From there the arm goes to the first pose on a way that nothing has judged."""
    file, cell = tmp_path / name, tmp_path / "cell.toml"
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
    sm.files.write_problem(replace(line.problem, constraints=limits), cell)
    file.write_text(written(line, name, targets=targets))
    text = file.read_text()
    first = re.search(r"(MoveAbsJ \[\[|PTP \{A1 |movej\(\[)([-\d.]+)", text)
    assert first is not None
    for more, code in ((0.1, 0), (20.0, 1)):
        value = float(first[2]) + (np.radians(more) if name == "weld.script" else more)
        file.write_text(text.replace(first[0], f"{first[1]}{value:.6f}", 1))
        found, told = invoke("check", file, "--robot", cell)
        assert found == code, told
    assert "its first axis target is 0.349 rad or m from where its first pose has the arm" in told


@pytest.mark.site
def test_seams_with_weaves_are_read_as_they_are_written(abb: sm.RobotModel, tmp_path: Path) -> None:
    """Their steps may be shorter than a zone."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    end = SE3(begin.rotation, begin.translation + np.array([0.02, 0.05, -0.01]))
    woven = sm.paths.Weave(sm.paths.Line(begin, end, 3.0), amplitude=0.003, pitch=0.02)
    seam = sm.paths.Feed(woven, 0.02)
    plan = sm.plan(sm.Problem(abb, seam, "pointing", start, clearance=None)).require()
    file = tmp_path / "weld.mod"
    sm.files.write_motion(plan, file, settings=settings("weld.mod"))
    stretch = stretch_of(file, abb)
    assert np.diff(stretch.lengths).min() < ZONE
    certificate = plan.problem.certify(read_program(file, abb).motions(seam)[0], WITHIN)
    assert certificate.position_error.value < WITHIN.position
    far = measured(plan, file)
    assert far.position <= program_deviation(plan, file)[1].path.position + ROUNDED


@pytest.mark.site
def test_where_no_poses_keep_a_feed_is_told_with_what_helps(
    abb: sm.RobotModel, tmp_path: Path
) -> None:
    """A corner that is rounded within less than the zones that controllers round."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    corner = begin.translation + np.array([0.0, 0.05, 0.0])
    places = [begin.translation, corner, corner + np.array([0.0, 0.0, 0.05])]
    turn = np.roll(Quaternion(begin.rotation).coeffs(), 1)
    legs = sm.paths.Polyline(places, [turn] * 3, tolerance=5e-5)
    seam = sm.paths.Feed(legs, FEED, within=0.9)
    plan = sm.plan(sm.Problem(abb, seam, "pointing", start, clearance=None)).require()
    file = tmp_path / "weld.mod"
    near = sm.Tolerance(2e-6, 2e-4)
    sm.files.write_motion(plan, file, settings=settings("weld.mod", deviation=near))
    (told,) = read_program(file, abb).timed_reasons
    found = re.search(r"near t = ([0-9.]+) s, at \(([-0-9., ]+)\) m, no poses", told)
    assert found is not None
    assert "tolerance = 0.002" in told
    assert "corners = 'stop'" in told
    assert "?" not in told
    at = np.array([float(value) for value in found[2].split(",")])
    # Three digits, and the corner's own size.
    assert np.linalg.norm(at - corner) < 2e-3
    assert np.linalg.norm(seam.pose(float(found[1])).translation - at) < 2e-3
    # Where more is allowed it is at its feed.
    sm.files.write_motion(plan, file, settings=settings("weld.mod"))
    assert not read_program(file, abb).timed_reasons


_CLAMPED = """
task = "pointing"
[robot]
name = "ur5"
tool_offset = { position_mm = [0, 0, 120] }
[workpiece]
frame = { position = [0.45, 0.0, 0.2] }
[[workpiece.obstacles]]
shape = "box"
name = "clamp"
position_mm = [40, 130, 60]
size_mm = [100, 20, 120]
[path]
kind = "line"
start = { position = [0, 0, 0], rpy_deg = [180, 0, 0] }
by_mm = [80, 0, 0]
feed_mm = 40
"""


def test_a_part_that_was_moved_is_moved_in_the_program_and_in_the_file(tmp_path: Path) -> None:
    """By the plan its path is shifted and obstacles are not, which is said; by the file neither."""
    cell, plan, file = tmp_path / "cell.toml", tmp_path / "weld.npz", tmp_path / "weld.mod"
    cell.write_text(_CLAMPED)
    sm.plan(sm.read_problem(cell)).require().save(plan)
    asked = sm.files.ProgramSettings(mass=2.0, targets="poses", work_object="path")
    sm.files.write_motion(sm.load_plan(plan), file, settings=asked)
    written = file.read_text()
    # The frame of the controller's base is turned by half a turn.
    shifted = written.replace('"", [[-450.0000, 0.0000,', '"", [[-450.0000, -60.0000,')
    assert shifted != written
    file.write_text(shifted)
    code, text, notes = in_full("check", file, "--robot", plan)
    assert code == 0, text
    assert "obstacles where they were planned" in notes
    moved = "workpiece.frame.position=[0.45, 0.06, 0.2]"
    code, text, notes = in_full("check", file, "--robot", cell, "--set", moved)
    assert code == 0, text
    assert "along the path where the file has it" in notes
    # With the part elsewhere again, and where the program stayed and the part did not.
    code, text = invoke("check", file, "--robot", cell, "--set", moved.replace("0.06", "0.03"))
    assert code == 1
    file.write_text(written)
    code, text = invoke("check", file, "--robot", cell, "--set", moved)
    assert code == 1
    assert "60 mm off the path" in text


def test_targets_that_are_led_back_from_a_part_that_was_moved_are_off_its_path(
    tmp_path: Path,
) -> None:
    """The tool goes where the plan has its path, and the part is elsewhere by now."""
    cell, plan, file = tmp_path / "cell.toml", tmp_path / "weld.npz", tmp_path / "weld.mod"
    cell.write_text(_CLAMPED)
    sm.plan(sm.read_problem(cell)).require().save(plan)
    asked = sm.files.ProgramSettings(mass=2.0, targets="poses", work_object="path")
    sm.files.write_motion(sm.load_plan(plan), file, settings=asked)
    text = file.read_text().replace('"", [[-450.0000, 0.0000,', '"", [[-450.0000, -60.0000,')
    for x in ("0.0000", "80.0000"):
        assert f"MoveL [[{x}, 0.0000," in text
        # The frame of the controller's base is turned by half a turn.
        text = text.replace(f"MoveL [[{x}, 0.0000,", f"MoveL [[{x}, -60.0000,")
    file.write_text(text)
    code, text = invoke("check", file, "--robot", plan)
    assert code == 1
    assert "60 mm off the path" in text
