"""What the README and the site say works: every block of code in them runs."""

import re
import shlex
from pathlib import Path

import pytest

from support.places import ROOT
from support.shell import invoke

README = (ROOT / "README.md").read_text()


PAGES = [
    "README.md",
    *sorted(str(page.relative_to(ROOT)) for page in ROOT.glob("docs/pages/**/*.md")),
]


BLOCK = re.compile(r"^```(\w*)([^\n]*)\n(.*?)^```", re.DOTALL | re.MULTILINE)


# All that is not run: it installs, or takes minutes.
NOT_RUN = {"make demo", "make test", "pip install ."}


def blocks(page: str) -> list[tuple[str, str, str]]:
    """Return language, title and text of each."""
    found = []
    for language, rest, text in BLOCK.findall((ROOT / page).read_text()):
        title = re.search(r'title="([^"]*)"', rest)
        found.append((language, title.group(1) if title else "", text))
    return found


def commands(page: str) -> list[list[str]]:
    """Return the words of each command that a shell is given."""
    lines = [
        line for kind, _, text in blocks(page) if kind == "console" for line in text.splitlines()
    ]
    return [words for words in (shlex.split(line, comments=True) for line in lines) if words]


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_every_block_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order, in one folder and one Python; files are those that the page shows."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    for _, title, text in blocks(page):
        if title:
            (tmp_path / title).write_text(text)
    names: dict[str, object] = {"__name__": "page"}
    for language, title, text in blocks(page):
        if language == "python":
            exec(compile(text, page, "exec"), names)
        elif language == "console":
            for line in text.splitlines():
                words = shlex.split(line, comments=True)
                if words and shlex.join(words) not in NOT_RUN:
                    assert words[0] == "selfmotion", line
                    assert invoke(*words[1:])[0] == 0, line
        else:
            assert title, f"a block of {language} that is neither run nor a file"


def test_what_is_not_run_is_there() -> None:
    written = {shlex.join(words) for page in PAGES for words in commands(page)}
    assert written >= NOT_RUN


def test_quickstart_is_short_and_verified(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = next(text for kind, _, text in blocks("README.md") if kind == "python")
    assert len([line for line in first.splitlines() if line]) <= 12
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(first, names)
    assert names["plan"].certificate.verified  # type: ignore[attr-defined]
    assert (tmp_path / "plan.npz").is_file()


def test_first_steps_are_five_commands() -> None:
    first = README.split("[start:first]")[1].split("[end:first]")[0]
    (block,) = BLOCK.findall(first)
    assert len(block[2].splitlines()) == 5


def test_performance_table_is_there() -> None:
    table = README.split("[start:bench]")[1].split("[end:bench]")[0]
    assert "| machine |" in table
    assert "rollout + exact gradient" in table


def test_every_named_file_exists() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).is_file(), target


def test_runtime_packages_are_explained() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    block = re.search(r"\ndependencies = \[(.*?)\]", text, re.DOTALL)
    assert block is not None
    for name in re.findall(r'"([a-z-]+)>=', block.group(1)):
        assert re.search(rf"\| .*\b{name}\b.* \|", README), name
