"""Any integrand that a user can write down."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError
from selfmotion.costs.base import Partials
from selfmotion.costs.samples import Samples

Integrand = Callable[[Array, Array, Array], npt.ArrayLike]
IntegrandGradient = Callable[[Array, Array, Array], tuple[npt.ArrayLike, npt.ArrayLike]]


@dataclass(frozen=True)
class FunctionCost:
    """Any integrand G(q̇, q, t), the paper's general form.

    Parameters
    ----------
    g : callable
        ``g(qd, q, t)`` with qd, q (S, n) and t (S,) → (S,), vectorised over samples.
    g_gradient : callable, optional
        ``g_gradient(qd, q, t)`` → (∂G/∂q̇, ∂G/∂q), each (S, n). Without it both are taken by
        central differences, 4n calls of `g`.
    """

    g: Integrand
    g_gradient: IntegrandGradient | None = None
    name: str = "function"

    def value(self, samples: Samples) -> Array:
        """See `Cost.value`."""
        return self._call(samples.qd, samples.q, samples.t)

    def gradient(self, samples: Samples) -> Partials:
        """See `Cost.gradient`."""
        qd, q, t = samples.qd, samples.q, samples.t
        if self.g_gradient is not None:
            by_qd, by_q = (np.asarray(part, dtype=float) for part in self.g_gradient(qd, q, t))
            for part in (by_qd, by_q):
                if part.shape != q.shape:
                    raise ProblemError(
                        f"cost '{self.name}': its gradient has shape {part.shape}, "
                        f"expected {q.shape} for both ∂G/∂q̇ and ∂G/∂q"
                    )
            return Partials(q=by_q, qd=by_qd)
        return Partials(
            q=self._difference(q, lambda shifted: self._call(qd, shifted, t)),
            qd=self._difference(qd, lambda shifted: self._call(shifted, q, t)),
        )

    def curvature(self, dof: int) -> dict[int, Array]:
        """See `Cost.curvature`."""
        return {}

    def check(self, dof: int) -> None:
        """See `Cost.check`."""

    def _call(self, qd: Array, q: Array, t: Array) -> Array:
        value = np.asarray(self.g(qd, q, t), dtype=np.float64)
        if value.shape != t.shape:
            raise ProblemError(
                f"cost '{self.name}' returned shape {value.shape} for {len(t)} samples, "
                f"expected {t.shape}"
            )
        return value

    @staticmethod
    def _difference(x: Array, function: Callable[[Array], Array]) -> Array:
        gradient = np.empty_like(x)
        for i in range(x.shape[1]):
            # The cube root of the rounding error balances it against the truncation error.
            step = np.cbrt(np.finfo(float).eps) * np.maximum(1.0, np.abs(x[:, i]))
            above, below = x.copy(), x.copy()
            above[:, i] += step
            below[:, i] -= step
            gradient[:, i] = (function(above) - function(below)) / (above[:, i] - below[:, i])
        return gradient
