"""Null motions at stages: linear in the coefficients, with the transpose."""

from functools import partial

import numpy as np
import pytest

from selfmotion.model.motion import NullMotionTable


def test_null_motion_table_and_its_transpose() -> None:
    """⟨ε(x), w⟩ = ⟨x, pullback(w)⟩ and ε(x) = matrix · x, for both spaces."""
    rng = np.random.default_rng(12)
    for frame, rows in ((None, 4), (rng.normal(size=(9, 4, 2)), 2)):
        given = None if frame is None else partial(np.copy, frame)
        table = NullMotionTable(rng.normal(size=(9, 3)), given, rows)
        x, w = rng.normal(size=table.size), rng.normal(size=(9, 4))
        assert (table.epsilon(x) * w).sum() == pytest.approx(x @ table.pullback(w))
        np.testing.assert_allclose(table.matrix() @ x, table.epsilon(x), atol=1e-12)
