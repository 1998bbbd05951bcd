"""Restoration: towards what is allowed, and when it ends."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.optimise import Residuals, SequentialQuadratic, Status
from selfmotion.optimise.restoration import _fall, _Penalised, restored, scanned
from selfmotion.optimise.rows import DenseRows
from selfmotion.optimise.step import best_step
from support.functions import Constrained, bowl, circle, curved


def residuals(h: list[float], tolerance: float = 1.0, equalities: int = 0) -> Residuals:
    count = len(h)
    return Residuals(np.array(h), np.full(count, tolerance), np.arange(count) >= count - equalities)


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


def test_a_restoration_goes_nowhere_without_a_gradient() -> None:
    function, start = bowl(), np.array([-1.0, 2.0])
    whole = function.gradient
    function.gradient = lambda x: np.full_like(whole(x), np.nan)
    with np.errstate(invalid="ignore"):
        x, status = restored(function, start, 1.0, np.inf, lambda step: None)
    assert status is None
    np.testing.assert_array_equal(x, start)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_restoration_ends_where_the_metric_is_no_number(value: float) -> None:
    """Without a warning: that of a motion in an instant is infinite."""
    function, start = bowl(), np.array([-1.0, 2.0])
    whole = function.metric
    function.metric = lambda x: np.full_like(whole(x), value)
    x, status = restored(function, start, 1.0, np.inf, lambda step: None)
    assert status is Status.INFEASIBLE
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

    monkeypatch.setattr("selfmotion.optimise.sqp_state.restored", restoring)
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
