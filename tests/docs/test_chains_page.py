"""The page of robot descriptions: what is on it, what its command does, and what it counts."""

import json
import os
import re
import subprocess
from dataclasses import asdict
from pathlib import Path

import arms
import numpy as np
import pytest

import selfmotion as sm
from support.files_of_people import arm

PAGE = arms.PAGE.read_text("utf-8")
_ROW = re.compile(
    r"^\| (.*?) \| (.*?) \| (\S*) \| (\d*) \| (\w*) \| (\w+) \| (\w+) \| (\w+) \| (.*) ?\|$"
)
ROWS = [found for line in PAGE.splitlines() if (found := _ROW.match(line))]


def test_every_chain_of_every_file_is_on_the_page() -> None:
    descriptions = list(arms.of_chains())
    assert len(descriptions) > 60
    for description in descriptions:
        tools = [row[3] for row in ROWS if row[2] == description.source]
        assert tools == (list(arms.tips(arms.text_of(description))) or [""]), (
            "run make bench NAME=arms"
        )


def test_the_counts_are_those_of_the_rows_and_what_is_not_verified_says_why() -> None:
    told = re.search(
        r"^\| all \| (\d+) \| (\d+) \| (\d+) \| (\d+) \| (\d+) \|$", PAGE, re.MULTILINE
    )
    assert told is not None
    not_fetched = [row for row in ROWS if row[9].startswith(arms.NOT_FETCHED)]
    flags = [[row[k] == "yes" for row in ROWS] for k in (6, 7, 8)]
    assert [int(x) for x in told.groups()] == [len(ROWS), len(not_fetched), *map(sum, flags)]
    for row, loaded, planned, verified in zip(ROWS, *flags, strict=True):
        assert loaded >= planned >= verified
        assert bool(row[9].strip()) != verified
        assert not row[9].startswith("UNTYPED")
    makers = {row[1] for row in ROWS if row[8] == "yes" and " at " in row[2] and "/" in row[2]}
    assert len(makers) >= 15


def repository(folder: Path, name: str, text: str) -> Path:
    """Commit an arm to a repository, and return a configuration of git that finds it."""
    top = folder / "remote" / name
    top.mkdir(parents=True)
    (top / "arm.urdf").write_text(text)
    for words in (
        ["init", "--quiet"],
        ["add", "."],
        ["-c", "user.name=a", "-c", "user.email=a@a", "commit", "--quiet", "-m", "An arm"],
    ):
        subprocess.run(["git", "-C", str(top), *words], check=True)
    given = folder / "gitconfig"
    given.write_text(f'[url "{folder}/remote/"]\n\tinsteadOf = https://github.com/\n')
    return given


@pytest.mark.site
def test_a_makers_repository_is_fetched_and_planned_by_two_commands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = repository(tmp_path, "maker/arms.git", arm())
    monkeypatch.setitem(os.environ, "GIT_CONFIG_GLOBAL", str(given))
    table = tmp_path / "makers.csv"
    table.write_text(
        "maker,arm,repository,file,arguments\nMaker,Seven,maker/arms,arm.urdf,\n"
        "Maker,Eight,maker/arms,other.urdf,\nNobody,One,nobody/none,arm.urdf,\n"
    )
    cache = tmp_path / "cache"
    found = list(arms.of_makers(cache, table))
    (row,) = arms.rows_of(found[0])
    assert (row.tool, row.joints, row.task) == ("l7", 7, "pose"), row.why
    assert row.loaded
    assert row.planned
    assert row.verified
    assert re.fullmatch(r"maker/arms at [0-9a-f]{8}, arm\.urdf", row.source)
    (missing,), (nobody,) = arms.rows_of(found[1]), arms.rows_of(found[2])
    assert missing.why == "not fetched: the repository has no such file now"
    assert nobody.why.startswith("not fetched: fatal: ")
    page = arms.page([row, missing, nobody])
    assert "| makers' repositories | 3 | 2 | 1 | 1 | 1 |" in page
    again = arms.Row(**json.loads(json.dumps(asdict(row))))
    assert again == row
    assert str(tmp_path) not in page


def test_a_tool_that_stands_elsewhere_is_not_loaded() -> None:
    """Against a file of other numbers than the arm was loaded from."""
    robot = sm.load_robot(arm(), tool="l7")
    assert arms.disagreement(robot, arm()) < 1e-12
    moved = arm().replace('xyz="0 0 0.3"', 'xyz="0 0 0.31"')
    assert arms.disagreement(robot, moved) == pytest.approx(0.01)
    assert np.isfinite(arms.disagreement(robot, moved))


def test_a_chain_is_planned_with() -> None:
    name = "so_arm_description/urdf/so100.urdf"
    (description,) = (x for x in arms.of_chains() if x.source == name)
    (row,) = arms.rows_of(description)
    assert (row.tool, row.joints, row.task, row.verified) == ("jaw", 6, "pointing", True)


def test_an_end_on_the_way_does_not_shorten_a_chain_and_fingers_end_it() -> None:
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
    assert arms.tips(f"<robot>{text}</robot>") == {"palm": 3}
    # What a linkage follows does not end an arm, but a finger that another one follows is none.
    followed = text.replace("<mimic/>", '<mimic joint="c"/>')
    assert arms.tips(f"<robot>{followed}</robot>") == {"palm": 3}
