"""Linear programs: tool poses in a work object, judged by an interpolation and kinematics of ours.

See `support.played_programs` for the oracle.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3, Quaternion, exp3
from selfmotion.shop.controllers import (
    base_rotation_note,
    judge_program,
    program_deviation,
    program_files,
    read_program,
)
from selfmotion.shop.controllers.configurations import confdata, status_and_turn
from selfmotion.shop.controllers.controller_axes import axes_of
from selfmotion.shop.controllers.deviations import Deviation, Deviations, deviation_between
from selfmotion.shop.controllers.pose_numbers import ROUNDINGS
from selfmotion.shop.controllers.tool_frames import ToolFrames
from selfmotion.shop.controllers.work_objects import frame_of_paths
from support.arms import PANDA_HOME, robot_named
from support.industrial import industrial_arm, two_seams
from support.own_kinematics import Arm
from support.played_programs import off, placed, read_poses
from support.shell import complaint, invoke

FILES = ("weld.mod", "weld.src", "weld.script")
SIGNALS = {"arc on": (7, True), "arc off": (7, False)}
NAMED = {"arc on": ("doArc", True), "arc off": ("doArc", False)}
# A work object that is nowhere in particular.
WORK = SE3(exp3(np.array([0.1, -0.2, 0.7])), np.array([0.3, -0.1, 0.2]))
# Newton's method of the oracle, and digits of its numbers, leave this [m, rad].
ROUNDED = 2e-8


def settings(name: str, **more: object) -> sm.files.ProgramSettings:
    signals = NAMED if name.endswith(".mod") else SIGNALS
    return sm.files.ProgramSettings(mass=3.0, signals=signals, targets="poses", **more)


@pytest.fixture(scope="module")
def abb(tmp_path_factory: pytest.TempPathFactory) -> sm.RobotModel:
    return industrial_arm(tmp_path_factory.mktemp("abb"), "abb")


@pytest.fixture(scope="module")
def kuka(tmp_path_factory: pytest.TempPathFactory) -> sm.RobotModel:
    return industrial_arm(tmp_path_factory.mktemp("kuka"), "kuka", rail=True)


@pytest.fixture(scope="module")
def alone(abb: sm.RobotModel) -> sm.Plan:
    """A line of an arm of six axes whose rotation about the tool's axis is free."""
    start = np.radians([10.0, -20.0, 30.0, 20.0, 60.0, 15.0])
    begin = abb.pose(start)
    end = SE3(begin.rotation, begin.translation + np.array([0.02, 0.15, -0.03]))
    problem = sm.Problem(abb, sm.paths.Line(begin, end, 3.0), "pointing", start, clearance=None)
    return sm.plan(problem).require()


@pytest.fixture(scope="module")
def on_rail(kuka: sm.RobotModel) -> sm.Plan:
    """A circle of an arm on a rail, which is its redundancy."""
    start = np.append(0.3, np.radians([10.0, -80.0, 100.0, 20.0, 60.0, 15.0]))
    circle = sm.paths.Circle.around(kuka.pose(start), 0.06, 4.0, normal=(0.0, 0.3, 1.0))
    return sm.plan(sm.Problem(kuka, circle, "pose", start, clearance=None)).require()


@pytest.fixture(scope="module")
def turned() -> sm.Plan:
    """A circle on a plate that tilts and turns, in the plate's frame."""
    there = np.eye(4)
    there[:3, 3] = -0.6, -0.3, 0.0
    parts = {"arm": "ur5", "table": "positioner"}
    base = {"table": there}
    cell = sm.load_robot(parts, base=base, tool="arm/tool0", reference="table/plate")
    start = cell.dexterous_configuration("pose")
    circle = sm.paths.Circle.around(cell.chain.place(start), 0.05, 4.0, normal=(0.0, 0.0, 1.0))
    return sm.plan(sm.Problem(cell, circle, "pose", start, clearance=None)).require()


@pytest.fixture(scope="module")
def program() -> sm.Program:
    """Two seams of a UR5, with an arc, moves and a wait."""
    return two_seams()


