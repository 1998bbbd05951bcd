"""Programs of controllers: what is stated of them holds, whichever way the targets are joined."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.certificate import Separation
from selfmotion.shell.cli import file_verification
from selfmotion.shop import controllers
from selfmotion.shop.controllers import (
    judge_program,
    judged_by_plan,
    program_deviation,
    read_program,
)
from selfmotion.shop.controllers.controller_axes import axes_of, tool_from_flange
from selfmotion.shop.controllers.deviations import NO_DEVIATION
from selfmotion.shop.controllers.operations import Operation
from selfmotion.shop.controllers.thinning import Section
from selfmotion.work.job import Step
from support.arms import PANDA_HOME, robot_named
from support.industrial import two_seams
from support.shell import invoke

SIGNALS = {"arc on": (7, True), "arc off": (7, False)}
NAMED = {"arc on": ("doArc", True), "arc off": ("doArc", False)}
FILES = ("weld.src", "weld.mod")
# The worst of the tool's error lies between the times at which the writer looks.
FINER = 1.02
# Each stretch is longer or shorter by half a digit of time, at some rad/s.
LATE = 2e-5
# Share of a limit of speed that targets may take; targets are no nearer than half of 2 ms [s].
FULL, CYCLE = 0.9995, 1e-3


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    return sm.plan(sm.Problem(panda, circle, start=PANDA_HOME, clearance=None)).require()


@pytest.fixture(scope="module")
def plans(plan: sm.Plan) -> dict[str, sm.Plan]:
    """A plan for each file: KRL is for arms of six axes, ABB has one of seven."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    circle = sm.paths.Circle.around(ur5.pose(start), 0.1, 3.0, normal=(1.0, 0.0, 0.0))
    problem = sm.Problem(ur5, circle, "pointing", start=start, clearance=None)
    return {".src": sm.plan(problem).require(), ".mod": plan}


@pytest.fixture(scope="module")
def program() -> sm.Program:
    """Two seams of a UR5, with an arc, moves and a wait."""
    return two_seams()


def settings(file: str, deviation: float = 2e-4) -> sm.files.ProgramSettings:
    signals = SIGNALS if file.endswith(".src") else NAMED
    return sm.files.ProgramSettings(
        sm.Tolerance(deviation, 10 * deviation), signals=signals, mass=3.0
    )


def krl_targets(text: str) -> tuple[list[list[float]], list[float]]:
    """By KSS 8.3 SI: parts share the time of their block in proportion."""
    code = "\n".join(line for line in text.splitlines() if not line.strip().startswith(";"))
    axes = ["A1", "A2", "A3", "A4", "A5", "A6", "E1"]
    begin = re.search(r"PTP (\{A1.*\})", code)
    assert begin is not None

    def values(aggregate: str) -> list[float]:
        found = dict(re.findall(r"([AE]\d) (\S+?)[,}]", aggregate))
        return [float(found[name]) for name in axes if name in found]

    targets, times = [values(begin[1])], [0.0]
    for block in re.findall(r"PTP_SPLINE(.*?)ENDSPLINE|WAIT SEC (\S+)", code, re.DOTALL):
        if block[1]:
            targets.append(targets[-1])
            times.append(times[-1] + float(block[1]))
            continue
        parts = [float(part) for part in re.findall(r"PART = (\S+)", block[0])]
        (whole,) = re.findall(r"TIME_BLOCK END = (\S+)", block[0])
        targets += [values(found) for found in re.findall(r"SPTP (\{.*\})", block[0])]
        times += [times[-1] + t * float(whole) / sum(parts) for t in np.cumsum(parts).tolist()]
    return targets, times


def rapid_targets(text: str) -> tuple[list[list[float]], list[float]]:
    """By ABB's manual: \\T is the time of each motion [s], 9E9 is no axis."""
    targets: list[list[float]] = []
    times: list[float] = []
    for line in text.splitlines():
        move = re.match(r"\s+MoveAbsJ \[\[(.*?)\], \[(.*?)\]\]\\NoEOffs, \w+(?:\\T:=(\S+))?,", line)
        wait = re.match(r"\s+WaitTime (\S+);", line)
        if move:
            row = [float(value) for value in f"{move[1]}, {move[2]}".split(",")]
            targets.append([value for value in row if value < 8.9e9])
            times.append((times[-1] if times else 0.0) + float(move[3] or 0.0))
        elif wait:
            targets.append(targets[-1])
            times.append(times[-1] + float(wait[1]))
    return targets, times


def joined(file: Path, names: tuple[str, ...], seventh: int | None) -> tuple[Array, Array]:
    """Return times and targets [rad] in the robot's order, by the makers' definitions."""
    parse = krl_targets if file.suffix == ".src" else rapid_targets
    targets, times = parse(file.read_text())
    q = np.radians(targets)
    order = list(range(len(names)))
    if seventh is not None:
        order = [*order[:seventh], len(names) - 1, *order[seventh : len(names) - 1]]
    return np.array(times), q[:, order]


