"""What the README says works, and the examples run."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def test_quickstart_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in blocks[0].splitlines() if line]) <= 12
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        exec(block, names)
        assert names["plan"].certificate.verified
    assert (tmp_path / "plan.npz").is_file()


@pytest.mark.parametrize("example", sorted(path.name for path in (ROOT / "examples").glob("*.py")))
def test_examples_run(example: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / example), run_name="__main__")


def test_performance_table_is_there() -> None:
    table = re.search(r"<!-- bench -->(.*?)<!-- /bench -->", README, re.DOTALL)
    assert table is not None
    assert "| machine |" in table.group(1)
    assert "rollout + exact gradient" in table.group(1)


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
