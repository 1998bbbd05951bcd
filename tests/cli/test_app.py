"""The command line as a user types it."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rich.console import Console
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.basics import jit, seconds_waited_for_kernels
from selfmotion.shell.cli import app
from selfmotion.shell.cli.app import StageDisplay
from support.shell import complaint, in_full, invoke, on_circle, on_line

SELFMOTION = Path(sys.executable).with_name("selfmotion")


def run(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"COLUMNS": "120"}
    command = [SELFMOTION, *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, check=False, cwd=cwd
    )


def test_plan_check_and_replay(tmp_path: Path) -> None:
    plan, csv, html = tmp_path / "plan.npz", tmp_path / "plan.csv", tmp_path / "a.html"
    planned = run(
        "plan", "planar_3r", *on_circle("0.5", "z"), "--task", "planar",
        "--set", "costs.InverseManipulability.mu=1", "--out", plan, "--out", csv, "--html", html,
        "--verbose",
    )  # fmt: skip
    assert planned.returncode == 0, planned.stderr
    for word in ("joint velocity", "inverse manipulability", "total", "verified", "evaluations"):
        assert word in planned.stdout
    assert "\x1b" not in planned.stdout
    assert sm.load_plan(plan).certificate.verified
    assert len(csv.read_text().splitlines()) == len(sm.load_plan(plan).trajectory.t) + 1
    assert html.stat().st_size > 100_000

    code, checked = invoke("check", plan)
    assert code == 0
    assert "verified at all times" in checked

    again = tmp_path / "b.html"
    assert invoke("replay", plan, "--html", again)[0] == 0
    assert again.read_bytes() == html.read_bytes()

    picture, arrays = tmp_path / "map.png", tmp_path / "map.npz"
    for file in (picture, arrays):
        code, told = invoke("replay", plan, "--html", again, "--map", file)
        assert code == 0
        assert f"wrote {file}" in told
    assert picture.read_bytes().startswith(b"\x89PNG")
    shown = sm.result.RedundancyMap.load(arrays)
    np.testing.assert_array_equal(shown.state, sm.load_plan(plan).redundancy_map().state)


def test_plan_through_waypoints(tmp_path: Path) -> None:
    robot = sm.load_robot("panda")
    start = robot.dexterous_configuration()
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 0.05), 2.0)
    rows = ["t,x,y,z,qw,qx,qy,qz"]
    for t in np.linspace(0, 2, 9):
        pose = line.pose(t)
        x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
        rows.append(",".join(map(repr, map(float, [t, *pose.translation, w, x, y, z]))))
    file = tmp_path / "path.csv"
    file.write_text("\n".join(rows) + "\n")
    code, text = invoke("plan", "panda", "--path", file, "--task", "pose", "-v")
    assert code in (0, 1)
    assert "position error" in text


def test_unverified_plans_exit_with_1(tmp_path: Path) -> None:
    plan = tmp_path / "plan.npz"
    fast = run("plan", "panda", *on_circle("0.15"), "--set", "path.duration=0.5", "--out", plan)
    assert fast.returncode == 1
    assert "not verified: joint" in fast.stdout
    assert invoke("check", plan)[0] == 1


MU, MOST = "costs.InverseManipulability.mu", "max_evaluations"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("plan", "ur5", *on_circle("0.1")), "error: ur5: 6 joints and task 'pose'"),
        (("plan", "panda"), "error: give the tool motion: --path FILE, or"),
        (("plan", "panda", "--path", "no.csv"), "error: no.csv: cannot be read"),
        (("plan", "a.dxf"), "error: a.dxf: is a path, expected a robot or a problem file first"),
        (("plan", "a.npz"), "error: a.npz: holds motions that are planned, expected a robot or a"),
        (("plan", "panda", *on_circle("0.1"), "--start", "1,2"), "shape (2,), expected (7,)"),
        (("plan", "panda", *on_circle("0.1"), "--start", "a"), "error: --start is 'a'"),
        (("plan", "panda", *on_line("1,2")), "error: by: is [1.0, 2.0], expected three numbers"),
        (("plan", "panda", *on_circle("0.1"), "--out", "a.txt"), "--out writes .npz"),
        (
            ("plan", "panda", *on_circle("0.1"), "--set", "costs.InverseManipulability.mu=-1"),
            "mu is -1",
        ),
        (
            ("plan", "panda", *on_circle("0.1"), "--set", "max_evaluations=0"),
            "max_evaluations is 0",
        ),
        (("check", "no.npz"), "error: no.npz: no such file"),
        (("replay", "no.npz"), "error: no.npz: no such file"),
        (("replay", "no.npz", "--map", "a.svg"), "--map: a.svg is neither a .png nor a .npz file"),
        (("replay", "a.npz", "b.npz", "--map", "a.png"), "a redundancy map is of one plan"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments: tuple[str, ...], message: str) -> None:
    assert message in complaint(*arguments)


def test_a_shell_sees_one_line_and_exit_2() -> None:
    result = run("plan", "nosuch", *on_circle("0.1"))
    assert result.returncode == 2
    assert "error: unknown robot 'nosuch'" in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_robots_lists_every_arm() -> None:
    code, text = invoke("robots")
    assert code == 0
    for name in sm.NAMED_ARMS:
        assert name in text
    assert "panda_hand_tcp" in text


COMMANDS = (
    "plan", "init", "schema", "check", "export", "compare", "replay", "batch", "robots", "demo",
    "study",
)  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_an_example(command: str) -> None:
    code, text = invoke(command, "--help")
    assert code == 0
    assert f"Example: selfmotion {command}" in text


def test_help_loses_no_words() -> None:
    """What is in brackets is no markup, or says so."""
    from typer.main import get_command

    for name, command in get_command(app).commands.items():  # type: ignore[attr-defined]
        _, text = invoke(name, "--help")
        seen = "".join(re.findall(r"[^\s│]", text))
        for parameter in command.params:
            said = (getattr(parameter, "help", None) or "").replace("\\[", "[")
            for word in re.findall(r"\[+[^\]]*\]+", said):
                assert "".join(word.split()) in seen, (name, parameter.name, word)


def test_demo(tmp_path: Path) -> None:
    assert invoke("demo", "--out", tmp_path / "out")[0] == 0
    names = {f"{name}.{kind}" for name in ("planar", "panda") for kind in ("npz", "csv", "html")}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names


def test_a_path_that_leaves_the_workspace_exits_with_1(tmp_path: Path) -> None:
    file, html = tmp_path / "plan.npz", tmp_path / "a.html"
    line = ("plan", "planar_3r", *on_line("11,0,0"), "--set", "path.duration=8", "--task", "planar")
    for asked in ((*line, "--out", file, "--html", html), ("check", file)):
        code, output = invoke(*asked)
        assert code == 1, asked
        text = " ".join(output.split())
        assert "not verified: the motion ends at t =" in text
        assert "the pose is out of reach" in text
    assert html.stat().st_size > 100_000

    code, output = invoke(*line, "--set", "damping=true")
    assert code == 1
    text = " ".join(output.split())
    assert "m off the path at t = " in text
    assert "where damping was active" in text


@pytest.mark.site
def test_a_log_names_the_stages_and_the_gap(tmp_path: Path) -> None:
    planned = run(
        *("plan", "planar_3r", *on_circle("0.1", "z"), "--task", "planar"),
        *("--set", "search.compare=true", "--verbose"),
    )
    assert planned.returncode in (0, 1), planned.stderr
    assert planned.stderr.splitlines()[-1].startswith("checking the motion")
    assert "refining sequence" in planned.stderr
    assert "\x1b" not in planned.stderr
    assert "% from its best motion" in planned.stdout


def test_retime_and_fastest(tmp_path: Path) -> None:
    robot = sm.load_robot("panda")
    start = robot.dexterous_configuration()
    line = sm.paths.Line(robot.pose(start), robot.pose(start + 0.05), 2.0)
    problem = sm.Problem(robot, line, start=start)
    file, plan, fast = (tmp_path / name for name in ("line.toml", "plan.npz", "fast.npz"))
    sm.files.write_problem(problem, file)
    sm.plan(problem).save(plan)
    code, told = invoke("retime", plan, "--acceleration", "8", "--out", fast, "-v")
    assert code == 0, told
    assert "limits used fully" in told
    assert sm.load_plan(fast).trajectory.duration < 1.0
    with pytest.raises(sm.errors.PlanError, match=r"at any pace in 1e-06 s"):
        invoke("plan", file, "--set", "goal=fastest", "--deadline", "1e-6")


def test_help_begins_with_plan_and_job() -> None:
    shown = CliRunner().invoke(app, ["--help"]).output
    listed = re.findall(r"^\W*([a-z-]+)  ", shown.partition("Plan ─")[2], re.MULTILINE)
    assert listed[:2] == ["plan", "job"]
    for panel in ("Plan", "Inspect plans", "Files", "To begin with", "While the arm moves"):
        assert f"{panel} ─" in shown


# Stages are shown in terminals and logs.


@pytest.mark.parametrize("terminal", [True, False])
def test_stages_are_shown_in_terminals_and_logs(terminal: bool) -> None:
    console = Console(force_terminal=terminal, width=100, record=True, file=open_nothing())
    with StageDisplay(console) as display:
        for number in range(1, 25):
            display.stage("start", number, 24)
        display.stage("no motion passes t = 2 s", 0, 0)
        display.stage("checking", 1, 1)
    lines = console.export_text().splitlines()
    # News stay on a terminal as well, where stages are a bar that is gone at the end.
    assert any(line.endswith("no motion passes t = 2 s") for line in lines)
    if not terminal:
        assert lines == [
            "optimising start 1 of 24",
            "no motion passes t = 2 s",
            "checking the motion",
        ]


def test_long_stages_say_how_long_they_will_last(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    shown = io.StringIO()
    with StageDisplay(Console(force_terminal=True, width=100, file=shown)) as display:
        for number in range(1, 5):
            display.stage("long", number, 10)
            now[0] += 0.5
        display._progress.refresh()
        for number in range(1, 5):
            display.stage("short", number, 10)
            now[0] += 0.05
        display._progress.refresh()
    # Three of ten took 1.5 s, so that seven will take 3.5.
    assert "long 4 of 10, 2 s so far, about 4 s to go" in shown.getvalue()
    assert "short 4 of 10 " in shown.getvalue()


def test_kernels_that_compile_are_no_part_of_what_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first of 31 starts took 10 s, 9.6 s of it to compile: the others take no such time."""
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(jit._waited, "_clock", lambda: now[0])
    before = seconds_waited_for_kernels()
    shown = io.StringIO()
    with StageDisplay(Console(force_terminal=True, width=100, file=shown)) as display:
        display.stage("screening", 1, 31)
        now[0] += 0.2
        with jit._waited:
            now[0] += 9.6
            # What goes on counts as well; within one another once.
            with jit._waited:
                assert seconds_waited_for_kernels() - before == pytest.approx(9.6)
        now[0] += 0.2
        display.stage("screening", 2, 31)
        display._progress.refresh()
    assert "2 of 31, 10 s so far, about 12 s to go" in shown.getvalue()


