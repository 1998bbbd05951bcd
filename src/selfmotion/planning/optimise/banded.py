"""A linear programme whose rows touch three neighbouring unknowns: an interior point, banded.

    maximise g·c   subject to   lower ≤ R c ≤ upper,   least ≤ c ≤ most

Mehrotra's predictor and corrector (S. Mehrotra, SIAM J. Optimization 2(4), 1992), kept near enough
to the central path that no product of slack and price falls far behind their mean (S. J. Wright,
Primal-Dual Interior-Point Methods, 1997, ch. 5). The normal matrix is pentadiagonal, so that a step
costs O(N). Most rows bind nowhere near: a programme is solved with those that might, and again with
those that its optimum breaks, until there are none.
"""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel

# Rows are met to this share of their limits, or to this where they are smaller than 1.
MET = 1e-7
_STEPS = 200
# Products of slack and price are aimed at this share of the gap, no less: the smaller they are, the
# more multipliers of steep rows round.
_AIMED = 0.1
# Where rounding leaves so much of g·c unpaid, by shares, and so many steps each leave more than
# this of what the one before left, multipliers pay as exactly as they can.
_ROUNDED, _STALLED, _SAME = 1e-2, 3, 0.7
# Share of the way to the boundary that a step goes.
_TO_BOUNDARY = 0.99
# A product of slack and price is at least this share of their mean; steps are shortened for that.
_NEAR, _SHORTER, _TRIES = 1e-3, 0.7, 12
# A step that goes less far than this leads along the boundary: the next one goes to products this
# much smaller, away from it.
_POOR, _CENTRED = 0.1, 0.5
# Shorter steps lead nowhere.
_STUCK = 1e-8
# Stands on the diagonal for an unknown that stays, and rounding on that of the others.
_STAYS, _ROUNDING = 1e200, 1e-14
# Unknowns that a row touches.
WIDTH = 3
# Rows with less room than this share of their limit are looked at, and then near an optimum these;
# where some are broken by more, those that are by this share of the worst.
_BESIDE, _NEARER, _AMONG = 0.5, 0.2, 0.5
# So often; then all rows are.
_ROUNDS = 12
# Rows that are left out may be broken by this share of their limits, and so many places beside one
# that is come in with it: with few, what is broken only moves on.
_BROKEN, _WIDE = 1e-5, 20


@kernel
def interior_optimum(
    gradient: Array,
    free: Flags,
    matrix: Array,
    place: Ints,
    limit: Array,
    start: Array,
    gap: float,
) -> tuple[Array, bool]:
    """Return the optimum c (N,), found from near it, and whether it was reached.

    Parameters
    ----------
    gradient : (N,)
    free : (N,) bool
        Unknowns that do not stay as they are.
    matrix : (R, 3)
    place : (R,) int
        The first unknown that a row touches.
    limit : (R,)
    start : (N,)
    gap : float
        What may be missing, as a share of g·c.
    """
    count, size, c = len(limit), len(gradient), start.copy()
    slack, price = np.empty(count), np.empty(count)
    value = _begin(gradient, matrix, place, limit, c, slack, price)
    missed, ds, dz = np.empty(count), np.empty(count), np.empty(count)
    band, paid, dc = np.empty((3, size)), np.empty(size), np.empty(size)
    stalled, before = 0, np.inf
    for _ in range(_STEPS):
        products, met = _measure(c, matrix, place, limit, slack, price, missed, band, paid)
        whole, left = _unpaid(gradient, free, paid, c, value)
        stalled = stalled + 1 if left > _SAME * before else 0
        before = left
        rounded = stalled >= _STALLED and left <= _ROUNDED * whole
        if met <= MET and products <= gap * whole and (left <= gap * whole or rounded):
            return c, True
        if not _factored(band, free):
            break
        mu = products / count
        _direct(0.0, 0.0, gradient, free, matrix, place, slack, price, missed, ds, dz, band, dc)
        primal, dual = _longest(matrix, place, dc, slack, price, missed, ds, dz, 0.0, 0.0, 1.0)
        after, _ = _products(slack, price, ds, dz, primal, dual)
        centre = mu * min((after / count / mu) ** 3, 1.0)
        centre = max(centre, min(_AIMED * gap * whole / count, mu))
        _direct(centre, 1.0, gradient, free, matrix, place, slack, price, missed, ds, dz, band, dc)
        primal, dual = _longest(
            matrix, place, dc, slack, price, missed, ds, dz, centre, 1.0, _TO_BOUNDARY
        )
        if min(primal, dual) < _POOR:
            centre = _CENTRED * mu
            _direct(
                centre, 0.0, gradient, free, matrix, place, slack, price, missed, ds, dz, band, dc
            )
            primal, dual = _longest(
                matrix, place, dc, slack, price, missed, ds, dz, centre, 0.0, _TO_BOUNDARY
            )
        primal, dual = _balanced(slack, price, ds, dz, primal, dual)
        for k in range(size):
            c[k] += primal * dc[k]
        for r in range(count):
            slack[r] += primal * ds[r]
            price[r] += dual * dz[r]
        if primal < _STUCK:
            break
    return c, False


