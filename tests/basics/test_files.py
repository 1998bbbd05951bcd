"""Files are written whole or not at all."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import files, read_table, write_csv, write_text


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


def test_a_link_stays_a_link_and_a_file_keeps_its_mode(tmp_path: Path) -> None:
    shared, link = tmp_path / "share" / "cell.toml", tmp_path / "cell.toml"
    shared.parent.mkdir()
    shared.write_text("old")
    shared.chmod(0o600)
    link.symlink_to(Path("share") / "cell.toml")
    write_text(link, "new")
    assert link.is_symlink()
    assert shared.read_text() == "new"
    assert shared.stat().st_mode & 0o777 == 0o600
    # One that leads nowhere yet, too.
    away = tmp_path / "away.toml"
    away.symlink_to(tmp_path / "made" / "x.toml")
    write_text(away, "made")
    assert away.is_symlink()
    assert (tmp_path / "made" / "x.toml").read_text() == "made"


@pytest.mark.parametrize("name", ["a,b", 'a"b', "a (b)", "joint 1", "ä;b", "'a'", "[mm]"])
def test_titles_come_back_from_tables(name: str, tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    write_csv(file, ["t", name, f"{name} 2"], np.array([[0.0, 1.0, 2.0], [1.0, 2.0, 3.0]]))
    titles, values = read_table(file)
    assert titles == ["t", name, f"{name} 2"]
    np.testing.assert_array_equal(values, [[0.0, 1.0, 2.0], [1.0, 2.0, 3.0]])
