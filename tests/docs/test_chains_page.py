"""The page of all chains of example-robot-data: every URDF is on it, with what became of it."""

import re
from pathlib import Path

import arms
import pytest

import selfmotion as sm

PAGE = arms.PAGE.read_text("utf-8")


def test_every_chain_of_every_file_is_on_the_page() -> None:
    sections = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))
    files = {x.relative_to(arms.robots()).as_posix(): x for x in arms.descriptions()}
    assert len(files) > 60
    assert list(sections) == sorted(files) == list(files)
    for name, file in files.items():
        tools = re.findall(r"^\| (\S*) \| \d+ \|", sections[name], re.MULTILINE)
        assert tools == (arms.tips(file) or [""]), "run make bench NAME=arms"


def test_what_is_not_verified_says_why() -> None:
    rows = re.findall(r"^\| \S* \| \d+ \| \w* \| (.+) \|$", PAGE, re.MULTILINE)
    verified = [row for row in rows if row == "verified"]
    assert f"{len(verified)} of {len(rows)} are verified" in PAGE
    assert len(verified) > len(rows) // 2
    for row in rows:
        assert re.match(r"verified|not verified: |no chain of two joints|\w+Error: ", row)


@pytest.mark.parametrize("name", ["so_arm_description/urdf/so100.urdf"])
def test_a_file_is_planned_with(name: str, tmp_path: Path) -> None:
    (row,) = arms.rows_of(arms.robots() / name, tmp_path)
    assert row == (name, "jaw", 6, sm.Task.POINTING.value, "verified")


def test_an_end_on_the_way_does_not_shorten_a_chain_and_fingers_end_it(tmp_path: Path) -> None:
    joints = [
        ("base", "thigh", "revolute", "a"),
        ("thigh", "sensor", "fixed", "b"),
        ("thigh", "shin", "revolute", "c"),
        ("shin", "palm", "revolute", "d"),
        ("palm", "one", "prismatic", "e"),
        ("palm", "two", "prismatic", "f"),
        ("base", "wheel", "continuous", "g"),
        ("palm", "copy", "revolute", "h"),
    ]
    text = "".join(
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{'<mimic/>' if name == 'h' else ''}</joint>"
        for parent, child, kind, name in joints
    )
    (tmp_path / "arm.urdf").write_text(f"<robot>{text}</robot>")
    assert arms.tips(tmp_path / "arm.urdf") == ["palm"]
