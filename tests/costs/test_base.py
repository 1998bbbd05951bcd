"""Weights that are none are refused."""

import pytest

import selfmotion as sm


@pytest.mark.parametrize("weight", [-1.0, [[0.0, 1.0], [0.0, 0.0]], float("inf")])
def test_bad_weights_are_refused(weight: object) -> None:
    with pytest.raises(sm.errors.ProblemError, match="weight"):
        sm.costs.JointVelocity(weight)
