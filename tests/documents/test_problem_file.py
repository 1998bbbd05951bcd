"""Problem files: what they say is what is planned, and they round-trip."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pinocchio as pin
import pytest

import selfmotion as sm
from selfmotion.basics import read_document
from selfmotion.shell.documents import example_text, grid_documents, json_schema, plan_request_of
from support.arms import PANDA_HOME, robot_named
from support.cells import CELL, written
from support.files_of_people import reaching_arm
from support.places import ROOT
from support.shell import complaint, invoke

# No pose is known to more digits after roll, pitch and yaw.
ROUNDING = 1e-12


def same_motion(one: sm.Plan, other: sm.Plan, tolerance: float = 0.0) -> None:
    np.testing.assert_array_equal(one.trajectory.t, other.trajectory.t)
    np.testing.assert_allclose(one.trajectory.q, other.trajectory.q, rtol=0, atol=tolerance)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> sm.files.PlanRequest:
    return sm.files.read_job(written(tmp_path_factory.mktemp("cell"), CELL))


def test_a_file_says_what_python_says(job: sm.files.PlanRequest) -> None:
    panda = sm.load_robot("panda", lock={"panda_finger_joint1": 0.02})
    circle = sm.paths.Circle.around(panda.pose(PANDA_HOME), 0.1, 4.0, normal=(1.0, 0.0, 0.0))
    turned = pin.SE3(pin.rpy.rpyToMatrix(np.array([0, 0, np.pi / 18])), np.array([0, -0.6, 0.6]))
    problem = sm.Problem(
        panda,
        circle,
        start=PANDA_HOME,
        null_motion=sm.motion.FreeNullMotion(),
        costs=[sm.costs.JointVelocity(), sm.costs.InverseManipulability(0.001)],
        constraints=[sm.constraints.JointPositionLimits()],
        clearance=sm.constraints.Clearance(
            [sm.obstacles.Box("post", turned, [0.1, 0.1, 1.2])], 0.01
        ),
        relaxations=[sm.Relaxation(("rx", "ry"), np.pi / 36)],
    )
    said = sm.plan(problem, max_evaluations=50, tolerance=sm.Tolerance(position=1e-5))
    same_motion(job.plan(), said, ROUNDING)


@pytest.mark.parametrize("name", ["again.toml", "again.json"])
def test_written_problems_give_the_same_plan(
    job: sm.files.PlanRequest, tmp_path: Path, name: str
) -> None:
    sm.files.write_problem(job.problem, tmp_path / name)
    again = sm.read_problem(tmp_path / name)
    same_motion(sm.plan(again, **job.settings), job.plan())


def test_problems_of_all_kinds_round_trip(tmp_path: Path) -> None:
    panda, file = robot_named("panda"), tmp_path / "problem.toml"
    base = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.4, 0.5, 0.6]))
    held = sm.load_robot("panda", base=base, tool_offset=pin.SE3(np.eye(3), np.array([0, 0, 0.1])))
    start = held.dexterous_configuration()
    line = sm.paths.Line(held.pose(start), held.pose(start + 0.05), 2.0)
    seam = sm.paths.Waypoints([0, 1, 2], [line.pose(t).translation for t in (0.0, 1.0, 2.0)])
    problems = [
        sm.sample_problem(),
        sm.Problem(held, line, start=start, clearance=None),
        sm.Problem(
            panda,
            sm.paths.Placed(seam, base.inverse()),
            "position",
            null_motion=sm.motion.BSplineNullMotion(6),
            costs=[
                sm.costs.GravityTorque(panda),
                sm.costs.JointAcceleration([1, 2, 3, 4, 5, 6, 7]),
            ],
            constraints=[
                sm.constraints.JointAccelerationLimits(5.0),
                sm.constraints.JointVelocityLimits(1.0, replace=True),
            ],
            relaxations=[sm.Relaxation("z", during=(0.5, 1.5))],
            damping=sm.Damping(),
            clearance=sm.constraints.Clearance(disabled=[("panda_link0", "panda_link2")]),
        ),
    ]
    for problem in problems:
        sm.files.write_problem(problem, file)
        read = sm.read_problem(file)
        for t in (0.0, 0.3, 0.9):
            np.testing.assert_array_equal(
                read.path.pose(t).homogeneous, problem.path.pose(t).homogeneous
            )
        q = problem.robot.dexterous_configuration("planar") * 0.9
        np.testing.assert_allclose(
            read.robot.pose(q).homogeneous, problem.robot.pose(q).homogeneous, atol=ROUNDING
        )
        for name in ("costs", "constraints", "relaxations"):
            one, other = getattr(read, name), getattr(problem, name)
            assert [item.to_dict() for item in one] == [item.to_dict() for item in other]
        assert read.null_motion == problem.null_motion
        assert read.damping == problem.damping
        assert (read.clearance is None) == (problem.clearance is None)
        text = file.read_text()
        sm.files.write_problem(read, file)
        if problem.robot is not held:
            assert file.read_text() == text


def test_a_base_and_a_tool_offset_move_what_they_should(tmp_path: Path) -> None:
    base = pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.4, 0.5, 0.6]))
    offset = pin.SE3(pin.exp3(np.array([0.3, 0.2, 0.1])), np.array([0.0, 0.01, 0.1]))
    plain = robot_named("panda")
    placed = sm.load_robot("panda", base=base, tool_offset=offset)
    wanted = base * plain.pose(PANDA_HOME) * offset
    np.testing.assert_allclose(placed.pose(PANDA_HOME).homogeneous, wanted.homogeneous, atol=1e-12)
    plan = sm.plan(
        sm.Problem(placed, sm.paths.Circle.around(wanted, 0.05, 3.0), start=PANDA_HOME)
    ).require()
    plan.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified
    assert not sm.load_plan(tmp_path / "plan.npz").certificate.notes


XACRO = """<robot name="two" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="long" default="1"/><link name="root"/>
<xacro:macro name="part" params="a b"><joint name="j_${b}" type="revolute">
<parent link="${a}"/><child link="${b}"/><axis xyz="0 0 1"/><origin xyz="$(arg long) 0 0"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint><link name="${b}"/></xacro:macro>
<xacro:part a="root" b="one"/><xacro:part a="one" b="two"/><xacro:part a="two" b="three"/>
<joint name="t" type="fixed"><parent link="three"/><child link="tool"/><origin xyz="1 0 0"/></joint>
<link name="tool"/></robot>"""


def test_xacro_files_are_expanded(tmp_path: Path) -> None:
    written(tmp_path, XACRO, "arm.xacro")
    cell = """
    task = "planar"
    start = [0.1, 0.5, 0.5]
    robot = { file = "arm.xacro", arguments = { long = 2 } }
    path = { kind = "line", by_mm = [-300, 0, 0], duration = 5 }
    """
    problem = sm.read_problem(written(tmp_path, cell))
    assert problem.robot.pose(np.zeros(3)).translation[0] == pytest.approx(7.0)
    assert not problem.robot.urdf.has_changed()
    written(tmp_path, XACRO.replace("${a}", "${nosuch}"), "arm.xacro")
    with pytest.raises(sm.SelfmotionError, match=r"arm\.xacro: cannot be expanded by xacro: .*nos"):
        sm.read_problem(tmp_path / "cell.toml")


def test_arguments_of_a_cell_are_those_of_each_part(tmp_path: Path) -> None:
    """They change the arm, so that a file that dropped them would name another one."""
    file = written(tmp_path, XACRO, "arm.xacro")
    parts = {"left": file, "right": file, "hand": "panda"}
    base = {"right": pin.SE3(np.eye(3), np.array([0.0, 5.0, 0.0]))}
    given = {"left": {"long": 2}, "right": {"long": 3}}
    robot = sm.load_robot(parts, "left/tool", base=base, arguments=given)
    other = sm.load_robot(parts, "right/tool", base=base, arguments=given)
    assert robot.pose(np.zeros(3)).translation[0] == pytest.approx(7.0)
    assert other.pose(np.zeros(3)).translation[0] == pytest.approx(10.0)
    start = np.array([0.1, 0.5, 0.5])
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 0.01), 2.0)
    sm.files.write_problem(sm.Problem(robot, line, "planar", start), tmp_path / "cell.toml")
    read = sm.read_problem(tmp_path / "cell.toml").robot
    np.testing.assert_array_equal(read.pose(start).homogeneous, robot.pose(start).homogeneous)
    for wrong, said in (
        ({"long": 2}, "arguments: 'long' is 2, expected a dict for each part"),
        ({"lft": {"long": 2}}, "nearest: 'left'"),
        ({"hand": {"long": 2}}, "panda: arguments are given, which only a .xacro file has"),
    ):
        with pytest.raises(sm.errors.RobotError, match=said):
            sm.load_robot(parts, "left/tool", arguments=wrong)
    with pytest.raises(sm.errors.RobotError, match="arguments are given, which only"):
        sm.load_robot("panda", arguments={"long": 2})
    written(tmp_path, XACRO.replace("-3", "-2"), "arm.xacro")
    with pytest.raises(sm.errors.ProblemError, match="files of its parts have changed"):
        sm.files.write_problem(sm.Problem(robot, line, "planar", start), tmp_path / "cell.toml")


def test_code_of_the_user_is_loaded_only_where_allowed(tmp_path: Path) -> None:
    code = """
    from dataclasses import dataclass
    import numpy as np
    import selfmotion as sm

    def elbow(qd, q, t):
        return 1.0 - np.cos(q[:, 3])

    @dataclass(frozen=True)
    class BendOfATest(sm.costs.Cost):
        mu: float = 1.0
        name: str = "elbow class"
        def value(self, samples):
            return self.mu * (1.0 - np.cos(samples.q[:, 3]))
        def gradient(self, samples):
            by_q = np.zeros_like(samples.q)
            by_q[:, 3] = self.mu * np.sin(samples.q[:, 3])
            return sm.costs.Partials(q=by_q)
    """
    written(tmp_path, "\n".join(line[4:] for line in code.splitlines()), "own_costs_of_a_test.py")
    own = CELL.replace('"InverseManipulability"\nmu', '"own_costs_of_a_test:BendOfATest"\nmu')
    own += '\n[[costs]]\nkind = "own_costs_of_a_test:elbow"\nname = "elbow function"\n'
    file = written(tmp_path, own)
    with pytest.raises(sm.errors.FileFormatError, match=r"costs\[1\]\.kind.*--allow-code"):
        sm.read_problem(file)
    assert "own_costs_of_a_test" not in sys.modules
    problem = sm.read_problem(file, allow_code=True)
    assert [cost.name for cost in problem.costs] == [
        "joint velocity", "elbow class", "elbow function",
    ]  # fmt: skip
    again = tmp_path / "again.toml"
    with pytest.raises(sm.errors.ProblemError, match="'elbow function' holds a function"):
        sm.files.write_problem(problem, again)
    sm.files.write_problem(replace(problem, costs=problem.costs[:2]), again)
    assert sm.read_problem(again, allow_code=True).costs[1] == problem.costs[1]
    # A misspelt key of an own class is found like one of ours.
    wrong = written(tmp_path, own.replace("mu =", "mus ="))
    with pytest.raises(
        sm.errors.FileFormatError, match=r"costs\[1\]\.mus: unknown key, did you mean 'mu'"
    ):
        sm.read_problem(wrong, allow_code=True)


@pytest.mark.parametrize(
    ("table", "where"),
    [
        ("clearance", r"clearance\.obstacles\[0\]"),
        ("[clearance]", r"clearance\[0\]\.obstacles\[0\]"),
        ("workpiece", r"workpiece\.obstacles\[0\]"),
    ],
)
def test_a_shape_of_a_users_own_stands_wherever_bodies_do(
    tmp_path: Path, table: str, where: str
) -> None:
    code = """
    from dataclasses import dataclass
    import selfmotion as sm

    @dataclass(frozen=True)
    class PillarOfATest(sm.obstacles.Box):
        shape = "pillar of a test"
    """
    written(tmp_path, "\n".join(line[4:] for line in code.splitlines()), "own_shapes_of_a_test.py")
    body = '{ shape = "own_shapes_of_a_test:PillarOfATest", name = "p", position = [0, 1, 0], '
    body += "size = [0.1, 0.1, 1] }"
    own = 'task = "pointing"\nrobot = { name = "panda" }\n'
    own += 'path = { kind = "circle", radius = 0.1, duration = 4, '
    own += "start = { position = [1, 0, 0] } }\n"
    file = written(tmp_path, f"{own}[{table}]\nobstacles = [{body}]\n")
    with pytest.raises(sm.errors.FileFormatError, match=rf"{where}\.shape.*--allow-code"):
        sm.read_problem(file)
    problem = sm.read_problem(file, allow_code=True)
    bodies = [body for one in problem.clearances for body in one.obstacles]
    assert [(type(body).__name__, body.name) for body in bodies] == [("PillarOfATest", "p")]


def test_poses_that_differ_in_the_last_digits_are_two(tmp_path: Path) -> None:
    grid = CELL.replace("lock =", "base = { position = [0, 0, 0] }\nlock =")
    grid += '[grid]\n"robot.base.position" = [[0, 0, 1e-9], [0, 0, 2e-9]]\n'
    cache: dict[str, Any] = {}
    documents = grid_documents(read_document(written(tmp_path, grid)))
    heights = [
        plan_request_of(one, tmp_path / "a.toml", cache=cache)
        .problem.robot.pose(PANDA_HOME)
        .translation[2]
        for one, _ in documents
    ]
    assert heights[1] - heights[0] == pytest.approx(1e-9, rel=1e-3)
    assert len(cache) == 4


CELL_OF_PARTS = """
task = "position"
start = "dexterous"
path = { kind = "line", by = [0.0, 0.0, 0.001], duration = 1.0 }

