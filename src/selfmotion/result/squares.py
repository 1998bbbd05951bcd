"""Quadratic splines over a pace's own time, so that accelerations do not jump."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Ints


@dataclass(frozen=True, eq=False)
class Squares:
    """b, the square of how much faster a pace becomes: a quadratic spline over its time.

    Attributes
    ----------
    knots : (K + 1,)
        Of the time of the pace; those at the ends count three times.
    c : (K + 2,)
        Coefficients.
    """

    knots: Array
    c: Array

    @classmethod
    def constant(cls, knots: Array, value: float) -> "Squares":
        """Return the same value everywhere."""
        return cls(knots, np.full(len(knots) + 1, value))

    @property
    def is_positive(self) -> bool:
        """Whether no coefficient is below 0, so that b is nowhere."""
        return bool(self.c.min() >= 0.0)

    def inside(self, share: float, order: int = 0) -> Array:
        """Return b, b' or b'' at a share of each interval, (K,)."""
        three = np.stack([self.c[:-2], self.c[1:-1], self.c[2:]])
        return np.asarray((basis(self.knots, share)[order] * three).sum(axis=0))

    def at_knots(self, order: int = 0) -> Array:
        """Return b or b' at the knots, (K + 1,)."""
        return np.append(self.inside(0.0, order), self.inside(1.0, order)[-1])

    def on(self, knots: Array) -> "Squares":
        """Return about the same over other knots of the same span."""
        three = np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2])
        places = 0.5 * (three[1:-2] + three[2:-1])
        old = np.clip(np.searchsorted(self.knots, places, side="right") - 1, 0, len(self.knots) - 2)
        share = (places - self.knots[old]) / np.diff(self.knots)[old]
        splines = _basis(*_neighbours(self.knots, old), share)[0]
        return Squares(
            knots, np.asarray((splines * self.c[old + np.arange(3)[:, None]]).sum(axis=0))
        )


def basis(t: Array, share: float) -> Array:
    """Return the three quadratic B-splines of each interval of knots t (K + 1,), (3, 3, K).

    Values, slopes and second derivatives (first axis) of the first, second and third spline that is
    not 0 there, at a share of the interval; knots at both ends count three times.
    """
    return _basis(*_neighbours(t, np.arange(len(t) - 1)), share)


def _neighbours(t: Array, k: Ints) -> tuple[Array, Array, Array]:
    """Return how long intervals k are, with the one before and with the one after."""
    h = np.diff(t)
    around = np.concatenate([[0.0], h, [0.0]])
    return h[k], h[k] + around[k], h[k] + around[k + 2]


def _basis(h: Array, before: Array, after: Array, share: Array | float) -> Array:
    x = share * h
    first = np.stack([(h - x) ** 2, -2.0 * (h - x), 0.0 * x + 2.0]) / (before * h)
    third = np.stack([x**2, 2.0 * x, 0.0 * x + 2.0]) / (after * h)
    second = np.array([[1.0], [0.0], [0.0]]) - first - third
    splines: Array = np.stack([first, second, third], axis=1)
    return splines
