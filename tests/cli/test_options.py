"""The shell knows what Python knows: each option is the problem that it stands for."""

import inspect
import json
import re
import shlex
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app
from selfmotion.shell.cli.documents import DocumentOptions, read
from selfmotion.shell.cli.moved import MOVED, replacement
from selfmotion.shell.documents import json_schema, keys_of, parse_setting, set_key
from support.arms import PANDA_HOME, robot_named
from support.shell import complaint, invoke, on_circle, on_line

HOME = ",".join(map(str, PANDA_HOME.tolist()))


SRDF = '<robot name="panda"><disable_collisions link1="panda_link5" link2="panda_link7"/></robot>'


def planned(folder: Path, *options: str | Path) -> sm.Plan:
    """Return the plan of a Panda on a circle, with further options."""
    out = folder / "plan.npz"
    code, text = invoke(
        "plan", "panda", *on_circle("0.05"), "--start", HOME, "--out", out, "--json", *options
    )
    assert code == 0, text
    assert json.loads(text)["certificate"]["verified"]
    return sm.load_plan(out)


def kinds(plan: sm.Plan) -> list[dict[str, Any]]:
    return [item.to_dict() for item in plan.problem.constraints]


def test_limits_and_closed_paths(tmp_path: Path) -> None:
    plan = planned(
        tmp_path, "--set", "constraints.JointVelocityLimits.limit=2", "--set",
        "constraints.JointAccelerationLimits.limit=[9, 9, 9, 9, 9, 9, 8]", "--set",
        "constraints.ClosedPath=true",
    )  # fmt: skip
    asked = {item["kind"]: item for item in kinds(plan)}
    assert set(asked) == {
        "JointPositionLimits", "JointVelocityLimits", "JointAccelerationLimits", "JointJerkLimits",
        "PositionDependentVelocityLimits", "ClosedPath",
    }  # fmt: skip
    assert asked["JointVelocityLimits"]["limit"] == 2.0
    assert asked["JointAccelerationLimits"]["limit"] == [9, 9, 9, 9, 9, 9, 8]


def test_a_start_by_its_name(tmp_path: Path) -> None:
    plan = planned(tmp_path, "--start", "home")  # the last one counts
    np.testing.assert_allclose(plan.trajectory.q[0], robot_named("panda").home, atol=1e-12)
    assert "--start is 'there', expected numbers" in complaint(
        "plan", "panda", *on_circle("0.05"), "--start", "there"
    )


def test_costs_by_name(tmp_path: Path) -> None:
    plan = planned(
        tmp_path, "--set", 'costs=[{kind="JointAcceleration", weight=0.1}]', "--set",
        "costs.SmallestSingularValue.mu=0.01", "--set", "costs.KineticEnergy=true", "--set",
        'null_motion={kind="PolynomialNullMotion", degree=2}',
    )  # fmt: skip
    described = [cost.to_dict() for cost in plan.problem.costs]
    assert [item["kind"] for item in described] == [
        "JointAcceleration", "SmallestSingularValue", "KineticEnergy",
    ]  # fmt: skip
    assert (described[0]["weight"], described[1]["mu"]) == (0.1, 0.01)
    assert plan.problem.null_motion == sm.PolynomialNullMotion(2)


def test_obstacles_pairs_and_locks(tmp_path: Path) -> None:
    (tmp_path / "arm.srdf").write_text(SRDF)
    cell = tmp_path / "cell.toml"
    cell.write_text(
        "[[obstacles]]\nshape = 'box'\nname = 'post'\nposition = [0, -0.8, 0.5]\n"
        "rpy_deg = [0, 0, 90]\nsize_mm = [100, 200, 1000]\n"
    )
    plan = planned(
        tmp_path, "--set", f"clearance.obstacles=@{cell}", "--set", "clearance.distance=0.01",
        "--set", f"clearance.srdf={tmp_path / 'arm.srdf'}",
        "--set", "robot.lock.panda_finger_joint1=0.03", "--tool", "panda_hand",
    )  # fmt: skip
    (clearance,) = (item.to_dict() for item in plan.problem.clearances)
    assert clearance["distance"] == 0.01
    assert clearance["disabled"] == [["panda_link5", "panda_link7"]]
    assert clearance["obstacles"][0]["size"] == pytest.approx([0.1, 0.2, 1.0])
    np.testing.assert_allclose(clearance["obstacles"][0]["rotation"][1], [1, 0, 0], atol=1e-12)
    assert plan.robot.locked["panda_finger_joint1"] == 0.03
    assert plan.robot.tool == "panda_hand"
    # The same as JSON; two bodies of one name are refused.
    (tmp_path / "twice.json").write_text(json.dumps(clearance["obstacles"] * 2))
    twice = complaint(
        "plan",
        "panda",
        *on_circle("0.1"),
        "--set",
        f"clearance.obstacles=@{tmp_path / 'twice.json'}",
    )
    assert "box 'post': a link or another obstacle has this name too" in twice


