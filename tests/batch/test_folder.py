"""Tables of a batch."""

import csv
from pathlib import Path

from selfmotion.work.batch import Row
from selfmotion.work.batch.folder import Folder


def test_what_ends_early_has_no_cost_to_compare(tmp_path: Path) -> None:
    """However cheap the part is, it comes after what is whole."""
    file = tmp_path / "plans" / "a.npz"
    whole = Row("whole", "1", file, cost=2.0, initial_cost=3.0, duration=9.0, aim=2.0)
    part = Row("part", "2", file, cost=0.4, initial_cost=0.5, duration=1.16, ends=1.16)
    Folder(tmp_path).write_tables([part, whole], replays=0)
    with (tmp_path / "table.csv").open() as stream:
        first, last = csv.DictReader(stream)
    assert (first["name"], first["cost"]) == ("whole", "2")
    assert (last["name"], last["cost"]) == ("part", "ends at t = 1.16 s")
    assert last["minimum-norm motion"] == ""