@called
def _begin(
    gradient: Array,
    matrix: Array,
    place: Ints,
    limit: Array,
    c: Array,
    slack: Array,
    price: Array,
) -> float:
    """Fill slacks and multipliers to begin with; return about how large g·c may be."""
    count, value = len(limit), 0.0
    for k in range(len(gradient)):
        value += abs(gradient[k]) * max(abs(c[k]), 1.0)
    for r in range(count):
        room = limit[r] - _product(matrix, place, c, r)
        slack[r] = max(room, 1e-2 * max(abs(limit[r]), 1.0))
        price[r] = value / count / slack[r]
    return value


@called
def _unpaid(
    gradient: Array, free: Flags, paid: Array, c: Array, value: float
) -> tuple[float, float]:
    """Return how large g·c is, and what of it multipliers do not pay for."""
    reached, left = 0.0, 0.0
    for k in range(len(gradient)):
        reached += gradient[k] * c[k]
        if free[k]:
            left += abs((gradient[k] - paid[k]) * c[k])
    return max(abs(reached), MET * value), left


@called
def _balanced(
    slack: Array, price: Array, ds: Array, dz: Array, primal: float, dual: float
) -> tuple[float, float]:
    """Return how far to go so that no product falls far below the others."""
    for _ in range(_TRIES):
        after, least = _products(slack, price, ds, dz, primal, dual)
        if least >= _NEAR * after / len(slack):
            break
        primal, dual = _SHORTER * primal, _SHORTER * dual
    return primal, dual


@called
def _product(matrix: Array, place: Ints, c: Array, r: int) -> float:
    k = place[r]
    found: float = matrix[r, 0] * c[k] + matrix[r, 1] * c[k + 1] + matrix[r, 2] * c[k + 2]
    return found


@called
def _measure(
    c: Array,
    matrix: Array,
    place: Ints,
    limit: Array,
    slack: Array,
    price: Array,
    missed: Array,
    band: Array,
    paid: Array,
) -> tuple[float, float]:
    """Fill what rows miss, the normal matrix (3, N) and what is paid; return Σ s z, the most."""
    band[:], paid[:] = 0.0, 0.0
    products, met = 0.0, 0.0
    for r in range(len(limit)):
        k = place[r]
        missed[r] = slack[r] - limit[r] + _product(matrix, place, c, r)
        met = max(met, abs(missed[r]) / max(abs(limit[r]), 1.0))
        products += slack[r] * price[r]
        ratio = price[r] / slack[r]
        for a in range(3):
            weighted = ratio * matrix[r, a]
            paid[k + a] += price[r] * matrix[r, a]
            for b in range(a, 3):
                band[b - a, k + a] += weighted * matrix[r, b]
    return products, met


@called
def _factored(band: Array, free: Flags) -> bool:
    """Replace a pentadiagonal matrix by its factors L D Lᵀ: D, and L below; whether there are."""
    size = band.shape[1]
    for k in range(size):
        pivot = band[0, k] * (1.0 + _ROUNDING) if free[k] else _STAYS
        if k > 0:
            pivot -= band[1, k - 1] ** 2 * band[0, k - 1]
        if k > 1:
            pivot -= band[2, k - 2] ** 2 * band[0, k - 2]
        if not pivot > 0.0:
            return False
        band[0, k] = pivot
        if k > 0:
            band[1, k] -= band[2, k - 1] * band[1, k - 1] * band[0, k - 1]
        band[1, k] /= pivot
        band[2, k] /= pivot
    return True


@called
def _solve(band: Array, right: Array) -> None:
    """Replace a right side by the solution, by factors of the matrix."""
    size = len(right)
    for k in range(1, size):
        right[k] -= band[1, k - 1] * right[k - 1]
        if k > 1:
            right[k] -= band[2, k - 2] * right[k - 2]
    for k in range(size - 1, -1, -1):
        right[k] /= band[0, k]
        if k + 1 < size:
            right[k] -= band[1, k] * right[k + 1]
        if k + 2 < size:
            right[k] -= band[2, k] * right[k + 2]


@called
def _direct(
    centre: float,
    second: float,
    gradient: Array,
    free: Flags,
    matrix: Array,
    place: Ints,
    slack: Array,
    price: Array,
    missed: Array,
    ds: Array,
    dz: Array,
    band: Array,
    dc: Array,
) -> None:
    """Fill how unknowns change towards products of `centre`, by factors of the normal matrix."""
    dc[:] = gradient
    for r in range(len(slack)):
        wanted = centre
        if second > 0.0:
            wanted -= ds[r] * dz[r]
        # What the price becomes where c stays.
        becomes = (price[r] * missed[r] + wanted) / slack[r]
        k = place[r]
        for a in range(3):
            dc[k + a] -= becomes * matrix[r, a]
    for k in range(len(dc)):
        if not free[k]:
            dc[k] = 0.0
    _solve(band, dc)
    for k in range(len(dc)):
        if not free[k]:
            dc[k] = 0.0


