"""How fast a line or circle is run through."""

from collections.abc import Callable
from enum import Enum

import numpy as np

from selfmotion.basics import (
    Array,
    PathError,
    series,
    shown,
)

# Minimum jerk's coefficients of 1, τ, τ² …
_JERK = (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)


class TimeLaw(Enum):
    """How far along the path (0 to 1) the tool is at normalised time τ (0 to 1)."""

    CONSTANT = "constant"
    MINIMUM_JERK = "minimum_jerk"

    @classmethod
    def of(cls, law: "TimeLaw | str") -> "TimeLaw":
        """Return the time law of that name; PathError where there is none."""
        try:
            return cls(law)
        except ValueError:
            names = ", ".join(member.value for member in cls)
            raise PathError(f"unknown time law {shown(law)}, expected one of: {names}") from None

    def __call__(self, tau: Array) -> tuple[Array, Array]:
        """Return s(τ) and ds/dτ.

        Constant speed: s = τ. Minimum jerk: s = 10τ³ - 15τ⁴ + 6τ⁵ (Flash and Hogan 1985).
        """
        return _TIME_LAWS[self](tau)

    def series(self, middle: Array, half: Array) -> Array:
        """Return the series of s on intervals of τ, (K + 1, I)."""
        coefficients = np.array([0.0, 1.0] if self is TimeLaw.CONSTANT else _JERK)[:, None]
        return series.of_polynomial(series.recentred(coefficients, middle, half))


def _constant(tau: Array) -> tuple[Array, Array]:
    return tau, np.ones_like(tau)


def _minimum_jerk(tau: Array) -> tuple[Array, Array]:
    return tau**3 * (10.0 + tau * (6.0 * tau - 15.0)), 30.0 * (tau * (1.0 - tau)) ** 2


_TIME_LAWS: dict[TimeLaw, Callable[[Array], tuple[Array, Array]]] = {
    TimeLaw.CONSTANT: _constant,
    TimeLaw.MINIMUM_JERK: _minimum_jerk,
}
