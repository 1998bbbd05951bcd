"""Paths from tables of places: their times, and what is told of corners."""

from pathlib import Path

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.shop.cam.path_building import _CutSection, _joined_sections

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


def test_what_is_at_a_feed_is_one_section_and_turns_beside_rapid_legs_are_none_of_it() -> None:
    """Of four legs with turns between them, whichever is rapid."""

    def section(first: float, last: float) -> _CutSection:
        ends = np.array([[first, 0.0, 0.0], [last, 0.0, 0.0]])
        return _CutSection(ends, np.tile(np.eye(3), (2, 1, 1)), np.ones(2), first == last)

    legs = [section(k, k + 1.0) for k in range(4)]
    turns = [section(k, k) for k in range(1, 4)]
    sections = [legs[0], turns[0], legs[1], turns[1], legs[2], turns[2], legs[3]]
    for rapid, expected in (
        ([False] * 4, [(0, 4, False)]),
        ([True, False, False, False], [(0, 1, True), (1, 1, True), (1, 4, False)]),
        (
            [False, False, True, False],
            [(0, 2, False), (2, 2, True), (2, 3, True), (3, 3, True), (3, 4, False)],
        ),
    ):
        found = _joined_sections(sections, rapid)
        told = [(x.positions[0, 0], x.positions[-1, 0], x.is_free) for x in found]
        assert told == expected
        assert all(len(x.positions) == len(x.rotations) == len(x.feeds) for x in found)
