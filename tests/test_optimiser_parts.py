"""Laws of the optimiser's parts: each by itself, on numbers that can be followed by hand."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import selfmotion as sm
from selfmotion.basics.arrays import Array
from selfmotion.optimise import Residuals, SequentialQuadratic, Status
from selfmotion.optimise.base import inverse_metric
from selfmotion.optimise.derivative import is_misleading
from selfmotion.optimise.penalty import IGNORED, ExactPenalty, Point
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.restoration import _fall, restored
from selfmotion.optimise.rows import DenseRows, ScaledRows, pulled_back
from selfmotion.optimise.step import AIM, Step, best_step
from selfmotion.optimise.update import renewed
from test_sqp import Constrained

X, STEP = np.array([1.0, -2.0]), np.array([0.5, 0.25])


def residuals(h: list[float], tolerance: float = 1.0, equalities: int = 0) -> Residuals:
    count = len(h)
    return Residuals(np.array(h), np.full(count, tolerance), np.arange(count) >= count - equalities)


def point(cost: float, *h: float) -> Point:
    return Point(X, cost, residuals(list(h)))


@pytest.mark.parametrize("share", [-1.0, 0.0, 0.3, 0.49, 0.51, 1.0, 1.9, 2.1, 10.0])
def test_a_gradient_misleads_where_it_is_wrong_by_more_than_a_factor_of_two(share: float) -> None:
    gradient = np.array([3.0, 1.0])
    curved = 40.0

    def value(x: Array) -> float:
        s = x - X
        return 5.0 + float(gradient @ s) + curved * float(s @ s)

    claimed = float(gradient @ STEP) / share if share else 1e9
    assert is_misleading(value, X, 5.0, STEP, claimed) is not (0.5 <= share <= 2.0)


@pytest.mark.parametrize(("cost", "slope", "says"), [(1e9, -1e-3, False), (1e9, -1e5, True)])
def test_what_rounding_hides_does_not_mislead(cost: float, slope: float, says: bool) -> None:
    """Of a constant; and nothing is said where F is infinite nearby."""
    assert is_misleading(lambda x: cost, X, cost, STEP, slope) is says
    assert not is_misleading(lambda x: np.inf if x[0] > 1.0 else cost, X, cost, STEP, slope)
    # A difference counts from a thousand roundings on.
    least = 1e3 * np.finfo(float).eps * cost / 1e-4
    assert is_misleading(lambda x: cost, X, cost, STEP, 1.01 * least)
    assert not is_misleading(lambda x: cost, X, cost, STEP, 0.99 * least)


def test_defaults_are_what_is_documented() -> None:
    """They are part of the interface: a plan that was made with them can be made again."""
    assert sm.QuasiNewton() == sm.QuasiNewton("fletcher", 1e-8, 200, sm.LineSearch(), 1e8)
    assert sm.QuasiNewton(unbounded=0.5).unbounded == 0.5
    assert sm.QuasiNewton().initial_metric == "gauss-newton"
    assert SequentialQuadratic() == SequentialQuadratic(1e-7, 200)


def test_the_line_search_has_fletchers_constants() -> None:
    assert sm.LineSearch() == sm.LineSearch(rho=0.01, sigma=0.9, tau1=9.0, tau2=0.1, tau3=0.5)


@pytest.mark.parametrize("tau1", [2.0, 9.0])
def test_bracketing_goes_tau1_times_as_far_while_the_slope_stays(tau1: float) -> None:
    tried: list[float] = []

    def value(a: float) -> float:
        tried.append(a)
        return -a

    found = sm.LineSearch(tau1=tau1).search(
        value, lambda a: -1.0, 0.0, -1.0, first=1.0, longest=1e3, more=lambda: True
    )
    assert found == (1e3, -1e3)
    advances = np.diff([0.0, *tried])[:-1]
    np.testing.assert_allclose(advances[1:] / advances[:-1], tau1)


def test_bracketing_goes_at_least_as_far_again() -> None:
    """However near the minimum is: of a parabola that is least at 1.1, the second trial is at 2."""
    tried: list[float] = []

    def value(a: float) -> float:
        tried.append(a)
        return (a - 1.1) ** 2

    sm.LineSearch(sigma=0.011).search(
        value,
        lambda a: 2.0 * (a - 1.1),
        1.21,
        -2.2,
        first=1.0,
        longest=1e3,
        more=lambda: len(tried) < 2,
    )
    np.testing.assert_allclose(tried, [1.0, 2.0])


def test_a_trial_that_falls_no_further_ends_the_bracket() -> None:
    """Equal to the one before, and still falling: the minimum is in between."""
    tried: list[float] = []

    def value(a: float) -> float:
        tried.append(a)
        return {0: -1.0, 1: -1.0}.get(len(tried) - 1, -2.0)

    sm.LineSearch(sigma=0.01, tau1=2.0).search(
        value, lambda a: -0.5, 0.0, -1.0, first=1.0, longest=1e3, more=lambda: len(tried) < 3
    )
    assert 1.0 < tried[2] < tried[1]


@pytest.mark.parametrize(("tau2", "tau3"), [(0.1, 0.5), (0.2, 0.3)])
def test_sectioning_keeps_away_from_the_ends_of_the_bracket(tau2: float, tau3: float) -> None:
    """Towards a minimum at either end: φ is least at 1e-3 or at 0.999 of the first step."""
    for least in (1e-3, 0.999):
        tried: list[float] = []

        def value(a: float, least: float = least, tried: list[float] = tried) -> float:
            tried.append(a)
            return np.inf if a >= 1.0 else (a - least) ** 2

        sm.LineSearch(sigma=0.1, tau2=tau2, tau3=tau3).search(
            value,
            lambda a, least=least: 2.0 * (a - least),
            least**2,
            -2.0 * least,
            first=1.0,
            longest=10.0,
            more=lambda: True,
        )
        # Beside an infinite value the shortest step that is allowed.
        assert tried[:2] == [1.0, pytest.approx(tau2)]
        assert tried[2] <= (1.0 - tau3) * tried[1] if least < tau2 else tried[2] > tried[1]


@pytest.mark.parametrize("seed", range(20))
def test_the_penalty_makes_a_step_worth_its_cost(seed: int) -> None:
    """gain + π fall ≥ 0.3 π fall, with equality where that is what raised π; π never falls."""
    rng = np.random.default_rng(seed)
    penalty, before = ExactPenalty(), 0.0
    for _ in range(5):
        here = point(1.0, *rng.uniform(1.0, 5.0, 3))
        left, gain = rng.uniform(0.0, here.at.worst - 0.2), rng.normal()
        step = Step(STEP, np.zeros(3), gain, left, relaxed=True)
        penalty.raise_for(here, step)
        fall = here.excess - max(left - IGNORED, 0.0)
        assert gain + penalty.weight * fall >= 0.3 * penalty.weight * fall - 1e-12
        if penalty.weight > before:
            assert gain + penalty.weight * fall == pytest.approx(0.3 * penalty.weight * fall)
        assert penalty.weight >= before
        before = penalty.weight


def test_the_penalty_is_above_the_multipliers_sum_where_steps_are_not_relaxed() -> None:
    here = Point(X, 1.0, Residuals(np.array([0.5, -3.0]), np.array([2.0, 0.5]), np.zeros(2) > 0))
    prices, penalty = np.array([3.0, -4.0]), ExactPenalty()
    penalty.raise_for(here, Step(STEP, prices, 1.0, 0.0, relaxed=True))
    assert penalty.weight == 0.0
    penalty.raise_for(here, Step(STEP, prices, 1.0, 0.0, relaxed=False))
    assert penalty.weight == pytest.approx(1.2 * (3.0 * 2.0 + 4.0 * 0.5))


def test_a_steps_share_is_its_fall_by_the_expected_one() -> None:
    penalty = ExactPenalty()
    penalty.weight = 2.0
    here, step = point(10.0, 3.0), Step(STEP, np.zeros(1), 4.0, 1.85, relaxed=True)
    # Expected: 4 of F, and 2 (2.15 - 1) of the penalty.
    assert penalty.share(here, point(7.0, 2.85), step) == pytest.approx((3.0 + 2.0 * 0.15) / 6.3)
    assert penalty.share(here, None, step) == -np.inf
    useless = Step(STEP, np.zeros(1), -2.3, 1.85, relaxed=True)
    assert penalty.share(here, point(7.0, 2.85), useless) == -np.inf


def test_of_two_points_the_cheaper_or_the_less_violated_is_better() -> None:
    cheap, dear, bad, worse = point(1.0, 1.0), point(2.0, 0.5), point(0.0, 1.1), point(-1.0, 2.0)
    order = [cheap, dear, bad, worse]
    for i, first in enumerate(order):
        for j, second in enumerate(order):
            assert first.better(second) is (i < j) or first is dear or second is dear
    assert cheap.better(dear)
    assert not dear.better(cheap)
    assert dear.better(bad)
    assert [p.kept for p in order] == [True, True, False, False]
    assert bad.excess == pytest.approx(1.1 - IGNORED)
    assert point(0.0, 0.5).excess == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_conditions_out_of_reach_are_brought_as_near_as_a_tenth_more_than_possible(
    sign: float,
) -> None:
    """An equality on either side: of 10, a region of 1 takes out 1; nine tenths of it are taken."""
    at, rows = residuals([sign * 10.0], equalities=1), np.array([[1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.1, abs=0.01)
    np.testing.assert_allclose(step.p, [-sign * 0.9, 0.0], atol=0.01)
    assert step.gain == pytest.approx(-0.5 * step.p @ step.p)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_out_of_reach_is_weighed_in_tolerances(sign: float) -> None:
    """Least is 9, of 50: a tenth of the way between is left, which the strict condition takes."""
    at = Residuals(np.array([0.5, -10.0 * sign]), np.array([0.01, 1.0]), np.array([False, True]))
    rows = np.array([[-sign, 0.0], [1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.0 + 0.1 * 41.0, abs=0.05)


def test_an_inequality_out_of_reach_is_relaxed_alone() -> None:
    at, rows = residuals([10.0, -0.5]), np.array([[1.0, 0.0], [0.0, 1.0]])
    step = best_step(np.array([0.0, -10.0]), np.eye(2), at, DenseRows(rows), 1.0)
    assert step.relaxed
    assert step.worst == pytest.approx(9.1, abs=0.01)
    # The other one may use what the first one has to be given.
    assert step.p[1] == pytest.approx(1.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_equalities_that_repeat_each_other_do_not_contradict(sign: float) -> None:
    """Met to a thousandth of their tolerance, as two rows of one condition may need."""
    rows = np.array([[1.0, 0.0], [1.0, 0.0]])
    for apart, relaxed in ((1.8e-3, False), (2.2e-3, True)):
        at = residuals([sign * 0.3, sign * (0.3 + apart)], equalities=2)
        assert best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 5.0).relaxed is relaxed


def test_inequalities_are_met_within_the_share_that_is_aimed_at() -> None:
    at, rows = residuals([-1.0, -50.0], 0.1), np.array([[1.0, 0.0], [0.0, 1.0]])
    step = best_step(np.array([-3.0, -4.0]), np.eye(2), at, DenseRows(rows), 20.0)
    np.testing.assert_allclose(step.p, [1.0 + AIM * 0.1, 4.0])
    np.testing.assert_allclose(step.multipliers, [3.0 - step.p[0], 0.0], atol=1e-9)
    assert step.gain == pytest.approx(3.0 * step.p[0] + 16.0 - 0.5 * (step.p[0] ** 2 + 16.0))
    assert step.worst == pytest.approx(AIM)
    assert not step.relaxed


def test_a_step_of_nothing_tells_what_is_violated() -> None:
    none = DenseRows(np.zeros((2, 0)))
    for h, relaxed in (([0.5, -3.0], False), ([1.5, -3.0], True)):
        step = best_step(np.zeros(0), np.zeros((0, 0)), residuals(h), none, 1.0)
        assert step.worst == max(h)
        assert step.relaxed is relaxed
        assert (step.gain, len(step.p), step.multipliers.tolist()) == (0.0, 0, [0.0, 0.0])


def test_rows_of_any_size_are_kept() -> None:
    """Scaled by their largest entry, but for rows of nothing; and multipliers go with rows."""
    for size in (1e-90, 1e-6, 1.0, 1e6):
        rows = size * np.array([[1.0, 1.0], [0.0, 0.0]])
        upper = np.array([size, 1.0])
        found = minimize_quadratic(
            np.eye(2), -2.0 * np.ones(2), rows, np.full(2, -np.inf), upper, np.full(2, np.inf)
        )
        assert found is not None
        np.testing.assert_allclose(found[0], 0.5)
        np.testing.assert_allclose(found[1] * size, [1.5, 0.0])
    rows = np.array([[0.0, 0.0]])
    lower, upper = np.array([1.0]), np.array([2.0])
    assert minimize_quadratic(np.eye(2), X, rows, lower, upper, np.ones(2)) is None


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


def test_directions_without_curvature_get_a_share_of_the_largest() -> None:
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    metric = (basis * [4.0, 1.0, 0.0]) @ basis.T
    expected = (basis * [0.25, 1.0, 1.0 / (4.0 * 1e-4)]) @ basis.T
    np.testing.assert_allclose(inverse_metric(metric), expected, rtol=1e-9)
    assert inverse_metric(np.zeros((0, 0))).shape == (0, 0)
    np.testing.assert_array_equal(inverse_metric(np.full((2, 2), np.nan)), np.eye(2))
    np.testing.assert_array_equal(inverse_metric(np.zeros((2, 2))), np.eye(2))
    assert np.all(np.isfinite(inverse_metric(np.diag([1e-320, 0.0]))))


def test_a_residual_is_measured_in_its_tolerance() -> None:
    at = Residuals(
        np.array([-4.0, 3.0, -2.0]), np.array([1.0, 2.0, 0.5]), np.array([False, False, True])
    )
    np.testing.assert_array_equal(at.excess, [-4.0, 1.5, 4.0])
    assert at.worst == 4.0
    assert residuals([-1.0]).worst == 0.0
    assert residuals([]).worst == 0.0


def bowl(equalities: int = 0) -> Constrained:
    """Return ½ |x|² + 3 where x₀ ≥ 1, or = 1."""
    return Constrained(
        lambda x: 0.5 * float(x @ x) + 3.0,
        lambda x: x,
        lambda x: np.array([1.0 - x[0]]),
        lambda x: np.array([[-1.0, 0.0]]),
        equalities,
    )


@pytest.mark.parametrize("inverse", [np.diag([1.0, -1e-18]), np.diag([1.0, 0.0])])
def test_estimates_that_rounding_made_indefinite_are_used(inverse: Array) -> None:
    found = SequentialQuadratic().minimize(bowl(), np.array([3.0, 0.0]), inverse)
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-5)
    assert np.all(np.isfinite(found.inverse_hessian))


@pytest.mark.parametrize("equalities", [0, 1])
def test_a_restoration_ends_near_the_conditions_and_tells_f_alone(equalities: int) -> None:
    """The penalty weighs ten times F at the start: ½ |x|² + 3 + w (1 - x₀)² is least near 1."""
    function, told = bowl(equalities), list[sm.Iteration]()
    start = np.array([-1.0, 2.0])
    x, status = restored(function, start, 1.0, np.inf, lambda step: told.append(step))
    assert status is None
    # w (1 - x₀)² = 10 F = 55 at the start, x₀ = -1: 13.75.
    assert x[0] == pytest.approx(27.5 / 28.5, abs=1e-3)
    assert x[1] == pytest.approx(0.0, abs=0.02)
    for step in told:
        assert step.cost == pytest.approx(function.value(step.x))
    # It ends where nothing is left to gain, not when it must.
    assert function.evaluations < 30


def test_restorations_are_the_same_in_other_variables() -> None:
    """Steps are damped in the metric of F: x = S y changes where they are written, not where to."""
    g = np.diag([1.0, 30.0, 0.1])
    scale = np.array([[2.0, 0.3, 0.0], [0.0, 0.05, 0.1], [0.5, 0.0, 9.0]])

    def problem(s: Array) -> Constrained:
        function = Constrained(
            lambda y: 0.5 * float(s @ y @ g @ s @ y) + 1.0,
            lambda y: s.T @ g @ s @ y,
            lambda y: np.array([9.0 - (s @ y) @ (s @ y), 2.0 - np.sum(np.sin(s @ y))]),
            lambda y: np.array([-2.0 * s @ y, -np.cos(s @ y)]) @ s,
        )
        function._metric = lambda y: s.T @ g @ s
        return function

    start, none = np.array([0.3, -0.1, 0.2]), np.eye(3)
    x, _ = restored(problem(none), start, 1.0, np.inf, lambda step: None)
    y, _ = restored(problem(scale), np.linalg.solve(scale, start), 1.0, np.inf, lambda step: None)
    assert np.linalg.norm(x - start) > 1.0
    np.testing.assert_allclose(scale @ y, x, rtol=1e-5)


@pytest.mark.parametrize(
    ("ratio", "factor"), [(0.9, 0.2), (0.76, 0.2), (0.74, 1.0), (0.26, 1.0), (0.24, 5.0)]
)
def test_damping_follows_how_well_a_fall_was_foreseen(ratio: float, factor: float) -> None:
    """K. Madsen and others: less where the model holds, more where it hardly does."""
    metric, gradient = np.diag([2.0, 1.0]), np.array([1.0, -3.0])
    p = -np.linalg.solve(metric + 0.01 * np.eye(2), gradient)
    foreseen = -float(gradient @ p + 0.5 * p @ metric @ p)
    asked: list[Array] = []

    def value(x: Array) -> float:
        asked.append(x)
        return 7.0 - ratio * foreseen

    stub: Any = SimpleNamespace(
        gradient=lambda x: gradient, metric=lambda x: metric, value=value, evaluations=0
    )
    x, there, damping = _fall(stub, np.ones(2), 7.0, np.eye(2), 0.01, 10)
    np.testing.assert_allclose(x, 1.0 + p)
    assert there == value(x)
    assert damping == pytest.approx(0.01 * factor)
    assert len(asked) == 2


def test_damping_grows_until_a_step_falls() -> None:
    """And not beyond what leads nowhere."""
    metric, gradient = np.eye(1), np.ones(1)
    asked: list[float] = []

    def value(x: Array) -> float:
        asked.append(float(x[0]))
        return 1.0 if abs(x[0]) > bound else 0.9

    stub: Any = SimpleNamespace(
        gradient=lambda x: gradient, metric=lambda x: metric, value=value, evaluations=0
    )
    bound = 0.1
    found = _fall(stub, np.zeros(1), 1.0, np.eye(1), 1.0, 10)
    assert found is not None
    np.testing.assert_allclose(asked, [-1.0 / (1.0 + 5.0**k) for k in range(3)])
    bound = -1.0
    assert _fall(stub, np.zeros(1), 1.0, np.eye(1), 1.0, 10) is None


def test_a_first_step_without_a_cost_is_short() -> None:
    """Where F = 0 nothing says how far to go: a thousandth of the scale, doubled.

    Nine tenths of what that takes out of the violation is taken.
    """
    function = Constrained(
        lambda x: 0.5 * float(x @ x), lambda x: x, lambda x: 1.0 - x, lambda x: -np.eye(2)
    )
    history = SequentialQuadratic().minimize(function, np.zeros(2)).history
    assert np.abs(history[1].x).max() == pytest.approx(0.9 * 2e-3)


@pytest.mark.parametrize("spoiled", ["gradient", "metric"])
def test_a_restoration_goes_nowhere_without_derivatives(spoiled: str) -> None:
    function, start = bowl(), np.array([-1.0, 2.0])
    whole = getattr(function, spoiled)
    setattr(function, spoiled, lambda x: np.full_like(whole(x), np.nan))
    with np.errstate(invalid="ignore"):
        x, status = restored(function, start, 1.0, np.inf, lambda step: None)
    assert status is None
    np.testing.assert_array_equal(x, start)


def test_a_restoration_ends_where_derivatives_are_beyond_all_numbers() -> None:
    """LAPACK calls such a matrix singular."""
    function, start = bowl(), np.array([-1.0, 2.0])
    function._metric = lambda x: np.zeros((2, 2))
    function._rows = lambda x: np.array([[0.0, 0.0]])
    x, status = restored(function, start, 1.0, np.inf, lambda step: None)
    assert status is None
    np.testing.assert_array_equal(x, start)


def hopeless() -> tuple[Constrained, list[Array]]:
    """Return ½ xᵀGx + 1 where 1 ≤ 0 is asked for, and where it is looked at."""
    seen: list[Array] = []
    basis = np.linalg.qr(np.random.default_rng(3).normal(size=(5, 5)))[0]
    g = (basis * [0.5, 20.0, 0.05, 4.0, 60.0]) @ basis.T

    def value(x: Array) -> float:
        seen.append(x.copy())
        return 0.5 * float(x @ g @ x) + 1.0

    function = Constrained(value, lambda x: g @ x, lambda x: np.ones(1), lambda x: np.zeros((1, 5)))
    # Elsewhere the first direction is the steepest.
    other = (basis * [900.0, 20.0, 0.05, 4.0, 60.0]) @ basis.T
    function._metric = lambda x: g if np.abs(x).max() < 0.5 else other
    return function, seen


def test_an_interruption_of_a_restoration_keeps_where_it_was() -> None:
    function, start, asked, interrupted = bowl(), np.array([-1.0, 2.0]), 0, 8
    whole = function._value

    def value(x: Array) -> float:
        nonlocal asked
        asked += 1
        if asked > interrupted:
            raise KeyboardInterrupt
        return whole(x)

    function._value = value
    function._h = lambda x: np.array([1.0 - x[0] + 1e-3 * np.sin(50.0 * x[1])])
    function._rows = lambda x: np.array([[-1.0, 0.05 * np.cos(50.0 * x[1])]])
    x, status = restored(function, start, 1.0, np.inf, lambda step: None)
    assert status is Status.INTERRUPTED
    assert np.all(np.isfinite(x))
    assert x[0] > start[0]


def test_far_conditions_are_never_asked_for() -> None:
    """Of a thousand, those that a step violates; the others only along it."""
    asked: set[int] = set()
    rng = np.random.default_rng(0)
    table, h = rng.normal(size=(1000, 3)), np.full(1000, -50.0)
    h[::100] = -0.01

    class Watched(DenseRows):
        def picked(self, which: Any) -> Array:
            asked.update(which.tolist())
            return super().picked(which)

    step = best_step(np.ones(3), np.eye(3), residuals(list(h), 1e-3), Watched(table), 10.0)
    assert not step.relaxed
    assert asked
    assert asked <= set(range(0, 1000, 100))


def test_steps_of_a_scan_lead_along_the_flattest_directions() -> None:
    """Both ways, by one, two and three times what would double a quadratic cost."""
    function, seen = hopeless()
    start = np.array([0.1, 0.2, -0.1, 0.3, 0.1])
    f = function.value(start)
    values, vectors = np.linalg.eigh(function.metric(start))
    found = SequentialQuadratic().minimize(function, start)
    assert found.status is Status.INFEASIBLE
    expected = [
        start + k * np.sqrt(2.0 * f / values[axis]) * vectors[:, axis]
        for axis in range(3)
        for k in (1, -1, 2, -2, 3, -3)
    ]
    far = np.linalg.norm(seen - start, axis=1) > 0.5
    points = np.array(seen)[far]
    for point in expected:
        assert np.abs(points - point).max(axis=1).min() < 1e-6 * np.linalg.norm(point)
    steep = vectors[:, 3:]
    assert np.abs((points - start) @ steep).max() < 1.0


@pytest.mark.parametrize(("kept", "weights"), [(1.0, [1.0, 10.0]), (0.5, [1.0, 10.0, 100.0])])
def test_restorations_go_on_as_long_as_they_help(
    kept: float, weights: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten times as stiff each time, and not after one that left the violation where it was."""
    asked: list[float] = []
    function, seen = hopeless()
    share, before = np.ones(1), []
    function._h = lambda x: share.copy()

    def restoring(function, x, weight, limit, note):
        asked.append(weight)
        before.append(len(seen))
        share[0] *= kept
        return x + 1e-3, None

    monkeypatch.setattr("selfmotion.optimise.sqp.restored", restoring)
    SequentialQuadratic().minimize(function, np.full(5, 0.1))
    assert asked == weights
    # Five steps that take nothing out of the violation are enough, each tried once.
    assert before[0] <= 8


