"""Functions with known minima."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array
from selfmotion.optimise import Residuals
from selfmotion.optimise.rows import DenseRows


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


# Conditions of these functions may be violated by so much.
TOLERANCE = 1e-6


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


def circle(x: Array) -> Array:
    return np.array([x @ x - 1.0])


def curved(**change: object) -> Constrained:
    """Rosenbrock's function within the unit circle."""

    def value(x: Array) -> float:
        return float((1.0 - x[0]) ** 2 + 100.0 * (x[1] - x[0] ** 2) ** 2) + 1.0

    def gradient(x: Array) -> Array:
        across = x[1] - x[0] ** 2
        return np.array([-2.0 * (1.0 - x[0]) - 400.0 * x[0] * across, 200.0 * across])

    parts = {"value": value, "gradient": gradient, "h": circle, "rows": lambda x: 2.0 * x[None]}
    return Constrained(**{**parts, **change})  # type: ignore[arg-type]


def bowl(equalities: int = 0) -> Constrained:
    """Return ½ |x|² + 3 where x₀ ≥ 1, or = 1."""
    return Constrained(
        lambda x: 0.5 * float(x @ x) + 3.0,
        lambda x: x,
        lambda x: np.array([1.0 - x[0]]),
        lambda x: np.array([[-1.0, 0.0]]),
        equalities,
    )
