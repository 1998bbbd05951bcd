"""What the shell says of files, keys and limits that are not what they should be."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.model.task import SE3
from selfmotion.planning.planner import LOOK_AT_POSES, NOTHING_IN_THE_WAY
from selfmotion.shell.cli.summaries import blocked_text
from selfmotion.shell.documents import example_text
from support.arms import robot_named
from support.shell import complaint, invoke, on_line

CIRCLE = """\
task = "pointing"
[robot]
name = "ur5"
[path]
kind = "circle"
start = { position = [0.5, 0.2, 0.3] }
radius_mm = 50
feed_mm = 20
"""
TIGHT = """\
[[constraints]]
kind = "JointPositionLimits"
lower = 0
upper = 0.1
"""


def problem(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "problem.toml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("command", ["compare", "check", "export"])
@pytest.mark.parametrize("name", ["none.program", "none.npz"])
def test_a_file_that_is_not_there_is_said_to_be_none(
    command: str, name: str, tmp_path: Path
) -> None:
    more = ("--out", tmp_path / "a.csv") if command == "export" else ()
    assert "no such file" in complaint(command, tmp_path / name, *more)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("speed_mm", "path.speed_mm: unknown key, did you mean 'feed_mm'?"),
        ("speed", "path.speed: unknown key, did you mean 'feed'?"),
    ],
)
def test_keys_are_told_with_the_units_that_were_written(
    key: str, said: str, tmp_path: Path
) -> None:
    assert said in complaint("plan", problem(tmp_path, CIRCLE.replace("feed_mm", key)))


def test_limits_that_keep_an_arm_from_its_path_are_named(tmp_path: Path) -> None:
    said = complaint("plan", problem(tmp_path, CIRCLE + TIGHT))
    assert "the arm's own limits let it be there: widen JointPositionLimits" in said
    assert "workspace" not in said
    # Where these are not in the way, the place is.
    far = CIRCLE.replace("0.5, 0.2", "3.0, 0.2")
    assert "JointPositionLimits" not in complaint("plan", problem(tmp_path, far))


def test_limits_the_wrong_way_round_are_told_in_words_of_files(tmp_path: Path) -> None:
    said = complaint("plan", problem(tmp_path, CIRCLE + TIGHT.replace("lower = 0", "lower = 1")))
    assert "replace = true" in said


def test_a_clearance_in_millimetres_is_refused_at_once(tmp_path: Path) -> None:
    asked = CIRCLE + '[[constraints]]\nkind = "Clearance"\ndistance = 5\n'
    assert "distance is 5 m, farther than" in complaint("plan", problem(tmp_path, asked))
    assert sm.constraints.Clearance(distance=3.0).distance == 3.0


def test_a_feed_that_no_process_has_is_noted() -> None:
    ur5 = robot_named("ur5")
    line = sm.paths.Line(np.eye(4), [[1, 0, 0, 0.01], *np.eye(4)[1:].tolist()], 1.0)
    slow, usual = (
        sm.Problem(ur5, sm.paths.Feed(line, feed), "pointing", clearance=None).remarks
        for feed in (3e-5, 3e-2)
    )
    assert any("a feed of 0.03 mm/s takes" in remark for remark in slow)
    assert any("feed = 0.03, feed_mm = 30" in remark for remark in slow)
    assert not any("mm/s takes" in remark for remark in usual)


def test_a_time_that_differs_by_digits_is_no_reason_beside_a_tool_off_its_path() -> None:
    ur5 = robot_named("ur5")
    start = ur5.dexterous_configuration("pointing")
    pose = ur5.pose(start)
    path = sm.paths.Circle.around(pose, 0.02, 2.0)
    motion = sm.Trajectory(
        np.array([0.0, 2.0 - 1.6e-6]), np.array([start, start]), np.zeros((2, 6)), ur5.joint_names
    )
    found = sm.certify(ur5, path, "pointing", motion)
    assert "off the path" in found.verdict
    assert "too short" not in found.verdict


def test_the_example_of_a_job_has_no_event_that_nothing_switches() -> None:
    """So that its first program for a controller is written."""
    text = example_text("ur5", "job.toml", job=True)
    assert '# events = [["tool on", 0.0]]' in text
    assert '\nevents = [["tool on"' not in text


def test_what_is_left_to_save_is_told_in_numbers_that_mean_something(tmp_path: Path) -> None:
    line = *on_line("0.03,0,0"), "--task", "pointing", "--set", "clearance=false", "-v"
    _, said = invoke("plan", "ur5", *line)
    (told,) = (text for text in said.splitlines() if "further saving possible" in text)
    assert "e-" not in told


POST = sm.obstacles.Box("post", [0.1, 0.12, 0.65], [0.1, 0.1, 0.6])


def test_where_no_motion_was_found_past_an_obstacle_it_is_said_with_what_may_help() -> None:
    ur5 = robot_named("ur5")
    pose = ur5.pose(ur5.dexterous_configuration("pointing"))
    line = sm.paths.Line(
        pose, SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.02])), 1.0
    )
    far = sm.obstacles.Box("post", [3.0, 0.0, 0.0], [0.1, 0.1, 0.1])
    held = sm.constraints.Clearance([far], 0.005)
    problem = sm.Problem(ur5, line, "pointing", "free", constraints=[], clearance=held)
    made = sm.plan(problem, search=sm.Search(starts=2, finalists=1))
    assert not blocked_text(made)
    findings = [
        replace(item, satisfied=False, amount=-0.02, subject="panda_link2 - post", time=0.5)
        if item.requirement == "clearance"
        else item
        for item in made.certificate.findings
    ]
    failed = replace(made.certificate, findings=tuple(findings), failures=("overlap",))
    looked = sm.result.Attempt(LOOK_AT_POSES, NOTHING_IN_THE_WAY, None, 0.0)
    blocked = replace(made, certificate=failed, report=replace(made.report, attempts=(looked,)))
    said = blocked_text(blocked)
    assert "no continuous motion was found" in said
    assert "panda_link2 - post at t = 0.500 s" in said
    assert "what may help: a smaller clearance" in said
    # Nothing is known of single poses where these were not looked at.
    unknown = replace(blocked, report=replace(made.report, attempts=()))
    assert "smaller clearance" not in blocked_text(unknown)


def test_a_clearance_that_a_pose_has_is_told_where_it_has_not_the_one_that_was_asked() -> None:
    panda = robot_named("panda")
    down = np.diag([1.0, -1.0, -1.0])
    begin, end = (SE3(down, np.array([0.5, y, 0.3])) for y in (-0.1, 0.3))
    line = sm.paths.Line(begin, end, 10.0)
    held = sm.constraints.Clearance([POST], 0.03)
    with pytest.raises(sm.SelfmotionError, match=r"what would help: .*a clearance of ") as error:
        sm.plan(sm.Problem(panda, line, "pose", "free", constraints=[], clearance=held))
    told = re.search(r"a clearance of ([0-9.]+) mm", str(error.value))
    apart = re.search(r"are ([0-9.]+) mm apart \(wanted: 30 mm\)", str(error.value))
    assert told is not None
    assert apart is not None
    assert float(apart[1]) - 0.2 <= float(told[1]) <= float(apart[1])
