"""What commands print by default: the verdict, one number, one remedy, and files."""

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app, summaries
from selfmotion.shell.cli.option_names import in_shell
from selfmotion.shell.cli.tables import show_certificate
from support.arms import robot_named
from support.shell import complaint, invoke, on_circle

# What a reader takes in at a glance.
MOST_LINES = 4


# A told saving is a slope over a small step: this near to what planning anew saves.
SLOPE = 0.2


def slowed(eased: float) -> sm.Plan:
    """A plan that one joint's speed limit keeps from a lower cost, or that limit eased."""
    arm, start = robot_named("planar_3r"), np.array([0.3, 0.8, 0.4])
    pose = arm.pose(start)
    end = pose.copy()
    end.translation = pose.translation + np.array([-1.2, 0.8, 0.0])
    path = sm.paths.Line(pose, end, 2.0)
    free = sm.plan(sm.Problem(arm, path, "planar", start))
    most = np.abs(free.trajectory.extremes(1)[1]).max(axis=0) * np.array([0.95, 3.0, 3.0])
    limits = [sm.constraints.JointVelocityLimits(most * (1.0 + eased))]
    return sm.plan(sm.Problem(arm, path, "planar", start, constraints=limits))


@pytest.fixture(scope="module")
def slow() -> sm.Plan:
    return slowed(0.0)


def told(show, thing) -> list[str]:
    page = io.StringIO()
    show(thing, Console(file=page, width=200))
    return page.getvalue().splitlines()


def test_of_a_plan_the_verdict_comes_first_then_cost_duration_and_what_would_help(
    slow: sm.Plan,
) -> None:
    lines = told(summaries.show_plan, slow)
    assert len(lines) <= MOST_LINES
    assert lines[0] == slow.certificate.summary
    assert lines[0].startswith("verified at all times: at most ")
    assert f"cost {slow.report.cost:.6g} (" in lines[1]
    assert "duration 2 s" in lines[1]
    first = slow.report.active[0]
    saving = 100.0 * first.saving / slow.report.cost
    assert first.easing.endswith(" % more speed for joint 'joint1'")
    assert lines[2].startswith(f"{first.easing} would lower the cost by about {saving:.2g} % (a ")


def test_a_told_saving_is_that_of_a_step_over_which_it_holds(slow: sm.Plan) -> None:
    first = slow.report.active[0]
    step = 0.01 * float(first.easing.partition(" %")[0])
    assert first.saving <= 1.05 * 0.01 * slow.report.cost
    saved = slow.report.cost - slowed(step).report.cost
    assert first.saving == pytest.approx(saved, rel=SLOPE)
    # In proportion, five times the step would save what it does not.
    assert slow.report.cost - slowed(5.0 * step).report.cost < (1.0 - SLOPE) * 5.0 * first.saving


@pytest.mark.parametrize("free", [False, True])
def test_where_a_path_leaves_the_reach_what_helps_is_told(free: bool) -> None:
    arm = robot_named("planar_3r")
    q = [0.0, 0.5, 0.5]
    end = arm.pose(q)
    end.translation *= 1.1
    line = sm.paths.Line(arm.pose(q), end, 4.0)
    plan = sm.plan(sm.Problem(arm, line, "planar", None if free else q))
    assert "out of reach" in plan.report.ending
    lines = told(summaries.show_plan, plan)
    assert lines[-1].startswith("what would help: the path moved" if free else "what may help: ")
    assert len(lines) <= MOST_LINES


def test_of_what_is_not_verified_the_first_reason_and_how_many_more(slow: sm.Plan) -> None:
    moved = replace(slow.trajectory, q=slow.trajectory.q + 0.3, qd=3.0 * slow.trajectory.qd)
    plan = replace(slow, trajectory=moved)
    plan = replace(plan, certificate=plan.check())
    failures = plan.certificate.failures
    assert len(failures) > 1
    lines = told(summaries.show_plan, plan)
    assert lines[0] == f"not verified: {failures[0]}; and {len(failures) - 1} more (--verbose)"
    assert len(lines) <= MOST_LINES


def test_what_was_not_checked_is_never_left_out(slow: sm.Plan) -> None:
    check = slow.certificate
    assert "not checked: accelerations, self-collision" in check.summary
    noted = replace(check, notes=("the arm has changed",), motion=check.motion)
    assert noted.summary.endswith("; the arm has changed")


def test_a_plan_that_was_cut_short_says_so(slow: sm.Plan) -> None:
    early = sm.plan(slow.problem, max_evaluations=2)
    lines = told(summaries.show_plan, early)
    if early.certificate.verified:
        assert any(in_shell(early.report.message) in line for line in lines)
    else:
        assert lines[0].startswith("not verified")


def test_a_retimed_plan_has_no_cost_of_before(slow: sm.Plan) -> None:
    fast = sm.retime(slow, 10.0, 10.0)
    lines = told(summaries.show_plan, fast)
    assert lines[1] == f"duration {fast.trajectory.duration:.4g} s"
    assert not any(line.startswith("cost") for line in lines)


