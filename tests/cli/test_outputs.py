"""Nothing is discarded for what cannot be written; results are there for programs."""

import json
from pathlib import Path

import pytest

import selfmotion as sm
from support.shell import invoke


def test_what_cannot_be_written_discards_neither_plan_nor_other_files(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    lost, kept = tmp_path / "file" / "lost.npz", tmp_path / "kept.csv"
    with pytest.raises(sm.FileFormatError) as raised:
        invoke("plan", "planar_3r", "--circle", "0.1", "--out", lost, "--out", kept)
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
