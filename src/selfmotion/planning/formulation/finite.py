"""Costs have finite values and derivatives: else their names, and when."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.problem.costs import Cost, Samples

_PARTIALS = ("q", "qd", "qdd", "qddd", "error")


def require_finite(cost: Cost, which: str, table: Array, t: Array) -> None:
    """Raise ProblemError where a cost's value or gradient (S, …) at times t (S,) is not finite."""
    bad = ~np.isfinite(table)
    if bad.any():
        row = int(np.argmax(bad.reshape(len(bad), -1).any(axis=1)))
        raise ProblemError(
            f"cost '{cost.name}': its {which} is {table[row]} at "
            f"t = {t[row]:.6g} s, expected finite numbers; "
            f"selfmotion.testing.check_cost checks a cost"
        )


def require_finite_values(costs: Sequence[Cost], samples: Samples) -> None:
    """Raise ProblemError where a cost has no finite value."""
    for cost in costs:
        require_finite(cost, "value", np.asarray(cost.value(samples)), samples.t)


def require_finite_gradients(costs: Sequence[Cost], samples: Samples) -> None:
    """Raise ProblemError where a derivative of a cost is not finite."""
    for cost in costs:
        partials = cost.gradient(samples)
        for part in (getattr(partials, name) for name in _PARTIALS):
            if part is not None:
                require_finite(cost, "gradient", part, samples.t)
