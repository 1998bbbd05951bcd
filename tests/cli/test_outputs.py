"""Nothing is discarded for what cannot be written; results are there for programs."""

import io
import json
import re
from pathlib import Path

import pytest
from rich.console import Console

import selfmotion as sm
from selfmotion.shell.cli.outputs import print_large
from support.shell import complaint, invoke, on_circle


def test_what_cannot_be_written_discards_neither_plan_nor_other_files(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    lost, kept = tmp_path / "file" / "lost.npz", tmp_path / "kept.csv"
    with pytest.raises(sm.errors.FileFormatError) as raised:
        invoke("plan", "planar_3r", *on_circle("0.1", "z"), "--out", lost, "--out", kept)
    line = str(raised.value)
    assert kept.is_file()
    rescued = line.rpartition("the plan is in ")[2]
    assert sm.load_plan(rescued).certificate.verified
    assert str(lost) in line


def test_results_are_there_for_programs(tmp_path: Path) -> None:
    code, printed = invoke("robots", "--json")
    assert code == 0
    assert json.loads(printed)["planar_3r"]["redundancy"] == {"planar": 1, "planar_pose": 0}
    plan, motion = tmp_path / "plan.npz", tmp_path / "motion.csv"
    sm.plan(sm.sample_problem(), max_evaluations=2).save(plan)
    _, printed = invoke("export", plan, "--out", motion, "--json")
    found = json.loads(printed)
    assert found["linear_miss"]["rate"] > 0.0
    assert "read back" in found["written"][str(motion)]


def test_a_plan_says_of_its_motions_what_export_says(tmp_path: Path) -> None:
    plan, motion = tmp_path / "plan.npz", tmp_path / "motion.yaml"
    asked = ("plan", "planar_3r", *on_circle("0.1", "z"), "--out", plan, "--out", motion)
    code, planned = invoke(*asked)
    assert code == 0, planned
    code, exported = invoke("export", plan, "--out", motion)
    assert code == 0, exported
    for begin in (f"wrote {motion}; read back: verified", "joined by straight lines, "):
        lines = [
            [line for line in text.splitlines() if line.startswith(begin)]
            for text in (planned, exported)
        ]
        assert lines[0] == lines[1]
        assert len(lines[0]) == 1
    assert f"wrote {plan}\n" in planned
    # The rate that is named keeps the tolerance when it is used, and is named again.
    found = re.search(r"--rate (\d+) keeps", exported)
    assert found is not None
    code, text = invoke("export", plan, "--out", motion, "--rate", found[1], "--json")
    miss, tolerance = json.loads(text)["linear_miss"], sm.load_plan(plan).tolerance
    assert miss["position"] <= tolerance.position
    assert miss["rotation"] <= tolerance.rotation
    assert miss["rate"] == float(found[1])


def test_a_large_file_of_text_proposes_a_bag(tmp_path: Path) -> None:
    small, large, bag = (tmp_path / name for name in ("small.yaml", "large.yaml", "large.mcap"))
    small.write_bytes(b" " * 10_000_000)
    large.write_bytes(b" " * 10_600_000)
    bag.write_bytes(b" " * 10_600_000)
    for file, said in ((small, False), (large, True), (bag, False)):
        told = io.StringIO()
        print_large(file, Console(file=told, width=400), given_rate=True)
        assert (told.getvalue() != "") is said
    plain, rated = io.StringIO(), io.StringIO()
    print_large(large, Console(file=plain, width=400))
    print_large(large, Console(file=rated, width=400), given_rate=True)
    assert plain.getvalue().endswith(f"about a third, --out {bag}\n")
    assert "has 11 MB" in plain.getvalue()
    assert ("--rate" in plain.getvalue(), "without --rate" in rated.getvalue()) == (False, True)


def test_outputs_outside_of_the_files_folder_need_a_word(tmp_path: Path) -> None:
    given, mine = tmp_path / "downloads", tmp_path / "measured.csv"
    given.mkdir()
    mine.write_text("what took a week to measure\n")
    (given / "link.csv").symlink_to(mine)
    cell = given / "cell.toml"
    text = (
        'outputs = ["OUT"]\ntask = "position"\nstart = "home"\nclearance = false\n[robot]\n'
        'name = "panda"\n[path]\nkind = "line"\nby = [0, 0.05, 0]\nduration = 3\n'
    )
    for out in ("../measured.csv", str(mine), "link.csv"):
        for goal in ("best", "fastest"):
            cell.write_text(text.replace("OUT", out))
            said = complaint("plan", cell, "--set", f"goal={goal}")
            assert "is outside of the file's own folder; say --force" in said
        assert mine.read_text().startswith("what took")
    cell.write_text(text.replace("OUT", "../measured.csv"))
    assert invoke("plan", cell, "--force")[0] == 0
    assert mine.read_text().startswith("t,")
    cell.write_text(text.replace("OUT", "deeper/plan.csv"))
    assert invoke("plan", cell)[0] == 0
    assert (given / "deeper" / "plan.csv").exists()