@pytest.mark.parametrize("limit", [1, 2])
def test_a_restoration_ends_with_the_evaluations(limit: int) -> None:
    function = bowl()
    _, status = restored(function, np.array([-1.0, 2.0]), 1.0, limit, lambda step: None)
    assert status is Status.MAX_EVALUATIONS
    assert function.evaluations <= limit + 1


def test_a_restoration_stops_when_it_is_asked_to() -> None:
    _, status = restored(bowl(), np.array([-1.0, 2.0]), 1.0, np.inf, lambda step: True)
    assert status is Status.STOPPED


def test_the_multiplier_and_the_estimate_are_those_of_the_unscaled_problem() -> None:
    """F = ½ (x - c)ᵀ G (x - c) on x₀ = 0: λ = -∂F/∂x₀, and the curvature left is G's."""
    g, c = np.diag([100.0, 0.01]), np.array([1.0, 2.0])
    function = Constrained(
        lambda x: 0.5 * float((x - c) @ g @ (x - c)) + 1.0,
        lambda x: g @ (x - c),
        lambda x: np.array([x[0]]),
        lambda x: np.array([[1.0, 0.0]]),
        1,
    )
    function._metric = lambda x: g
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, np.array([0.3, -3.0]))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, [0.0, 2.0], atol=1e-5)
    assert found.multipliers[0] == pytest.approx(100.0, rel=1e-4)
    np.testing.assert_allclose(found.inverse_hessian, np.linalg.inv(g), rtol=1e-3, atol=1e-6)
    assert function.evaluations <= 4


