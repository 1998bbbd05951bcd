"""The plan that other works' methods are compared with."""

import pytest

import selfmotion as sm


@pytest.fixture(scope="module")
def ours() -> sm.Plan:
    """Sixteen coefficients: within the four digits of the optimum over all motions."""
    return sm.plan(sm.sample_problem(null_motion=sm.PolynomialNullMotion(15)))