[robot.parts]
arm = { name = "ur5", calibration = "measured.yaml" }
"""


def test_a_calibrated_part_is_read_once_for_many_problems(tmp_path: Path) -> None:
    written(tmp_path, "offsets: {shoulder_lift_joint: 0.1}", "measured.yaml")
    cell = written(tmp_path, CELL_OF_PARTS)
    document = read_document(cell)
    cache: dict[str, Any] = {}
    first, second = (plan_request_of(document, cell, cache=cache).problem for _ in range(2))
    assert second.robot is first.robot
    np.testing.assert_array_equal(second.start, first.start)
    assert len(cache) == 2
    calibrated = sm.load_robot("ur5", calibration=tmp_path / "measured.yaml")
    np.testing.assert_allclose(
        first.robot.pose(first.start).homogeneous,
        calibrated.pose(first.start).homogeneous,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("key", ["name", "file"])
def test_a_part_of_another_kind_has_a_start_of_its_own(key: str, tmp_path: Path) -> None:
    kinds = ["panda", "fr3"]
    if key == "file":
        kinds = ["short.urdf", "long.urdf"]
        written(tmp_path, reaching_arm(), "short.urdf")
        written(tmp_path, reaching_arm().replace("-0.21038", "-0.31"), "long.urdf")
    document = read_document(written(tmp_path, CELL_OF_PARTS))
    cache: dict[str, Any] = {}
    together, alone = [], []
    for kind in kinds:
        one = {**document, "robot": {"parts": {"arm": {key: kind}}}}
        together.append(plan_request_of(one, tmp_path / "a.toml", cache=cache).problem.start)
        alone.append(plan_request_of(one, tmp_path / "a.toml").problem.start)
    np.testing.assert_array_equal(together, alone)
    assert not np.array_equal(*alone)


def test_grids_are_all_combinations(tmp_path: Path) -> None:
    grid = CELL + '[grid]\n"path.duration" = [3, 5]\n"costs.1.mu" = [0, 1, 2]\n'
    found = grid_documents(read_document(written(tmp_path, grid)))
    seen = [(one["path"]["duration"], one["costs"][1]["mu"]) for one, _ in found]
    assert seen == [(3, 0), (3, 1), (3, 2), (5, 0), (5, 1), (5, 2)]
    assert found[1][1] == {"path.duration": 3, "costs.1.mu": 1}
    assert all("grid" not in one for one, _ in found)


@pytest.mark.parametrize("name", ["panda", "planar_3r", "ur5"])
def test_examples_run_as_they_are(name: str, tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    assert invoke("init", name, "--out", file)[0] == 0
    code, text = invoke("plan", file, "--json", "--out", tmp_path / "plan.npz")
    assert code == 0
    assert json.loads(text)["certificate"]["verified"]
    assert sm.load_plan(tmp_path / "plan.npz").certificate.verified
    assert "is there already" in complaint("init", name, "--out", file)
    with pytest.raises(sm.errors.RobotError, match="unknown robot 'none'"):
        example_text("none", "cell.toml")


@pytest.mark.site
def test_examples_of_files_jobs_and_cells_are_read(tmp_path: Path) -> None:
    urdf = (ROOT / "robots" / "planar_3r.urdf").read_text()
    (tmp_path / "arms").mkdir()
    for name in ("arm.urdf", "arm.xacro"):
        (tmp_path / "arms" / name).write_text(urdf)
        file = tmp_path / f"{name}.toml"
        asked = ("init", tmp_path / "arms" / name, "--out", file)
        assert invoke(*asked)[0] == 0
        assert f'file = "arms/{name}"' in file.read_text()
        assert sm.files.read_job(file).problem.robot.dof == 3
        if name == "arm.xacro":
            continue
        assert invoke(*asked, "--job", "--force")[0] == 0
        first, second = sm.files.read_seam_job(file).seams
        assert (first.name, second.name) == ("one", "two")
        # Controllers' programs need more for these: they are there to be taken in.
        assert first.events == ()
        assert '# events = [["tool on", 0.0]]' in file.read_text()
    file = tmp_path / "cell.toml"
    for options in ((), ("--job",)):
        asked = ("init", "panda", "--positioner", "--out", file, "--force", *options)
        assert invoke(*asked)[0] == 0
        cell = (
            sm.files.read_seam_job(file).robot if options else sm.files.read_job(file).problem.robot
        )
        assert cell.dof == 9
        assert cell.reference == "table/plate"
        assert '# frame = "arm/panda_hand_tcp"' in file.read_text()


def test_what_init_writes_runs_where_the_most_dexterous_pose_is_stretched(tmp_path: Path) -> None:
    """There the circle of the example leaves the reach: another start has to be found."""
    arm, file = tmp_path / "arm7.urdf", tmp_path / "arm7.toml"
    arm.write_text(reaching_arm())
    assert invoke("init", arm, "--out", file)[0] == 0
    assert sm.files.read_job(file).plan().certificate.verified
    # The former start, with the same circle.
    text = file.read_text()
    file.write_text(re.sub(r"start = \[.*?\]", 'start = "dexterous"', text, count=1))
    assert file.read_text() != text
    problem = sm.files.read_job(file).problem
    shoulder = problem.robot.model.jointPlacements[1].translation
    poses = [problem.path.pose(t) for t in np.linspace(0.0, problem.path.duration, 41)]
    farthest = max(poses, key=lambda pose: float(np.linalg.norm(pose.translation - shoulder)))
    with pytest.raises(sm.errors.InverseKinematicsError):
        problem.robot.inverse_kinematics(farthest, problem.task, problem.start)


def test_the_example_cell_runs() -> None:
    cell = ROOT / "examples" / "cell.toml"
    assert sm.files.read_job(cell).plan().certificate.verified


def test_the_schema_accepts_what_is_read_and_refuses_what_is_not(tmp_path: Path) -> None:
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    check = jsonschema.Draft202012Validator(schema)
    good = read_document(written(tmp_path, CELL))
    assert check.is_valid(good)
    assert check.is_valid(read_document(written(tmp_path, example_text("panda", "cell.toml"))))
    for key, value in (("task", "pse"), ("start", 3), ("paht", {}), ("robot", {"nam": "panda"})):
        assert not check.is_valid({**good, key: value})
    assert invoke("schema", "--out", tmp_path / "schema.json")[0] == 0
    assert json.loads((tmp_path / "schema.json").read_text()) == schema


def test_a_path_from_a_file_is_run_up_to_its_speed(tmp_path: Path) -> None:
    (tmp_path / "seam.csv").write_text("x,y,z\n0.5,-0.1,0.4\n0.5,0.0,0.4\n0.5,0.1,0.4\n")
    file = tmp_path / "cell.toml"
    text = 'task = "position"\nrobot.name = "panda"\n[path]\nkind = "file"\nfile = "seam.csv"\n'
    file.write_text(text + "duration = 4\n")
    usual = sm.read_problem(file).path
    file.write_text(text + "duration = 4\nramp = 1\n")
    path = sm.read_problem(file).path
    # The ramps are part of the duration: 0.2 m in what is left but for half of each.
    for each, speed in ((usual, 0.2 / 3.5), (path, 0.2 / 3.0)):
        assert each.duration == pytest.approx(4.0)
        assert not each.twist(0.0).any()
        assert not each.twist(each.duration).any()
        assert np.linalg.norm(each.twist(2.0)[:3]) == pytest.approx(speed)
    (tmp_path / "seam.csv").write_text("t,x,y,z\n0,0.5,-0.1,0.4\n2,0.5,0.0,0.4\n4,0.5,0.1,0.4\n")
    file.write_text(text)
    timed = sm.read_problem(file).path
    file.write_text(text + "ramp = 0.5\n")
    path = sm.read_problem(file).path
    assert path.duration == pytest.approx(timed.duration + 0.5)
    assert np.linalg.norm(timed.twist(0.0)[:3]) == pytest.approx(0.05)
    assert not path.twist(0.0).any()
    np.testing.assert_allclose(path.twist(1.0), timed.twist(0.75), atol=1e-12)


def test_a_seam_is_woven_as_a_file_says(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    line = 'kind = "line"\nby_mm = [0, 100, 0]\nfeed = 0.02\n'
    swing = "weave = {amplitude_mm = 2, pitch_mm = 10, axis = [1, 0, 0], dwell = 0.1}\n"
    text = 'start = "home"\nrobot.name = "panda"\n[path]\n' + line
    file.write_text(text)
    plain = sm.read_problem(file).path
    file.write_text(text + swing)
    woven = sm.read_problem(file).path
    expected = sm.paths.Weave(plain, 2e-3, 0.01, axis=(1.0, 0.0, 0.0), dwell=0.1)
    assert woven.to_dict() == expected.to_dict()
    for wrong in ("pich = 0.1", "amplitude = 0.1"):
        file.write_text(text + f"weave = {{{wrong}}}\n")
        with pytest.raises(
            sm.errors.FileFormatError, match=r"path\.weave\.(pich: unknown key|pitch: is missing)"
        ):
            sm.read_problem(file)


def test_the_axis_of_a_tilt_is_a_letter_or_numbers(tmp_path: Path) -> None:
    head = 'task = "position"\nstart = "home"\nrobot.name = "panda"\n'
    head += 'path = { kind = "line", by = [0, 0.1, 0], duration = 2 }\n[[constraints]]\n'
    for axis, said in (('"z"', "z"), ("[0, 0, 1]", [0, 0, 1])):
        text = f'kind = "Tilt"\nframe = "panda_hand"\nwithin_deg = 9\naxis = {axis}\n'
        with pytest.raises(sm.errors.FileFormatError, match=r"towards.* is missing"):
            sm.read_problem(written(tmp_path, head + text))
        text += "towards = [0, 0, -1]\n"
        (tilt,) = sm.read_problem(written(tmp_path, head + text)).constraints
        assert isinstance(tilt, sm.constraints.Tilt)
        assert tilt.axis == said
    with pytest.raises(sm.errors.FileFormatError, match=r"axis: is 'w', expected x, y, z or three"):
        sm.read_problem(written(tmp_path, head + text.replace("[0, 0, 1]", '"w"')))


def test_values_in_degrees_are_quoted_in_degrees(tmp_path: Path) -> None:
    head = 'task = "position"\nrobot.name = "panda"\n'
    head += 'path = { kind = "line", by = [0, 0.1, 0], duration = 2 }\n'
    text = '[[constraints]]\nkind = "JointVelocityLimits"\nlimit_deg = { panda_joint1 = -30.0 }\n'
    with pytest.raises(sm.errors.FileFormatError, match=r"limit_deg: is {'panda_joint1': -30.0}"):
        sm.read_problem(written(tmp_path, head + text))


def test_up_to_three_faults_are_told_and_the_nearest_key(tmp_path: Path) -> None:
    head = 'task = "position"\nrobot.name = "panda"\n'
    head += 'path = { kind = "line", by = [0, 0.1, 0], duration = 2 }\n'
    wrong = '[[constraints]]\nkind = "JointVelocityLimits"\nlimit_degs = 300\n'
    with pytest.raises(
        sm.errors.FileFormatError, match="limit_degs: unknown key, did you mean 'limit_deg'"
    ):
        sm.read_problem(written(tmp_path, head + wrong))
    for count in (1, 2, 3, 4):
        lines = "".join(f"zzz{k} = 1\n" for k in range(count))
        with pytest.raises(sm.errors.FileFormatError) as caught:
            sm.read_problem(written(tmp_path, lines + head))
        assert str(caught.value).count("unknown key") == min(count, 3)
        assert ("and 1 more" in str(caught.value)) == (count == 4)


_CLEARANCE = """
[robot]
name = "panda"