def test_a_log_is_never_silent_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage that tells nothing while it lasts has its line all the same."""
    # By this name the package has the application.
    module = sys.modules["selfmotion.shell.cli.app"]
    monkeypatch.setattr(module, "_SILENT", 0.05)
    monkeypatch.setattr(module, "_TICK", 0.01)
    monkeypatch.setattr(module, "_WORTH_SAYING", 0.0)
    shown = io.StringIO()
    with StageDisplay(Console(force_terminal=False, width=100, file=shown)) as display:
        display.stage("refining", 1, 1)
        deadline = time.monotonic() + 5.0
        while shown.getvalue().count("\n") < 3 and time.monotonic() < deadline:
            time.sleep(0.01)
    first, *later = shown.getvalue().splitlines()
    assert first.startswith("refining the motion")
    assert len(later) >= 2
    assert all(line == "refining the motion, 0 s so far" for line in later)
    ended = shown.getvalue()
    time.sleep(0.1)
    assert shown.getvalue() == ended


def test_where_the_number_is_not_known_it_counts() -> None:
    shown = io.StringIO()
    with StageDisplay(Console(force_terminal=True, width=100, file=shown)) as display:
        for number in (1, 2, 3):
            display.stage("places", number, 0)
        display._progress.refresh()
    assert "trying place 3" in shown.getvalue()
    assert " of 0" not in shown.getvalue()


def open_nothing() -> io.StringIO:
    return io.StringIO()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("check", "no.npz"), {"class": "FileFormatError", "file": "no.npz", "key": None}),
        (("plan", "bad.toml"), {"file": "bad.toml", "key": "path", "line": None}),
        (("plan", "panda", "--path", "bad.csv"), {"file": "bad.csv", "line": 3, "key": None}),
        (("plan", "nosuch", *on_circle("0.1")), {"class": "RobotError", "file": None}),
        (("plan", "panda", *on_circle("0.1"), "--nosuch"), {"class": "NoSuchOption"}),
        (("plan", "ur5", *on_circle("0.1")), {"class": "RedundancyError", "dof": 6, "rows": 6}),
        (("plan", "my file.toml"), {"file": "my file.toml", "key": "path"}),
        (("plan",), {"class": "MissingParameter"}),
    ],
)
def test_of_bad_input_a_program_sees_json(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    expected: dict[str, object],
) -> None:
    (tmp_path / "bad.toml").write_text('[robot]\nname = "panda"\n[path]\nfle = "x.csv"\n')
    shutil.copy(tmp_path / "bad.toml", tmp_path / "my file.toml")
    (tmp_path / "bad.csv").write_text("t,x,y,z\n0,0.3,0,0.5\n1,0.3,zero,0.5\n")
    monkeypatch.chdir(tmp_path)
    code, output, errors = in_full(*arguments, "--json")
    assert code == 2, errors
    error = json.loads(output)["error"]
    assert error | expected == error
    assert error["message"]
    assert error["message"] in errors