def test_commands_are_short_unless_asked(slow: sm.Plan, tmp_path: Path) -> None:
    file, motion = tmp_path / "plan.npz", tmp_path / "motion.csv"
    slow.save(file)
    for command in (["check", file], ["export", file, "--out", motion]):
        words = list(map(str, command))
        short = CliRunner().invoke(app, words).output.splitlines()
        whole = CliRunner().invoke(app, [*words, "--verbose"]).output
        assert len(short) <= MOST_LINES
        assert slow.certificate.summary in short[0]
        # However a terminal wraps it.
        assert slow.certificate.verdict in " ".join(whole.split())


def test_json_is_whole_without_verbose(slow: sm.Plan, tmp_path: Path) -> None:
    slow.save(tmp_path / "plan.npz")
    run = ["check", str(tmp_path / "plan.npz"), "--json"]
    found = [json.loads(CliRunner().invoke(app, [*run, *more]).output) for more in ([], ["-v"])]
    assert found[0] == found[1]
    assert found[0]["verdict"] == slow.certificate.verdict
    assert found[0]["findings"]


# What the shell says is in its own words: options, not arguments of Python.

TABLE = "x,y,z\n0.4,0,0.4\n0.5,0,0.4\n"


TIMED = "t,x,y,z\n0,0.4,0,0.4\n1,0.5,0,0.4\n"


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (TABLE, "--feed 0.1", "(--task position)"),
        (TABLE, "--task position", "give either --feed (m/s) or path.duration (s)"),
        (
            TIMED,
            "--task position --set path.duration=3",
            "so that path.duration has no effect; drop it",
        ),
        (TABLE, "--feed 0.1 --set path.jump=0.01 --task position", "give a larger --set path.jump"),
        (
            TABLE,
            "--set path.duration=1 --set path.corners=round --task position",
            "which needs --feed (m/s)",
        ),
    ],
)
def test_remedies_name_options(text: str, options: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    assert said in complaint("plan", "panda", "--path", file, *options.split())


def test_the_order_of_quaternions_is_asked_for_by_its_option(tmp_path: Path) -> None:
    np.save(tmp_path / "seam.npy", np.ones((3, 7)))
    line = complaint("plan", "panda", "--path", tmp_path / "seam.npy", "--feed", "0.1")
    assert "give --set path.columns ('x,y,z,qw,qx,qy,qz' or 'x,y,z,qx,qy,qz,qw')" in line


def test_remedies_for_arms_name_options(tmp_path: Path) -> None:
    line = complaint("plan", "ur5", *on_circle("0.05"), "--task", "pose")
    assert "take another --task (position, pointing, planar), relax some" in line
    urdf = tmp_path / "two.urdf"
    parts = ['<link name="base"/>']
    for name in "ab":
        parts.append(f'<link name="{name}"/><joint name="j{name}" type="continuous">')
        parts.append(f'<parent link="base"/><child link="{name}"/><axis xyz="0 0 1"/></joint>')
    urdf.write_text(f'<robot name="two">{"".join(parts)}</robot>')
    assert complaint("plan", urdf, *on_circle("0.1")).endswith("name the tool frame with --tool")


def test_problem_files_keep_their_own_words(tmp_path: Path) -> None:
    sm.files.write_problem(sm.sample_problem(), tmp_path / "problem.toml")
    text = (tmp_path / "problem.toml").read_text()
    (tmp_path / "problem.toml").write_text(text.replace('task = "planar"', 'task = "pose"'))
    line = complaint("plan", tmp_path / "problem.toml")
    assert "choose another task (planar), or relax rows that it cannot move (relaxations=)" in line
    assert "--task" not in line


def test_a_circle_of_a_planar_arm_lies_in_its_plane(tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    code, _ = invoke("plan", "planar_3r", *on_circle("0.3", "z"), "--out", file, "--json")
    assert code == 0
    plan = sm.load_plan(file)
    assert plan.problem.task is sm.Task.PLANAR
    heights = [plan.path.pose(t).translation[2] for t in (0.0, 1.0, 2.0)]
    assert max(heights) - min(heights) < 1e-12


def test_a_feed_that_is_not_reached_says_how_the_shell_allows_less(tmp_path: Path) -> None:
    """Cuts of real programs are shorter than what a run-up takes."""
    cut = tmp_path / "cut.nc"
    cut.write_text("G21 G90\nG0 X400 Y0 Z400\nG1 X401 F6000\nG1 X402\nG0 Z420\nM30\n")
    robot, path = sm.load_robot("panda"), sm.files.read_path(cut)
    still = sm.Trajectory(np.array([0.0, path.duration]), *np.zeros((2, 2, 7)), robot.joint_names)
    found = sm.Problem(robot, path, "position").certify(still)
    assert "or allow it more (within=" in found.verdict
    file = io.StringIO()
    show_certificate(found, {}, robot, Console(file=file, width=400))
    assert "or allow it more (--set path.within=0." in file.getvalue()
    assert in_shell("without it (Feed.original)") == "without it (a duration in its place)"
    seam = "seam 'cut': ask for 0.1 m/s, or allow it more (within=0.5)"
    assert in_shell(seam) == seam
