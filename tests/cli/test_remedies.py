"""What the shell says is in its own words: options, not arguments of Python."""

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.cli.summaries import in_shell
from selfmotion.cli.tables import show_certificate
from support.shell import complaint, invoke

TABLE = "x,y,z\n0.4,0,0.4\n0.5,0,0.4\n"


TIMED = "t,x,y,z\n0,0.4,0,0.4\n1,0.5,0,0.4\n"


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (TABLE, "--feed 0.1", "(--task position)"),
        (TABLE, "--task position", "give either --feed (m/s) or --duration (s)"),
        (TIMED, "--task position --duration 3", "so that --duration has no effect; drop it"),
        (TABLE, "--feed 0.1 --jump 0.01 --task position", "give a larger --jump"),
        (TABLE, "--duration 1 --corners round --task position", "which needs --feed (m/s)"),
    ],
)
def test_remedies_name_options(text: str, options: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    assert said in complaint("plan", "panda", "--path", file, *options.split())


def test_the_order_of_quaternions_is_asked_for_by_its_option(tmp_path: Path) -> None:
    np.save(tmp_path / "seam.npy", np.ones((3, 7)))
    line = complaint("plan", "panda", "--path", tmp_path / "seam.npy", "--feed", "0.1")
    assert "give --columns ('x,y,z,qw,qx,qy,qz' or 'x,y,z,qx,qy,qz,qw')" in line


def test_remedies_for_arms_name_options(tmp_path: Path) -> None:
    line = complaint("plan", "ur5", "--circle", "0.05", "--task", "pose")
    assert "take another --task (position, pointing, planar), relax some" in line
    urdf = tmp_path / "two.urdf"
    parts = ['<link name="base"/>']
    for name in "ab":
        parts.append(f'<link name="{name}"/><joint name="j{name}" type="continuous">')
        parts.append(f'<parent link="base"/><child link="{name}"/><axis xyz="0 0 1"/></joint>')
    urdf.write_text(f'<robot name="two">{"".join(parts)}</robot>')
    assert complaint("plan", urdf, "--circle", "0.1").endswith("name the tool frame with --tool")


def test_problem_files_keep_their_own_words(tmp_path: Path) -> None:
    sm.files.write_problem(sm.sample_problem(), tmp_path / "problem.toml")
    text = (tmp_path / "problem.toml").read_text()
    (tmp_path / "problem.toml").write_text(text.replace('task = "planar"', 'task = "pose"'))
    line = complaint("plan", tmp_path / "problem.toml")
    assert line.endswith("choose another task (planar)")
    assert "--task" not in line


def test_a_circle_of_a_planar_arm_lies_in_its_plane(tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    code, _ = invoke("plan", "planar_3r", "--circle", "0.3", "--out", file, "--json")
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