def named(plan: sm.Plan | sm.Program) -> dict[str, str]:
    """Return joint → axis as six axes and external ones are counted."""
    return {axis.joint: axis.name for axis in axes_of(plan.robot, sm.files.ProgramSettings())}


SLIDES = {"E1": True, "E2": False}


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("deviation", [1e-4, 1e-3])
def test_what_controllers_make_of_poses_is_as_near_as_is_stated(
    alone: sm.Plan, tmp_path: Path, name: str, deviation: float
) -> None:
    file = tmp_path / name
    within = sm.Tolerance(deviation, 10.0 * deviation)
    sm.files.write_motion(alone, file, settings=settings(name, deviation=within, work_object=WORK))
    count, stated, found = program_deviation(alone, file)
    read = read_poses(file, SLIDES)
    flange = alone.robot.urdf.links[-2]
    measured = off(alone.robot, read, alone.trajectory, None, flange, named(alone))
    assert measured.position <= stated.path.position + ROUNDED
    assert measured.rotation <= stated.path.rotation + ROUNDED
    assert measured.joint <= stated.path.joint + ROUNDED
    assert found.path.position <= stated.path.position <= deviation
    assert max(stated.path.rotation, stated.path.joint) <= within.rotation
    # And it is used: fewer poses would not do. As many as joints take, about.
    assert max(stated.path.position / deviation, stated.path.joint / within.rotation) > 0.5
    joints = replace(settings(name, deviation=within), targets="joints")
    if name != "weld.script":
        sm.files.write_motion(alone, file, settings=joints)
        assert 0.5 < count / program_deviation(alone, file)[0] < 2.0


