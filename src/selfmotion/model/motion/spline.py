"""Polynomial segments of a motion between its samples, and path lengths of its joints.

p(s) = Σ c_k s^k on 0 ≤ s ≤ 1, coefficients (m + 1, …) lowest first.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Ints, interval_of, kernel, plain, series

# Relative size below which a leading coefficient counts as zero.
_NOTHING = 1e-13
# Largest imaginary part of a real root, and of two that rounding has separated.
_REAL = 1e-6
# Distance outside of 0..1 at which a root is still polished.
_NEAR = 1e-3
# Newton iterations of a root.
_STEPS = 3
# Intervals, or times, that are evaluated at once, to bound memory.
_CHUNK = 16_384


def evaluated(coefficients: Array, s: Array) -> Array:
    """Return p(s), by Horner's rule; `s` broadcasts with one coefficient of all polynomials."""
    value = np.zeros(np.broadcast_shapes(coefficients.shape[1:], np.shape(s)))
    for coefficient in coefficients[::-1]:
        value = value * s + coefficient
    return value


def differentiated(coefficients: Array) -> Array:
    """Return the coefficients of dp/ds, one fewer, but at least one."""
    if len(coefficients) == 1:
        return np.zeros_like(coefficients)
    powers = np.arange(1.0, len(coefficients))
    return np.asarray(coefficients[1:] * powers.reshape(-1, *np.ones(coefficients.ndim - 1, int)))


def may_pass(coefficients: Array, least: Array, largest: Array) -> npt.NDArray[np.bool_]:
    """Return the mask of polynomials (m + 1, P, n) that may leave least..largest (n,), (P, n).

    A polynomial lies in the hull of its Bernstein coefficients, the first and last of which are
    its ends.
    """
    inner = np.tensordot(series.bernstein(len(coefficients) - 1)[1:-1], coefficients, 1)
    if not len(inner):
        return np.zeros(coefficients.shape[1:], dtype=bool)
    return np.asarray((inner.max(axis=0) > largest) | (inner.min(axis=0) < least))


def may_vanish(coefficients: Array) -> npt.NDArray[np.bool_]:
    """Return the mask of polynomials (m + 1, …) that may have a root: not those of one sign."""
    hull = np.tensordot(series.bernstein(len(coefficients) - 1), coefficients, 1)
    return np.asarray((hull.max(axis=0) >= 0.0) & (hull.min(axis=0) <= 0.0))


def inner_roots(coefficients: Array) -> Array:
    """Return the real roots of M polynomials (m + 1, M) in 0 < s < 1, (m, M); 0 stands for none."""
    degree, count = len(coefficients) - 1, coefficients.shape[1]
    roots = np.zeros((degree, count))
    if not degree or not count:
        return roots
    size = np.abs(coefficients).max(axis=0)
    scaled = coefficients / np.where(size > 0.0, size, 1.0)
    lower = np.abs(scaled[-1]) <= _NOTHING
    roots[:-1, lower] = inner_roots(scaled[:-1, lower])
    rest = scaled[:, ~lower]
    found = _all_roots(rest / rest[-1])
    real = np.where(np.abs(found.imag) <= _REAL, found.real, 0.0)
    real = _polished(rest, np.where((real > -_NEAR) & (real < 1.0 + _NEAR), real, 0.0))
    roots[:, ~lower] = np.where((real > 0.0) & (real < 1.0), real, 0.0)
    return roots


def _polished(coefficients: Array, roots: Array) -> Array:
    """Return roots (m, M), but for zeros, after Newton's steps that make |p| smaller.

    Small leading coefficients cost the companion matrix digits.
    """
    slopes = differentiated(coefficients)
    value = evaluated(coefficients, roots)
    for _ in range(_STEPS):
        slope = evaluated(slopes, roots)
        moved = roots - value / np.where(slope == 0.0, np.inf, slope)
        there = evaluated(coefficients, moved)
        better = (np.abs(there) < np.abs(value)) & (roots != 0.0)
        roots, value = np.where(better, moved, roots), np.where(better, there, value)
    return roots


def _all_roots(monic: Array) -> npt.NDArray[np.complexfloating]:
    """Return the roots of polynomials (m + 1, M) with leading coefficient 1, (m, M)."""
    degree, count = len(monic) - 1, monic.shape[1]
    if degree == 2:
        middle = -0.5 * monic[1]
        apart = np.sqrt(middle**2 - monic[0] + 0.0j)
        # The one farther from 0 loses no digits; their product is the constant term.
        far = middle + np.where(middle < 0.0, -apart, apart)
        return np.stack([far, monic[0] / np.where(far == 0.0, 1.0, far)])
    companion = np.zeros((count, degree, degree))
    companion[:, 1:, :-1] = np.eye(degree - 1)
    companion[:, :, -1] = -monic[:-1].T
    return np.asarray(np.linalg.eigvals(companion).T)