def test_self_collision_can_be_left_out(tmp_path: Path) -> None:
    plan = planned(tmp_path, "--set", "clearance=false", "--set", "damping=true")
    assert plan.problem.clearance is None
    assert plan.problem.damping == sm.Damping()


def test_a_plan_can_start_from_another(tmp_path: Path) -> None:
    first = planned(tmp_path)
    out = tmp_path / "next.npz"
    code, _ = invoke(
        "plan", "panda", *on_line("0,0.05,0"), "--from", tmp_path / "plan.npz", "--out", out
    )
    assert code == 0
    np.testing.assert_allclose(sm.load_plan(out).trajectory.q[0], first.trajectory.q[0])


def test_anything_of_a_problem_file_can_be_set(tmp_path: Path) -> None:
    plan = planned(
        tmp_path, "--set", 'robot.base={"position": [0, 0, 1]}', "--set", "path.duration=6",
        "--set", "path.normal=[1,0,0]", "--set", "tolerance.position=1e-5",
    )  # fmt: skip
    assert plan.path.duration == 6.0
    assert plan.path.pose(0.0).translation[2] > 1.0
    assert plan.tolerance.position == 1e-5


@pytest.mark.parametrize("name", ["a.csv", "a.html", "a.yaml", "a.json", "a.xml"])
def test_a_plan_is_written_in_any_format(tmp_path: Path, name: str) -> None:
    planned(tmp_path, "--out", tmp_path / name)
    assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--set", 'costs=[{kind="Speed"}]'), "costs[0]: kind is 'Speed'"),
        (("--set", "costs.PathLength.weight=1"), "costs[1].weight: unknown key"),
        (("--set", "costs.JointVelocity.weight=a"), "costs[0].weight: is 'a', expected a number"),
        (("--set", "constraints.JointJerkLimits=3"), "is 3, expected a table of keys, true or"),
        (("--frame", "0,0,0,0,0,0"), "frame: needs start, the tool's first pose"),
        (("--set", "path.corners=blend"), "path.corners: unknown key"),
        (("--set", "path.radus=1"), "path.radus: unknown key, did you mean 'radius'?"),
        (("--set", "robot.lock.a=1", "--set", "robot.lock.a=2"), "says 'robot.lock.a' twice"),
        (("--set", "path.radius=1", "--set", "path.radius_mm=2"), "--set says 'path.radius' twice"),
        (("--set", "path.feed=1", "--feed", "2"), "--set says 'path.feed' twice"),
        (("--feed", "0.1"), "has duration and feed, expected either duration or feed"),
        (("--set", "robot.lock.a"), "--set is 'robot.lock.a', expected KEY=VALUE"),
        (("--set", "robot.lock.a=1"), "lock names joint 'a'"),
        (("--from", "no.npz"), "no.npz: no such file"),
        (("--set", "clearance.obstacles=@no.toml"), "no.toml: cannot be read"),
        (("--set", "constraints.JointVelocityLimits.limit=[1,2]"), "one for each of the 7 joints"),
        (("--set", "clearance.srdf=no.srdf"), "no.srdf: SRDF cannot be read"),
        (("--out", "a.txt"), "--out writes .npz (the plan)"),
    ],
)
def test_what_is_wrong_is_one_line(options: tuple[str, ...], said: str) -> None:
    assert said in complaint("plan", "panda", *on_circle("0.1"), *options)


def test_processes_are_of_one_machine() -> None:
    for command in ("batch", "job"):
        said = complaint(command, "a.toml", "--workers", "2", "--dask", "127.0.0.1:8786")
        assert "--workers has no effect beside --dask" in said


