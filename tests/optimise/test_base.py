"""Defaults, and metrics without curvature in some directions."""

import numpy as np

import selfmotion as sm
from selfmotion.planning.optimise import inverse_metric


def test_defaults_are_what_is_documented() -> None:
    """They are part of the interface: a plan that was made with them can be made again."""
    assert sm.QuasiNewton() == sm.QuasiNewton("fletcher", 1e-8, 200, sm.optimise.LineSearch(), 1e8)
    assert sm.QuasiNewton(unbounded=0.5).unbounded == 0.5
    assert sm.QuasiNewton().initial_metric == "gauss-newton"


def test_directions_without_curvature_get_a_share_of_the_largest() -> None:
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    metric = (basis * [4.0, 1.0, 0.0]) @ basis.T
    expected = (basis * [0.25, 1.0, 1.0 / (4.0 * 1e-4)]) @ basis.T
    np.testing.assert_allclose(inverse_metric(metric), expected, rtol=1e-9)
    assert inverse_metric(np.zeros((0, 0))).shape == (0, 0)
    np.testing.assert_array_equal(inverse_metric(np.full((2, 2), np.nan)), np.eye(2))
    np.testing.assert_array_equal(inverse_metric(np.zeros((2, 2))), np.eye(2))
    assert np.all(np.isfinite(inverse_metric(np.diag([1e-320, 0.0]))))