@pytest.mark.parametrize("region", [0.3, 3.0])
@pytest.mark.parametrize("seed", range(20))
def test_steps_are_those_of_all_conditions(seed: int, region: float) -> None:
    """Though programmes are solved with those alone that some step would violate."""
    rng = np.random.default_rng(seed)
    rows, h = rng.normal(size=(300, 5)), -rng.uniform(0.0, 2.0, 300)
    at = residuals(list(h), 1e-3)
    gradient = 3.0 * rng.normal(size=5)
    step = best_step(gradient, np.eye(5), at, DenseRows(rows), region)
    reach, upper = np.full(5, region), -h + AIM * 1e-3
    everything = minimize_quadratic(np.eye(5), gradient, rows, np.full(300, -np.inf), upper, reach)
    assert everything is not None
    assert not step.relaxed
    # A condition may be left out that is violated by a thousandth of its tolerance.
    np.testing.assert_allclose(step.p, everything[0], atol=1e-5)
    np.testing.assert_allclose(step.multipliers, everything[1], atol=1e-4)
    assert step.worst == pytest.approx(np.max((h + rows @ step.p) / 1e-3), rel=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_violations_that_are_left_are_those_of_all_conditions(seed: int) -> None:
    """Of half-spaces that share no point: the least violation, by linear programming."""
    rng = np.random.default_rng(seed)
    rows, h = rng.normal(size=(200, 3)), rng.uniform(-1.0, 1.0, 200)
    at = residuals(list(h), 1e-2)
    step = best_step(np.zeros(3), np.eye(3), at, DenseRows(rows), 2.0)
    answer = linprog(
        [0.0, 0.0, 0.0, 1.0],
        A_ub=np.column_stack([rows, np.full(200, -1e-2)]),
        b_ub=-h,
        bounds=[(-2.0, 2.0)] * 3 + [(None, None)],
    )
    least, before = answer.fun, at.worst
    assert step.relaxed
    assert step.worst <= least + 0.1 * (before - least) + 0.002 * before
    assert step.worst >= least * (1.0 - 1e-6)


def test_rows_of_other_variables_are_those_by_the_chain_rule() -> None:
    rng = np.random.default_rng(0)
    table, scale = rng.normal(size=(6, 4)), rng.normal(size=(4, 3))
    rows = ScaledRows(DenseRows(table), scale)
    p, weights = rng.normal(size=3), np.array([0.0, 2.0, 0.0, -1.0, 0.0, 0.5])
    np.testing.assert_allclose(rows.along(p), table @ scale @ p, rtol=1e-12)
    np.testing.assert_allclose(rows.picked(np.array([4, 1])), (table @ scale)[[4, 1]], rtol=1e-12)
    np.testing.assert_allclose(pulled_back(rows, weights), weights @ table @ scale, rtol=1e-12)
