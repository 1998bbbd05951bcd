"""`check` answers each of its options for plans, too, or refuses it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.basics import write_csv
from selfmotion.shell.cli import app
from selfmotion.shell.documents import example_text, plan_request_of
from support.arms import robot_named
from support.shell import complaint, invoke, on_circle, on_line


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    panda = robot_named("panda")
    start = panda.dexterous_configuration()
    circle = sm.paths.Circle.around(panda.pose(start), radius=0.05, duration=4.0)
    file = tmp_path_factory.mktemp("check") / "seam.npz"
    sm.plan(sm.Problem(panda, circle, task="position", start=start)).save(file)
    return file


@pytest.mark.parametrize("options", [["--robot", "ur5"], ["--degrees"]])
def test_what_is_the_plans_own_is_refused(plan: Path, options: list[str]) -> None:
    said = complaint("check", plan, *options)
    assert f"{options[0]} is the plan's own" in said


def test_parts_are_judged_anew(plan: Path, tmp_path: Path) -> None:
    made, file = sm.load_plan(plan), tmp_path / "a.parts"
    for problem, code in ((made.problem, 0), (replace(made.problem, task="pose"), 1)):
        sm.Parts(problem, (made,)).save(file)
        got, shown = invoke("check", file, "--json")
        assert (got, json.loads(shown)["verified"]) == (code, not code)
    assert "its task is 'position', not 'pose'" in " ".join(invoke("check", file)[1].split())
    assert "--tool is the parts' own" in complaint("check", file, "--tool", "x")


def test_what_is_not_judged_is_said_in_words_of_the_shell(tmp_path: Path) -> None:
    job = tmp_path / "three.toml"
    job.write_text(example_text("panda", job, job=True))
    motion = tmp_path / "a.csv"
    motion.write_text("t,a\n0,0\n1,0\n")
    (tmp_path / "fast.script").write_text("def selfmotion():\n  servoj([0, 0], t=0.008)\nend\n")
    (tmp_path / "keys.xml").write_text("<mujoco/>")
    (tmp_path / "bad.mod").write_text("MODULE bad\n  MoveL p1;\nENDMODULE\n")
    for asked in (("plan", job), ("check", motion, "--robot", job)):
        said = complaint(*asked)
        assert f"{job}: has seams, so that it is a job: `selfmotion job` plans it" in said
    for name, words in (
        ("keys.xml", "is no motion that is read, though it is written: expected .csv,"),
        ("fast.script", "line 2: a stream of servoj is not read; only programs of linear motions"),
        (
            "bad.mod",
            "line 2: 'MoveL p1;' is not read: selfmotion did not write this program, and only the "
            "statements that it writes are read; of another one judge the recorded motion",
        ),
        ("a.doc", "is no motion that is read: expected .csv, "),
    ):
        with pytest.raises(sm.errors.FileFormatError, match=words):
            sm.files.read_motion(tmp_path / name)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], ""),
        (["--set", "constraints.JointVelocityLimits.limit=0.001"], "times its limit"),
        (["--set", "constraints.JointAccelerationLimits.limit=0.001"], "accelerates at"),
        (["--set", "clearance.distance=0.5"], "apart"),
        (["--tolerance", "1e-15"], "off the path"),
    ],
)
def test_what_is_asked_is_judged(plan: Path, options: list[str], words: str) -> None:
    found = CliRunner().invoke(app, ["check", str(plan), *options])
    assert found.exit_code == (1 if words else 0), found.output
    assert words in found.output.replace("\n", " ")


def test_a_path_is_read_by_the_options_that_it_was_planned_with(tmp_path: Path) -> None:
    rows = "0.05;0;0;0\n0.05;0.05;0;9\n0.05;0.1;0;9\n"
    file = tmp_path / "a.csv"
    file.write_text(rows)
    typed = [
        "--path",
        file,
        "--set",
        'path.columns=["x", "y", "z", "-"]',
        "--frame",
        "0.4,-0.1,0.4,0,0,0",
    ]
    typed += ["--set", "path.duration=3", "--task", "position"]
    table = {"kind": "file", "file": str(file), "columns": ["x", "y", "z", "-"], "duration": 3.0}
    frame = {"frame": {"position": [0.4, -0.1, 0.4]}}
    document = {"task": "position", "start": "free", "path": table | frame}
    problem = plan_request_of({"robot": {"name": "panda"}, **document}, None).problem
    sm.files.write_motion(sm.plan(problem, max_evaluations=3), tmp_path / "motion.csv")
    run = ["check", str(tmp_path / "motion.csv"), "--robot", "panda", *map(str, typed)]
    found = CliRunner().invoke(app, run)
    assert found.exit_code == 0, found.output
    moved = [text.replace("0.4,-0.1", "0.4,-0.11") for text in run]
    assert CliRunner().invoke(app, moved).exit_code == 1
    assert "names no seams, so that seam has no effect" in complaint(*run, "--set", "path.seam=a")


def test_motions_made_elsewhere_are_judged_by_what_plan_keeps(tmp_path: Path) -> None:
    """Accelerations and jerks of the arm's maker, and that the arm does not meet itself."""
    panda = robot_named("panda")
    start = panda.dexterous_configuration()

    def checked(duration: float, *options: str, **given: object) -> tuple[int, str]:
        circle = sm.paths.Circle.around(panda.pose(start), 0.05, duration)
        made = sm.plan(sm.Problem(panda, circle, "position", start, **given), max_evaluations=3)
        sm.files.write_motion(made, tmp_path / "a.csv", force=True)
        t = np.linspace(0.0, duration, 201)
        rows = [[time, *at.translation] for time, at in zip(t, circle.pose(t), strict=True)]
        np.savetxt(tmp_path / "c.csv", rows, delimiter=",", header="t,x,y,z", comments="")
        run = ["check", tmp_path / "a.csv", "--robot", "panda", "--path", tmp_path / "c.csv"]
        run += ["--task", "position", "--tolerance", "1e-4", "--verbose", *options]
        code, text = invoke(*run)
        return code, " ".join(text.split())

    code, text = checked(2.0)
    assert code == 0, text
    for what in ("accelerations", "jerks", "self-collision"):
        assert what in text
    assert "not checked" not in text
    code, text = checked(2.0, "--set", "clearance=false")
    assert code == 0
    assert "not checked: self-collision" in text
    # Too fast for the maker's accelerations, for a plan that asked for none.
    code, text = checked(0.5, constraints=())
    assert code == 1
    assert "accelerates at" in text


