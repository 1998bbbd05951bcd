"""A linear programme whose rows touch three neighbouring unknowns: an interior point, banded.

    maximise g·c   subject to   lower ≤ R c ≤ upper

Mehrotra's predictor and corrector (S. Mehrotra, SIAM J. Optimization 2(4), 1992), kept near enough
to the central path that no product of slack and price falls far behind their mean (S. J. Wright,
Primal-Dual Interior-Point Methods, 1997, ch. 5). The normal matrix is pentadiagonal, so that a step
costs O(N).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

from selfmotion.basics import Array, Flags

# Unknowns that a row touches, and pairs a ≤ b of them.
WIDTH = 3
_PAIRS = tuple((a, b) for a in range(WIDTH) for b in range(a, WIDTH))
# Rows are met to this share of their limits, or to this where they are smaller than 1.
_MET = 1e-7
# Prices pay for the gradient to this share.
_PAID = 1e-6
_STEPS = 60
# Share of the way to the boundary that a step goes.
_TO_BOUNDARY = 0.99
# A product of slack and price is at least this share of their mean; steps are shortened for that.
_NEAR, _SHORTER, _TRIES = 1e-3, 0.7, 12
# Shorter steps lead nowhere.
_STUCK = 1e-8
# Stands on the diagonal for an unknown that stays, and rounding on that of the others.
_STAYS, _ROUNDING = 1e200, 1e-14


@dataclass(frozen=True, eq=False)
class BandedRows:
    """Rows R of a banded programme: row m of place k touches the unknowns k, k + 1 and k + 2.

    Attributes
    ----------
    matrix : (3, K, M)
    lower, upper : (K, M)
        lower < upper; ±inf where there is none.
    """

    matrix: Array
    lower: Array
    upper: Array

    def times(self, c: Array) -> Array:
        """Return R c of unknowns c (K + 2,), (K, M)."""
        count = self.matrix.shape[1]
        found: Array = self.matrix[0] * c[:count, None]
        for k in range(1, WIDTH):
            found += self.matrix[k] * c[k : count + k, None]
        return found

    def transposed(self, y: Array) -> Array:
        """Return Rᵀ y of y (K, M), (K + 2,)."""
        count = self.matrix.shape[1]
        found = np.zeros(count + WIDTH - 1)
        for k in range(WIDTH):
            found[k : count + k] += np.einsum("km,km->k", self.matrix[k], y)
        return found

    def normal(self, weights: Array) -> Array:
        """Return Rᵀ diag(weights) R of weights (K, M), its lower band (3, K + 2)."""
        count = self.matrix.shape[1]
        band, weighted = np.zeros((WIDTH, count + WIDTH - 1)), self.matrix * weights
        for a, b in _PAIRS:
            band[b - a, a : count + a] += np.einsum("km,km->k", weighted[a], self.matrix[b])
        return band


def banded_optimum(
    gradient: Array, rows: BandedRows, start: Array, fixed: Flags, gap: float = 1e-6
) -> tuple[Array, bool]:
    """Return the c that maximises g·c within rows, and whether it was reached.

    Parameters
    ----------
    gradient : (N,)
        g.
    rows : Rows
    start : (N,)
        Near c, best within the rows.
    fixed : (N,) bool
        Unknowns that stay as they are.
    gap : float
        What may be missing, as a share of g·c.
    """
    sides = [_Side.of(sign, rows, start, limit) for sign, limit in _signed(rows)]
    count = max(sum(side.count for side in sides), 1)
    value = float(np.abs(gradient) @ np.maximum(np.abs(start), 1.0))
    sides = [side.priced(value / count) for side in sides]
    c = start
    for _ in range(_STEPS):
        reached = rows.times(c)
        missed = [side.missed(reached) for side in sides]
        mu = sum(side.products() for side in sides) / count
        met = max(
            float(np.abs(m / s.size).max(initial=0.0)) for m, s in zip(missed, sides, strict=True)
        )
        small = max(abs(float(gradient @ c)), _MET * value)
        if mu * count <= gap * small and met <= _MET and _balanced(gradient, rows, sides, fixed):
            return c, True
        step = _step(gradient, rows, sides, missed, fixed, mu, count)
        if step is None:
            break
        dc, sides, length = step
        c = c + length * dc
        if length < _STUCK:
            break
    return c, False


def _balanced(gradient: Array, rows: BandedRows, sides: list["_Side"], fixed: Flags) -> bool:
    """Return whether prices pay for the gradient, as far as gaps are looked at."""
    left = gradient - rows.transposed(sides[0].price - sides[1].price)
    return bool(np.abs(left[~fixed]).max(initial=0.0) <= _PAID * np.abs(gradient).max(initial=0.0))


def _signed(rows: BandedRows) -> tuple[tuple[float, Array], tuple[float, Array]]:
    return (1.0, rows.upper), (-1.0, -rows.lower)


@dataclass(frozen=True, eq=False)
class _Side:
    """The rows ±R c + slack = limit, with their prices; a slack without limit never binds."""

    sign: float
    limit: Array
    there: Flags
    size: Array
    slack: Array
    price: Array

    @classmethod
    def of(cls, sign: float, rows: BandedRows, start: Array, limit: Array) -> "_Side":
        there = np.isfinite(limit)
        limit = np.where(there, limit, 0.0)
        size = np.maximum(np.abs(limit), 1.0)
        slack = np.maximum(limit - sign * rows.times(start), 1e-2 * size)
        return cls(sign, limit, there, size, np.where(there, slack, 1.0), np.zeros_like(limit))

    @property
    def count(self) -> int:
        return int(self.there.sum())

    def priced(self, mu: float) -> "_Side":
        return self._with(self.slack, np.where(self.there, mu / self.slack, 0.0))

    def _with(self, slack: Array, price: Array) -> "_Side":
        return _Side(self.sign, self.limit, self.there, self.size, slack, price)

    @cached_property
    def ratio(self) -> Array:
        """Price by slack."""
        return np.asarray(self.price / self.slack)

    def missed(self, reached: Array) -> Array:
        found = self.slack - self.limit
        found += reached if self.sign > 0.0 else -reached
        found[~self.there] = 0.0
        return np.asarray(found)

    def products(self) -> float:
        return float(np.vdot(self.slack, self.price))

    def towards(self, wanted: Array | float, missed: Array) -> Array:
        """Return what the prices become where c stays."""
        becomes = self.ratio * missed
        becomes += wanted / self.slack
        becomes[~self.there] = 0.0
        return np.asarray(becomes)

    def moved(self, change: Array, missed: Array, becomes: Array) -> tuple[Array, Array]:
        """Return the changes of slacks and prices with that of R c."""
        signed = change if self.sign > 0.0 else -change
        slack = -missed - signed
        slack[~self.there] = 0.0
        price = self.ratio * signed
        price += becomes
        price -= self.price
        return slack, price

    def after(self, moves: tuple[Array, Array], primal: float, dual: float) -> "_Side":
        return self._with(self.slack + primal * moves[0], self.price + dual * moves[1])

    def least_product(self) -> float:
        products = self.slack * self.price
        products[~self.there] = np.inf
        return float(products.min(initial=np.inf))


def _step(
    gradient: Array,
    rows: BandedRows,
    sides: list[_Side],
    missed: list[Array],
    fixed: Flags,
    mu: float,
    count: int,
) -> tuple[Array, list[_Side], float] | None:
    """Return a change of c, the sides after a step, and how far it goes; None where none is."""
    band = rows.normal(sides[0].ratio + sides[1].ratio)
    band[0] *= 1.0 + _ROUNDING
    band[0, fixed] = _STAYS
    try:
        factor = cholesky_banded(band, lower=True, check_finite=False)
    except LinAlgError:
        return None

    def direction(wanted: list[Array | float]) -> tuple[Array, list[tuple[Array, Array]]]:
        each = zip(sides, wanted, missed, strict=True)
        becomes = [side.towards(aim, miss) for side, aim, miss in each]
        right = gradient - rows.transposed(becomes[0] - becomes[1])
        right[fixed] = 0.0
        dc = cho_solve_banded((factor, True), right, check_finite=False)
        dc[fixed] = 0.0
        change, three = rows.times(dc), zip(sides, missed, becomes, strict=True)
        return dc, [side.moved(change, miss, price) for side, miss, price in three]

    _, moves = direction([0.0, 0.0])
    primal, dual = _longest(sides, moves, 1.0)
    after = sum(s.after(m, primal, dual).products() for s, m in zip(sides, moves, strict=True))
    centre = mu * min((after / count / mu) ** 3, 1.0)
    dc, moves = direction([centre - move[0] * move[1] for move in moves])
    primal, dual = _longest(sides, moves, _TO_BOUNDARY)
    for _ in range(_TRIES):
        found = [s.after(m, primal, dual) for s, m in zip(sides, moves, strict=True)]
        mean = sum(side.products() for side in found) / count
        if min(side.least_product() for side in found) >= _NEAR * mean:
            break
        primal, dual = _SHORTER * primal, _SHORTER * dual
    return dc, found, primal


def _longest(
    sides: list[_Side], moves: list[tuple[Array, Array]], share: float
) -> tuple[float, float]:
    """Return how far slacks and prices may go, each at most the whole way."""
    lengths = [1.0, 1.0]
    for side, move in zip(sides, moves, strict=True):
        for k, (x, change) in enumerate(zip((side.slack, side.price), move, strict=True)):
            # Prices of what has no limit are 0 and stay so.
            falling = np.divide(change, x, out=np.zeros_like(x), where=x > 0.0)
            most = -float(falling.min(initial=0.0))
            lengths[k] = min(lengths[k], share / most if most > 0.0 else np.inf)
    return lengths[0], lengths[1]
