"""Linear programme with rows of three neighbouring unknowns: a banded interior-point method.

    maximise g·c   subject to   lower ≤ R c ≤ upper,   least ≤ c ≤ most

Mehrotra's predictor and corrector (S. Mehrotra, SIAM J. Optimization 2(4), 1992), within a
neighbourhood of the central path: no product of slack and multiplier is far below their mean (S. J.
Wright, Primal-Dual Interior-Point Methods, 1997, ch. 5). The normal matrix is pentadiagonal, so
that a step costs O(N). Most rows are far from binding: a programme is solved with those near to it,
then again with those that its optimum violates, until there are none (constraint generation).
"""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel

# Feasibility tolerance of rows, relative to their limits or 1, whichever is larger.
MET = 1e-7
# Limit of iterations of the interior-point method.
_MAX_ITERATIONS = 200
# Smallest target of a product of slack and multiplier, as a share of the gap per row: the smaller
# it is, the more rounding there is in multipliers of steep rows.
_MU_FLOOR = 0.1
# Rounding ends the iteration where the dual residual is below this share of g·c …
_STALL_RESIDUAL = 1e-2
# … and this number of iterations in turn …
_STALL_ITERATIONS = 3
# … each left more than this share of it.
_STALL_FACTOR = 0.7
# Fraction to the boundary of a step.
_TAU = 0.99
# Smallest product of slack and multiplier, as a share of their mean (γ of the neighbourhood) …
_NEIGHBOURHOOD = 1e-3
# … for which steps are shortened by this factor …
_SHORTENING = 0.7
# … at most this number of times.
_SHORTENINGS = 12
# A shorter step than this runs along the boundary: it is replaced by a centring step …
_SHORT_STEP = 0.1
# … towards this share of the mean product.
_CENTRING = 0.5
# Shorter steps than this end the iteration.
_MIN_STEP = 1e-8
# Diagonal entry of an unknown that is fixed.
_FIXED = 1e200
# Relative increase of the other diagonal entries, against rounding.
_ROUNDING = 1e-14
# Unknowns that a row touches.
WIDTH = 3
# Rows of the first programme: those with less room than this share of their limit.
_ROOM_FIRST = 0.5
# Rows that are added later: those with less room than this share …
_ROOM_LATER = 0.2
# … or, where some are violated by more, those violated by this share of the worst.
_SHARE_OF_WORST = 0.5
# Programmes with a part of the rows; then one with all. Where four do not do, as in first steps of
# short moves, twelve do not either, and take twice as long as all rows.
_ROUNDS = 4
# Largest violation of a row that was left out, relative to its limit.
_VIOLATED = 1e-5
# Neighbours on both sides that are added with each violated row; with fewer, the violation only
# moves.
_NEIGHBOURS = 20


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
        Relative duality gap, as a share of g·c.
    """
    count, size, c = len(limit), len(gradient), start.copy()
    slack, price = np.empty(count), np.empty(count)
    value = _initialise(gradient, matrix, place, limit, c, slack, price)
    residuals, ds, dz = np.empty(count), np.empty(count), np.empty(count)
    band, paid, dc = np.empty((3, size)), np.empty(size), np.empty(size)
    stalled, before = 0, np.inf
    for _ in range(_MAX_ITERATIONS):
        products, met = _update_residuals(
            c, matrix, place, limit, slack, price, residuals, band, paid
        )
        whole, left = _dual_residual(gradient, free, paid, c, value)
        stalled = stalled + 1 if left > _STALL_FACTOR * before else 0
        before = left
        rounded = stalled >= _STALL_ITERATIONS and left <= _STALL_RESIDUAL * whole
        if met <= MET and products <= gap * whole and (left <= gap * whole or rounded):
            return c, True
        if not _factored(band, free):
            break
        mu = products / count
        _search_direction(
            0.0, 0.0, gradient, free, matrix, place, slack, price, residuals, ds, dz, band, dc
        )
        primal, dual = _step_lengths(
            matrix, place, dc, slack, price, residuals, ds, dz, 0.0, 0.0, 1.0
        )
        after, _ = _products(slack, price, ds, dz, primal, dual)
        centre = mu * min((after / count / mu) ** 3, 1.0)
        centre = max(centre, min(_MU_FLOOR * gap * whole / count, mu))
        _search_direction(
            centre, 1.0, gradient, free, matrix, place, slack, price, residuals, ds, dz, band, dc
        )
        primal, dual = _step_lengths(
            matrix, place, dc, slack, price, residuals, ds, dz, centre, 1.0, _TAU
        )
        if min(primal, dual) < _SHORT_STEP:
            centre, known = _CENTRING * mu, (gradient, free, matrix, place, slack, price, residuals)
            _search_direction(centre, 0.0, *known, ds, dz, band, dc)
            primal, dual = _step_lengths(
                matrix, place, dc, slack, price, residuals, ds, dz, centre, 0.0, _TAU
            )
        primal, dual = _into_neighbourhood(slack, price, ds, dz, primal, dual)
        for k in range(size):
            c[k] += primal * dc[k]
        for r in range(count):
            slack[r] += primal * ds[r]
            price[r] += dual * dz[r]
        if primal < _MIN_STEP:
            break
    return c, False


@called
def _initialise(
    gradient: Array,
    matrix: Array,
    place: Ints,
    limit: Array,
    c: Array,
    slack: Array,
    price: Array,
) -> float:
    """Set initial slacks and multipliers; return an estimate of the size of g·c."""
    count, value = len(limit), 0.0
    for k in range(len(gradient)):
        value += abs(gradient[k]) * max(abs(c[k]), 1.0)
    for r in range(count):
        room = limit[r] - _product(matrix, place, c, r)
        slack[r] = max(room, 1e-2 * max(abs(limit[r]), 1.0))
        price[r] = value / count / slack[r]
    return value


@called
def _dual_residual(
    gradient: Array, free: Flags, paid: Array, c: Array, value: float
) -> tuple[float, float]:
    """Return the size of g·c, and the dual residual weighted by c."""
    reached, left = 0.0, 0.0
    for k in range(len(gradient)):
        reached += gradient[k] * c[k]
        if free[k]:
            left += abs((gradient[k] - paid[k]) * c[k])
    return max(abs(reached), MET * value), left


@called
def _into_neighbourhood(
    slack: Array, price: Array, ds: Array, dz: Array, primal: float, dual: float
) -> tuple[float, float]:
    """Return step lengths after which every product is within the neighbourhood."""
    for _ in range(_SHORTENINGS):
        after, least = _products(slack, price, ds, dz, primal, dual)
        if least >= _NEIGHBOURHOOD * after / len(slack):
            break
        primal, dual = _SHORTENING * primal, _SHORTENING * dual
    return primal, dual


@called
def _product(matrix: Array, place: Ints, c: Array, r: int) -> float:
    k = place[r]
    found: float = matrix[r, 0] * c[k] + matrix[r, 1] * c[k + 1] + matrix[r, 2] * c[k + 2]
    return found


@called
def _update_residuals(
    c: Array,
    matrix: Array,
    place: Ints,
    limit: Array,
    slack: Array,
    price: Array,
    residuals: Array,
    band: Array,
    paid: Array,
) -> tuple[float, float]:
    """Set residuals, the normal matrix (3, N) and Rᵀz; return Σ s z and the largest residual."""
    band[:], paid[:] = 0.0, 0.0
    products, met = 0.0, 0.0
    for r in range(len(limit)):
        k = place[r]
        residuals[r] = slack[r] - limit[r] + _product(matrix, place, c, r)
        met = max(met, abs(residuals[r]) / max(abs(limit[r]), 1.0))
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
        pivot = band[0, k] * (1.0 + _ROUNDING) if free[k] else _FIXED
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
def _search_direction(
    centre: float,
    second: float,
    gradient: Array,
    free: Flags,
    matrix: Array,
    place: Ints,
    slack: Array,
    price: Array,
    residuals: Array,
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
        # The multiplier where c is constant.
        becomes = (price[r] * residuals[r] + wanted) / slack[r]
        k = place[r]
        for a in range(3):
            dc[k + a] -= becomes * matrix[r, a]
    _solve(band, dc)
    for k in range(len(dc)):
        if not free[k]:
            dc[k] = 0.0


@called
def _step_lengths(
    matrix: Array,
    place: Ints,
    dc: Array,
    slack: Array,
    price: Array,
    residuals: Array,
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
        ds[r] = -residuals[r] - change
        dz[r] = (price[r] * (residuals[r] + change) + wanted) / slack[r] - price[r]
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
        lower < upper; ±inf for none.
    """

    matrix: Array
    lower: Array
    upper: Array


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
        Relative duality gap, as a share of g·c.
    """
    room = _room(rows, start)
    chosen = room[0] < _ROOM_FIRST, room[1] < _ROOM_FIRST
    for number in range(_ROUNDS + 1):
        if number == _ROUNDS:
            chosen = np.isfinite(room[0]), np.isfinite(room[1])
        c, reached = _solved(gradient, rows, chosen, start, least, most, gap)
        room = _room(rows, c)
        if not reached or min(float(side.min(initial=0.0)) for side in room) >= -_VIOLATED:
            break
        # Where rows are far beyond their limits, those farthest beyond stand for the others.
        worst = np.minimum(*(side.min(axis=1, initial=0.0) for side in room))
        near = np.where(worst < -_ROOM_LATER, _SHARE_OF_WORST * worst, _ROOM_LATER)
        for side, rows_of_side in zip(room, chosen, strict=True):
            _choose(side, near, rows_of_side)
    return c, reached


def _room(rows: BandedRows, c: Array) -> tuple[Array, Array]:
    """Return the room of rows to `upper` and `lower`, relative to these, (K, M) each."""
    above, below = np.empty_like(rows.upper), np.empty_like(rows.lower)
    _set_room(rows.matrix, rows.lower, rows.upper, c, above, below)
    return above, below


@kernel
def _set_room(
    matrix: Array, lower: Array, upper: Array, c: Array, above: Array, below: Array
) -> None:
    """Set the room of rows R c to both limits, relative to these or 1 if that is larger."""
    width, count, columns = matrix.shape
    for k in range(count):
        for m in range(columns):
            value = 0.0
            for i in range(width):
                value += matrix[i, k, m] * c[k + i]
            above[k, m], below[k, m] = upper[k, m] - value, value - lower[k, m]
            if np.isfinite(upper[k, m]):
                above[k, m] /= max(abs(upper[k, m]), 1.0)
            if np.isfinite(lower[k, m]):
                below[k, m] /= max(abs(lower[k, m]), 1.0)


@kernel
def _choose(room: Array, near: Array, chosen: Flags) -> None:
    """Choose rows (K, M) with less room than `near` (K,), and their neighbours, but those without.

    Without a limit their room is infinite.
    """
    count, columns = room.shape
    for m in range(columns):
        # Up to which place all are chosen.
        until = 0
        for k in range(count):
            if room[k, m] < near[k]:
                for i in range(max(k - _NEIGHBOURS, until), min(k + _NEIGHBOURS + 1, count)):
                    chosen[i, m] = chosen[i, m] or np.isfinite(room[i, m])
                until = min(k + _NEIGHBOURS + 1, count)


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
