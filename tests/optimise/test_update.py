"""Updates of the inverse Hessian."""

from functools import partial

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.planning.optimise.quasi_newton import renewed
from support.functions import quadratic


@pytest.mark.parametrize("update", ["bfgs", "dfp"])
def test_an_update_is_its_duals_inverse(update: str) -> None:
    """DFP of H is BFGS of H⁻¹ with s and y exchanged, and the other way round."""
    rng = np.random.default_rng(0)
    factor, s = rng.normal(size=(4, 4)), rng.normal(size=4)
    h = factor @ factor.T + 0.1 * np.eye(4)
    y = np.linalg.solve(h, s) + 0.1 * rng.normal(size=4)
    dual = {"bfgs": "dfp", "dfp": "bfgs"}[update]
    there, name = renewed(h, s, y, update)
    assert name == update
    back, _ = renewed(np.linalg.inv(h), y, s, dual)
    np.testing.assert_allclose(there, np.linalg.inv(back), rtol=1e-8)


def test_little_curvature_is_enough_and_none_is_not() -> None:
    """A share of 1e-14 of |s| |y| is rounding."""
    s = np.array([2.0, 0.0])
    for share, name in ((3e-14, "bfgs"), (3e-15, "none"), (-1.0, "none")):
        y = np.array([5.0 * share, 5.0])
        assert renewed(np.eye(2), s, y, "bfgs")[1] == name


# From H0 = I, as the paper has it: these functions know no metric of their own.
plain = partial(sm.QuasiNewton, initial_metric="identity")


def test_updates_satisfy_the_secant_equation() -> None:
    function, _, _ = quadratic(seed=3)
    for update in ("bfgs", "dfp"):
        steps: list[sm.optimise.Iteration] = []
        method = plain(update, max_iterations=3)
        found = method.minimize(function, np.ones(6), callback=steps.append)
        s = steps[-1].x - steps[-2].x
        y = function.gradient(steps[-1].x) - function.gradient(steps[-2].x)
        np.testing.assert_allclose(found.inverse_hessian @ y, s, atol=1e-10)


def test_no_curvature_along_the_step_gives_no_update() -> None:
    h = np.diag([1.0, 2.0, 3.0])
    s = np.array([1.0, 0.0, 0.0])
    for y in (np.array([0.0, 1.0, 1.0]), np.array([-1e-3, 1.0, 1.0]), np.zeros(3)):
        again, name = renewed(h, s, y, "fletcher")
        assert name == "none"
        np.testing.assert_array_equal(again, h)
