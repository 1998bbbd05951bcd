"""The command that tracks writes what it recorded."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import selfmotion as sm
from selfmotion.cli import app


def test_the_command_writes_replay_plan_and_histogram(tmp_path: Path) -> None:
    shown = CliRunner().invoke(app, ["track", "--seconds", "1.2", "--out", str(tmp_path)])
    assert shown.exit_code == 0, shown.output
    assert "120, every 10 ms" in shown.output
    for name in ("track.html", "track.npz", "latency.png"):
        assert (tmp_path / name).stat().st_size > 1000
    assert "keeps up with a circle on a conveyor" in (tmp_path / "track.html").read_text()
    plan = sm.load_plan(tmp_path / "track.npz")
    assert plan.trajectory.duration == pytest.approx(1.19)