@pytest.mark.parametrize("name", FILES)
def test_the_deviation_that_is_stated_holds(
    plans: dict[str, sm.Plan], tmp_path: Path, name: str
) -> None:
    plan = plans[Path(name).suffix]
    file, counts = tmp_path / name, []
    for deviation in (1e-3, 1e-4):
        sm.files.write_motion(plan, file, settings=settings(name, deviation))
        count, stated, found = program_deviation(plan, file)
        counts.append(count)
        # KUKA's LBR and ABB's IRB 14000 count the third of seven joints apart.
        t, q = joined(file, plan.robot.joint_names, seventh=2 if plan.robot.dof == 7 else None)
        assert len(t) == count + 1
        assert t[-1] == pytest.approx(plan.trajectory.duration, abs=1e-5)
        times = np.linspace(0.0, 0.999999 * t[-1], 4001)
        exact = plan.trajectory(times)
        lines = np.stack([np.interp(times, t, column) for column in q.T], axis=1)
        smooth = CubicSpline(t, q, bc_type="clamped")(times)
        place = plan.robot.chain.along
        for way in (lines, smooth):
            off = np.linalg.norm(place(way)[2] - place(exact)[2], axis=1).max()
            assert off <= FINER * stated.path.position
        assert found.path.position <= stated.path.position <= deviation
        # And it is used: fewer targets would not do.
        assert stated.path.position > 0.4 * deviation
    # The error of straight lines goes with the square of their length.
    assert 2.5 < counts[1] / counts[0] < 4.0


