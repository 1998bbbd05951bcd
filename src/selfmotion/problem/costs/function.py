"""A cost by a function of the user: any integrand of (q̇, q, t)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, plain_numbers, shown
from selfmotion.problem.costs.base import Cost, Partials, check_name
from selfmotion.problem.costs.lost import LostCost
from selfmotion.problem.costs.samples import Samples

Integrand = Callable[[Array, Array, Array], npt.ArrayLike]
IntegrandGradient = Callable[[Array, Array, Array], tuple[npt.ArrayLike, npt.ArrayLike]]


@dataclass(frozen=True)
class FunctionCost(Cost):
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

    def __post_init__(self) -> None:
        check_name(self.name)
        for field in ("g", "g_gradient"):
            function = getattr(self, field)
            is_missing = function is None and field == "g_gradient"
            if not callable(function) and not is_missing:
                raise ProblemError(
                    f"cost '{self.name}': {field} is {shown(function)}, expected a function of "
                    f"(qd, q, t)"
                )

    @override
    def value(self, samples: Samples) -> Array:
        return self._call(samples.qd, samples.q, samples.t)

    @override
    def gradient(self, samples: Samples) -> Partials:
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
            q=self._central_differences(q, lambda shifted: self._call(qd, shifted, t)),
            qd=self._central_differences(qd, lambda shifted: self._call(shifted, q, t)),
        )

    @override
    def to_dict(self) -> dict[str, Any]:
        """Return the name of the cost, and that it was a function, which no file carries."""
        return {"kind": LostCost.kind, "name": self.name, "was": self.kind}

    def _call(self, qd: Array, q: Array, t: Array) -> Array:
        value = plain_numbers(self.g(qd, q, t))
        if value is None:
            raise ProblemError(f"cost '{self.name}' returned no numbers, expected {t.shape}")
        if value.shape != t.shape:
            raise ProblemError(
                f"cost '{self.name}' returned shape {value.shape} for {len(t)} samples, "
                f"expected {t.shape}"
            )
        return value

    @staticmethod
    def _central_differences(x: Array, function: Callable[[Array], Array]) -> Array:
        """Return ∂f/∂x (S, n) of a function of x (S, n), sample by sample."""
        gradient = np.empty_like(x)
        for i in range(x.shape[1]):
            # The cube root of the rounding error balances it against the truncation error.
            step = np.cbrt(np.finfo(float).eps) * np.maximum(1.0, np.abs(x[:, i]))
            above, below = x.copy(), x.copy()
            above[:, i] += step
            below[:, i] -= step
            gradient[:, i] = (function(above) - function(below)) / (above[:, i] - below[:, i])
        return gradient
