"""Every benchmark has a name, files that exist, and a short form or a reason for none."""

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import selfmotion as sm

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def runner() -> ModuleType:
    spec = importlib.util.spec_from_file_location("benchmarks_runner", FOLDER / "__main__.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_every_benchmark_has_a_short_form_or_a_reason(runner: ModuleType) -> None:
    runs = [run for one in runner.BENCHMARKS.values() for run in one.runs]
    assert all((FOLDER / run.file).is_file() for run in runs)
    assert all(bool(run.short) != bool(run.whole) for run in runs)


def test_every_script_has_a_name(runner: ModuleType) -> None:
    named = {run.file for one in runner.BENCHMARKS.values() for run in one.runs}
    scripts = {
        str(file.relative_to(FOLDER))
        for file in FOLDER.rglob("*.py")
        if "typer.run(" in file.read_text() and file.name != "__main__.py"
    }
    # `made` writes problems for another one; a judge and shared problems are no benchmarks.
    assert scripts - named == set()


def test_an_unknown_name_is_refused_with_those_that_there_are() -> None:
    ended = subprocess.run(
        [sys.executable, str(FOLDER), "place-s"], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert "place-s" in ended.stdout
    assert "places" in ended.stdout


def test_equivalent_mutants_are_of_lines_that_are_there() -> None:
    """A line that has changed is judged anew."""
    listed = tomllib.loads((FOLDER / "data/equivalent_mutants.toml").read_text())["mutant"]
    source = Path(sm.__file__).parent
    assert len(listed) > 0
    for item in listed:
        file = source / item["file"]
        assert file.is_file(), item
        assert item["before"].strip() in file.read_text("utf-8"), item
