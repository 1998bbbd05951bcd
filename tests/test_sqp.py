"""Sequential quadratic programming on functions with known answers, and at the edges."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.optimise import Residuals, SequentialQuadratic, Status
from selfmotion.optimise.quadratic import minimize_quadratic
from selfmotion.optimise.restoration import _Penalised, restored, scanned
from selfmotion.optimise.rows import DenseRows, pulled_back
from selfmotion.optimise.step import AIM, best_step

# Conditions of these functions may be violated by so much.
TOLERANCE = 1e-6
# ∇F + Σ λ ∇h relative to ∇F: the square root of the decrease that is still predicted.
STATIONARY = 1e-3


class Constrained:
    """A function with conditions h ≤ 0, the last `equalities` of them h = 0."""

    def __init__(
        self,
        value: Callable[[Array], float],
        gradient: Callable[[Array], Array],
        h: Callable[[Array], Array],
        rows: Callable[[Array], Array],
        equalities: int = 0,
        tolerance: float = TOLERANCE,
        metric: Callable[[Array], Array] = lambda x: np.eye(len(x)),
    ) -> None:
        self._metric = metric
        self._value, self._gradient, self._h, self._rows = value, gradient, h, rows
        self._equalities, self._tolerance = equalities, tolerance
        self.evaluations = 0
        self._last: Array | None = None

    def value(self, x: Array) -> float:
        if self._last is None or not np.array_equal(x, self._last):
            self.evaluations += 1
            self._last = x.copy()
        return self._value(x)

    def gradient(self, x: Array) -> Array:
        return self._gradient(x)

    def slope(self, x: Array, direction: Array) -> float:
        return float(self._gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        return self._metric(x)

    def conditions(self, x: Array) -> Residuals:
        h = self._h(x)
        equality = np.arange(len(h)) >= len(h) - self._equalities
        return Residuals(h, np.full(len(h), self._tolerance), equality)

    def condition_rows(self, x: Array) -> DenseRows:
        return DenseRows(self._rows(x))


def quadratic_programme(seed: int, equalities: int = 1) -> tuple[Constrained, Array]:
    """Return a random convex programme with a feasible point, and its answer by SLSQP."""
    rng = np.random.default_rng(seed)
    size, count = int(rng.integers(2, 7)), int(rng.integers(3, 9))
    factor = rng.normal(size=(size, size))
    hessian, center = factor @ factor.T + np.eye(size), 2.0 * rng.normal(size=size)
    rows, feasible = rng.normal(size=(count, size)), rng.normal(size=size)
    room = np.append(rng.uniform(0, 1, count - equalities), np.zeros(equalities))
    bounds = rows @ feasible + room

    def value(x: Array) -> float:
        return float(0.5 * (x - center) @ hessian @ (x - center)) + 1.0

    def gradient(x: Array) -> Array:
        return hessian @ (x - center)

    function = Constrained(value, gradient, lambda x: rows @ x - bounds, lambda x: rows, equalities)
    first = count - equalities
    below = {"type": "ineq", "fun": lambda x: (bounds - rows @ x)[:first]}
    asked = [{**below, "jac": lambda x: -rows[:first]}]
    if equalities:
        same = {"type": "eq", "fun": lambda x: (rows @ x - bounds)[first:]}
        asked.append({**same, "jac": lambda x: rows[first:]})
    options = {"ftol": 1e-14, "maxiter": 500}
    found = minimize(
        value, feasible, jac=gradient, constraints=asked, method="SLSQP", options=options
    )
    # 8: no step changes the value any more.
    assert found.status in (0, 8)
    return function, found.x


def kkt(function: Constrained, found: sm.Minimum) -> tuple[float, Array, Residuals]:
    """Return |∇F + Σ λ ∇h| relative to |∇F|, λ and the residuals."""
    rows, gradient = function.condition_rows(found.x), function.gradient(found.x)
    residual = np.abs(gradient + pulled_back(rows, found.multipliers)).max()
    return residual / np.abs(gradient).max(), found.multipliers, function.conditions(found.x)


@pytest.mark.parametrize("equalities", [0, 1])
@pytest.mark.parametrize("seed", range(25))
def test_quadratic_programmes_agree_with_slsqp(seed: int, equalities: int) -> None:
    function, answer = quadratic_programme(seed, equalities)
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, np.zeros(len(answer)))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, answer, atol=2e-5)
    assert function.evaluations <= 60


@pytest.mark.parametrize("seed", range(25))
def test_multipliers_are_prices(seed: int) -> None:
    """∇F + Σ λ ∇h = 0, λ ≥ 0 for inequalities, and 0 where they are not active."""
    function, _ = quadratic_programme(seed)
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, np.zeros(len(_)))
    residual, prices, at = kkt(function, found)
    assert residual <= STATIONARY
    assert np.all(prices[~at.equality] >= -1e-9)
    idle = ~at.equality & (at.h < -1e-4)
    np.testing.assert_allclose(prices[idle], 0.0, atol=1e-9)
    shifted = function._h
    best, step = int(np.argmax(np.where(at.equality, 0.0, prices))), 1e-4
    if prices[best] > 0.1:
        function._h = lambda x: shifted(x) - step * (np.arange(len(at.h)) == best)
        eased = SequentialQuadratic(tolerance=1e-12).minimize(function, found.x)
        assert found.cost - eased.cost == pytest.approx(prices[best] * step, rel=0.05)


@pytest.mark.parametrize("seed", range(40))
def test_the_step_is_the_best_of_its_model(seed: int) -> None:
    """Against SLSQP, within the trust region."""
    rng = np.random.default_rng(seed)
    size, count = 4, 6
    factor = rng.normal(size=(size, size))
    hessian, gradient = factor @ factor.T + 0.1 * np.eye(size), rng.normal(size=size)
    rows, upper = rng.normal(size=(count, size)), rng.uniform(-0.1, 1.0, count)
    region = 1.5
    found = minimize_quadratic(
        hessian, gradient, rows, np.full(count, -np.inf), upper, np.full(size, region)
    )

    def model(p: Array) -> float:
        return float(gradient @ p + 0.5 * p @ hessian @ p)

    answer = minimize(
        model,
        np.zeros(size),
        jac=lambda p: gradient + hessian @ p,
        bounds=[(-region, region)] * size,
        constraints=[{"type": "ineq", "fun": lambda p: upper - rows @ p, "jac": lambda p: -rows}],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    assert answer.status in (0, 8)
    assert found is not None
    p, prices = found
    assert model(p) == pytest.approx(answer.fun, abs=1e-8)
    assert np.all(prices >= -1e-10)
    assert np.all(rows @ p <= upper + 1e-9)
    inside = np.abs(p) < region - 1e-9
    np.testing.assert_allclose((hessian @ p + gradient + rows.T @ prices)[inside], 0.0, atol=1e-8)


def test_contradictory_rows_have_no_answer() -> None:
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    upper = np.array([-1.0, -1.0])
    lower, reach = np.full(2, -np.inf), np.full(2, np.inf)
    assert minimize_quadratic(np.eye(2), np.ones(2), rows, lower, upper, reach) is None


@pytest.mark.parametrize(("share", "expected"), [(1.0, 0.0), (3.0, 0.5)])
def test_contradictions_are_relaxed_in_proportion_to_tolerances(
    share: float, expected: float
) -> None:
    """x ≤ -1 and x ≥ 1: the least violation is in the middle, or nearer to the stricter one."""
    at = Residuals(np.array([1.0, 1.0]), np.array([share, 1.0]) * 1e-3, np.zeros(2, bool))
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    step = best_step(np.zeros(2), np.eye(2), at, DenseRows(rows), 10.0)
    assert step.relaxed
    least = 2.0 / (1e-3 * (1.0 + share))
    # A tenth of what the relaxation takes out is left to the cost.
    assert least * (1.0 - 1e-3) <= step.worst <= least + 0.11 * abs(1000.0 - least) + 1e-6
    if share != 1.0:
        assert step.p[0] == pytest.approx(expected, abs=0.1)


def test_contradictory_conditions_end_with_the_least_violation() -> None:
    function = Constrained(
        lambda x: float(x @ x) + 1.0,
        lambda x: 2.0 * x,
        lambda x: np.array([x[0] + 1.0, 1.0 - x[0]]),
        lambda x: np.array([[1.0, 0.0], [-1.0, 0.0]]),
    )
    found = SequentialQuadratic().minimize(function, np.array([3.0, 1.0]))
    assert found.status is Status.INFEASIBLE
    assert "contradict" in found.status.message
    assert abs(found.x[0]) < 0.2
    assert function.evaluations <= 200


def circle(x: Array) -> Array:
    return np.array([x @ x - 1.0])


def test_a_curved_condition_does_not_shorten_steps() -> None:
    """Maratos' example: without the correction, steps along the circle are refused."""
    function = Constrained(
        lambda x: float(2.0 * (x @ x - 1.0) - x[0]) + 3.0,
        lambda x: 4.0 * x - np.array([1.0, 0.0]),
        circle,
        lambda x: 2.0 * x[None],
        equalities=1,
    )
    start = np.array([np.cos(1.2), np.sin(1.2)])
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, start)
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-4)
    assert found.multipliers[0] == pytest.approx(-1.5, abs=1e-3)
    assert function.evaluations <= 20