@pytest.mark.parametrize("name", FILES)
def test_what_is_read_is_what_was_written(
    plans: dict[str, sm.Plan], tmp_path: Path, name: str
) -> None:
    plan = plans[Path(name).suffix]
    file = tmp_path / name
    sm.files.write_motion(plan, file, settings=settings(name))
    again = sm.files.read_motion(file).of_joints(plan.robot.joint_names)
    t, q = joined(file, plan.robot.joint_names, seventh=2 if plan.robot.dof == 7 else None)
    np.testing.assert_allclose(again.t, t, atol=1e-9)
    np.testing.assert_allclose(again.q, q, atol=1e-12)
    within = sm.Tolerance(2e-4, 2e-3)
    assert plan.problem.certify(again, within).position_error.value < within.position
    # Another number, and the file is no longer what it states.
    text = file.read_text()
    middle = text.index("SPTP" if name.endswith("src") else "MoveAbsJ", len(text) // 2)
    moved = re.sub(
        r"(\d)\.(\d)", lambda m: f"{m[1]}.{(int(m[2]) + 5) % 10}", text[middle:], count=1
    )
    file.write_text(text[:middle] + moved)
    _, stated, found = program_deviation(plan, file)
    assert found.path.position > 2.0 * stated.path.position


@pytest.mark.parametrize("name", FILES)
def test_a_job_keeps_its_seams_events_and_waits(
    program: sm.Program, tmp_path: Path, name: str
) -> None:
    file = tmp_path / name
    sm.files.write_motion(program, file, settings=settings(name))
    text = file.read_text()
    for step in program.steps:
        assert f"step: {step.name.replace('→', '->')}" in text
    t, q = joined(file, program.robot.joint_names, seventh=None)
    np.testing.assert_allclose(q, program.trajectory(np.minimum(t, program.duration)), atol=LATE)
    motion = sm.files.read_motion(file)
    assert motion.duration == pytest.approx(program.duration, abs=1e-4)
    count, stated, found = program_deviation(program, file)
    assert found.path.position <= stated.path.position <= 2e-4
    assert count < len(program.trajectory.t)
    switched = r"\$OUT\[7\] = (TRUE|FALSE)" if name.endswith("src") else "SetDO doArc, ([01]);"
    assert re.findall(switched, text) == (["TRUE", "FALSE"] if "src" in name else ["1", "0"]) * 2
    # An output is switched at the target that is reached at its time.
    marks = [match.start() for match in re.finditer(switched, text)]
    for mark, (at, _, event) in zip(marks, program.events, strict=True):
        before = len(re.findall(r"SPTP|MoveAbsJ.*\\T|WAIT SEC|WaitTime", text[:mark]))
        ahead = event == "arc off" and name.endswith("src")
        assert t[before + ahead] == pytest.approx(at, abs=1e-4)


@pytest.fixture(scope="module")
def cornered() -> sm.Plan:
    """Return a motion of an arm that rests for an instant, at 1 s of 2."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    begin = ur5.pose(start)
    corner, end = begin.copy(), begin.copy()
    corner.translation = begin.translation - np.array([0.0, 0.0, 0.04])
    end.translation = corner.translation + np.array([0.0, 0.05, 0.0])
    path = sm.paths.Joined([sm.paths.Line(begin, corner, 1.0), sm.paths.Line(corner, end, 1.0)])
    return sm.plan(sm.Problem(ur5, path, "pointing", start, clearance=None)).require()


@pytest.mark.parametrize("at", [1.0, 1.0 + 1e-12, 1.0 - 1e-12, 0.6])
def test_where_the_arm_rests_controllers_stop(cornered: sm.Plan, tmp_path: Path, at: float) -> None:
    rests = float(np.abs(cornered.trajectory(at, 1)).max()) < 1e-6
    assert rests == (at != 0.6)
    step = Step("a", cornered, events=(("arc on", at), ("arc off", cornered.trajectory.duration)))
    made = sm.Program(cornered.robot, (step,), {})
    abb, kuka = tmp_path / "weld.mod", tmp_path / "weld.src"
    sm.files.write_motion(made, abb, settings=settings(abb.name))
    lines = [line.strip() for line in abb.read_text().splitlines()]
    before = lines[lines.index("SetDO doArc, 1;") - 1]
    if before.startswith("! step"):
        before = lines[lines.index("SetDO doArc, 1;") - 3]
    assert ("fine" in before) == rests
    # A stop in the middle, whatever happens there, besides the first target and the last.
    assert sum("fine" in line for line in lines) == 3
    sm.files.write_motion(made, kuka, settings=settings(kuka.name))
    text = kuka.read_text()
    assert text.count("PTP_SPLINE") == 2
    first = text.split("ENDSPLINE")[0]
    _, times = krl_targets(first + "ENDSPLINE")
    assert times[-1] == pytest.approx(1.0, abs=LATE)
    if rests:
        # At the very end of a block, or between the two.
        after = text.index("$OUT[7] = TRUE")
        assert first.count("SPTP", after) <= 1
        assert after < text.rindex("PTP_SPLINE")
    for file in (abb, kuka):
        _, stated, found = program_deviation(made, file)
        assert found.path.position <= stated.path.position <= 2e-4


@pytest.fixture(scope="module")
def past() -> sm.Move:
    """A move past a box, most of it at the full speed of a joint."""
    ur5 = robot_named("ur5")
    first = np.array([-1.2, -1.2, 1.4, -1.8, -1.5, 0.0])
    last = first + np.array([2.4, 0.2, 0.0, 0.0, 0.3, 0.0])
    box = sm.obstacles.Box("post", [0.9, 0.0, 0.1], [0.1, 0.1, 0.2])
    limits = (sm.constraints.JointVelocityLimits(1.5), sm.constraints.JointAccelerationLimits(6.0))
    asked = sm.constraints.Clearance([box], 0.005)
    return sm.move(ur5, first, last, constraints=limits, clearance=asked).require()


@pytest.mark.parametrize("name", FILES)
def test_free_moves_are_as_far_off_as_bodies_keep_apart(
    past: sm.Move, tmp_path: Path, name: str
) -> None:
    """However the controller joins the targets; the elbow and all else, not the tool alone."""
    file = tmp_path / name
    sm.files.write_motion(past, file, settings=settings(name, 1e-4))
    few, stated, found = program_deviation(past, file)
    assert stated.path == NO_DEVIATION
    assert found.moves.position <= stated.moves.position
    assert stated.moves.position > 5e-4
    (apart,) = (item for item in past.requirements if isinstance(item, Separation))
    (stretch,) = read_program(file).segments
    times = np.linspace(0.0, stretch.t[-1], 400)
    for way in stretch.interpolated(times):
        assert min(apart.model.distance(q).value for q in way) >= apart.distance
    # Where nothing else is said, and not for less.
    narrow = replace(settings(name, 1e-4), move_deviation=sm.Tolerance(1e-4, 1e-3))
    sm.files.write_motion(past, file, settings=narrow)
    many, stated, found = program_deviation(past, file)
    assert found.moves.position <= stated.moves.position <= 1e-4
    assert many > 1.5 * few


def test_targets_grow_with_the_root_of_the_error_where_a_motion_has_straight_parts(
    past: sm.Move, tmp_path: Path
) -> None:
    """Splines swing where long steps and short ones meet, and times have few digits."""
    counts = []
    for deviation in (1e-3, 1e-4, 1e-5):
        within = sm.Tolerance(deviation, 10 * deviation)
        asked = replace(settings("a.src"), move_deviation=within)
        sm.files.write_motion(past, tmp_path / "a.src", settings=asked)
        count, stated, _ = program_deviation(past, tmp_path / "a.src")
        assert stated.moves.position <= deviation
        counts.append(count)
    assert counts[1] < 4.0 * counts[0]
    assert counts[2] < 4.0 * counts[1]


def test_what_digits_forbid_is_said_in_words_of_the_file(past: sm.Move, tmp_path: Path) -> None:
    tiny = sm.Tolerance(1e-8, 1e-3)
    asked = replace(settings("a.src"), move_deviation=tiny)
    said = (
        r"'move': programs count angles in 1e-05°, which is up to .* mm and .*° of the tool; allow "
        r"more than move_deviation = \{ position_mm = 1e-05, "
    )
    with pytest.raises(sm.errors.ProblemError, match=said):
        sm.files.write_motion(past, tmp_path / "a.src", settings=asked)


@pytest.mark.parametrize("name", FILES)
def test_a_program_of_a_job_is_verified_by_its_job(
    program: sm.Program, tmp_path: Path, name: str
) -> None:
    """Step by step, at the deviation that is stated; and not once a target is elsewhere."""
    file, job = tmp_path / name, tmp_path / "a.program"
    program.save(job)
    sm.files.write_motion(program, file, settings=settings(name, 1e-3))
    code, text = invoke("check", file, "--robot", job, "--verbose")
    assert code == 0, text
    assert [line.split(":")[0] for line in text.splitlines()[:-1]] == [
        step.name for step in program.steps
    ]
    assert "verified: each step, and the whole" in text
    text = file.read_text()
    middle = text.index("SPTP" if name.endswith("src") else "MoveAbsJ", len(text) // 3)
    moved = re.sub(
        r"(\d)\.(\d)", lambda m: f"{m[1]}.{(int(m[2]) + 5) % 10}", text[middle:], count=1
    )
    file.write_text(text[:middle] + moved)
    found = judge_program(file, program).steps
    assert sum(not step.verified for step in found) == 1
    code, text = invoke("check", file, "--robot", job, "--verbose")
    assert code == 1
    assert f"not verified: 1 of {len(found)} steps" in text
    other = replace(program, steps=program.steps[:-1])
    with pytest.raises(sm.errors.FileFormatError, match="goes on with '"):
        judge_program(file, other)


def _cornered(feed: float) -> sm.Plan:
    """Return a plan of an arm of six joints along a rounded corner."""
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    first = ur5.pose(start)
    corner, last = first.copy(), first.copy()
    corner.translation = first.translation - np.array([0.0, 0.0, 0.1])
    last.translation = corner.translation + np.array([0.0, 0.1, 0.0])
    way = sm.paths.Polyline([x.translation for x in (first, corner, last)], tolerance=2e-3)
    limits = (
        sm.constraints.JointPositionLimits(),
        sm.constraints.JointVelocityLimits(),
        sm.constraints.JointAccelerationLimits(9.0),
    )
    path = sm.paths.Feed(way, feed)
    problem = sm.Problem(ur5, path, "position", start, constraints=limits, clearance=None)
    return sm.plan(problem).require()


@pytest.mark.parametrize("feed", [0.04, 0.005])
def test_export_and_check_say_the_same_of_feeds(feed: float, tmp_path: Path) -> None:
    """Of slow ones run-up and run-down are too short for targets no nearer than a cycle."""
    made, file = tmp_path / "made.npz", tmp_path / "weld.src"
    _cornered(feed).save(made)
    code, told = invoke("export", made, "--out", file)
    again, text = invoke("check", file, "--robot", made)
    assert code == again == int(feed < 0.02), (told, text)
    assert ("not verified: the feed of" in told) == ("not verified: the feed of" in text)
    assert ("linear motions (--set targets=poses)" in told) == bool(code)


_HUNG = """
task = "pointing"
clearance = false
[robot]
name = "ur5"
tool_offset = { position_mm = [0, 0, 120], rpy_deg = [0, 30, 0] }
base = { position = [0.2, 0.1, 1.5], rpy_deg = [180, 0, 40] }
[path]
kind = "file"
file = "line.csv"
feed_mm = 30
corners = "round"
tolerance_mm = 2
frame = { position = [0.55, -0.2, 0.9], rpy_deg = [0, 0, 15] }
"""


def test_rounded_corners_between_targets_keep_a_feed(tmp_path: Path) -> None:
    """Here only the motion through the middles of both sides lost it, in the path's own corner."""
    (tmp_path / "line.csv").write_text(
        "x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,-1\n60,0,0,0,0,-1\n60,40,0,0,0,-1\n"
    )
    (tmp_path / "hung.toml").write_text(_HUNG)
    made = sm.plan(sm.read_problem(tmp_path / "hung.toml")).require()
    file = tmp_path / "weld.src"
    sm.files.write_motion(made, file)
    certificate = judged_by_plan(read_program(file, made.robot), made)
    assert certificate.verified, certificate.verdict


@pytest.mark.parametrize(("name", "deviation"), [("weld.src", 1e-3), ("weld.mod", 1e-4)])
def test_a_program_of_a_plan_is_verified_as_it_is_written(
    name: str, deviation: float, tmp_path: Path
) -> None:
    """By the file of its problem, feed included, though only targets are known."""
    made = _cornered(0.05)
    problem = made.problem
    sm.files.write_problem(problem, tmp_path / "cell.toml")
    asked = settings(name, deviation)
    sm.files.write_motion(made, tmp_path / name, settings=asked)
    code, text = invoke("check", tmp_path / name, "--robot", tmp_path / "cell.toml", "-v")
    assert code == 0, text
    assert "feed (at least 0.049 m/s)" in text
    # Slower than it was written, it neither takes its time nor keeps the feed.
    late = (tmp_path / name).read_text()
    late = re.sub(r"(TIME_BLOCK END = )", r"\g<1>1", late)
    late = re.sub(r"\\T:=0", r"\\T:=1", late)
    (tmp_path / name).write_text(late)
    code, text = invoke("check", tmp_path / name, "--robot", tmp_path / "cell.toml", "-v")
    assert code == 1
    assert "feed (at least 0.049 m/s)" in text


def test_urscript_knows_tool_load_and_outputs(program: sm.Program, tmp_path: Path) -> None:
    file = tmp_path / "weld.script"
    sm.files.write_motion(program, file, settings=settings("weld.src").streamed)
    lines = file.read_text().splitlines()
    head = [line for line in lines if "servoj(" not in line]
    assert any(line.startswith("  set_tcp(p[0.0") for line in head)
    assert "  set_payload(3, [0, 0, 0])" in head
    assert any(re.match(r"  movej\(\[.*\], a=0.14, v=0.314\)", line) for line in head)
    outputs = [k for k, line in enumerate(lines) if "set_standard_digital_out(7" in line]
    assert [lines[k].endswith("True)") for k in outputs] == [True, False] * 2
    stream = [sum("servoj(" in line for line in lines[:k]) for k in outputs]
    # The arm follows 0.1 s late: its outputs are switched when it is there.
    late = [125.0 * (at + 0.1) for at, _, _ in program.events]
    np.testing.assert_allclose(stream, late, atol=1.0)
    # These arms have eight.
    beyond = sm.files.ProgramSettings(signals={"arc on": (8, True), "arc off": (8, False)})
    with pytest.raises(sm.errors.ProblemError, match="from 0 to 7"):
        sm.files.write_motion(program, file, settings=beyond)


def test_other_axes_are_in_mm_and_counted_apart(tmp_path: Path) -> None:
    tiago = robot_named("tiago")
    first = tiago.dexterous_configuration()
    last = first + np.array([0.1, *[0.2] * 7])
    move = sm.move(tiago, first, last, clearance=None).require()
    sm.files.write_motion(move, tmp_path / "lift.mod", settings=sm.files.ProgramSettings(mass=1.0))
    text = (tmp_path / "lift.mod").read_text()
    assert "E2 = torso_lift_joint [mm]" in text
    (begin,) = re.findall(r"MoveAbsJ \[\[.*?\], \[(.*?)\]\]", text)[:1]
    slide = begin.split(", ")[1]
    assert float(slide) == pytest.approx(1e3 * first[0], abs=1e-4)
    again = sm.files.read_motion(tmp_path / "lift.mod").of_joints(tiago.joint_names)
    np.testing.assert_allclose(again.q[-1], last, atol=1e-6)
    axes = {name: f"A{k}" for k, name in enumerate(tiago.joint_names[1:7], 1)}
    axes |= {tiago.joint_names[7]: "E1", tiago.joint_names[0]: "E3"}
    own = sm.files.ProgramSettings(axes=axes, mass=1.0)
    sm.files.write_motion(move, tmp_path / "lift.mod", settings=own)
    begin = re.search(r"MoveAbsJ \[\[.*?\], \[(.*?)\]\]", (tmp_path / "lift.mod").read_text())
    assert begin is not None
    assert [text == "9E9" for text in begin[1].split(", ")] == [False, True, False, *[True] * 3]
    # Its last joint but one is in the arm, whichever axis it is called.
    within = {name: f"A{k}" for k, name in enumerate(tiago.joint_names[2:], 1)}
    within |= {tiago.joint_names[3]: "E1", tiago.joint_names[1]: "A2"}
    within |= {tiago.joint_names[0]: "E2"}
    with pytest.raises(sm.errors.ProblemError, match=r"Java \(Sunrise\)"):
        sm.files.write_motion(
            move, tmp_path / "lift.src", settings=sm.files.ProgramSettings(axes=within)
        )
    for wrong, said in (
        ({"torso_lift_joint": "A1"}, "joint 'arm_1_joint' has no axis"),
        (axes | {"torso_lift_joint": "E1"}, "two joints are axis E1"),
        ({**axes, "torso_lift_joint": "A1", "arm_1_joint": "E3"}, "'torso_lift_joint' slides"),
        (axes | {"nose": "E4"}, "'nose' is none of its joints"),
    ):
        asked = sm.files.ProgramSettings(axes=wrong)
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.files.write_motion(move, tmp_path / "lift.src", settings=asked)


def test_settings_that_have_no_effect_are_refused_by_name(
    program: sm.Program, tmp_path: Path
) -> None:
    with pytest.raises(sm.errors.ProblemError, match="center: has no effect without a mass"):
        sm.files.ProgramSettings(center=(0.0, 0.1, 0.0))
    asked = settings("a.src")
    axes = {name: f"A{k}" for k, name in enumerate(program.robot.joint_names, 1)}
    for given in ({"axes": axes}, {"deviation": sm.Tolerance(1e-3, 1e-3)}):
        other = replace(asked, **given)
        with pytest.raises(sm.errors.ProblemError, match="axes have no effect on URScript"):
            sm.files.write_motion(program, tmp_path / "a.script", settings=other)
        assert other.streamed == asked.streamed


def test_what_is_not_verified_is_written_only_when_forced(
    plans: dict[str, sm.Plan], program: sm.Program, tmp_path: Path
) -> None:
    broken = replace(plans[".src"], altered="somebody changed it")
    unmade = replace(program, missing={"third": "out of reach"})
    for made in (broken, unmade):
        for name in (*FILES, "weld.csv"):
            file = tmp_path / name
            asked = settings(name) if name in FILES else None
            with pytest.raises(sm.errors.PlanError, match=r"is not written: .*force=True"):
                sm.files.write_motion(made, file, settings=asked)
            assert not file.exists()
            sm.files.write_motion(made, file, settings=asked, force=True)
            assert file.exists()
            file.unlink()
    with pytest.raises(sm.errors.ProblemError, match="settings have no effect"):
        sm.files.write_motion(program, tmp_path / "weld.csv", settings=settings("weld.src"))
    unmade.save(tmp_path / "a.program")
    asked = ("export", tmp_path / "a.program", "--out", tmp_path / "a.csv")
    code, text = invoke(*asked)
    assert code == 1
    assert "nothing is written: not verified: seam 'third' is not made" in text
    assert text.count("\n") == 1
    code, text = invoke(*asked, "--force")
    assert code == 1
    assert (tmp_path / "a.csv").exists()


def test_the_shell_writes_programs_and_confirms_them(program: sm.Program, tmp_path: Path) -> None:
    program.save(tmp_path / "a.program")
    (tmp_path / "kuka.toml").write_text(
        "mass = 3\ncenter_mm = [0, 0, 60]\napproach = 0.05\ndeviation = { position_mm = 0.2 }\n"
        '[signals]\n"arc on" = [7, true]\n"arc off" = [7, false]\n'
    )
    asked = ("export", tmp_path / "a.program", "--out", tmp_path / "weld.src")
    code, text = invoke(*asked, "--settings", tmp_path / "kuka.toml")
    assert code == 0, text
    assert re.search(r"read back: \d+ targets, between which the tool is at most 0\.\d+ mm", text)
    assert "CM {X 0.0000, Y 0.0000, Z 60.0000" in (tmp_path / "weld.src").read_text()
    with pytest.raises(
        sm.errors.ProblemError, match=r"'arc on' has no signal; .*--settings .*\[signals\]"
    ):
        invoke(*asked)
    # A signal of no event is named where it may be meant, one of another event is not.
    signals = {"arc on": (7, True), "arc of": (7, False)}
    with pytest.raises(
        sm.errors.ProblemError, match="'arc off' has no signal; nearest: 'arc of'; say"
    ):
        sm.files.write_motion(
            program, tmp_path / "b.src", settings=sm.files.ProgramSettings(signals=signals)
        )
    signals.pop("arc of")
    alike = {name: (7, True) for name in ("arc on", "arc off")}
    with pytest.raises(
        sm.errors.ProblemError, match="'arc on' and 'arc off' both switch 7 to True; one"
    ):
        sm.files.write_motion(
            program, tmp_path / "b.src", settings=sm.files.ProgramSettings(signals=alike)
        )
    with pytest.raises(sm.errors.ProblemError, match="'arc off' has no signal; say"):
        sm.files.write_motion(
            program, tmp_path / "b.src", settings=sm.files.ProgramSettings(signals=signals)
        )
    (tmp_path / "quiet.toml").write_text('[signals]\n"arc on" = false\n"arc off" = false\n')
    assert invoke(*asked, "--settings", tmp_path / "quiet.toml")[0] == 0
    assert "; event: arc on" in (tmp_path / "weld.src").read_text()
    with pytest.raises(sm.errors.ProblemError, match="--rate has no effect"):
        invoke(*asked, "--rate", "100")
    (tmp_path / "kuka.toml").write_text("mas = 3\n")
    with pytest.raises(sm.errors.FileFormatError, match=r"unknown key 'mas'.*nearest: 'mass'"):
        invoke(*asked, "--settings", tmp_path / "kuka.toml")


def test_lines_that_are_not_written_are_refused_by_number(
    plans: dict[str, sm.Plan], tmp_path: Path
) -> None:
    for name, line, said in (
        ("weld.src", "  CIRC {X 0, Y 0, Z 0}", "'CIRC {X 0, Y 0, Z 0}' is not read"),
        ("weld.src", "    SPTP {A1 0, A1 3}", "axis A1 is there twice|no TIME_BLOCK PART"),
        ("weld.src", "    TIME_BLOCK PART = -1", "there is no target before|above 0"),
        ("weld.mod", "    MoveL p1, v100, fine, tool0;", "'MoveL p1, v100, fine, tool0;'"),
        ("weld.mod", "    WaitTime 1;", "rest where it does not stop"),
    ):
        file = tmp_path / name
        sm.files.write_motion(plans[file.suffix], file, settings=settings(name))
        lines = file.read_text().splitlines()
        at = len(lines) // 2
        while not re.match(r"\s+(SPTP|MoveAbsJ)", lines[at]):
            at += 1
        file.write_text("\n".join([*lines[:at], line, *lines[at:]]))
        with pytest.raises(sm.errors.FileFormatError, match=rf"{name}: line {at + 1}: .*({said})"):
            sm.files.read_motion(file)
        file.write_text("\n".join(lines[:at]))
        with pytest.raises(sm.errors.FileFormatError, match="is the last one, expected END"):
            sm.files.read_motion(file)


def test_modules_are_called_as_controllers_allow(plans: dict[str, sm.Plan], tmp_path: Path) -> None:
    for name in ("2weld.src", "we ld.mod", f"{'w' * 25}.src", f"{'w' * 29}.mod", "wéld.src"):
        asked = sm.files.ProgramSettings(mass=1.0)
        with pytest.raises(sm.errors.FileFormatError, match="is no name: expected a letter"):
            sm.files.write_motion(plans[Path(name).suffix], tmp_path / name, settings=asked)
    for name in (f"{'w' * 24}.src", f"{'w' * 28}.mod"):
        asked = sm.files.ProgramSettings(mass=1.0)
        sm.files.write_motion(plans[Path(name).suffix], tmp_path / name, settings=asked)
        text = (tmp_path / name).read_text()
        assert max(len(word) for word in re.findall(r"\b[A-Za-z]\w*", text)) <= 32
        assert text.isascii()
        assert max(map(len, text.splitlines())) < 250


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6, 2e-5])
def test_events_near_each_other_and_the_ends_are_all_written(
    plans: dict[str, sm.Plan], tmp_path: Path, apart: float
) -> None:
    plan = plans[".src"]
    last = plan.trajectory.duration
    pairs = ((0.5, 0.5 + apart), (min(apart, 1e-6), last - apart), (0.0, last + 5e-10))
    for number, (on, off) in enumerate(pairs):
        step = Step("a", plan, events=(("arc on", on), ("arc off", off)))
        file = tmp_path / f"weld{number}.src"
        made = sm.Program(plan.robot, (step,), {})
        assert made.verified
        sm.files.write_motion(made, file, settings=settings("weld.src"))
        assert file.read_text().count("$OUT[7]") == 2
        sm.files.read_motion(file)


