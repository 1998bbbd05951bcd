"""Files are written whole or not at all."""

from dataclasses import replace
from pathlib import Path

import pytest

import selfmotion as sm
from selfmotion.basics import files


@pytest.fixture(scope="module")
def plan() -> sm.Plan:
    return sm.plan(sm.sample_problem())


def test_failed_writes_leave_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "plan.npz"
    file.write_text("old")

    def fail(stream: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        files.write_atomically(file, fail)
    assert [path.name for path in tmp_path.iterdir()] == ["plan.npz"]
    assert file.read_text() == "old"


def test_a_folder_in_the_way_is_named(plan: sm.Plan, tmp_path: Path) -> None:
    (tmp_path / "plan.npz").mkdir()
    with pytest.raises(sm.errors.FileFormatError, match=r"plan\.npz: cannot be written"):
        plan.save(tmp_path / "plan.npz")
    assert [path.name for path in tmp_path.iterdir()] == ["plan.npz"]


def test_a_name_that_no_file_can_have_is_of_none(plan: sm.Plan, tmp_path: Path) -> None:
    source = replace(plan.robot.urdf, source="n" * 300 + ".urdf")
    saved = replace(plan, problem=replace(plan.problem, robot=replace(plan.robot, urdf=source)))
    assert not saved.robot.urdf.has_changed()
    saved.save(tmp_path / "plan.npz")
    assert sm.load_plan(tmp_path / "plan.npz").certificate.notes == plan.certificate.notes
    with pytest.raises(sm.errors.FileFormatError, match="cannot be read"):
        sm.load_plan("n" * 300 + ".npz")