def test_a_residual_of_minus_one_keeps_an_inequality_and_no_equality() -> None:
    h, tolerance = np.array([-1.0]), np.array([0.5])
    assert Residuals(h, tolerance, np.array([False])).worst == 0.0
    assert Residuals(h, tolerance, np.array([True])).worst == 2.0
    assert not Residuals(np.array([np.nan]), tolerance, np.array([False])).worst <= 1.0


def detour() -> Constrained:
    """Three points on a line past a disc, one coordinate each: the middle one is inside it.

    The largest violation has a stationary point where the middle is, the sum of squares of all has
    another one.
    """
    stations = np.array([-0.5, 0.0, 0.5])

    def h(x: Array) -> Array:
        return 1.0 - (x - 0.2 * stations) ** 2 - stations**2

    return Constrained(
        lambda x: float(np.sum(np.diff(np.concatenate([[0.0], x, [0.0]])) ** 2)) + 0.1,
        lambda x: 2.0 * np.convolve(np.concatenate([[0.0], x, [0.0]]), [-1.0, 2.0, -1.0], "valid"),
        h,
        lambda x: np.diag(-2.0 * (x - 0.2 * stations)),
        tolerance=1e-3,
    )


def test_restoration_leaves_where_the_largest_violation_is_stationary() -> None:
    start = np.array([0.02, 0.0, 0.05])
    found = SequentialQuadratic().minimize(detour(), start)
    assert found.status is Status.CONVERGED
    assert detour().conditions(found.x).worst <= 1.0
    x, status = restored(detour(), np.array([0.02, 0.01, 0.05]), 100.0, np.inf, lambda _: None)
    assert status is None
    assert detour().conditions(x).worst < 0.2 * detour().conditions(start).worst


