"""The line search: Fletcher's constants, Wolfe's conditions, and where nothing decreases."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

import selfmotion as sm
from selfmotion.basics import Array
from selfmotion.planning.optimise.quasi_newton import _minimizer, _Point
from support.functions import Counted


def test_the_line_search_has_fletchers_constants() -> None:
    assert sm.optimise.LineSearch() == sm.optimise.LineSearch(
        rho=0.01, sigma=0.9, tau1=9.0, tau2=0.1, tau3=0.5
    )


@pytest.mark.parametrize("tau1", [2.0, 9.0])
def test_bracketing_goes_tau1_times_as_far_while_the_slope_stays(tau1: float) -> None:
    tried: list[float] = []

    def value(a: float) -> float:
        tried.append(a)
        return -a

    found = sm.optimise.LineSearch(tau1=tau1).search(
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

    sm.optimise.LineSearch(sigma=0.011).search(
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

    sm.optimise.LineSearch(sigma=0.01, tau1=2.0).search(
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

        sm.optimise.LineSearch(sigma=0.1, tau2=tau2, tau3=tau3).search(
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


# From H0 = I, as the paper has it: these functions know no metric of their own.
plain = partial(sm.QuasiNewton, initial_metric="identity")


@pytest.mark.parametrize("sigma", [0.1, 0.9])
@pytest.mark.parametrize("first", [1e-3, 0.1, 1.0, 30.0])
def test_line_search_meets_the_wolfe_conditions(sigma: float, first: float) -> None:
    def value(a: float) -> float:
        return float(-a / (a**2 + 2) + 0.03 * np.sin(3 * a))

    def slope(a: float) -> float:
        return float((a**2 - 2) / (a**2 + 2) ** 2 + 0.09 * np.cos(3 * a))

    search = sm.optimise.LineSearch(sigma=sigma)
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
    found = sm.optimise.LineSearch().search(
        lambda a: 1.0 + a, lambda a: 1.0, 1.0, -1.0, first=1.0, longest=1e6, more=lambda: True
    )
    assert found is None


def test_infinite_trial_points_are_stepped_back_from() -> None:
    def value(x: Array) -> float:
        return float(x[0] - np.log(x[0])) if x[0] > 0 else np.inf

    function = Counted(value, lambda x: np.array([1 - 1 / x[0]]))
    found = plain().minimize(function, np.array([3.0]), 50.0 * np.eye(1))
    assert found.x[0] == pytest.approx(1.0, abs=1e-3)


def random_phi(seed: int) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Return φ, bounded below and falling at 0, and φ'."""
    rng = np.random.default_rng(seed)
    size, rate, phase = rng.normal(size=4), rng.uniform(0.2, 3.0, 4), rng.uniform(0.0, 6.0, 4)
    bowl, tilt = rng.uniform(0.01, 0.5), float(np.sum(size * rate * np.cos(phase)))
    tilt += 10.0 ** rng.uniform(-2.0, 1.0)

    def value(a: float) -> float:
        return float(np.sum(size * np.sin(rate * a + phase)) + bowl * a**2 - tilt * a)

    def slope(a: float) -> float:
        return float(np.sum(size * rate * np.cos(rate * a + phase)) + 2.0 * bowl * a - tilt)

    return value, slope


@pytest.mark.parametrize("sigma", [0.02, 0.1, 0.9])
@pytest.mark.parametrize("seed", range(100))
def test_strong_wolfe_conditions_on_random_functions(seed: int, sigma: float) -> None:
    """Both conditions, and no acceptable point that was seen is better."""
    value, slope = random_phi(seed)
    seen: list[tuple[float, float]] = []

    def noted(a: float) -> float:
        seen.append((a, value(a)))
        return seen[-1][1]

    search = sm.optimise.LineSearch(sigma=sigma)
    first = 10.0 ** np.random.default_rng(seed).uniform(-2.0, 2.0)
    found = search.search(
        noted, slope, value(0), slope(0), first=first, longest=1e6, more=lambda: True
    )
    assert found is not None
    alpha, reached = found
    assert reached == value(alpha)
    assert reached <= value(0) + search.rho * alpha * slope(0)
    assert abs(slope(alpha)) <= -sigma * slope(0)
    low_enough = [v for a, v in seen if v <= value(0) + search.rho * a * slope(0)]
    assert reached == min(low_enough)
    assert len(seen) <= 40


@pytest.mark.parametrize("seed", range(50))
def test_interpolation_is_exact_on_cubics(seed: int) -> None:
    """The step is where a cubic is least between two steps, seen from either end."""
    rng = np.random.default_rng(seed)
    cubic, (near, far) = np.polynomial.Polynomial(rng.normal(size=4)), np.sort(rng.normal(size=2))
    rate = cubic.deriv()
    points = [_Point(a, float(cubic(a)), float(rate(a))) for a in (near, far)]
    candidates = [near, far, *(r.real for r in rate.roots() if near < r.real < far and not r.imag)]
    best = min(candidates, key=cubic)
    assert _minimizer(points[0], points[1], near, far) == pytest.approx(best, abs=1e-6)
    assert _minimizer(points[1], points[0], far, near) == pytest.approx(best, abs=1e-6)
