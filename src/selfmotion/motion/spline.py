"""The polynomials of a motion between its samples, and the ways that joints make on them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.motion.polynomials import (
    differentiated,
    evaluated,
    hermite,
    inner_roots,
    may_vanish,
)

# Intervals that are looked at together.
_LOT = 16_384


@dataclass(frozen=True, eq=False)
class Spline:
    """Cubics, or quintics where q̈ is given, through samples of a motion.

    Attributes
    ----------
    t : (N,)
        [s].
    q, qd : (N, n)
    qdd : (N, n), optional
    """

    t: Array
    q: Array
    qd: Array
    qdd: Array | None

    @cached_property
    def before(self) -> Array:
        """The way made by the beginning of each interval, and in all, (N, n)."""
        whole = np.concatenate([self.way(k, np.ones(len(k))) for k in self.lots()])
        return np.vstack([np.zeros(whole.shape[1]), np.cumsum(whole, axis=0)])

    def way(self, k: Ints, s: Array) -> Array:
        """Return the ways from the beginning of intervals k (K,) up to s (K,), (K, n)."""
        edge = np.broadcast_to(s[:, None, None], (len(k), 1, self.q.shape[1]))
        stops = [np.zeros_like(edge), np.minimum(self._turns(k), edge), edge]
        passed = evaluated(self.pieces(k)[:, :, None], np.concatenate(stops, axis=1))
        return np.asarray(np.abs(np.diff(passed, axis=1)).sum(axis=1))

    def _turns(self, k: Ints) -> Array:
        """Where joints turn round in intervals k (K,), sorted, (K, m, n); 0 for nowhere."""
        pieces = self.pieces(k, 1)
        turns = np.zeros((len(pieces) - 1, *pieces.shape[1:]))
        some, joints = np.nonzero(may_vanish(pieces))
        turns[:, some, joints] = inner_roots(pieces[:, some, joints])
        return np.sort(turns.transpose(1, 0, 2), axis=1)

    def place(self, t: Array) -> tuple[Ints, Array]:
        """Return the interval of each time, and how far into it the time is, 0 to 1."""
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        return k, (t - self.t[k]) / (self.t[k + 1] - self.t[k])

    def at(self, t: Array, order: int = 0) -> Array:
        """Return the motion or a derivative at times t (…), (…, n)."""
        return _by_lots(lambda part: self._at(part, order), t)

    def within(self, shares: Array, order: int) -> Array:
        """Return the same at these shares (S,) of each interval, then at the end, (…, n)."""
        found = []
        for k in self.lots():
            pieces = self.pieces(k, order)
            each = np.tensordot(shares[:, None] ** np.arange(len(pieces)), pieces, 1)
            found.append(each.swapaxes(0, 1).reshape(-1, pieces.shape[-1]))
        return np.concatenate([*found, self._at(self.t[-1:], order)])

    def _at(self, t: Array, order: int) -> Array:
        k, s = self.place(t)
        return evaluated(self.pieces(k, order), s[..., None])

    def travelled(self, t: Array) -> Array:
        """Return the ways made by times t (K,), (K, n)."""
        return _by_lots(self._travelled, t)

    def _travelled(self, t: Array) -> Array:
        k, s = self.place(t)
        return np.asarray(self.before[k] + self.way(k, s))

    def lots(self) -> Iterator[Ints]:
        """Yield the numbers of all intervals in lots that fit into memory."""
        for first in range(0, len(self.t) - 1, _LOT):
            yield np.arange(first, min(first + _LOT, len(self.t) - 1))

    def pieces(self, k: Ints, order: int = 0) -> Array:
        """Return the coefficients of 1, s, s² … of a derivative in intervals k (…), (m, …, n).

        s goes from 0 to 1 in each.
        """
        if len(self.t) > _LOT:
            return self._differentiated(k, order)
        if order not in self._derivatives:
            every = np.arange(len(self.t) - 1)
            self._derivatives[order] = self._differentiated(every, order)
        return self._derivatives[order][:, k]

    @cached_property
    def _derivatives(self) -> dict[int, Array]:
        """The pieces of some orders, of a motion with few samples."""
        return {}

    def _differentiated(self, k: Ints, order: int) -> Array:
        if order == 0:
            return self._of(k)
        steps = (self.t[k + 1] - self.t[k])[..., None]
        return differentiated(self._differentiated(k, order - 1)) / steps

    def _of(self, k: Ints) -> Array:
        """Return the coefficients of q in some of the intervals (I,), (m, I, n)."""
        h, ends = self.t[k + 1] - self.t[k], (k, k + 1)
        given = (self.q, self.qd) if self.qdd is None else (self.q, self.qd, self.qdd)
        return hermite(h[..., None], *((table[ends[0]], table[ends[1]]) for table in given))


def _by_lots(function: Callable[[Array], Array], t: Array) -> Array:
    """Return what a function returns for times t, of many a lot after the other.

    The coefficients that it needs are several times as large as what it returns.
    """
    if t.ndim != 1 or len(t) <= _LOT:
        return function(t)
    return np.concatenate([function(t[k : k + _LOT]) for k in range(0, len(t), _LOT)])
