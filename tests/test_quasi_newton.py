"""The optimiser on functions with known minima, and its behaviour at the edges."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics.arrays import Array
from selfmotion.optimise.quasi_newton import Minimum

# From H0 = I, as the paper has it: these functions know no metric of their own.
plain = partial(sm.QuasiNewton, initial_metric="identity")


class Counted:
    """A function with its gradient, counting calls like the real objective."""

    def __init__(self, value: Callable[[Array], float], gradient: Callable[[Array], Array]) -> None:
        self._value, self._gradient = value, gradient
        self.evaluations = 0

    def value(self, x: Array) -> float:
        self.evaluations += 1
        return self._value(x)

    def gradient(self, x: Array) -> Array:
        return self._gradient(x)

    def slope(self, x: Array, direction: Array) -> float:
        return float(self._gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        raise AssertionError("H0 is the identity or given")


def quadratic(size: int = 6, seed: int = 0, offset: float = 1.0) -> tuple[Counted, Array, Array]:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(size, size))
    hessian = factor @ factor.T + 0.5 * np.eye(size)
    center = rng.normal(size=size)

    def value(x: Array) -> float:
        return float(0.5 * (x - center) @ hessian @ (x - center)) + offset

    return Counted(value, lambda x: hessian @ (x - center)), hessian, center


def rosenbrock() -> Counted:
    def value(x: Array) -> float:
        return float((1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2) + 1.0

    def gradient(x: Array) -> Array:
        valley = x[1] - x[0] ** 2
        return np.array([-2 * (1 - x[0]) - 400 * x[0] * valley, 200 * valley])

    return Counted(value, gradient)


@pytest.mark.parametrize("update", ["fletcher", "bfgs", "dfp"])
def test_quadratic_with_exact_searches_ends_in_n_iterations(update: str) -> None:
    """The family's defining property: n exact line searches find the minimum and H = G⁻¹."""
    function, hessian, center = quadratic()
    search = sm.LineSearch(sigma=1e-6, tau2=1e-6, tau3=1e-6)
    method = plain(update, tolerance=1e-14, line_search=search)
    found = method.minimize(function, np.zeros(6))
    np.testing.assert_allclose(found.x, center, atol=1e-5)
    assert len(found.history) - 1 <= 6 + 2
    np.testing.assert_allclose(found.inverse_hessian @ hessian, np.eye(6), atol=1e-2)


@pytest.mark.parametrize("update", ["fletcher", "bfgs", "dfp"])
def test_rosenbrock(update: str) -> None:
    # DFP is known to want fairly exact searches.
    search = sm.LineSearch(sigma=0.1)
    method = plain(update, tolerance=1e-14, line_search=search)
    found = method.minimize(rosenbrock(), np.array([-1.2, 1.0]))
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-5)


def test_the_exact_inverse_hessian_needs_one_step() -> None:
    function, hessian, center = quadratic()
    found = plain().minimize(function, np.zeros(6), np.linalg.inv(hessian))
    np.testing.assert_allclose(found.x, center, atol=1e-10)
    assert function.evaluations == 2
    assert found.status is sm.Status.CONVERGED


def test_switch_takes_dfp_when_curvature_is_below_the_models() -> None:
    """Fletcher 1970: DFP iff sᵀy < yᵀHy; both occur on the way through Rosenbrock's valley."""
    function = rosenbrock()
    found = plain().minimize(function, np.array([-1.2, 1.0]))
    h = np.eye(2)
    names = []
    for before, after in zip(found.history[:-1], found.history[1:], strict=True):
        s = after.x - before.x
        y = function.gradient(after.x) - function.gradient(before.x)
        hy = h @ y
        expected = "dfp" if s @ y < y @ hy else "bfgs"
        assert after.update == expected
        h = h + np.outer(s, s) / (s @ y) - np.outer(hy, hy) / (y @ hy)
        if expected == "bfgs":
            v = s / (s @ y) - hy / (y @ hy)
            h = h + (y @ hy) * np.outer(v, v)
        names.append(expected)
    assert set(names) == {"dfp", "bfgs"}
    np.testing.assert_allclose(found.inverse_hessian, h, rtol=1e-6)


def test_updates_satisfy_the_secant_equation() -> None:
    function, _, _ = quadratic(seed=3)
    for update in ("bfgs", "dfp"):
        steps: list[sm.Iteration] = []
        method = plain(update, max_iterations=3)
        found = method.minimize(function, np.ones(6), callback=steps.append)
        s = steps[-1].x - steps[-2].x
        y = function.gradient(steps[-1].x) - function.gradient(steps[-2].x)
        np.testing.assert_allclose(found.inverse_hessian @ y, s, atol=1e-10)


