"""What the site shows of the examples: each is run while the site is built."""

import io
import os
import runpy
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.cli import app
from selfmotion.replay import write_replay

EXAMPLES = Path(__file__).parent.parent / "examples"
# In the order of the page; a file that is in none of the groups does not build.
GROUPS = {
    "Jobs": (
        "quickstart", "weld_seam", "deburring", "painting", "closed_loop", "ur5_pointing", "rail",
        "weld_corner", "weld_positioner", "weld_torch", "part_in_hand", "two_arms", "own_arm",
        "relaxed_rows", "in_parts", "weld_frame", "print_frame", "deburr_holes", "retiming",
        "warm_start",
    ),
    "To and from other programs": (
        "ros2_handover", "foreign_motion", "placement_map", "dask_cluster",
    ),
    "While the arm moves": ("moving_target", "udp_bridge"),
    "Parts of one's own": (
        "own_cost", "own_constraint", "own_path", "own_null_motion", "own_obstacle",
        "own_optimizer",
    ),
    "The paper": ("study_joint_speeds", "study_other_works", "study_surging"),
}  # fmt: skip
_PLAYED = (sm.Plan, sm.Program, sm.Parts)
SHELL = "plan examples/cell.toml"


@dataclass(frozen=True)
class Shown:
    """An example that was run.

    Attributes
    ----------
    name : str
    code, output : str
    plan : Plan, Program, Parts or None
        The last one it made.
    """

    name: str
    code: str
    output: str
    plan: sm.Plan | sm.Program | sm.Parts | None

    @property
    def title(self) -> str:
        """The first sentence of the file."""
        return self.code.split('"""')[1].strip().splitlines()[0]

    def replay(self) -> str:
        """Return the page that replays the plan."""
        with tempfile.TemporaryDirectory() as folder:
            return write_replay(self.plan, Path(folder) / "replay.html").read_text()


def run_all() -> dict[str, Shown]:
    """Run every example, each in the same empty folder."""
    names = [name for group in GROUPS.values() for name in group]
    there = sorted(file.stem for file in EXAMPLES.glob("*.py"))
    if sorted(names) != there:
        raise ValueError(f"examples: shown are {sorted(names)}, but there are {there}")
    with _empty_folder():
        return {name: _run(name) for name in names}


def run_shell() -> str:
    """Return what `SHELL` prints."""
    with _empty_folder():
        Path("examples").symlink_to(EXAMPLES)
        result = CliRunner().invoke(app, SHELL.split(), env={"COLUMNS": "90"})
    if result.exit_code != 0:
        raise RuntimeError(f"selfmotion {SHELL}: {result.output}")
    return result.stdout


def _run(name: str) -> Shown:
    file, printed = EXAMPLES / f"{name}.py", io.StringIO()
    with redirect_stdout(printed):
        made = runpy.run_path(str(file), run_name="__main__")
    named = (made.get(name) for name in ("plan", "program", "parts"))
    plan = next((item for item in named if isinstance(item, _PLAYED)), None)
    return Shown(name, file.read_text(), printed.getvalue(), plan)


@contextmanager
def _empty_folder() -> Iterator[None]:
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)
