"""Pieces follow each other."""

import numpy as np
import pytest

from support.paths import pose, there_and_back


def test_pieces_follow_each_other() -> None:
    path = there_and_back()
    assert path.duration == pytest.approx(5.7)
    assert np.abs(path.samples(np.linspace(2.0, 2.7, 8)).twist).max() <= 1e-12
    np.testing.assert_allclose(path.pose(2.5).homogeneous, pose(2).homogeneous, atol=1e-12)
    np.testing.assert_allclose(path.pose(5.7).homogeneous, pose(1).homogeneous, atol=1e-12)
