"""The optimiser on functions with known minima, and its behaviour at the edges."""

from functools import partial

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.optimise import Minimum
from support.functions import Counted, quadratic

# From H0 = I, as the paper has it: these functions know no metric of their own.
plain = partial(sm.QuasiNewton, initial_metric="identity")


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
    search = sm.optimise.LineSearch(sigma=1e-6, tau2=1e-6, tau3=1e-6)
    method = plain(update, tolerance=1e-14, line_search=search)
    found = method.minimize(function, np.zeros(6))
    np.testing.assert_allclose(found.x, center, atol=1e-5)
    assert len(found.history) - 1 <= 6 + 2
    np.testing.assert_allclose(found.inverse_hessian @ hessian, np.eye(6), atol=1e-2)


@pytest.mark.parametrize("update", ["fletcher", "bfgs", "dfp"])
def test_rosenbrock(update: str) -> None:
    # DFP is known to want fairly exact searches.
    search = sm.optimise.LineSearch(sigma=0.1)
    method = plain(update, tolerance=1e-14, line_search=search)
    found = method.minimize(rosenbrock(), np.array([-1.2, 1.0]))
    np.testing.assert_allclose(found.x, [1.0, 1.0], atol=1e-5)


def test_the_exact_inverse_hessian_needs_one_step() -> None:
    function, hessian, center = quadratic()
    found = plain().minimize(function, np.zeros(6), np.linalg.inv(hessian))
    np.testing.assert_allclose(found.x, center, atol=1e-10)
    assert function.evaluations == 2
    assert found.status is sm.optimise.Status.CONVERGED


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


def test_infinite_start_is_refused() -> None:
    function = Counted(lambda x: np.inf, lambda x: x)
    with pytest.raises(sm.errors.ProblemError, match="at the start is not finite"):
        plain().minimize(function, np.zeros(2))


def test_unbounded_functions_are_named() -> None:
    function = Counted(lambda x: float(-x[0]), lambda x: np.array([-1.0]))
    found = plain(unbounded=1e4).minimize(function, np.zeros(1))
    assert found.status is sm.optimise.Status.UNBOUNDED
    assert "JointVelocity" in found.status.message


def test_a_start_that_costs_nothing_is_no_bound_of_what_follows() -> None:
    """F falls from 0 to its minimum -1, as it would from anywhere else."""
    function = Counted(lambda x: float((x[0] - 1.0) ** 2) - 1.0, lambda x: 2.0 * (x - 1.0))
    found = plain().minimize(function, np.zeros(1))
    assert found.status is sm.optimise.Status.CONVERGED
    assert found.cost == pytest.approx(-1.0)


def test_a_wrong_gradient_is_told_as_long_as_it_can_be_asked_for() -> None:
    """It takes two evaluations to know; without them the limit is the reason."""
    wrong = Counted(lambda x: float(x @ x) + 1.0, lambda x: -2.0 * x)
    start = np.array([1.0, 2.0])
    assert plain().minimize(wrong, start).status is sm.optimise.Status.GRADIENT
    needed, reasons = wrong.evaluations, []
    for limit in (needed - 1, needed, needed + 3):
        wrong.evaluations = 0
        reasons.append(plain().minimize(wrong, start, max_evaluations=limit).status)
    told = sm.optimise.Status
    assert reasons == [told.MAX_EVALUATIONS, told.GRADIENT, told.GRADIENT]


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
    assert found.status is sm.optimise.Status.INTERRUPTED
    assert found.cost == min(iteration.cost for iteration in found.history)
    assert found.cost < 25.2
    with pytest.raises(ZeroDivisionError):
        interrupted_after(12, ZeroDivisionError())


@pytest.mark.parametrize("limit", [1, 2, 5, 9])
def test_evaluation_limit_is_kept(limit: int) -> None:
    function = rosenbrock()
    found = plain().minimize(function, np.array([-1.2, 1.0]), max_evaluations=limit)
    assert function.evaluations <= limit
    assert found.status is sm.optimise.Status.MAX_EVALUATIONS


