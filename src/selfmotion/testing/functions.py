"""Functions with known minima."""

import numpy as np

from selfmotion.basics import Array, read_only


class Bowl:
    """½ (x - 1)ᵀ A (x - 1) + offset, with condition number 100."""

    def __init__(self, offset: float) -> None:
        self._hessian, self._offset = np.diag(np.geomspace(1.0, 100.0, 4)), offset
        self.evaluations = 0

    def value(self, x: Array) -> float:
        """See `Function`."""
        self.evaluations += 1
        return float(0.5 * (x - 1.0) @ self._hessian @ (x - 1.0)) + self._offset

    def gradient(self, x: Array) -> Array:
        """See `Function`."""
        return np.asarray(self._hessian @ (x - 1.0))

    def slope(self, x: Array, direction: Array) -> float:
        """See `Function`."""
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        """See `Function`."""
        return read_only(np.eye(len(x)))


class Valley:
    """Rosenbrock's function, with its least value 1."""

    def __init__(self) -> None:
        self.evaluations = 0

    def value(self, x: Array) -> float:
        """See `Function`."""
        self.evaluations += 1
        return float((1.0 - x[0]) ** 2 + 100.0 * (x[1] - x[0] ** 2) ** 2) + 1.0

    def gradient(self, x: Array) -> Array:
        """See `Function`."""
        across = x[1] - x[0] ** 2
        return np.array([-2.0 * (1.0 - x[0]) - 400.0 * x[0] * across, 200.0 * across])

    def slope(self, x: Array, direction: Array) -> float:
        """See `Function`."""
        return float(self.gradient(x) @ direction)

    def metric(self, x: Array) -> Array:
        """See `Function`."""
        return read_only(np.eye(2))