@pytest.mark.parametrize("name", FILES[:2])
def test_external_axes_hold_the_redundancy(on_rail: sm.Plan, tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    sm.files.write_motion(on_rail, file, settings=settings(name))
    _, stated, _ = program_deviation(on_rail, file)
    read = read_poses(file, SLIDES)
    measured = off(on_rail.robot, read, on_rail.trajectory, None, "flange", named(on_rail))
    assert measured.position <= stated.path.position + ROUNDED
    assert measured.joint <= stated.path.joint + ROUNDED
    text = file.read_text()
    rail = 1e3 * on_rail.trajectory.q[0, on_rail.robot.joint_names.index("rail")]
    assert f"{rail:.4f}".rstrip("0") in text


@pytest.mark.parametrize(("name", "unit"), [("weld.mod", "STN1"), ("weld.src", 2)])
def test_a_positioner_carries_its_work_object(
    turned: sm.Plan, tmp_path: Path, name: str, unit: str | int
) -> None:
    file = tmp_path / name
    with pytest.raises(sm.errors.ProblemError, match="say positioner = "):
        sm.files.write_motion(turned, file, settings=settings(name))
    sm.files.write_motion(turned, file, settings=settings(name, positioner=unit))
    _, stated, _ = program_deviation(turned, file)
    read = read_poses(file, {"E1": False, "E2": False})
    links = "table/plate", "arm/tool0"
    measured = off(turned.robot, read, turned.trajectory, *links, named(turned))
    assert measured.position <= stated.path.position + ROUNDED
    assert measured.joint <= stated.path.joint + ROUNDED
    text = file.read_text()
    said = '[FALSE, FALSE, "STN1", ' if unit == "STN1" else "EK(MACHINE_DEF[2].ROOT, MACHINE_DEF[2]"
    assert said in text
    with pytest.raises(sm.errors.FileFormatError, match="whose joint positions need the robot"):
        sm.files.read_motion(file)
    again = sm.files.read_motion(file, robot=turned.robot).of_joints(turned.robot.joint_names)
    within = sm.Tolerance(stated.path.position, max(stated.path.rotation, 1e-5))
    assert turned.problem.certify(again, within).position_error.value <= within.position


@pytest.mark.parametrize("name", FILES)
def test_units_of_verdicts_are_words_of_ascii(alone: sm.Plan, tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    sm.files.write_motion(alone, file, settings=settings(name))
    text = file.read_text()
    assert "?" not in text
    assert re.search(r"at most [\d.e-]+ um and", text)


def test_a_speed_is_declared_once(alone: sm.Plan, tmp_path: Path) -> None:
    file = tmp_path / "weld.mod"
    sm.files.write_motion(alone, file, settings=settings(file.name))
    text = file.read_text()
    (line,) = re.findall(r"^ *CONST speeddata weld_v :=.*$", text, re.MULTILINE)
    fast = re.sub(r"\[.*\]", "[5000, 500, 5000, 500]", line)
    file.write_text(text.replace(line, f"{fast}\n{line}"))
    with pytest.raises(sm.errors.FileFormatError, match="a speeddata 'weld_v' already"):
        read_program(file, alone.robot)


def test_the_last_base_counts(turned: sm.Plan, tmp_path: Path) -> None:
    """A controller that sets $BASE again has left the kinematic system that it named before."""
    file = tmp_path / "weld.src"
    sm.files.write_motion(turned, file, settings=settings(file.name, positioner=2))
    text = file.read_text()
    (carried,) = re.findall(r"^ *\$BASE = EK\(.*\)$", text, re.MULTILINE)
    alone = f"  $BASE = {carried[carried.rindex('{') : -1]}"
    file.write_text(text.replace(carried, f"{alone}\n{carried}"))
    assert read_program(file, turned.robot).segments
    file.write_text(text.replace(carried, f"{carried}\n{alone}"))
    with pytest.raises(sm.errors.FileFormatError, match="its work object stands in the world"):
        read_program(file, turned.robot)


@pytest.mark.parametrize("name", FILES)
def test_a_shifted_work_object_shifts_the_motion(alone: sm.Plan, tmp_path: Path, name: str) -> None:
    """By as much, in the world; and it is judged along the path that is shifted with it."""
    file, cell = tmp_path / name, tmp_path / "cell.toml"
    limits = (sm.constraints.JointPositionLimits(), sm.constraints.JointVelocityLimits())
    problem = replace(alone.problem, constraints=limits)
    sm.files.write_problem(problem, cell)
    sm.files.write_motion(alone, file, settings=settings(name, work_object=WORK))
    text = file.read_text()
    numbers = {
        "weld.mod": (r'(wobjdata .*?TRUE, "", \[\[)(\S+?),', 1e3, 4),
        "weld.src": (r"(\$BASE = \{X )(\S+?),", 1e3, 5),
        "weld.script": (r"(feature = p\[)(\S+?),", 1.0, 9),
    }
    pattern, scale, digits = numbers[name]
    before = sm.files.read_motion(file, robot=alone.robot)
    file.write_text(
        re.sub(pattern, lambda m: f"{m[1]}{float(m[2]) + 0.03 * scale:.{digits}f},", text)
    )
    assert file.read_text() != text
    after = sm.files.read_motion(file, robot=alone.robot)
    names, arm = alone.robot.joint_names, Arm(alone.robot)
    here, there = (
        placed(arm, motion.of_joints(names)(np.linspace(0.0, 3.0, 50)), None, "torch")
        for motion in (before, after)
    )
    shifted = there[:, :3, 3] - here[:, :3, 3]
    np.testing.assert_allclose(shifted, np.tile([0.03, 0.0, 0.0], (50, 1)), atol=1e-6)
    np.testing.assert_allclose(there[:, :3, :3], here[:, :3, :3], atol=1e-6)
    shift = read_program(file, alone.robot).shift
    assert shift is not None
    np.testing.assert_allclose(shift.translation, [0.03, 0.0, 0.0], atol=1e-6)
    code, said = invoke("check", file, "--robot", cell)
    assert code == 0, said
    # Somewhere that the arm does not reach it is refused, by the line of the pose.
    away = 2.0 * scale
    file.write_text(re.sub(pattern, lambda m: f"{m[1]}{float(m[2]) + away:.{digits}f},", text))
    with pytest.raises(
        sm.errors.FileFormatError, match=r"line \d+: the arm does not follow to this pose"
    ):
        sm.files.read_motion(file, robot=alone.robot)


@pytest.mark.parametrize("name", FILES)
def test_a_pose_that_was_touched_up_is_judged(alone: sm.Plan, tmp_path: Path, name: str) -> None:
    """One target a little elsewhere, and the file is off by as much."""
    file = tmp_path / name
    sm.files.write_motion(alone, file, settings=settings(name))
    lines = file.read_text().splitlines()
    where = [k for k, line in enumerate(lines) if re.match(r"\s+(MoveL|SPL|SLIN|movel)\b", line)]
    k = where[len(where) // 2]
    x = re.search(r"(MoveL \[\[|\{X |, p\[)(-?[\d.]+)", lines[k])
    assert x is not None
    more = 5e-4 * (1.0 if name == "weld.script" else 1e3)
    lines[k] = lines[k].replace(x[0], f"{x[1]}{float(x[2]) + more:.9f}", 1)
    file.write_text("\n".join(lines) + "\n")
    _, stated, found = program_deviation(alone, file)
    assert found.path.position > 4e-4 > 2.0 * stated.path.position


@pytest.mark.parametrize("name", FILES)
def test_a_job_keeps_its_seams_events_and_waits(
    program: sm.Program, tmp_path: Path, name: str
) -> None:
    file, job = tmp_path / name, tmp_path / "a.program"
    program.save(job)
    asked = settings(name, deviation=sm.Tolerance(1e-3, 1e-2))
    sm.files.write_motion(program, file, settings=asked)
    assert judge_program(file, program).verified, judge_program(file, program).verdict
    _, stated, _ = program_deviation(program, file)
    moves = tuple(step.name.replace("→", "->") for step in program.steps if not step.is_seam)
    read = read_poses(file, SLIDES)
    seams = off(program.robot, read, program.trajectory, "base", "tool0", named(program), moves)
    assert seams.position <= stated.path.position + ROUNDED
    whole = off(program.robot, read, program.trajectory, "base", "tool0", named(program))
    assert whole.position <= max(stated.path.position, stated.moves.position) + ROUNDED
    code, text = invoke("check", file, "--robot", job)
    assert code == 0, text
    assert "verified: each step, and the whole" in text
    # A shifted work object is judged along shifted paths; and said.
    content = file.read_text()
    shifts = {
        "weld.mod": ('TRUE, "", [[0.0000,', 'TRUE, "", [[5.0000,'),
        "weld.src": ("$BASE = {X 0.00000,", "$BASE = {X 5.00000,"),
        "weld.script": ("feature = p[0.000000000,", "feature = p[0.005000000,"),
    }
    file.write_text(content.replace(*shifts[name]))
    found = judge_program(file, program)
    assert "the work object is 5 mm and 0° from where it was planned" in found.verdict
    assert found.verified, found.verdict
    # An event at another time, and a seam that is lost.
    marks = {"weld.mod": "SetDO doArc, 1", "weld.src": "$OUT[7] = TRUE"}
    mark = marks.get(name, "set_standard_digital_out(7, True)")
    file.write_text(content.replace(mark, mark.replace("7", "6").replace("doArc", "doGas"), 1))
    assert not judge_program(file, program).verified


def test_a_seven_axis_arm_has_joint_targets_and_is_told_why(tmp_path: Path) -> None:
    panda = robot_named("panda")
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.05, 3.0, normal=(1.0, 0.0, 0.0))
    plan = sm.plan(sm.Problem(panda, circle, start=PANDA_HOME, clearance=None)).require()
    plan.save(tmp_path / "plan.npz")
    out = tmp_path / "weld.mod"
    asked = ("export", tmp_path / "plan.npz", "--out", out, "--set", "targets=poses")
    with pytest.raises(sm.errors.ProblemError, match=r"mass of what the flange carries.*mass=KG"):
        invoke(*asked)
    code, text = invoke(*asked, "--set", "mass=2")
    assert code == 0, text
    why = "poses do not keep the motion: joint 'panda_joint3' is in the arm itself"
    assert why in text
    assert why in " ".join(out.read_text().replace("! ..", "").replace("!", "").split())
    assert "MoveAbsJ" in out.read_text()
    assert "MoveL" not in out.read_text()
    with pytest.raises(
        sm.errors.ProblemError, match=r"'panda_joint3' is in the arm.*Java \(Sunrise\)"
    ):
        invoke("export", tmp_path / "plan.npz", "--out", tmp_path / "weld.src")


def test_an_arm_that_holds_the_part_has_joint_targets(tmp_path: Path) -> None:
    """Its tool stands still: a pose of it in the hand is no pose of a tool in a work object."""
    ur5 = sm.load_robot("ur5", tool="base", reference="tool0")
    start = ur5.dexterous_configuration("pointing")
    begin = ur5.chain.place(start)
    line = sm.paths.Line(
        begin, SE3(begin.rotation, begin.translation + np.array([0.03, 0.0, 0.0])), 1.0
    )
    plan = sm.plan(sm.Problem(ur5, line, "pointing", start, clearance=None)).require()
    sm.files.write_motion(plan, tmp_path / "held.mod", settings=settings("held.mod"))
    text = (tmp_path / "held.mod").read_text()
    assert "not all of A1 to A6 of ur5 carry its tool" in text
    assert "MoveL" not in text


def test_through_a_singular_wrist_joints_are_written(abb: sm.RobotModel, tmp_path: Path) -> None:
    """Axis 5 passes zero, where axes 4 and 6 are one: no pose says what they are."""
    first = np.radians([0.0, 10.0, 10.0, 30.0, 40.0, 0.0])
    last = np.radians([10.0, 10.0, 10.0, 30.0, -40.0, 0.0])
    move = sm.move(abb, first, last, clearance=None).require()
    t = move.motion.t
    straight = sm.paths.Waypoints(
        t,
        [abb.pose(q).translation for q in move.motion.q],
        [np.roll(Quaternion(abb.pose(q).rotation).coeffs(), 1) for q in move.motion.q],
    )
    assert straight.duration > 0.0
    sm.files.write_motion(move, tmp_path / "go.mod", settings=settings("go.mod"))
    text = (tmp_path / "go.mod").read_text()
    assert re.search(r"MoveAbsJ .*\\T:=", text)
    assert not re.search(r"MoveL .*\\T:=", text)
    again = sm.files.read_motion(tmp_path / "go.mod", robot=abb)
    np.testing.assert_allclose(again.q[-1], last, atol=1e-6)


def test_configurations_are_those_of_the_makers(abb: sm.RobotModel, kuka: sm.RobotModel) -> None:
    """Known ones: the home of an IRB 120, KUKA's home; and each of the singularities passed."""
    frames = ToolFrames.of(
        abb, axes_of(abb, sm.files.ProgramSettings()), sm.files.ProgramSettings()
    )
    for degrees, expected in (
        ((0, 0, 0, 0, 30, 0), (0, 0, 0, 0)),
        ((0, 0, 0, 0, -30, 0), (0, 0, 0, 1)),
        ((-10, 0, 0, 100, 30, 200), (-1, 1, 2, 0)),
        # Bent back over the stretched arm, and past axis 1.
        ((0, 60, -108, 0, 30, -100), (0, 0, -2, 2)),
        ((0, -100, 60, 0, 30, 0), (0, 0, 0, 4)),
        ((0, -60, -100, 0, -30, 0), (0, 0, 0, 7)),
    ):
        assert confdata(frames, np.radians(degrees)) == expected
    on_rail = ToolFrames.of(
        kuka, axes_of(kuka, sm.files.ProgramSettings()), sm.files.ProgramSettings()
    )
    for degrees, expected in (
        ((0, -90, 90, 0, 0, 0), (2, 0b000010)),
        ((-1, -90, 90, 0, 10, -1), (2, 0b100011)),
        ((0, -90, 90, 0, -1, 0), (6, 0b010010)),
        ((0, -40, -20, 0, 5, 0), (0, 0b000110)),
        ((0, -170, 20, 0, 5, 0), (3, 0b000010)),
    ):
        assert status_and_turn(on_rail, np.append(0.1, np.radians(degrees))) == expected
    # Of these no number is made up.
    ur5 = robot_named("ur5")
    other = ToolFrames.of(ur5, axes_of(ur5, sm.files.ProgramSettings()), sm.files.ProgramSettings())
    q = np.radians([10.0, -60.0, 60.0, -60.0, -80.0, 5.0])
    assert confdata(other, q) == (0, -1, 0, None)
    assert status_and_turn(other, q)[0] is None
    assert status_and_turn(frames, np.radians([0, 0, 0, 0, 30, 0]))[0] is None
    assert confdata(on_rail, np.zeros(7))[3] is None


@pytest.mark.parametrize("form", ["krl", "rapid", "urscript"])
def test_numbers_of_poses_are_read_as_they_are_written(form: str) -> None:
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(4)
    turns = np.vstack([Rotation.random(40, rng).as_quat(), np.eye(4), -np.eye(4)])
    # KUKA's B at ±90°, where A and C are one.
    upright = Rotation.from_euler("ZYX", [[30, 90, 0], [30, -90, 20]], degrees=True).as_quat()
    turns = np.vstack([turns, upright])
    places = rng.uniform(-3.0, 3.0, (len(turns), 3))
    again, turned_again = ROUNDINGS[form](places, turns)
    np.testing.assert_allclose(again, places, atol=1e-7)
    apart = (Rotation.from_quat(turned_again) * Rotation.from_quat(turns).inv()).magnitude()
    assert apart.max() < 3e-7
    twice = ROUNDINGS[form](again, turned_again)
    np.testing.assert_allclose(twice[0], again, atol=1e-12)


def test_settings_of_poses_say_what_is_wrong(alone: sm.Plan, tmp_path: Path) -> None:
    for given, said in (
        ({"targets": "lines"}, "expected one of 'joints', 'poses', 'timed-poses'"),
        ({"work_object": "table"}, "no effect on joint targets; give targets='poses'"),
        ({"targets": "poses", "positioner": 0}, "its number in MACHINE_DEF"),
        ({"targets": "poses", "work_object": np.zeros((4, 4))}, "work_object: its rotation"),
    ):
        with pytest.raises(sm.errors.ProblemError, match=said):
            sm.files.ProgramSettings(**given)
    asked = settings("a.mod", work_object="link_3")
    with pytest.raises(
        sm.errors.ProblemError, match="'link_3' moves with joint 'a1', which carries"
    ):
        sm.files.write_motion(alone, tmp_path / "a.mod", settings=asked)
    (tmp_path / "cell.toml").write_text(
        'mass = 2\ntargets = "poses"\n'
        "work_object = { position_mm = [1, 2, 3], rpy_deg = [0, 0, 90] }\n"
    )
    read = sm.files.read_program_settings(tmp_path / "cell.toml")
    assert isinstance(read.work_object, SE3)
    np.testing.assert_allclose(read.work_object.translation, [1e-3, 2e-3, 3e-3])
    # What a file cannot say by itself, an option may make right.
    (tmp_path / "unit.toml").write_text("positioner = 2\n")
    with pytest.raises(sm.errors.FileFormatError, match="positioner: has no effect on joint"):
        sm.files.read_program_settings(tmp_path / "unit.toml")
    assert sm.files.read_program_settings(tmp_path / "unit.toml", targets="poses").positioner == 2
    held = tmp_path / "held.toml"
    held.write_text('positioner = "STN1"\ncenter = [0, 0, 0.1]\n')
    # What is given besides counts before the file is judged.
    given = sm.files.read_program_settings(held, targets="poses", mass=3.0)
    assert (given.targets, given.positioner, given.mass) == ("poses", "STN1", 3.0)
    with pytest.raises(sm.errors.FileFormatError, match="has no effect without a mass"):
        sm.files.read_program_settings(held, targets="poses")
    alone.save(tmp_path / "plan.npz")
    out = tmp_path / "a.src"
    asked = ("export", tmp_path / "plan.npz", "--out", out, "--set", "targets=poses")
    work_object = (
        "work_object={position=[0.1, 0.2, 0.3], rotation_vector=[0, 0, 1.5707963267948966]}"
    )
    code, text = invoke(*asked, "--set", work_object)
    assert code == 0, text
    assert "$BASE = {X 100.00000, Y 200.00000, Z 300.00000, A 90.00000, B " in out.read_text()
    with pytest.raises(sm.errors.ProblemError, match=r"targets=poses: is of controllers' programs"):
        invoke(
            "export", tmp_path / "plan.npz", "--out", tmp_path / "a.csv", "--set", "targets=poses"
        )


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("a.mod", r"(?<=0\], )\[9E9, 9E9", "[5, 9E9", "has external axes E1, expected none"),
        ("a.mod", r"MoveL \[\[[^,]*, ", "MoveL [[", "trans has 2 numbers, expected 3"),
        ("a.mod", r"! poses: .*", "!", "poses need the comment 'poses: work object"),
        ("a.src", r"  LIN \{.*", "", "a pose after axis targets, expected a slow motion"),
        ("a.src", r"    SPL \{X [^,]*, ", "    SPL {", "has no X"),
        ("a.src", r"    SPL \{.*", "    SPTP {A1 1}", "SPLINE has SPL and SLIN"),
        ("a.script", r"pose_trans\(feature, p\[[^,]*, ", "pose_trans(feature, p[", "has 5 numbers"),
        ("a.script", r"  movel\(.*", "  servoj([0])", "a stream of servoj is not read"),
    ],
)
def test_what_is_not_meant_is_refused(
    alone: sm.Plan, tmp_path: Path, name: str, old: str, new: str, said: str
) -> None:
    file = tmp_path / name
    sm.files.write_motion(alone, file, settings=settings(name))
    text = file.read_text()
    changed = re.sub(old, lambda _: new, text, count=1 if "LIN" in old or "!" in old else 0)
    assert changed != text
    file.write_text(changed)
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_motion(file, robot=alone.robot)


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("arm", ["ur5", "ur10"])
def test_out_of_and_into_a_singular_home_joints_are_written(
    arm: str, name: str, tmp_path: Path
) -> None:
    """Home of these arms is straight up, elbow and wrist at zero: poses there say too little."""
    robot = robot_named(arm)
    home = np.array(sm.NAMED_ARMS[arm].home)
    goals = home + np.random.default_rng(5).uniform(-1.2, 1.2, (3, 6))
    for k, goal in enumerate(goals):
        ends = (home, goal) if k % 2 == 0 else (goal, home)
        move = sm.move(robot, *ends, clearance=None).require()
        file = tmp_path / name
        sm.files.write_motion(move, file, settings=settings(name))
        assert not re.search(r"movel|MoveL|\bSPL\b|\bLIN\b", file.read_text())
        _, stated, found = program_deviation(move, file)
        assert np.all(np.array(found.moves) <= np.array(stated.moves) + ROUNDED)


