"""A warm-up does each of its works, and says what it compiled."""

import pytest

from selfmotion.cli import warm_up
from support.shell import invoke


def test_each_work_is_done_and_what_was_compiled_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    names = [name for name, _ in warm_up.small_works()]
    assert len(set(names)) == len(names)
    works = [(name, lambda name=name: done.append(name)) for name in names]
    monkeypatch.setattr(warm_up, "small_works", lambda: iter(works))
    code, printed = invoke("warm-up")
    assert code == 0
    assert done == names
    assert "nothing was left to compile" in printed