def outside(size: int) -> Constrained:
    """The points from 1 on away from the line x₀ = 0, on which the condition has no slope."""
    return Constrained(
        lambda x: float(1.0 + 0.5 * x @ x),
        lambda x: np.array(x),
        lambda x: np.array([1.0 - x[0] ** 2]),
        lambda x: -2.0 * x[0] * np.eye(1, size),
    )


@pytest.mark.parametrize("size", [1, 2, 5])
def test_conditions_without_a_slope_are_met_far_away(size: int) -> None:
    found = SequentialQuadratic().minimize(outside(size), np.zeros(size))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(np.abs(found.x), np.eye(1, size)[0], atol=1e-5)


def test_a_scan_finds_the_least_penalty_on_both_sides_of_the_first_axes() -> None:
    x, axes = np.array([0.1, 0.0, 0.0, 0.0]), 0.4 * np.eye(4)
    found = scanned(outside(4), x, axes[:, ::-1])
    # The axis that helps is not among the first ones: every step is as bad as the shortest.
    assert abs(found - x).max() == pytest.approx(0.4)
    # The nearest of those that are outside, on either side.
    assert scanned(outside(4), x, axes)[0] == pytest.approx(0.1 - 3 * 0.4)
    assert scanned(outside(4), -x, axes)[0] == pytest.approx(-0.1 + 3 * 0.4)


