"""What the README and the site say works: every block of code in them runs."""

import re
import shlex
from pathlib import Path

import pytest
import shown
import two_motions
from markdown import markdown
from mathml import MathMl

import selfmotion as sm
from support.places import ROOT

README = (ROOT / "README.md").read_text()
PERFORMANCE = (ROOT / "docs" / "pages" / "performance.md").read_text()
PACKAGES = (ROOT / "docs" / "pages" / "about.md").read_text()


PAGES = [
    "README.md",
    *sorted(str(page.relative_to(ROOT)) for page in ROOT.glob("docs/pages/**/*.md")),
]


# All that is not run: it installs, or takes minutes.
NOT_RUN = {"make demo", "make test", "make docs", "pip install ."}


def blocks(page: str) -> list[tuple[str, str, str]]:
    """Return language, title and text of each."""
    found = []
    for language, rest, text in shown.BLOCK.findall((ROOT / page).read_text()):
        title = re.search(r'title="([^"]*)"', rest)
        found.append((language, title.group(1) if title else "", text))
    return found


def commands(page: str) -> list[list[str]]:
    """Return the words of each command that a shell is given."""
    lines = [
        line for kind, _, text in blocks(page) if kind == "console" for line in text.splitlines()
    ]
    return [words for words in (shlex.split(line, comments=True) for line in lines) if words]


# The others run while the site is built, by the same function: see `test_site.py`.
RUN = [page for page in PAGES if blocks(page) and ROOT / page not in shown.PRINTING]


# Every part of the package is in the tour, which takes as long.
LONG = Path("docs/pages/tour.md")


@pytest.mark.parametrize(
    "page",
    [pytest.param(x, marks=pytest.mark.site if Path(x) == LONG else ()) for x in RUN],
)
def test_every_block_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order, in one folder and one Python; files are those that the page shows."""
    monkeypatch.chdir(tmp_path)
    shown.run_page(ROOT / page, not_run=NOT_RUN)


@pytest.mark.parametrize(
    "block",
    [
        'python\nraise ArithmeticError("no")',
        "console\nselfmotion plan nothing",
        "console\nls",
        "yaml\na: 1",
    ],
)
def test_a_block_that_does_not_run_is_told(
    block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n```{block}\n```\n")
    with pytest.raises((ArithmeticError, RuntimeError, ValueError)):
        shown.run_page(page)


def test_what_blocks_print_is_below_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n```python\nfor k in (6, 7):\n    print(k)\n```\n\nEnd.\n")
    told = shown.run_page(page)
    assert told.text.endswith('```\n\n````text title="prints"\n6\n7\n````\n\nEnd.\n')
    assert told.names["k"] == 7


def unmarked(text: str) -> list[str]:
    """Return the sections that a page takes from files which do not mark them."""
    found = []
    for file, name in re.findall(r'^--8<-- "([^":]+):([^"]+)"$', text, re.MULTILINE):
        whole = (ROOT / file).read_text()
        section = re.search(rf"8<-- \[start:{name}\](.*?)8<-- \[end:{name}\]", whole, re.DOTALL)
        if section is None or len(section[1].splitlines()) < 3:
            found.append(f"{file}:{name}")
    return found


@pytest.mark.parametrize("page", PAGES)
def test_what_pages_take_from_files_is_marked_there(page: str) -> None:
    assert unmarked((ROOT / page).read_text()) == []


def test_a_section_that_is_not_marked_is_told() -> None:
    assert unmarked('--8<-- "README.md:first"\n--8<-- "README.md:last"\n') == ["README.md:last"]


def not_drawn(text: str) -> list[str]:
    """Return what stands after each dollar that belongs to no equation, code left out."""
    html = markdown(text, extensions=["tables", "fenced_code", MathMl()])
    prose = re.sub(r"<(pre|code)\b.*?</\1>", "", html, flags=re.DOTALL)
    return re.findall(r"\$[^$]{0,40}", prose)


@pytest.mark.parametrize("page", PAGES)
def test_equations_of_pages_are_drawn(page: str) -> None:
    assert not_drawn((ROOT / page).read_text()) == []


def test_an_equation_on_two_lines_is_told() -> None:
    assert not_drawn("With $a + b$ and\n$c$.\n") == []
    assert not_drawn("With $a +\nb$.\n") != []


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
    (block,) = shown.BLOCK.findall(first)
    assert len(block[2].splitlines()) == 5


def test_performance_table_is_there() -> None:
    table = PERFORMANCE.split("[start:bench]")[1].split("[end:bench]")[0]
    assert "| machine |" in table
    assert "rollout + exact gradient" in table


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 150


def test_figures_of_the_readme_are_those_of_the_page() -> None:
    """Each number that it measured is on the page, in the words of the command that gives it."""
    rows = re.findall(r"^\| .+ \| (.+) \| `(make bench NAME=[\w-]+)` \|$", README, re.MULTILINE)
    assert len(rows) >= 8
    for measured, command in rows:
        assert command in PERFORMANCE, command
        for number in re.findall(r"\d[\d.,]*\d|\d", measured):
            assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d])", PERFORMANCE), number


def test_costs_of_the_sample_problem_are_those_that_plans_have() -> None:
    paper = sm.PolynomialNullMotion(space="joint", basis="monomial")
    for motion in (None, paper, sm.motion.FreeNullMotion()):
        plan = sm.plan(sm.sample_problem(null_motion=motion))
        assert f"{plan.report.cost:.4f}" in PACKAGES


def test_the_picture_is_of_what_the_readme_says() -> None:
    problem = two_motions.seam()
    for plan in (sm.plan_by(problem, sm.baselines.PseudoInverse()), sm.plan(problem)):
        assert f"at {100.0 * two_motions.shares(plan).max():.0f} %" in README
        assert f"at cost {plan.report.cost:.2f}" in README
    assert plan.certificate.verified


def test_every_named_file_exists() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if "://" not in target:
            assert (ROOT / target).is_file(), target


def places_of(table: str) -> list[tuple[str, str]]:
    """Return the files of a map, and the names that it says are in them, "" for the file alone."""
    places = list[tuple[str, str]]()
    for row in table.splitlines():
        for file, names in re.findall(r"`([\w/]+\.py)`(?:: ((?:`\w+`(?:, )?)+))?", row):
            places += [(file, name) for name in re.findall(r"`(\w+)`", names) or [""]]
    return places


def test_what_the_map_of_contributing_names_is_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    places = places_of(text.partition("## Where is")[2].partition("\n## ")[0])
    assert ("planning/optimise/banded.py", "interior_optimum") in places
    for file, name in places:
        source = (ROOT / "src" / "selfmotion" / file).read_text()
        is_there = not name or re.search(rf"^\s*(?:def |class )?{name}\b", source, re.MULTILINE)
        assert is_there, f"{file}: {name}"


def test_runtime_packages_are_explained() -> None:
    text = (ROOT / "pyproject.toml").read_text()
    block = re.search(r"\ndependencies = \[(.*?)\]", text, re.DOTALL)
    assert block is not None
    for name in re.findall(r'"([a-z-]+)>=', block.group(1)):
        assert re.search(rf"\| .*\b{name}\b.* \|", PACKAGES), name