@pytest.mark.parametrize("sigma", [0.1, 0.9])
@pytest.mark.parametrize("first", [1e-3, 0.1, 1.0, 30.0])
def test_line_search_meets_the_wolfe_conditions(sigma: float, first: float) -> None:
    def value(a: float) -> float:
        return float(-a / (a**2 + 2) + 0.03 * np.sin(3 * a))

    def slope(a: float) -> float:
        return float((a**2 - 2) / (a**2 + 2) ** 2 + 0.09 * np.cos(3 * a))

    search = sm.LineSearch(sigma=sigma)
    found = search.search(
        value, slope, value(0), slope(0), first=first, longest=1e6, more=lambda: True
    )
    assert found is not None
    alpha, reached = found
    assert reached == value(alpha)
    assert reached <= value(0) + search.rho * alpha * slope(0)
    assert abs(slope(alpha)) <= -sigma * slope(0)


def test_line_search_gives_up_where_nothing_decreases() -> None:
    """A wrong slope (the function rises) ends the search instead of shrinking for ever."""
    found = sm.LineSearch().search(
        lambda a: 1.0 + a, lambda a: 1.0, 1.0, -1.0, first=1.0, longest=1e6, more=lambda: True
    )
    assert found is None


def test_infinite_trial_points_are_stepped_back_from() -> None:
    def value(x: Array) -> float:
        return float(x[0] - np.log(x[0])) if x[0] > 0 else np.inf

    function = Counted(value, lambda x: np.array([1 - 1 / x[0]]))
    found = plain().minimize(function, np.array([3.0]), 50.0 * np.eye(1))
    assert found.x[0] == pytest.approx(1.0, abs=1e-3)


def test_infinite_start_is_refused() -> None:
    function = Counted(lambda x: np.inf, lambda x: x)
    with pytest.raises(sm.ProblemError, match="at the start is not finite"):
        plain().minimize(function, np.zeros(2))


def test_unbounded_functions_are_named() -> None:
    function = Counted(lambda x: float(-x[0]), lambda x: np.array([-1.0]))
    found = plain(unbounded=1e4).minimize(function, np.zeros(1))
    assert found.status is sm.Status.UNBOUNDED
    assert "JointVelocity" in found.status.message


def interrupted_after(count: int, error: BaseException) -> Minimum:
    function = rosenbrock()
    value = function._value

    def failing(x: Array) -> float:
        if function.evaluations > count:
            raise error
        return value(x)

    function._value = failing
    return plain().minimize(function, np.array([-1.2, 1.0]))


def test_interruption_keeps_the_best_so_far() -> None:
    found = interrupted_after(12, KeyboardInterrupt())
    assert found.status is sm.Status.INTERRUPTED
    assert found.cost == min(iteration.cost for iteration in found.history)
    assert found.cost < 25.2
    with pytest.raises(ZeroDivisionError):
        interrupted_after(12, ZeroDivisionError())


@pytest.mark.parametrize("limit", [1, 2, 5, 9])
def test_evaluation_limit_is_kept(limit: int) -> None:
    function = rosenbrock()
    found = plain().minimize(function, np.array([-1.2, 1.0]), max_evaluations=limit)
    assert function.evaluations <= limit
    assert found.status is sm.Status.MAX_EVALUATIONS


def test_iteration_limit_and_callback_stop() -> None:
    found = plain(max_iterations=3).minimize(rosenbrock(), np.array([-1.2, 1.0]))
    assert found.status is sm.Status.MAX_ITERATIONS
    assert len(found.history) == 4
    found = plain().minimize(
        rosenbrock(), np.array([-1.2, 1.0]), callback=lambda step: step.evaluations > 5
    )
    assert found.status is sm.Status.STOPPED


def test_cost_never_rises() -> None:
    found = plain().minimize(rosenbrock(), np.array([-1.2, 1.0]))
    costs = [iteration.cost for iteration in found.history]
    assert np.all(np.diff(costs) < 0)


@pytest.mark.parametrize(
    "arguments", [{"update": "sr1"}, {"tolerance": 0.0}, {"tolerance": float("nan")}]
)
def test_bad_settings_are_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(sm.ProblemError, match="optimiser"):
        plain(**arguments)