CELL = """
task = "position"
start = "dexterous"

[robot]
tool = "arm/panda_hand_tcp"
reference = "table/plate"

[robot.parts.arm]
name = "panda"

[robot.parts.table]
name = "positioner"
base = { position = [0.6, 0.0, 0.0] }

[path]
kind = "circle"
radius = 0.05
duration = 4

[[constraints]]
kind = "Tilt"
frame = "arm/panda_link4"
within = 3.1
"""


def test_a_motion_of_a_cell_is_judged_by_its_problem_file(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_text(
        CELL + "towards = [0, 0, 1]\n" + "[tolerance]\nposition = 1e-3\nrotation = 1e-3\n"
    )
    problem = sm.read_problem(file)
    sm.files.write_motion(sm.plan(problem, max_evaluations=5), tmp_path / "motion.csv")
    run = ["check", str(tmp_path / "motion.csv"), "--robot", str(file)]
    found = CliRunner().invoke(app, [*run, "--verbose"])
    assert found.exit_code == 0, found.output
    assert "tilt" in found.output
    assert (
        CliRunner()
        .invoke(app, [*run, "--set", "constraints.JointVelocityLimits.limit=0.001"])
        .exit_code
        == 1
    )
    # What is asked besides counts as well.
    assert CliRunner().invoke(app, [*run, "--set", "constraints.Tilt.within=0.01"]).exit_code == 1
    strict = file.read_text().replace("within = 3.1", "within = 0.01")
    file.write_text(strict)
    assert CliRunner().invoke(app, run).exit_code == 1


def test_obstacles_are_judged_with_a_plan(plan: Path, tmp_path: Path) -> None:
    at = robot_named("panda").pose(robot_named("panda").dexterous_configuration()).translation
    wall = [{"shape": "box", "name": "wall", "position": at.tolist(), "size": [0.2] * 3}]
    (tmp_path / "wall.json").write_text(json.dumps(wall))
    options = ["--set", f"clearance.obstacles=@{tmp_path / 'wall.json'}"]
    assert CliRunner().invoke(app, ["check", str(plan), *options]).exit_code == 1


@pytest.mark.parametrize("distance", ["nan", "-1"])
def test_clearances_that_make_no_sense_are_refused(plan: Path, distance: str) -> None:
    complaint("check", plan, "--set", f"clearance.distance={distance}")
    complaint("plan", "panda", *on_circle("0.1"), "--set", f"clearance.distance={distance}")


def test_a_windowed_relaxation_is_taken_from_the_shell() -> None:
    found = sm.Relaxation("rz", during=(1.0, 2.5)).to_dict()
    assert sm.Relaxation(**json.loads(json.dumps(found))).during == (1.0, 2.5)
    assert isinstance(found["during"], list)


def test_six_joints_with_a_window_and_a_free_start_are_planned() -> None:
    """No self-motion is left outside the window, so that no null motion can be taken over."""
    robot = robot_named("ur5")
    pose = robot.pose(robot.dexterous_configuration())
    end = pose.copy()
    end.translation = pose.translation + np.array([0.05, 0.03, 0.02])
    relaxed = sm.Relaxation("rz", 0.2, during=(0.5, 1.5))
    plan = sm.plan(
        sm.Problem(robot, sm.paths.Line(pose, end, 2.0), task="pose", relaxations=[relaxed])
    )
    assert plan.certificate.on_path


@pytest.mark.parametrize("name", ["seam.script", "seam.mod", "seam.src", "seam.csv"])
def test_a_file_is_judged_by_the_plan_that_it_comes_from(tmp_path: Path, name: str) -> None:
    """By all that was asked for; and what is not that motion any more is not verified."""
    line = (
        *on_line("0.05,0,0", "feed=0.02"), "--task", "pointing", "--set", "clearance=false",
    )  # fmt: skip
    kept, file = tmp_path / "plan.npz", tmp_path / name
    limit = "constraints.JointVelocityLimits.limit"
    assert invoke("plan", "ur5", *line, "--set", f"{limit}=2", "--out", kept)[0] == 0
    of_program = () if name.endswith("csv") else ("--set", "targets=poses", "--set", "mass=2")
    assert invoke("export", kept, "--out", file, *of_program)[0] == 0
    code, said = invoke("check", file, "--robot", kept)
    assert code == 0
    assert "verified at all times" in said
    code, said = invoke("check", file, "--robot", kept, "--set", f"{limit}=1e-4", "--json")
    assert code == 1
    assert "times its limit of 0.0001 rad/s" in json.loads(said)["verdict"]


def test_an_arm_without_a_joint_to_spare_is_judged_all_the_same(tmp_path: Path) -> None:
    """It is not planned, but its motion along a path of poses is checked."""
    arm = robot_named("ur5")
    start = arm.dexterous_configuration()
    line, times = sm.paths.Line(arm.pose(start), arm.pose(start + 0.02), 2.0), [0.0, 1.0, 2.0]
    motion = sm.plan_by(
        sm.Problem(arm, line, "position", start), sm.baselines.PseudoInverse()
    ).trajectory
    rows = np.column_stack([motion.t, motion.q])
    write_csv(tmp_path / "a.csv", ["t", *motion.joint_names], rows)
    poses = [arm.pose(motion(t)) for t in times]
    along = sm.paths.Waypoints.from_poses(times, poses).to_dict()
    table = np.column_stack([along["t"], along["positions"], along["quaternions"]])
    write_csv(tmp_path / "b.csv", ["t", "x", "y", "z", "qw", "qx", "qy", "qz"], table)
    asked = ("check", tmp_path / "a.csv", "--robot", "ur5", "--path", tmp_path / "b.csv")
    for turn, code in (("0.1", 0), ("1e-9", 1)):
        found, said = invoke(*asked, "--tolerance", "0.05", "--turn", turn, "--json")
        assert found == code, said
        assert json.loads(said)["rotation_error"]["value"] > 1e-9
    assert "joints" in complaint("plan", "ur5", "--path", tmp_path / "b.csv")


@pytest.mark.parametrize("key", ["tolerance.position=1e-12", "search.starts=3", "goal=fastest"])
def test_what_says_how_to_plan_is_refused_of_a_motion_that_is_there(
    plan: Path, tmp_path: Path, key: str
) -> None:
    """It would be told as verified, by a tolerance that it does not keep."""
    motion = tmp_path / "m.csv"
    sm.files.write_motion(sm.load_plan(plan), motion)
    name = key.partition("=")[0]
    for options in ([plan], [motion, "--robot", plan]):
        assert f"--set {name}: says how to plan" in complaint("check", *options, "--set", key)


def test_costs_are_refused_of_a_motion_that_is_there(plan: Path) -> None:
    said = complaint("check", plan, "--set", "costs.JointVelocity.weight=2")
    assert "a verdict does not depend on costs" in said


def test_a_motion_of_a_problem_file_is_judged_by_the_tolerance_that_is_set(
    plan: Path, tmp_path: Path
) -> None:
    motion, problem = tmp_path / "m.csv", tmp_path / "cell.toml"
    sm.files.write_motion(sm.load_plan(plan), motion)
    sm.files.write_problem(sm.load_plan(plan).problem, problem)
    assert invoke("check", motion, "--robot", problem)[0] == 0
    assert invoke("check", motion, "--robot", problem, "--set", "tolerance.position=1e-12")[0] == 1
    assert "says how to plan" in complaint(
        "check", motion, "--robot", problem, "--set", "max_evaluations=3"
    )