def test_a_key_of_the_shell_leaves_the_rest_as_the_file_says(tmp_path: Path) -> None:
    file = tmp_path / "problem.toml"
    assert invoke("init", "panda", "--out", file)[0] == 0
    text = file.read_text().replace("duration = 4.0", "feed = 0.2")
    file.write_text(f"{text}\n[search]\nstarts = 7\nmode = 'global'\n")
    said = DocumentOptions(["search.compare=true"], feed=0.1, task="position")
    found, known = read(str(file), said), read(str(file), DocumentOptions())
    assert found.search == replace(known.search, compare=True)
    assert (found.problem.path.feed, found.problem.task) == (0.1, sm.Task.POSITION)
    assert known.problem.path.feed == 0.2


def test_angles_beyond_a_turn_are_meant_in_degrees() -> None:
    wide = 'relaxations=[{rows=["rx", "ry"], band=10}]'
    for options, said in (
        (["--path", "a.csv", "--frame", "0,0,0,0,0,90"], "--frame has an angle of 90 rad"),
        ([*on_circle("0.1"), "--set", wide], "a band of 10 rad is more than a turn"),
    ):
        text = complaint("plan", "panda", *options)
        assert said in text
        assert "in degrees?" in text


@pytest.mark.parametrize("command", sorted(MOVED))
def test_an_option_that_went_says_what_takes_its_place(command: str) -> None:
    """What it says is typed as it stands, and is a key of the file that the command reads."""
    settings = {item.name for item in fields(sm.files.ProgramSettings)}
    known = settings if command == "export" else set(keys_of(json_schema()))
    typed = {"--normal": "z", "--relax": "rx,ry=0.2@1:2", "--lock": "a=1", "--argument": "a=1"}
    for option in MOVED[command]:
        said = complaint(command, "panda", option, typed.get(option, "1"))
        (word,) = re.findall(rf"{option}: (--set .*)$", said)
        _, text = shlex.split(word)
        if "@" not in text:
            key, value = parse_setting(text)
            assert value != "" or option == "--argument"
            document: dict[str, Any] = {}
            set_key(document, key, value)
        parts = text.partition("=")[0].split(".")
        of_table = parts[0] == "robot" or parts[:2] == ["constraints", "ClosedPath"]
        assert ".".join(parts) in known or ".".join(parts[:2]) in known or of_table, text


def test_commands_that_went_say_what_takes_their_place() -> None:
    assert "selfmotion plan FILE --set goal=fastest" in complaint("fastest", "cell.toml")
    assert "python examples/moving_target.py" in complaint("track", "--seconds", "2")
    said = complaint("place", "cell.toml", "--x=-0.1,0.1", "--path-alone")
    assert "--x: --within x=-0.1,0.1; --path-alone: --of path" in said


def test_an_example_takes_keys_of_the_arm_and_its_links_alone(tmp_path: Path) -> None:
    out, links = tmp_path / "a.toml", "clearance.disabled=[['panda_link0', 'panda_link2']]"
    given = ("--set", f"robot.packages={tmp_path}", "--set", links)
    assert invoke("init", "panda", "--out", out, *given)[0] == 0
    text = out.read_text()
    assert '["panda_link0", "panda_link2"]' in text
    assert 'packages = ["."]' in text
    said = complaint("init", "panda", "--out", out, "--force", "--set", "path.duration=3")
    assert "--set path: an example takes robot.lock, robot.arguments" in said


def test_options_are_declared_once() -> None:
    """Each option that several commands share is one declaration, and all are few."""
    folder = Path(inspect.getfile(replacement)).parent
    text = "".join(file.read_text() for file in folder.glob("*.py"))
    assert len(re.findall(r"typer\.(?:Option|Argument)\(", text)) <= 60


def test_keys_are_completed_in_the_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("_SELFMOTION_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "selfmotion plan panda --set path.rad")
    monkeypatch.setenv("COMP_CWORD", "4")
    found = CliRunner().invoke(app, [], prog_name="selfmotion").stdout.split()
    assert {"path.radius=", "path.radius_mm="} <= set(found)


@pytest.mark.parametrize(
    ("goal", "what"), [("fastest", "the fastest motion"), ("parts", "a motion in parts")]
)
def test_options_without_effect_on_a_goal_are_refused(tmp_path: Path, goal: str, what: str) -> None:
    file = tmp_path / "problem.toml"
    assert invoke("init", "panda", "--out", file)[0] == 0
    said = complaint("plan", file, "--set", "max_evaluations=9", "--set", f"goal={goal}")
    assert f"max_evaluations: has no effect on {what}" in " ".join(said.split())
