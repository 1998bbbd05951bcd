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

from selfmotion.basics import Array, Flags
from selfmotion.optimise.interior_point import interior_optimum

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
