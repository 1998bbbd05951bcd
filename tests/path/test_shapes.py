"""Lines and circles."""

import numpy as np
import pytest

import selfmotion as sm
from support.paths import pose


def test_line_starts_and_ends_where_it_should() -> None:
    line = sm.paths.Line(pose(1), pose(2), 2.0)
    assert line.pose(0.0).isApprox(pose(1), 1e-12)
    assert line.pose(2.0).isApprox(pose(2), 1e-12)
    np.testing.assert_allclose(line.twist(0.0), 0.0, atol=1e-12)


def test_circle_keeps_its_radius_and_closes() -> None:
    circle = sm.paths.Circle.around(pose(1), 0.15, 3.0, normal=(1, 2, 0))
    positions = circle.samples(np.linspace(0, 3, 50)).translation
    np.testing.assert_allclose(np.linalg.norm(positions - circle.center, axis=1), 0.15, rtol=1e-12)
    np.testing.assert_allclose((positions - circle.center) @ circle.normal, 0.0, atol=1e-12)
    assert circle.radius == pytest.approx(0.15)
    assert circle.pose(3.0).isApprox(circle.pose(0.0), 1e-12)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (1.0, -2.0, 0.5)])
def test_a_spiral_has_turns_as_far_apart_as_each_other(normal: tuple[float, ...]) -> None:
    center, axis = np.array([0.2, 0.1, -0.3]), np.array(normal) / np.linalg.norm(normal)
    spiral = sm.paths.Spiral(pose(1), center, normal, 4.0, turns=3.0, radius=0.02, rise=0.06)
    t = np.linspace(0.0, 4.0, 3001)
    away = spiral.samples(t).translation - center
    heights = away @ axis
    radii = np.linalg.norm(away - heights[:, None] * axis, axis=1)
    assert spiral.pose(0.0).isApprox(pose(1), 1e-12)
    assert radii[-1] == pytest.approx(0.02, abs=1e-12)
    assert heights[-1] - heights[0] == pytest.approx(0.06, abs=1e-12)
    # Radius and height grow with the angle, as measured from the places alone.
    flat = away - heights[:, None] * axis
    steps = np.arctan2(
        np.cross(flat[:-1], flat[1:]) @ axis, np.einsum("ki,ki->k", flat[:-1], flat[1:])
    )
    angle = np.append(0.0, np.cumsum(steps)) / (2.0 * np.pi)
    assert angle[-1] == pytest.approx(3.0, abs=1e-9)
    for grown in (radii, heights):
        expected = grown[0] + (grown[-1] - grown[0]) * angle / 3.0
        np.testing.assert_allclose(grown, expected, atol=1e-10)


def test_a_spiral_from_its_middle_at_a_feed() -> None:
    start = pose(1)
    spiral = sm.paths.Spiral(start, start.translation, (0.0, 0.0, 1.0), 1.0, turns=4.0, radius=0.1)
    feed = sm.paths.Feed(spiral, 0.05, acceleration=2.0)
    # Of Archimedes: about half of the turns' angle times the radius.
    length = 0.5 * 4.0 * 2.0 * np.pi * 0.1
    assert feed.duration == pytest.approx(length / 0.05, rel=0.02)
    with pytest.raises(sm.errors.PathError, match="no way"):
        sm.paths.Spiral(start, start.translation, (0.0, 0.0, 1.0), 1.0, turns=4.0, radius=0.0)
    center = start.translation + np.array([0.1, 0.0, 0.0])
    with pytest.raises(sm.errors.PathError, match="turns is 0, radius that of the start"):
        sm.paths.Spiral(start, center, (0.0, 0.0, 1.0), 1.0, turns=0.0, radius=0.1)