@pytest.mark.parametrize(("form", "name"), [("krl", "a.txt"), ("csv", "a.src"), ("rapid", "a.src")])
def test_programs_have_the_suffix_of_their_controller(
    plan: sm.Plan, tmp_path: Path, form: str, name: str
) -> None:
    with pytest.raises(sm.errors.FileFormatError, match="is written with"):
        sm.files.write_motion(plan, tmp_path / name, format=form)
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("name", ["for.src", "Loop.src", "test.mod", "proc.mod"])
def test_words_of_a_language_name_no_module(
    plans: dict[str, sm.Plan], tmp_path: Path, name: str
) -> None:
    asked = sm.files.ProgramSettings(mass=1.0)
    with pytest.raises(sm.errors.FileFormatError, match="is a word of the controller's language"):
        sm.files.write_motion(plans[Path(name).suffix], tmp_path / name, settings=asked)


def test_the_tool_of_an_arm_in_a_cell_is_that_of_the_arm_alone() -> None:
    alone = sm.load_robot("ur5", tool="tool0")
    cell = sm.load_robot({"arm": "ur5", "other": "z1"}, base={"other": np.eye(4)}, tool="arm/tool0")
    for robot in (alone, cell):
        at = tool_from_flange(robot, sm.files.ProgramSettings())
        np.testing.assert_allclose(at.homogeneous, np.eye(4), atol=1e-9)


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_judged_as_a_whole_by_its_job(
    program: sm.Program, tmp_path: Path, name: str
) -> None:
    """Its ends and its outputs, though each of its steps is verified."""
    file = tmp_path / name
    sm.files.write_motion(program, file, settings=settings(name, 1e-3))
    assert judge_program(file, program).verified
    text = file.read_text()
    lines = text.splitlines(keepends=True)
    switching = [k for k, line in enumerate(lines) if "$OUT[" in line or "SetDO" in line]
    assert len(switching) == len(program.events) == 4
    first, second = switching[:2]
    on, off = ("TRUE", "FALSE") if name.endswith("src") else (", 1;", ", 0;")
    without = lines[:first] + lines[first + 1 :]
    later = list(lines)
    effects = [re.search(r"\$OUT.*|SetDO.*", lines[k])[0] for k in (first, second)]
    later[first] = ""
    later[second] = lines[second].replace(effects[1], effects[0]) + lines[second]
    other = list(lines)
    other[first] = lines[first].replace(on, off)
    for spoilt, said in (
        (without, "it switches 3 times, the job 4 times"),
        (later, "event 'arc on' of 'seam 0' is at"),
        (other, "event 'arc on' switches"),
    ):
        file.write_text("".join(spoilt))
        found = judge_program(file, program)
        assert not found.verified
        assert said in "; ".join(found.failures), found.failures
        assert all(step.verified for step in found.steps)
    # Nor does what is switched off stay on.
    file.write_text(text.replace("= FALSE", "= TRUE").replace(", 0;", ", 1;"))
    assert "'arc on' and 'arc off' both switch" in judge_program(file, program).verdict
    file.write_text(text)
    said = judge_program(file, program).verdict
    assert re.search(
        r"and the whole; seams within 0\.9\d* mm and \S+ rad of their paths; acc", said
    )
    loose = replace(program, specification=replace(program.specification, start=None))
    assert judge_program(file, loose).verified
    wrong = replace(program, missing={"seam 9": "nobody knows"})
    assert "the job itself: seam 'seam 9'" in "; ".join(judge_program(file, wrong).failures)
    elsewhere = turned_smoothly(lines, program, 20.0)
    file.write_text("".join(elsewhere))
    assert "does not begin where it was asked to" in "; ".join(
        judge_program(file, program).failures
    )


