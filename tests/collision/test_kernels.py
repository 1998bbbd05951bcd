"""Winding numbers."""

import numpy as np
import pytest
import trimesh

from selfmotion.model.collision.kernels import winding_number


def test_winding_number_counts_a_closed_surface_once() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2).triangles
    assert winding_number(ball, np.array([0.2, 0.3, 0.1])) == pytest.approx(1.0)
    assert winding_number(ball, np.array([0.2, 1.3, 0.1])) == pytest.approx(0.0, abs=1e-12)
