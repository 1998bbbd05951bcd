"""Paths from tables of places: their times, and what is told of corners."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array

# Bends between uneven steps along a circle, each below 30° [°], and its radius [m].
ANGLES, RADIUS = np.cumsum([0.0, 24.0, 6.0, 27.0, 12.0, 25.0, 3.0, 20.0]), 0.5


def circle() -> Array:
    turned = np.radians(ANGLES)
    return RADIUS * np.column_stack([np.cos(turned), np.sin(turned), 0.0 * turned])


def table(folder: Path, points: Array) -> Path:
    file = folder / "seam.csv"
    rows = "\n".join(",".join(f"{x:.9f}" for x in point) for point in points)
    file.write_text(f"x,y,z\n{rows}\n")
    return file


def about_lines(path: sm.paths.Path) -> list[str]:
    return [note for note in path.notes if "leaves the straight lines between poses" in note]


def test_only_a_corner_is_told_to_be_off_the_straight_lines(tmp_path: Path) -> None:
    """A smooth curve is meant, however far apart its places are; the corner is named."""
    smooth = circle()
    assert about_lines(sm.files.read_path(table(tmp_path, smooth), feed=0.02)) == []
    for corner in (2, 5):
        kinked = smooth.copy()
        kinked[corner] *= 1.1
        (note,) = about_lines(sm.files.read_path(table(tmp_path, kinked), feed=0.02))
        named = [f"line {corner + 2 + off}" for off in (-1, 0, 1)]
        assert any(f" at {line}:" in note for line in named), note


@pytest.mark.parametrize("corners", ["blend", "round"])
def test_a_path_takes_its_length_over_its_feed_or_its_duration(
    tmp_path: Path, corners: str
) -> None:
    """But for running up and down, and for what curves are longer than their chords."""
    file, feed = table(tmp_path, circle()), 0.02
    arc = RADIUS * np.radians(ANGLES[-1])
    found = sm.files.read_path(file, feed=feed, corners=corners)
    assert 0.97 * arc / feed < found.duration < 1.1 * arc / feed + 1.0
    if corners == "blend":
        timed = sm.files.read_path(file, duration=7.0, corners=corners)
        assert timed.duration == pytest.approx(7.0, abs=1.0)
        t = np.linspace(0.3 * timed.duration, 0.7 * timed.duration, 50)
        speeds = np.linalg.norm(timed.samples(t).twist[:, :3], axis=1)
        # As fast as it goes on the whole.
        np.testing.assert_allclose(speeds, arc / 7.0, rtol=0.2)