def turned_smoothly(lines: list[str], program: sm.Program, by: float) -> list[str]:
    """Return a file whose first axis is turned in the first move, smoothly less towards its end."""
    found = list(lines)
    steps = [k for k, line in enumerate(lines) if "step:" in line]
    targets = [
        k for k, line in enumerate(lines[: steps[1]]) if re.search(r"PTP \{A1|MoveAbsJ \[\[", line)
    ]
    for share, k in zip(np.linspace(0.0, 1.0, len(targets)), targets, strict=True):
        more = by * (1.0 - share**3 * (10.0 - 15.0 * share + 6.0 * share**2))
        found[k] = re.sub(
            r"(\{A1 |MoveAbsJ \[\[)(-?[\d.]+)",
            lambda m, more=more: f"{m[1]}{float(m[2]) + more:.5f}",
            lines[k],
        )
    return found


def test_a_table_in_the_urdf_of_an_arm_is_no_wrist(tmp_path: Path) -> None:
    cell = sm.load_robot(
        {"arm": "ur5", "table": "positioner"}, tool="arm/tool0", reference="table/plate"
    )
    file = tmp_path / "cell.urdf"
    file.write_text(cell.urdf.text.replace("arm/", "arm_").replace("table/", "table_"))
    one = sm.load_robot(file, tool="arm_tool0", reference="table_plate", lock={"table_tilt": 0.0})
    with pytest.raises(
        sm.errors.ProblemError, match=r"'table_turn' does not carry the tool.*'A6'.*'E1'"
    ):
        axes_of(one, sm.files.ProgramSettings())
    assert [axis.name for axis in axes_of(cell, sm.files.ProgramSettings())][-2:] == ["E1", "E2"]