[path]
kind = "circle"
radius = 0.05
duration = 4.0
"""


@pytest.mark.parametrize("key", ["clearance", "collision"])
@pytest.mark.parametrize("form", ["table", "switch"])
def test_files_of_before_call_the_clearance_collision(tmp_path: Path, key: str, form: str) -> None:
    said = f"{key} = false" if form == "switch" else ""
    table = f"\n[{key}]\ndistance_mm = 5\n" if form == "table" else ""
    file = tmp_path / "cell.toml"
    file.write_text(f'start = "dexterous"\n{said}\n{_CLEARANCE}{table}')
    found = sm.read_problem(file).clearance
    if form == "switch":
        assert found is None
    else:
        assert found is not None
        assert found.distance == 0.005
    job = tmp_path / "job.toml"
    pose = "position = [0.5, {y}, 0.5]\nrpy = [3.1, 0.0, 0.0]\n"
    seams = (
        '\n[[seams]]\nname = "a"\n[seams.path]\nkind = "line"\nduration = 2.0\n'
        f"[seams.path.start]\n{pose.format(y=0.0)}[seams.path.end]\n{pose.format(y=0.1)}"
    )
    head = _CLEARANCE.partition("[path]")[0]
    job.write_text(f"{said}\n{head}{table}{seams}")
    asked = sm.files.read_seam_job(job).settings["clearance"]
    assert (asked is None) == (form == "switch")


def test_the_clearance_is_given_once(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(f"clearance = false\ncollision = false\n{_CLEARANCE}")
    with pytest.raises(sm.errors.FileFormatError, match="the former name of clearance"):
        sm.read_problem(file)


def test_a_key_of_a_table_is_told_where_it_belongs(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    for key, tables in (("obstacles", "[clearance] or [workpiece]"), ("lock", "[robot]")):
        file.write_text(f'{key} = []\ntask = "pointing"\n[robot]\nname = "panda"\n')
        with pytest.raises(sm.errors.FileFormatError) as refused:
            sm.read_problem(file)
        assert f"{key}: unknown key; it belongs to {tables}" in str(refused.value)


def test_a_body_has_a_distance_of_its_own(tmp_path: Path) -> None:
    """What is written of it is read again."""
    file = tmp_path / "own.toml"
    file.write_text(
        """
