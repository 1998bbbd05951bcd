"""Programs that were changed by hand: a sample of `make bench NAME=fuzz-programs`."""

from pathlib import Path

import changed_programs
import numpy as np
import pytest

import selfmotion as sm
from support.industrial import two_seams
from support.played_changes import Player

# Changes of each kind that are tried.
TRIES = 2


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[changed_programs.Written]:
    """A job of two seams, written for each controller."""
    folder, job, found = tmp_path_factory.mktemp("written"), two_seams(), []
    kept = folder / "weld.program"
    job.save(kept)
    for suffix, targets in ((".src", "joints"), (".mod", "timed-poses"), (".script", "poses")):
        file = folder / f"weld{suffix}"
        signals = changed_programs.SIGNALS[suffix]
        settings = sm.files.ProgramSettings(mass=2.0, targets=targets, signals=signals)
        sm.files.write_motion(job, file, settings=settings)
        player = Player(job, file, "base", job.robot.tool)
        found.append(changed_programs.Written(targets, file.read_text(), suffix, kept, player))
    return found


def test_as_they_are_written_they_are_verified_and_run_so(
    written: list[changed_programs.Written], tmp_path: Path
) -> None:
    for item in written:
        file = tmp_path / f"weld{item.suffix}"
        file.write_text(item.text)
        assert changed_programs.judged(file, item.kept)[0] == 0
        assert item.player.beyond(file) == []


@pytest.mark.parametrize("change", changed_programs.CHANGES, ids=lambda change: change.__name__)
def test_what_is_verified_runs_as_it_was_written(
    written: list[changed_programs.Written], tmp_path: Path, change
) -> None:
    for seed in range(TRIES):
        rng = np.random.default_rng(seed)
        for item in written:
            lines = change(item.text.splitlines(), rng)
            if lines is None:
                continue
            file = tmp_path / f"weld{item.suffix}"
            file.write_text("\n".join([*lines, ""]))
            code, _ = changed_programs.judged(file, item.kept)
            assert code in (0, 1, 2)
            if code == 0:
                assert item.player.beyond(file) == []


def test_the_player_sees_what_runs_otherwise(
    written: list[changed_programs.Written], tmp_path: Path
) -> None:
    """Of targets that are moved by a centimetre, outputs exchanged, and times that are doubled."""
    for item in written:
        file = tmp_path / f"weld{item.suffix}"
        for change in (changed_programs.unit, changed_programs.switched, changed_programs.timed):
            lines = change(item.text.splitlines(), np.random.default_rng(3))
            file.write_text("\n".join([*lines, ""]))
            assert item.player.beyond(file)
