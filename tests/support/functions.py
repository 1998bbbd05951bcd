"""Functions with known minima."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array


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
