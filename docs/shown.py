"""What the site shows of examples and of pages with code: each is run while the site is built."""

import io
import os
import re
import runpy
import shlex
import tempfile
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.shell.cli import app
from selfmotion.shell.replay import write_replay

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"
PAGES = Path(__file__).parent / "pages"
# Pages that show below each of their blocks what it prints.
PRINTING = (*sorted(PAGES.glob("howto/*.md")), PAGES / "from_other_tools.md")
# Folders of the repository that pages and examples name files of.
_BESIDE = ("examples", "benchmarks")
# A block of a page: its language, what is said of it, and its text.
BLOCK = re.compile(r"^```(\w*)([^\n]*)\n(.*?)^```\n", re.DOTALL | re.MULTILINE)
_TITLE = re.compile(r'title="([^"]*)"')
_COLUMNS = {"COLUMNS": "90"}
# In the order of the page; a file that is in none of the groups does not build.
GROUPS = {
    "Jobs": (
        "quickstart", "weld_seam", "deburring", "painting", "closed_loop", "ur5_pointing", "rail",
        "mobile_base",
        "weld_corner", "weld_positioner", "weld_downhand", "weld_torch", "part_in_hand", "two_arms",
        "own_arm",
        "relaxed_rows", "in_parts", "paint_strokes", "weld_frame", "print_frame", "deburr_holes",
        "retiming", "warm_start",
    ),
    "To and from other programs": (
        "ros2_handover", "foreign_motion", "placement_map", "dask_cluster",
    ),
    "While the arm moves": ("moving_target", "policy_chunks", "udp_bridge"),
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


@dataclass(frozen=True)
class Page:
    """A page whose blocks were run.

    Attributes
    ----------
    file : Path
    text : str
        Of the page, below each block what it printed.
    names : dict
        What its Python knows in the end.
    folder : Path
        Where its files are.
    """

    file: Path
    text: str
    names: dict[str, object]
    folder: Path


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
        return _invoked(SHELL.split())


def run_page(file: Path, *, not_run: Collection[str] = ()) -> Page:
    """Run the blocks of a page in their order, in this folder and one Python.

    Files are those that the page shows, each by its title. Commands of `not_run` are passed over.
    """
    text = file.read_text()
    for name in _BESIDE:
        Path(name).symlink_to(ROOT / name)
    for _, said, content in BLOCK.findall(text):
        if title := _TITLE.search(said):
            Path(title[1]).write_text(content)
    names: dict[str, object] = {"__name__": "page"}

    def with_output(block: re.Match[str]) -> str:
        language, said, content = block.groups()
        printed = ""
        if language == "python":
            stream = io.StringIO()
            with redirect_stdout(stream):
                exec(compile(content, str(file), "exec"), names)
            printed = stream.getvalue()
        elif language == "console":
            commands = [shlex.split(line, comments=True) for line in content.splitlines()]
            printed = _session(
                [each for each in commands if shlex.join(each) not in ("", *not_run)]
            )
        elif not _TITLE.search(said):
            raise ValueError(f"{file.name}: a block of {language} that is neither run nor a file")
        # What is told of files is where a reader has them.
        printed = printed.replace(f"{Path.cwd()}/", "").strip()
        return f'{block[0]}\n````text title="prints"\n{printed}\n````\n' if printed else block[0]

    return Page(file, BLOCK.sub(with_output, text), names, Path.cwd())


def _session(commands: Sequence[Sequence[str]]) -> str:
    """Return what commands print, each below itself where there are several."""
    printed = []
    for command in commands:
        program, *words = command
        if program != "selfmotion":
            raise ValueError(f"{shlex.join(command)}: a page shows commands of selfmotion only")
        output = _invoked(words).strip()
        if output:
            head = f"$ {shlex.join(command)}\n" if len(commands) > 1 else ""
            printed.append(head + output)
    return "\n\n".join(printed)


def _invoked(words: list[str]) -> str:
    result = CliRunner().invoke(app, words, env=_COLUMNS)
    if result.exit_code != 0:
        raise RuntimeError(f"selfmotion {shlex.join(words)}: {result.output}") from result.exception
    return result.stdout


def _run(name: str) -> Shown:
    file, printed = EXAMPLES / f"{name}.py", io.StringIO()
    with redirect_stdout(printed):
        made = runpy.run_path(str(file), run_name="__main__")
    named = (made.get(name) for name in ("plan", "program", "parts"))
    plan = next((item for item in named if isinstance(item, _PLAYED)), None)
    return Shown(name, file.read_text(), printed.getvalue(), plan)


@contextmanager
def run_pages() -> Iterator[dict[str, Page]]:
    """Run the pages that show what they print, each in an empty folder, there until the end."""
    with tempfile.TemporaryDirectory() as folder:
        found = {}
        for page in PRINTING:
            own = Path(folder) / page.stem
            own.mkdir()
            with _within(own):
                found[page.stem] = run_page(page)
        yield found


@contextmanager
def _empty_folder() -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder, _within(Path(folder)):
        yield


@contextmanager
def _within(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