@pytest.mark.parametrize("name", FILES)
def test_a_job_from_home_to_home_is_read_as_it_is_written(name: str, tmp_path: Path) -> None:
    ur5 = robot_named("ur5")
    home = np.array(sm.NAMED_ARMS["ur5"].home)
    facing = np.diag([1.0, -1.0, -1.0])
    begin, end = (SE3(facing, np.array([x, 0.1, 0.2])) for x in (0.4, 0.45))
    seam = sm.Seam("weld", sm.paths.Feed(sm.paths.Line(begin, end, 1.0), 0.05), task="pointing")
    given = {"start": home, "end": home, "branches": 1, "clearance": None}
    job = sm.plan_job(ur5, [seam], **given).require()
    file = tmp_path / name
    sm.files.write_motion(job, file, settings=settings(name))
    assert judge_program(file, job).verified
    # The seam keeps its poses, which a shop can shift.
    assert re.search(r"movel\(|MoveL |SLIN ", file.read_text())


def test_what_is_not_read_as_it_is_written_is_written_by_joints(
    alone: sm.Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where poses are off when a file is read again, whatever for, no such file is left."""
    read = program_files.program_deviation
    off = Deviations(Deviation(1.0, 0.0, 0.0), Deviation(0.0, 0.0, 0.0))
    asked = settings("a.mod")

    def spoilt(plan: sm.Plan, file: Path) -> tuple[int, Deviations, Deviations]:
        count, stated, found = read(plan, file)
        return count, stated, off if "MoveL" in file.read_text() else found

    monkeypatch.setattr(program_files, "program_deviation", spoilt)
    sm.files.write_motion(alone, tmp_path / "a.mod", settings=asked)
    text = (tmp_path / "a.mod").read_text()
    assert "MoveL" not in text
    assert "read again" in text
    assert list(tmp_path.iterdir()) == [tmp_path / "a.mod"]


def test_joints_that_no_pose_gives_are_infinitely_far_off(abb: sm.RobotModel) -> None:
    q = np.zeros((2, 6))
    unknown = np.array([np.zeros(6), np.full(6, np.nan)])
    assert deviation_between(unknown, q, [abb.chain]).position == np.inf
    assert deviation_between(q, q, [abb.chain]).position == 0.0


@pytest.mark.parametrize("name", FILES)
def test_the_frame_of_the_path_may_be_the_work_object(name: str, tmp_path: Path) -> None:
    """In it poses are the numbers of the table, wherever the table lies, and the base is turned."""
    ur5 = robot_named("ur5")
    facing = np.diag([1.0, -1.0, -1.0])
    begin, end = (SE3(facing, np.array([x, 0.02, 0.01])) for x in (0.0, 0.05))
    lies = SE3(exp3(np.array([0.0, 0.0, 0.3])), np.array([0.4, 0.1, 0.2]))
    path = sm.paths.Placed(sm.paths.Feed(sm.paths.Line(begin, end, 1.0), 0.05), lies)
    plan = sm.plan(sm.Problem(ur5, path, "pointing", clearance=None)).require()
    file = tmp_path / name
    sm.files.write_motion(plan, file, settings=settings(name, work_object="path"))
    (stretch,) = read_program(file, ur5).segments
    np.testing.assert_allclose(stretch.positions[0], begin.translation, atol=2e-7)
    np.testing.assert_allclose(stretch.positions[-1], end.translation, atol=2e-7)
    # And it is where the table lies, by a chain that the program knows nothing of.
    base = ur5.chain_to("base").place(np.zeros(6))
    found = base * stretch.frames.work
    np.testing.assert_allclose(found.homogeneous, lies.homogeneous, atol=1e-6)


def test_what_work_objects_cannot_be_is_said(alone: sm.Plan, tmp_path: Path) -> None:
    with pytest.raises(sm.errors.ProblemError, match=r"600 m is far from any arm.*position_mm"):
        settings("a.mod", work_object=SE3(np.eye(3), np.array([600.0, -100.0, 200.0])))
    # Nearer than that, and still in millimetres: no arm reaches there.
    in_mm = settings("a.mod", work_object=SE3(np.eye(3), np.array([30.0, 0.0, 0.0])))
    with pytest.raises(sm.errors.ProblemError, match=r"30 m away, but the arm reaches .*in m"):
        sm.files.write_motion(alone, tmp_path / "a.mod", settings=in_mm)
    with pytest.raises(sm.errors.ProblemError) as error:
        sm.files.write_motion(alone, tmp_path / "a.mod", settings=settings("a", work_object="part"))
    assert "work_object 'part' is none of its links" in str(error.value)
    assert ".urdf" not in str(error.value)
    line = sm.paths.Line(np.eye(4), SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), 1.0)
    moved = SE3(np.eye(3), np.array([0.0, 0.1, 0.0]))
    with pytest.raises(sm.errors.ProblemError, match="several frames, expected one"):
        frame_of_paths([line, sm.paths.Placed(line, moved)])


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            "{position=[600, -100, 200]}",
            "work_object: 600 m is far from any arm, expected at most 50; in millimetres",
        ),
        ("{position=[0.6, -0.1, 0.2], rotation_vector=[0, 0, 90]}", "90 rad is more than a turn"),
        (
            "{position=[0.6, -0.1, 0.2], rotation_vector=[3, 2, 0]}",
            "more than half a turn; in degrees, or angles about axes",
        ),
    ],
)
def test_numbers_of_work_objects_in_other_units_are_refused(given: str, said: str) -> None:
    typed = ("--out", "a.src", "--set", "targets=poses", "--set", f"work_object={given}")
    assert said in complaint("export", "any.npz", *typed)


def test_a_base_that_is_turned_is_told() -> None:
    assert "'base', the controller's frame, which is rotated by 180°" in base_rotation_note(
        robot_named("ur5")
    )
    assert not base_rotation_note(robot_named("panda"))
