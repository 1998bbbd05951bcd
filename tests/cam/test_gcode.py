"""Feeds of G-code that say how often a minute a line is gone along."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.shop.cam.gcode import read_gcode

# Chords of arcs are shorter than these by so much.
CHORD = 1e-3


@pytest.mark.parametrize(
    ("line", "length"),
    [("G1 X30 Y40", 0.05), ("G3 X20 Y20 I0 J20", 0.01 * np.pi), ("G2 X10 Y0 I5 J0", 0.005 * np.pi)],
)
@pytest.mark.parametrize("often", [2.0, 30.0])
def test_after_g93_each_line_takes_its_share_of_a_minute(
    tmp_path: Path, line: str, length: float, often: float
) -> None:
    """However many chords it has."""
    file = tmp_path / "a.nc"
    file.write_text(f"G21 G90\nG0 X0 Y0 Z0\nG93\n{line} F{often:g}\nG0 Z50\nM30\n")
    (cut,) = read_gcode(file).values()
    assert cut.feed is not None
    steps = np.linalg.norm(np.diff(cut.positions, axis=0), axis=1)
    cutting = steps > 0.0
    if cut.rapid is not None:
        cutting &= ~np.asarray(cut.rapid[:-1], dtype=bool)
    assert steps[cutting].sum() == pytest.approx(length, rel=CHORD)
    seconds = float((steps[cutting] / cut.feed[:-1][cutting]).sum())
    assert seconds == pytest.approx(60.0 / often)


def test_of_several_cuts_the_first_is_offered(tmp_path: Path) -> None:
    file = tmp_path / "a.nc"
    lines = "G1 X{0} F600\nG0 Z50\nG0 X{1} Y0\nG0 Z0\n"
    body = "".join(lines.format(x, x + 10) for x in (10, 30, 50))
    file.write_text(f"G21 G90\nG0 X0 Y0 Z0\n{body}M30\n")
    names = list(read_gcode(file))
    assert len(names) == 3
    said = rf"has 3 seams or cuts, {names[0]} to {names[2]}: choose one by seam = '{names[0]}'"
    with pytest.raises(sm.errors.FileFormatError, match=said):
        sm.files.read_path(file)
