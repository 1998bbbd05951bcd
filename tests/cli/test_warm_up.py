"""A warm-up does each of its works, and says what it and another process compiled."""

from typing import Any

import pytest

from selfmotion.realtime import warm
from selfmotion.shell.cli import project_commands
from support.shell import invoke


class Other:
    """A process that has compiled some kernels."""

    def __init__(self, told: str) -> None:
        self.told = told

    def communicate(self) -> tuple[str, None]:
        return self.told, None


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (None, "nothing was left to compile"),
        (Other("0"), "nothing was left to compile"),
        (Other("7"), "7 kernels"),
        (Other(""), "nothing was left to compile"),
    ],
)
def test_each_work_is_done_and_what_was_compiled_is_said(
    other: Any, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    names = [name for name, _ in warm.small_works()]
    assert len(set(names)) == len(names)
    works = [(name, lambda name=name: done.append(name)) for name in names]
    monkeypatch.setattr(project_commands, "small_works", lambda: iter(works))
    monkeypatch.setattr(project_commands, "compile_in_background", lambda _: other)
    code, printed = invoke("warm-up")
    assert code == 0
    assert done == names
    assert told in printed


def test_another_process_begins_elsewhere(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With all works the last one first, or with those alone that any plan needs."""
    done: list[int] = []
    monkeypatch.setattr(warm, "compile_alone", lambda: None)
    works = [(str(k), lambda k=k: done.append(k)) for k in range(4)]
    monkeypatch.setattr(warm, "small_works", lambda: iter(works))
    for which in (warm.FIRST_WORKS, "all"):
        warm.main(which)
    assert done == [0, 1, 3, 2, 1, 0]
    assert capsys.readouterr().out == "00"