def hermite(h: Array, *given: tuple[Array, Array]) -> Array:
    """Return the coefficients of 1, s, s² … that meet both ends of intervals, (4 or 6, I, n).

    Of intervals h (I, 1) long: values and slopes at both ends, (I, n) each, and for a quintic
    second derivatives; s goes from 0 to 1.
    """
    (start, end), (rate, last) = given[0], (h * side for side in given[1])
    if len(given) == 2:
        rise, gain = end - start - rate, last - rate
        return np.stack([start, rate, 3.0 * rise - gain, gain - 2.0 * rise])
    bend, bent = (0.5 * h**2 * side for side in given[2])
    rise = end - start - rate - bend
    gain = last - rate - 2.0 * bend
    surge = bent - bend
    higher = (
        10.0 * rise - 4.0 * gain + surge,
        7.0 * gain - 15.0 * rise - 2.0 * surge,
        6.0 * rise - 3.0 * gain + surge,
    )
    return np.stack([start, rate, bend, *higher])


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
    def lengths_before(self) -> Array:
        """Path lengths of the joints up to the start of each interval, and in all, (N, n)."""
        whole = np.concatenate([self.path_length(k, np.ones(len(k))) for k in self.chunks()])
        return np.vstack([np.zeros(whole.shape[1]), np.cumsum(whole, axis=0)])

    def path_length(self, k: Ints, s: Array) -> Array:
        """Return the path lengths from the start of intervals k (K,) up to s (K,), (K, n)."""
        edge = np.broadcast_to(s[:, None, None], (len(k), 1, self.q.shape[1]))
        stops = [np.zeros_like(edge), np.minimum(self._turning_points(k), edge), edge]
        passed = evaluated(self.segments(k)[:, :, None], np.concatenate(stops, axis=1))
        return np.asarray(np.abs(np.diff(passed, axis=1)).sum(axis=1))

    def _turning_points(self, k: Ints) -> Array:
        """Return the joints' turning points in intervals k (K,), sorted, (K, m, n); 0 for none."""
        return self._turns_in(k) if len(self.t) > _CHUNK else self._turns[k]

    @cached_property
    def _turns(self) -> Array:
        """Turning points in all intervals, of a motion with few samples."""
        return self._turns_in(np.arange(len(self.t) - 1))

    def _turns_in(self, k: Ints) -> Array:
        segments = self.segments(k, 1)
        turns = np.zeros((len(segments) - 1, *segments.shape[1:]))
        some, joints = np.nonzero(may_vanish(segments))
        turns[:, some, joints] = inner_roots(segments[:, some, joints])
        return np.sort(turns.transpose(1, 0, 2), axis=1)

    def place(self, t: Array) -> tuple[Ints, Array]:
        """Return the interval of each time, and how far into it the time is, 0 to 1."""
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        return k, (t - self.t[k]) / (self.t[k + 1] - self.t[k])

    def at(self, t: Array, order: int) -> Array:
        """Return the motion or a derivative at times t (…), (…, n)."""
        return _in_chunks(lambda part: self._at(part, order), t)

    def within(self, shares: Array, order: int) -> Array:
        """Return a derivative at these shares (S,) of each interval, then at the end, (…, n)."""
        found = []
        for k in self.chunks():
            segments = self.segments(k, order)
            each = np.tensordot(shares[:, None] ** np.arange(len(segments)), segments, 1)
            found.append(each.swapaxes(0, 1).reshape(-1, segments.shape[-1]))
        return np.concatenate([*found, self._at(self.t[-1:], order)])

    def _at(self, t: Array, order: int) -> Array:
        if len(self.t) > _CHUNK:
            k, s = self.place(t)
            return evaluated(self.segments(k, order), s[..., None])
        found = np.empty((t.size, self.q.shape[1]))
        evaluate_pieces(self._knots, self._every(order), plain(t.ravel()), found)
        return found.reshape(*t.shape, self.q.shape[1])

    def travelled(self, t: Array) -> Array:
        """Return the path lengths up to times t (K,), (K, n)."""
        return _in_chunks(self._travelled, t)

    def _travelled(self, t: Array) -> Array:
        k, s = self.place(t)
        return np.asarray(self.lengths_before[k] + self.path_length(k, s))

    def chunks(self) -> Iterator[Ints]:
        """Yield the numbers of all intervals, in chunks that fit into memory."""
        for first in range(0, len(self.t) - 1, _CHUNK):
            yield np.arange(first, min(first + _CHUNK, len(self.t) - 1))

    def segments(self, k: Ints, order: int = 0) -> Array:
        """Return the coefficients of 1, s, s² … of a derivative in intervals k (…), (m, …, n).

        s goes from 0 to 1 in each.
        """
        if len(self.t) > _CHUNK:
            return self._differentiated(k, order)
        return self._every(order)[:, k]

    def _every(self, order: int) -> Array:
        """Return the segments of a derivative in all intervals, of a motion with few samples."""
        found = self._derivatives.get(order)
        if found is None:
            found = (
                plain(self._of(np.arange(len(self.t) - 1)))
                if order == 0
                else differentiated(self._every(order - 1)) / np.diff(self.t)[:, None]
            )
            self._derivatives[order] = found
        return found

    @cached_property
    def _derivatives(self) -> dict[int, Array]:
        return {}

    @cached_property
    def _knots(self) -> Array:
        return plain(self.t)

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


def _in_chunks(function: Callable[[Array], Array], t: Array) -> Array:
    """Evaluate `function` at times t in chunks, to bound memory.

    Its coefficients are several times as large as its result.
    """
    if t.ndim != 1 or len(t) <= _CHUNK:
        return function(t)
    return np.concatenate([function(t[k : k + _CHUNK]) for k in range(0, len(t), _CHUNK)])


@kernel
def evaluate_pieces(knots: Array, pieces: Array, t: Array, found: Array) -> None:
    """Set the values (K, n) at times t (K,) of polynomials (m, N - 1, n) between N knots.

    Coefficients of 1, s, s² … with s from 0 to 1; the first and the last piece go on beyond.
    """
    degree = len(pieces) - 1
    for k in range(len(t)):
        piece = interval_of(knots, t[k])
        s = (t[k] - knots[piece]) / (knots[piece + 1] - knots[piece])
        for j in range(found.shape[1]):
            value = pieces[degree, piece, j]
            for power in range(degree - 1, -1, -1):
                value = value * s + pieces[power, piece, j]
            found[k, j] = value
