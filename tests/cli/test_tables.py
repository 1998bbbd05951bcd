"""Tables fit narrow terminals and logs."""

import dataclasses
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.cli import tables

# Runs several commands in one process, each as the shell does, with a mark after each.
SEVERAL = """
import json, sys
from selfmotion.cli import app
for words in json.loads(sys.argv[1]):
    assert not app(words, standalone_mode=False), words
    print("\\f")
"""


@pytest.mark.parametrize("columns", [60, None])
def test_tables_fit_narrow_terminals_and_logs(tmp_path: Path, columns: int | None) -> None:
    """No name is cut and no unit lost; a verdict is one line of a log, to be searched for."""
    file = tmp_path / "plan.npz"
    sm.plan(sm.sample_problem()).save(file)
    environment = {key: value for key, value in os.environ.items() if key != "COLUMNS"}
    environment |= {} if columns is None else {"COLUMNS": str(columns)}
    verdict = sm.load_plan(file).certificate.verdict
    commands = [["check", str(file)], ["compare", str(file), str(file)], ["robots"]]
    printed = subprocess.run(
        [sys.executable, "-c", SEVERAL, json.dumps(commands)],
        capture_output=True,
        text=True,
        env=environment,
    )
    assert printed.returncode == 0, printed.stderr
    checked, compared, robots, _ = printed.stdout.split("\f\n")
    for text in (checked, compared, robots):
        assert "…" not in text
        table = [line for line in text.splitlines() if line != verdict]
        assert max(map(len, table)) <= (columns or 120)
    assert verdict in checked.splitlines()
    assert "joint path, rad or m" in compared


@pytest.mark.parametrize(
    ("amount", "allowed", "kept", "told"),
    [
        (0.015, 0.0147, True, "at least"),
        (0.014, 0.0147, False, "at least"),
        (0.0, 1e-6, True, "at most"),
        (0.1, 1e-6, False, "at most"),
    ],
)
def test_a_limit_is_told_with_its_side(
    amount: float, allowed: float, kept: bool, told: str
) -> None:
    """A feed that is kept, above what it has to be at least, does not read as a violation."""
    found = sm.Finding("feed", "path", 1.0, amount, allowed, kept, "")
    plan = sm.plan(sm.sample_problem())
    certificate, page = plan.certificate, io.StringIO()
    only = dataclasses.replace(certificate, findings=(*certificate.findings, found))
    tables.show_certificate(only, {}, plan.robot, Console(file=page, width=120))
    # Its joints turn, all of them.
    assert "rad or m" not in page.getvalue()
    assert f"feed ({told}: {allowed:.4g})" in page.getvalue()