def test_a_restoration_takes_steps_down_until_the_cost_holds_it_back() -> None:
    function, notes = curved(h=lambda x: np.append(circle(x), 2.0 * x[0] + 1.0)), []
    function._rows = lambda x: np.array([2.0 * x, [2.0, 0.0]])
    far = np.array([3.0, -2.0])
    x, status = restored(function, far, 1.0, np.inf, notes.append)
    assert status is None
    assert function.conditions(x).worst < 1e-3 * function.conditions(far).worst
    assert [note.cost for note in notes] == [function.value(note.x) for note in notes]

    def violated(x: Array) -> float:
        return float(np.sum(np.maximum(function.conditions(x).h, 0.0) ** 2))

    # At the start the violation weighs ten times the cost.
    weight = 10.0 * function.value(far) / violated(far)
    totals = [function.value(x) + weight * violated(x) for x in [far, *(one.x for one in notes)]]
    assert all(np.diff(totals) < 0.0)
    # As told to: not a step more.
    assert restored(function, far, 1.0, np.inf, lambda _: True)[1] is Status.STOPPED
    assert restored(function, far, 1.0, function.evaluations, lambda _: True) == (
        far,
        Status.MAX_EVALUATIONS,
    )
    # Where all is kept, nothing is done.
    assert restored(function, np.array([-0.6, 0.3]), 1.0, np.inf, lambda _: True)[1] is None


def test_far_from_where_it_was_made_the_matrix_is_made_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A chain of residuals that bends: the matrix of the start is of no use at the end."""

    def residuals(x: Array) -> Array:
        return np.concatenate([10.0 * (x[1:] - x[:-1] ** 2), 1.0 - x])

    def slopes(x: Array) -> Array:
        bends = np.eye(len(x))[1:] - 2.0 * np.diag(x)[:-1]
        return np.vstack([10.0 * bends, -np.eye(len(x))])

    function = Constrained(
        lambda x: 0.5 * float(residuals(x) @ residuals(x)) + 1e-3,
        lambda x: residuals(x) @ slopes(x),
        lambda x: np.array([x[0] - 2.0]),
        lambda x: np.eye(1, len(x)),
    )
    function._metric = lambda x: slopes(x).T @ slopes(x)
    counts = []
    for never in (False, True):
        if never:
            monkeypatch.setattr("selfmotion.optimise.sqp._Run._is_far", lambda _: False)
        before = function.evaluations
        found = SequentialQuadratic().minimize(function, np.array([3.0, -1.0, 2.0, -1.0]))
        np.testing.assert_allclose(found.x, 1.0, atol=1e-3)
        counts.append(function.evaluations - before)
    assert counts[0] < 0.7 * counts[1]


def test_the_penalty_of_a_restoration_has_its_own_gradient_and_metric() -> None:
    """Also for negative residuals of equalities."""
    rng = np.random.default_rng(5)
    matrix, x = rng.normal(size=(5, 3)), rng.normal(size=3)
    shift = matrix @ x - np.array([0.5, -0.4, -0.3, 0.2, -0.6])
    function = Constrained(
        lambda x: 0.0,
        lambda x: np.zeros(3),
        lambda x: matrix @ x - shift,
        lambda x: matrix,
        equalities=3,
        tolerance=0.1,
    )
    function._metric = lambda x: np.zeros((3, 3))
    penalised = _Penalised(function, 2.0)
    gradients = [
        (penalised.gradient(x + e) - penalised.gradient(x - e)) / 2e-6 for e in 1e-6 * np.eye(3)
    ]
    np.testing.assert_allclose(penalised.metric(x), gradients, rtol=1e-6)
    values = [(penalised.value(x + e) - penalised.value(x - e)) / 2e-6 for e in 1e-6 * np.eye(3)]
    np.testing.assert_allclose(penalised.gradient(x), values, rtol=1e-6)


def curved(**change: object) -> Constrained:
    """Rosenbrock's function within the unit circle."""

    def value(x: Array) -> float:
        return float((1.0 - x[0]) ** 2 + 100.0 * (x[1] - x[0] ** 2) ** 2) + 1.0

    def gradient(x: Array) -> Array:
        across = x[1] - x[0] ** 2
        return np.array([-2.0 * (1.0 - x[0]) - 400.0 * x[0] * across, 200.0 * across])

    parts = {"value": value, "gradient": gradient, "h": circle, "rows": lambda x: 2.0 * x[None]}
    return Constrained(**{**parts, **change})  # type: ignore[arg-type]