task = "position"
start = "free"
[robot]
name = "panda"
[workpiece]
frame = { position = [0.5, 0.0, 0.2] }
[[workpiece.obstacles]]
shape = "box"
name = "clamp"
position_mm = [0, 200, 0]
size_mm = [40, 40, 40]
distance_mm = 20
[path]
kind = "circle"
radius = 0.1
duration = 4.0
start = { position = [0, 0, 0.1], rpy_deg = [180, 0, 0] }
[clearance]
distance_mm = 5
[[clearance.obstacles]]
shape = "box"
name = "post"
position = [0.3, -0.6, 0.6]
size = [0.1, 0.1, 1.2]
"""
    )

    def distances(file: Path) -> list[tuple[float, list[str], tuple[str, ...]]]:
        found = sm.read_problem(file).clearances
        return [(one.distance, [body.name for body in one.obstacles], one.only) for one in found]

    expected = [(0.005, ["post"], ()), (0.02, ["clamp"], ("clamp",))]
    assert distances(file) == expected
    again = tmp_path / "again.toml"
    sm.files.write_problem(sm.read_problem(file), again)
    assert distances(again) == expected


def test_bodies_of_the_robot_have_no_distance_of_their_own(tmp_path: Path) -> None:
    """It would have no effect."""
    head = 'task = "position"\nstart = "dexterous"\n'
    head += 'path = { kind = "line", by = [0, 0.1, 0], duration = 2 }\n'
    text = '[robot]\nname = "panda"\n[[robot.bodies]]\nshape = "sphere"\nname = "camera"\n'
    text += 'frame = "panda_hand"\nradius_mm = 20\n'
    sm.read_problem(written(tmp_path, head + text))
    with pytest.raises(sm.errors.FileFormatError, match="distance_mm: is of obstacles of a"):
        sm.read_problem(written(tmp_path, head + text + "distance_mm = 20\n"))
