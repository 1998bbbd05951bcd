"""Sequential quadratic programming on functions with known answers, and at the edges."""

import numpy as np
import pytest
from scipy.optimize import minimize

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.optimise import Residuals, SequentialQuadratic, Status
from selfmotion.optimise.rows import pulled_back
from selfmotion.optimise.step import AIM
from support.functions import Constrained, bowl, circle, curved


@pytest.mark.parametrize("inverse", [np.diag([1.0, -1e-18]), np.diag([1.0, 0.0])])
def test_estimates_that_rounding_made_indefinite_are_used(inverse: Array) -> None:
    found = SequentialQuadratic().minimize(bowl(), np.array([3.0, 0.0]), inverse)
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.x, [1.0, 0.0], atol=1e-5)
    assert np.all(np.isfinite(found.inverse_hessian))


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


# ∇F + Σ λ ∇h relative to ∇F: the square root of the decrease that is still predicted.
STATIONARY = 1e-3


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
            monkeypatch.setattr(
                "selfmotion.optimise.sqp_state.Minimisation._is_far", lambda _: False
            )
        before = function.evaluations
        found = SequentialQuadratic().minimize(function, np.array([3.0, -1.0, 2.0, -1.0]))
        np.testing.assert_allclose(found.x, 1.0, atol=1e-3)
        counts.append(function.evaluations - before)
    assert counts[0] < 0.7 * counts[1]


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
