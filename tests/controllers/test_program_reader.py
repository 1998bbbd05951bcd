"""Motions at speeds in programs: how long they take, and what cannot be one."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shop.controllers.program_comments import COMMENTS
from selfmotion.shop.controllers.program_reader import ProgramReader, Target
from selfmotion.shop.controllers.rapid_reader import RapidReader
from selfmotion.shop.controllers.segment_building import Pose

# Places of a way of 0.4 m [m], and its speed [m/s].
PLACES = np.array([[0.4, 0.0, 0.3], [0.5, 0.0, 0.3], [0.5, 0.2, 0.3], [0.5, 0.2, 0.4]])
SPEED = 0.5
# Without ramps [s].
LEAST = 0.4 / SPEED


def pose(place: np.ndarray) -> Pose:
    return Pose(place, np.array([0.0, 0.0, 0.0, 1.0]), [], 1)


def standing(folder: Path, planned: float) -> ProgramReader:
    """Return a reader of a program whose arm stands at the first place."""
    file = folder / "seam.mod"
    file.write_text("MODULE seam\n")
    reader = RapidReader(file)
    reader.last_stop = pose(PLACES[0])
    reader.lines.notes = [COMMENTS.text("planned", seconds=planned)]
    return reader


def gone(reader: ProgramReader, places: np.ndarray) -> None:
    for k, place in enumerate(places):
        reader.take(Target(pose(place), speed=SPEED), stops=k == len(places) - 1)


@pytest.mark.parametrize("planned", [0.9, 2.0, 7.0])
def test_a_motion_at_a_speed_takes_the_time_that_was_planned(
    tmp_path: Path, planned: float
) -> None:
    """However short; what is switched at a target is so when it is reached."""
    reader = standing(tmp_path, planned)
    for place in PLACES[1:3]:
        reader.take(Target(pose(place), speed=SPEED), stops=False)
        reader.pass_event("here")
    gone(reader, PLACES[3:])
    (row,) = reader.rows
    assert row.seconds == [planned]
    assert reader.clock == planned
    times = [switch.time for switch in reader.switches]
    assert 0.0 < times[0] < times[1] < planned
    # The second place is three quarters along the way.
    assert times[0] < 0.5 * planned < times[1]


@pytest.mark.parametrize("planned", [0.9 * LEAST, 0.6 * LEAST, 0.3 * LEAST])
def test_what_takes_longer_than_planned_is_refused(tmp_path: Path, planned: float) -> None:
    reader = standing(tmp_path, planned)
    with pytest.raises(sm.errors.FileFormatError, match=f"takes {LEAST:g} s without ramps"):
        gone(reader, PLACES[1:])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_target_where_the_one_before_is_is_named(tmp_path: Path, number: int) -> None:
    reader = standing(tmp_path, 5.0)
    places = PLACES.copy()
    places[number] = places[number - 1]
    with pytest.raises(sm.errors.FileFormatError, match=f"target {number} of a seam at its speed"):
        gone(reader, places[1:])
