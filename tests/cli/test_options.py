"""The shell knows what Python knows: each option is the problem that it stands for."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shell.cli.options import relaxation, search_of
from support.arms import PANDA_HOME, robot_named
from support.shell import complaint, invoke

HOME = ",".join(map(str, PANDA_HOME.tolist()))


SRDF = '<robot name="panda"><disable_collisions link1="panda_link5" link2="panda_link7"/></robot>'


def planned(folder: Path, *options: str | Path) -> sm.Plan:
    """Return the plan of a Panda on a circle, with further options."""
    out = folder / "plan.npz"
    code, text = invoke(
        "plan", "panda", "--circle", "0.05", "--start", HOME, "--out", out, "--json", *options
    )
    assert code == 0, text
    assert json.loads(text)["certificate"]["verified"]
    return sm.load_plan(out)


def kinds(plan: sm.Plan) -> list[dict[str, Any]]:
    return [item.to_dict() for item in plan.problem.constraints]


def test_limits_and_closed_paths(tmp_path: Path) -> None:
    plan = planned(tmp_path, "--velocity", "2", "--acceleration", "9,9,9,9,9,9,8", "--closed")
    asked = {item["kind"]: item for item in kinds(plan)}
    assert set(asked) == {
        "JointPositionLimits", "JointVelocityLimits", "JointAccelerationLimits", "JointJerkLimits",
        "ClosedPath",
    }  # fmt: skip
    assert asked["JointVelocityLimits"]["limit"] == 2.0
    assert asked["JointAccelerationLimits"]["limit"] == [9, 9, 9, 9, 9, 9, 8]


def test_a_start_by_its_name(tmp_path: Path) -> None:
    plan = planned(tmp_path, "--start", "home")  # the last one counts
    np.testing.assert_allclose(plan.trajectory.q[0], robot_named("panda").home, atol=1e-12)
    assert "--start is 'there', expected numbers" in complaint(
        "plan", "panda", "--circle", "0.05", "--start", "there"
    )


def test_costs_by_name(tmp_path: Path) -> None:
    plan = planned(
        tmp_path, "--cost", "JointAcceleration=0.1", "--cost", "SmallestSingularValue=0.01",
        "--cost", "KineticEnergy", "--degree", "2",
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
        tmp_path, "--obstacles", cell, "--clearance", "0.01", "--srdf", tmp_path / "arm.srdf",
        "--lock", "panda_finger_joint1=0.03", "--tool", "panda_hand",
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
    twice = complaint("plan", "panda", "--circle", "0.1", "--obstacles", tmp_path / "twice.json")
    assert "box 'post': a link or another obstacle has this name too" in twice


def test_self_collision_can_be_left_out(tmp_path: Path) -> None:
    plan = planned(tmp_path, "--no-self-collision", "--damped")
    assert plan.problem.clearance is None
    assert plan.problem.damping == sm.Damping()


def test_a_plan_can_start_from_another(tmp_path: Path) -> None:
    first = planned(tmp_path)
    out = tmp_path / "next.npz"
    code, _ = invoke(
        "plan", "panda", "--line", "0,0.05,0", "--from", tmp_path / "plan.npz", "--out", out
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
        (("--cost", "Speed"), "--cost is 'Speed', expected NAME or NAME=WEIGHT"),
        (("--cost", "PathLength=1"), "--cost: PathLength has no weight"),
        (("--cost", "JointVelocity=a"), "--cost is 'a', expected numbers"),
        (("--frame", "0,0,0,0,0,0"), "--frame is for --path: a shape is one"),
        (("--corners", "blend"), "--corners is for --path"),
        (("--corner-tolerance", "0.01"), "--corner-tolerance is for --path"),
        (("--jump", "0.1"), "--jump is for --path"),
        (("--rotary-axes", "BC"), "--rotary-axes is for --path"),
        (("--rotary-center", "0,0,0"), "--rotary-center is for --path"),
        (("--lock", "a=1", "--lock", "a=2"), "--lock says 'a' twice; say it once"),
        (("--argument", "a=1", "--argument", "a=2"), "--argument says 'a' twice"),
        (("--set", "path.radius=1", "--set", "path.radius_mm=2"), "--set says 'path.radius' twice"),
        (("--clearance", "0.01", "--no-self-collision"), "has no effect beside --obstacles"),
        (("--feed", "0.1", "--duration", "2"), "give the pace by one of --feed and --duration"),
        (("--lock", "a"), "--lock is 'a', expected NAME=VALUE"),
        (("--lock", "a=1"), "lock names joint 'a'"),
        (("--from", "no.npz"), "no.npz: no such file"),
        (("--obstacles", "no.toml"), "no.toml: cannot be read"),
        (("--velocity", "1,2"), "one for each of the 7 joints"),
        (("--srdf", "no.srdf"), "no.srdf: SRDF cannot be read"),
        (("--out", "a.txt"), "--out writes .npz (the plan)"),
    ],
)
def test_what_is_wrong_is_one_line(options: tuple[str, ...], said: str) -> None:
    assert said in complaint("plan", "panda", "--circle", "0.1", *options)


def test_a_normal_is_of_a_circle_and_processes_are_of_one_machine() -> None:
    said = complaint("plan", "panda", "--line", "0.1,0,0", "--normal", "z")
    assert "--normal is for --circle" in said
    for command in ("batch", "job"):
        said = complaint(command, "a.toml", "--workers", "2", "--dask", "127.0.0.1:8786")
        assert "--workers has no effect beside --dask" in said


def test_a_search_of_the_shell_leaves_the_rest_as_the_file_says() -> None:
    known = sm.Search(starts=7, finalists=2, mode="global", rng=5)
    assert search_of(None, True, known) == replace(known, compare=True)
    assert search_of("local", False, known) == replace(known, mode="local")
    assert search_of("local", False) == sm.Search(mode="local")
    assert search_of(None, False, known) is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--path", "a.csv", "--frame", "0,0,0,0,0,90"], "--frame has an angle of 90 rad"),
        (["--circle", "0.1", "--relax", "rx,ry=10"], "a band of 10 rad is more than a turn"),
        (["--circle", "0.1", "--relax", "rx,ry"], ""),
    ],
)
def test_angles_beyond_a_turn_are_meant_in_degrees(options: list[str], said: str) -> None:
    if said:
        text = complaint("plan", "panda", *options)
        assert said in text
        assert "in degrees?" in text
    else:
        assert relaxation(options[-1]).band == np.inf


@pytest.mark.parametrize(
    ("goal", "what"), [("fastest", "the fastest motion"), ("parts", "a motion in parts")]
)
def test_options_without_effect_on_a_goal_are_refused(tmp_path: Path, goal: str, what: str) -> None:
    file = tmp_path / "problem.toml"
    assert invoke("init", "panda", "--out", file)[0] == 0
    for option in ("--deadline", "--max-evaluations"):
        said = complaint("plan", file, option, "9", "--set", f"goal={goal}")
        assert f"{option} has no effect on {what}" in " ".join(said.split())