def test_iteration_limit_and_callback_stop() -> None:
    found = plain(max_iterations=3).minimize(rosenbrock(), np.array([-1.2, 1.0]))
    assert found.status is sm.optimise.Status.MAX_ITERATIONS
    assert len(found.history) == 4
    found = plain().minimize(
        rosenbrock(), np.array([-1.2, 1.0]), callback=lambda step: step.evaluations > 5
    )
    assert found.status is sm.optimise.Status.STOPPED


def test_cost_never_rises() -> None:
    found = plain().minimize(rosenbrock(), np.array([-1.2, 1.0]))
    costs = [iteration.cost for iteration in found.history]
    assert np.all(np.diff(costs) < 0)


@pytest.mark.parametrize(
    "arguments", [{"update": "sr1"}, {"tolerance": 0.0}, {"tolerance": float("nan")}]
)
def test_bad_settings_are_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(sm.errors.ProblemError, match="optimiser"):
        plain(**arguments)


@pytest.mark.parametrize("offset", [50.0, -50.0])
def test_costs_below_zero_converge_as_others(offset: float) -> None:
    """Relative to |F|, from a metric and from the identity."""
    counts = []
    for sign in (offset, abs(offset)):
        function, hessian, center = quadratic(offset=sign)
        found = sm.QuasiNewton().minimize(function, np.zeros(6), 0.7 * np.linalg.inv(hessian))
        assert found.status is sm.optimise.Status.CONVERGED
        np.testing.assert_allclose(found.x, center, atol=1e-2)
        counts.append(function.evaluations)
    assert abs(counts[0] - counts[1]) <= 1
    function, _, center = quadratic(offset=offset)
    found = plain().minimize(function, np.zeros(6))
    assert found.status is sm.optimise.Status.CONVERGED
    assert function.evaluations <= 40


@pytest.mark.parametrize("slope", np.geomspace(1e-4, 1e4, 9))
def test_falling_for_ever_stops_at_the_stated_bound(slope: float) -> None:
    function = Counted(lambda x: float(-slope * x[0]), lambda x: np.array([-slope, 0.0]))
    found = plain(unbounded=1e4).minimize(function, np.zeros(2))
    assert found.status is sm.optimise.Status.UNBOUNDED
    # The line search may go twice as far from where it began.
    assert 1e4 < np.linalg.norm(found.x) <= 3e4
    assert function.evaluations <= 20


def test_the_first_step_from_the_identity_is_no_longer_than_one() -> None:
    function, _, _ = quadratic(offset=1.0)
    steps: list[float] = []
    value = function._value
    function._value = lambda x: (steps.append(float(np.linalg.norm(x))), value(x))[1]
    plain(max_iterations=1).minimize(function, np.zeros(6))
    assert steps[1] <= 1.0 + 1e-12


def test_a_gradient_that_is_not_finite_is_an_error_and_a_slope_a_step_too_far() -> None:
    function = Counted(lambda x: float(x @ x), lambda x: np.full(2, np.nan))
    with pytest.raises(sm.errors.ProblemError, match="its gradient is not"):
        plain().minimize(function, np.ones(2))

    def slope(a: float) -> float:
        return 2.0 * a - 2.0 if a < 3.0 else np.nan

    found = sm.optimise.LineSearch(sigma=0.1).search(
        lambda a: a**2 - 2.0 * a if a < 3.0 else -1.5,
        slope,
        0.0,
        -2.0,
        first=4.0,
        longest=1e6,
        more=lambda: True,
    )
    assert found is not None
    assert found[0] == pytest.approx(1.0, abs=0.2)


def test_a_function_without_bottom_ends_where_its_start_is_lost_in_rounding() -> None:
    function = Counted(lambda x: float(-(x[0] ** 3)) - x[0], lambda x: -3.0 * x**2 - 1.0)
    found = plain().minimize(function, np.zeros(1))
    assert found.status is sm.optimise.Status.UNBOUNDED
    assert function.evaluations <= 100