def test_what_is_read_back_is_held_in_turns_joints_and_outputs_as_well(
    program: sm.Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "weld.src"
    sm.files.write_motion(program, file, settings=settings("weld.src", 1e-3))
    assert file_verification._verify_program(program, file).verified
    count, stated, found = program_deviation(program, file)
    for k in range(3):
        path = list(found.path)
        path[k] = stated.path[k] + 1e-8
        off = count, stated, found._replace(path=type(found.path)(*path))
        monkeypatch.setattr(controllers, "program_deviation", lambda *_, off=off: off)
        assert not file_verification._verify_program(program, file).verified
    monkeypatch.undo()
    file.write_text(file.read_text().replace("= FALSE", "= TRUE"))
    kept, said = file_verification._verify_program(program, file)
    assert not kept
    assert "both switch '7' to True" in said


@pytest.mark.parametrize("form", ["joint {}", "gelenk_ä{}", "axis,{}", 'a"{}(1)'])
def test_names_of_joints_come_back_from_every_file(form: str, tmp_path: Path) -> None:
    from html import escape

    text, names = robot_named("ur5").urdf.text, robot_named("ur5").joint_names
    for k, name in enumerate(names, 1):
        text = text.replace(f'joint name="{name}"', f'joint name="{escape(form.format(k))}"')
    (tmp_path / "arm.urdf").write_text(text, encoding="utf-8")
    robot = sm.load_robot(tmp_path / "arm.urdf", tool="tool0")
    assert robot.joint_names == tuple(form.format(k) for k in range(1, 7))
    start = np.array([0.1, -1.3, 1.4, -1.6, -1.5, 0.2])
    end = robot.pose(start).copy()
    end.translation = end.translation + np.array([0.0, 0.05, 0.0])
    line = sm.paths.Line(robot.pose(start), end, 2.0)
    plan = sm.plan(sm.Problem(robot, line, "position", start, clearance=None))
    settings = sm.files.ProgramSettings(mass=1.0)
    for suffix in (".src", ".mod", ".csv", ".yaml", ".json", ".npz"):
        file = tmp_path / f"out{suffix}"
        sm.files.write_motion(plan, file, settings=settings if suffix == ".mod" else None)
        motion = sm.files.read_motion(file)
        assert motion.joint_names == robot.joint_names
        np.testing.assert_allclose(motion.q[0], start, atol=1e-6)


def test_targets_are_not_nearer_than_a_controller_s_cycle() -> None:
    """A joint as fast as its limit: the digits of angles pass it, however near targets are."""
    ur5 = robot_named("ur5")
    t = np.linspace(0.0, 2.0, 401)
    # It starts and stops smoothly and goes evenly in between.
    share = np.clip(np.minimum(t, 2.0 - t) / 0.4, 0.0, 1.0)
    ramp = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    slope = np.gradient(ramp, t)
    q = np.tile(ur5.dexterous_configuration("pointing"), (len(t), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    qd[:, 0], qdd[:, 0] = 0.3 * ramp, 0.3 * slope
    q[:, 0] += np.concatenate([[0.0], np.cumsum(0.5 * (qd[1:, 0] + qd[:-1, 0]) * np.diff(t))])
    motion = sm.Trajectory(t, q, qd, ur5.joint_names, qdd)
    speeds = np.abs(motion(np.linspace(0.0, 2.0, 4001), 1)).max(axis=0) / FULL
    operation = Operation("seam", motion, (), (ur5.chain,), speed_limits=np.maximum(speeds, 1e-9))
    slides = np.zeros(ur5.dof, dtype=bool)
    stretch, _ = Section(operation, slides, 0.0, 2.0).thinned(sm.Tolerance(1e-4, 1e-3))
    assert np.diff(stretch.t).min() >= CYCLE