@called
def _longest(
    matrix: Array,
    place: Ints,
    dc: Array,
    slack: Array,
    price: Array,
    missed: Array,
    ds: Array,
    dz: Array,
    centre: float,
    second: float,
    share: float,
) -> tuple[float, float]:
    """Fill the changes of slacks and multipliers; return how far they may go, at most 1."""
    falls, drops = 0.0, 0.0
    for r in range(len(slack)):
        wanted = centre
        if second > 0.0:
            wanted -= ds[r] * dz[r]
        change = _product(matrix, place, dc, r)
        ds[r] = -missed[r] - change
        dz[r] = (price[r] * (missed[r] + change) + wanted) / slack[r] - price[r]
        falls = min(falls, ds[r] / slack[r])
        drops = min(drops, dz[r] / price[r])
    primal = 1.0 if -falls <= share else -share / falls
    dual = 1.0 if -drops <= share else -share / drops
    return primal, dual


@called
def _products(
    slack: Array, price: Array, ds: Array, dz: Array, primal: float, dual: float
) -> tuple[float, float]:
    """Return the sum and the least of the products after a step."""
    total, least = 0.0, np.inf
    for r in range(len(slack)):
        product = (slack[r] + primal * ds[r]) * (price[r] + dual * dz[r])
        total += product
        least = min(least, product)
    return total, least


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


def banded_optimum(
    gradient: Array, rows: BandedRows, start: Array, least: Array, most: Array, gap: float = 1e-6
) -> tuple[Array, bool]:
    """Return the c that maximises g·c within rows and bounds, and whether it was reached.

    Parameters
    ----------
    gradient : (N,)
        g.
    rows : BandedRows
    start : (N,)
        Near c, best within the rows.
    least, most : (N,)
        Finite; an unknown with both the same stays as it is.
    gap : float
        What may be missing, as a share of g·c.
    """
    room = _room(rows, start)
    chosen = room[0] < _BESIDE, room[1] < _BESIDE
    for number in range(_ROUNDS + 1):
        if number == _ROUNDS:
            chosen = np.isfinite(room[0]), np.isfinite(room[1])
        c, reached = _solved(gradient, rows, chosen, start, least, most, gap)
        room = _room(rows, c)
        if not reached or min(float(side.min(initial=0.0)) for side in room) >= -_BROKEN:
            break
        # Where rows are far beyond their limits, those farthest beyond stand for the others.
        worst = np.minimum(*(side.min(axis=1, initial=0.0) for side in room))[:, None]
        near = np.where(worst < -_NEARER, _AMONG * worst, _NEARER)
        chosen = chosen[0] | _wide(room[0], near), chosen[1] | _wide(room[1], near)
    return c, reached


def _wide(room: Array, near: Array) -> Flags:
    """Return rows (K, M) with less room, and the same of places beside: an optimum evades there."""
    rows = room < near
    wide = rows.copy()
    for k in range(1, _WIDE + 1):
        wide[k:] |= rows[:-k]
        wide[:-k] |= rows[k:]
    return np.asarray(wide & np.isfinite(room))


def _room(rows: BandedRows, c: Array) -> tuple[Array, Array]:
    """Return how far rows at c are from `upper` and `lower`, as shares of these, (K, M) each."""
    reached, sides = rows.times(c), []
    for sign, limit in ((1.0, rows.upper), (-1.0, rows.lower)):
        size = np.where(np.isfinite(limit), np.maximum(np.abs(limit), 1.0), 1.0)
        sides.append(sign * (limit - reached) / size)
    return sides[0], sides[1]


def _solved(
    gradient: Array,
    rows: BandedRows,
    chosen: tuple[Flags, Flags],
    start: Array,
    least: Array,
    most: Array,
    gap: float,
) -> tuple[Array, bool]:
    """Return the optimum of chosen rows, for `upper` and for `lower`, and of all bounds."""
    free, parts = least < most, []
    for sign, which, limit in ((1.0, chosen[0], rows.upper), (-1.0, chosen[1], rows.lower)):
        places = np.nonzero(which)[0]
        parts.append((sign * rows.matrix[:, which].T, places, sign * limit[which]))
    own = np.flatnonzero(free)
    place = np.minimum(own, len(gradient) - WIDTH)
    for sign, bound in ((1.0, most), (-1.0, least)):
        matrix = np.zeros((len(own), WIDTH))
        matrix[np.arange(len(own)), own - place] = sign
        parts.append((matrix, place, sign * bound[own]))
    matrix, place, limit = (np.concatenate(each) for each in zip(*parts, strict=True))
    c, reached = interior_optimum(gradient, free, matrix, place, limit, start, gap)
    return c, bool(reached)
