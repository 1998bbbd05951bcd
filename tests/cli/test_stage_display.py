"""Stages are shown in terminals and logs."""

import io
import time

import pytest
from rich.console import Console

from selfmotion.cli.app import StageDisplay


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


def test_a_log_is_never_silent_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stage that tells nothing while it lasts has its line all the same."""
    monkeypatch.setattr("selfmotion.cli.app._SILENT", 0.05)
    monkeypatch.setattr("selfmotion.cli.app._TICK", 0.01)
    monkeypatch.setattr("selfmotion.cli.app._WORTH_SAYING", 0.0)
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
