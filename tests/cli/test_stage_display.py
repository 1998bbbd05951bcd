"""Stages are shown in terminals and logs."""

import pytest
from rich.console import Console

from selfmotion.cli.stage_display import StageDisplay


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
        assert lines == ["start (of 24)", "no motion passes t = 2 s", "checking"]


def open_nothing() -> object:
    import io

    return io.StringIO()