def test_rosenbrock_within_a_circle() -> None:
    function = curved()
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, np.array([-0.5, 0.5]))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, [0.786415, 0.617698], atol=1e-4)
    assert kkt(function, found)[0] <= STATIONARY
    assert found.cost == function.value(found.x)
    assert function.evaluations <= 60


@pytest.mark.parametrize("limit", [1, 2, 5, 9])
def test_evaluation_limit_is_kept_and_the_best_is_shown(limit: int) -> None:
    function = curved()
    seen: list[sm.Iteration] = []
    found = SequentialQuadratic().minimize(
        function, np.array([-0.5, 0.5]), max_evaluations=limit, callback=seen.append
    )
    assert function.evaluations <= limit
    assert found.status is Status.MAX_EVALUATIONS
    kept = [item.cost for item in seen if function.conditions(item.x).worst <= 1.0]
    assert found.cost == min(kept)


def test_interruption_and_callback_stop() -> None:
    function = curved()
    value = function._value

    def interrupted(x: Array) -> float:
        if function.evaluations > 6:
            raise KeyboardInterrupt
        return value(x)

    function._value = interrupted
    found = SequentialQuadratic().minimize(function, np.array([-0.5, 0.5]))
    assert found.status is Status.INTERRUPTED
    stopped = SequentialQuadratic().minimize(
        curved(), np.array([-0.5, 0.5]), callback=lambda item: item.evaluations > 3
    )
    assert stopped.status is Status.STOPPED
    short = SequentialQuadratic(max_iterations=2).minimize(curved(), np.array([-0.5, 0.5]))
    assert short.status is Status.MAX_ITERATIONS


def test_what_is_not_finite_ends_with_a_sentence() -> None:
    start, method = np.array([-0.5, 0.5]), SequentialQuadratic()
    for change in (
        {"value": lambda x: np.nan},
        {"h": lambda x: np.array([np.nan])},
        {"gradient": lambda x: np.full(2, np.nan)},
        {"rows": lambda x: np.full((1, 2), np.inf)},
    ):
        with pytest.raises(sm.ProblemError, match=r"not finite|is not"):
            method.minimize(curved(**change), start)
    # Where only some of the points have no value, they are stepped back from.
    found = method.minimize(curved(h=lambda x: np.where(x[:1] > 0.9, np.nan, circle(x))), start)
    assert found.status is Status.CONVERGED


def test_a_wrong_gradient_is_noticed() -> None:
    right = curved()
    wrong = curved(gradient=lambda x: -right.gradient(x))
    found = SequentialQuadratic().minimize(wrong, np.array([-0.5, 0.5]))
    assert found.status is Status.GRADIENT
    assert wrong.evaluations <= 150
    unbounded = sm.QuasiNewton(initial_metric="identity").minimize(wrong, np.array([-0.5, 0.5]))
    assert unbounded.status is Status.GRADIENT


def test_inequalities_may_use_the_share_of_their_tolerance_that_is_aimed_at() -> None:
    function = curved(tolerance=1e-3)
    found = SequentialQuadratic(tolerance=1e-12).minimize(function, np.array([-0.5, 0.5]))
    assert function.conditions(found.x).worst == pytest.approx(AIM, abs=0.05)


def test_bad_settings_are_refused() -> None:
    with pytest.raises(sm.ProblemError, match="tolerance is nan"):
        SequentialQuadratic(tolerance=float("nan"))
