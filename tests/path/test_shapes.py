"""Lines and circles."""

import numpy as np
import pytest

import selfmotion as sm
from support.paths import pose


def test_line_starts_and_ends_where_it_should() -> None:
    line = sm.Line(pose(1), pose(2), 2.0)
    assert line.pose(0.0).isApprox(pose(1), 1e-12)
    assert line.pose(2.0).isApprox(pose(2), 1e-12)
    np.testing.assert_allclose(line.twist(0.0), 0.0, atol=1e-12)


def test_circle_keeps_its_radius_and_closes() -> None:
    circle = sm.Circle.around(pose(1), 0.15, 3.0, normal=(1, 2, 0))
    positions = circle.samples(np.linspace(0, 3, 50)).translation
    np.testing.assert_allclose(np.linalg.norm(positions - circle.center, axis=1), 0.15, rtol=1e-12)
    np.testing.assert_allclose((positions - circle.center) @ circle.normal, 0.0, atol=1e-12)
    assert circle.radius == pytest.approx(0.15)
    assert circle.pose(3.0).isApprox(circle.pose(0.0), 1e-12)
