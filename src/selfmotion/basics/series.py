"""Majorant series: bounds of all derivatives of smooth functions on intervals of time.

A series a (K + 1, I) belongs to a function f (of numbers, vectors or matrices) on I intervals
|t - m| ≤ h: with u = (t - m) / h, sup |∂ᵏf/∂uᵏ| / k! ≤ a_k for k = 0 … K over each of them. By the
rules of Leibniz and Faà di Bruno, majorants of products and compositions follow from those of their
parts as if they were power series (A. Cauchy; H. Cartan, Théorie élémentaire des fonctions
analytiques, 1961, ch. VII), in any norm with |xy| ≤ |x||y|.
"""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
import numpy.typing as npt

from selfmotion.basics.arrays import Array, plain
from selfmotion.basics.jit import kernel

# Largest number of nodes of an interval.
ORDER = 12
# Number of coefficients of a series: also of two derivatives more.
LENGTH = ORDER + 3


def constant(values: npt.ArrayLike, like: Array) -> Array:
    """Return the series of constants (I,) or one number, of the shape of another one."""
    series = np.zeros_like(like)
    series[0] = values
    return series


def product(a: Array, b: Array) -> Array:
    """Return the series of a product, as long as the shorter one."""
    found = np.zeros((min(len(a), len(b)), a.shape[1]))
    _multiply(plain(a), plain(b), found)
    return found


def exponential(a: Array) -> Array:
    """Return exp(a - a₀), the series of exp(A(t)) for skew A with the series a.

    As exp(A + B) = e^A + ∫ e^((1-s)A) B e^(sA) ds + …, with e^(sA) orthogonal, the n-th term is at
    most |B|ⁿ/n! (F. J. Dyson, Phys. Rev. 75, 1949; R. M. Wilcox, J. Math. Phys. 8, 1967).
    """
    found = np.zeros(a.shape)
    _exponentiate(plain(a), found)
    return found


def composed(outer: Array, inner: Array) -> Array:
    """Return the series of f(g(t)): that of f, over the range of g, at that of g.

    The outer one's coefficients are per unit of g.
    """
    found = np.zeros(inner.shape)
    _compose(plain(outer), plain(inner), found)
    return found


def root(low: Array, high: Array, length: int) -> Array:
    """Return the outer series of √x for 0 < low ≤ x ≤ high, (I,) each: binomial coefficients."""
    found, factor = np.empty((length, len(low))), 0.5
    found[0] = np.sqrt(high)
    for k in range(1, length):
        found[k] = abs(factor) * low ** (0.5 - k)
        factor *= (0.5 - k) / (k + 1)
    return found


def logarithm(a: Array) -> Array:
    """Return -log(1 - (a - a₀)), the series of log(1 + f) about where f = 0, but for its size."""
    found = np.zeros_like(a)
    for k in range(1, len(a)):
        inner = sum(j * found[j] * a[k - j] for j in range(1, k))
        found[k] = a[k] + inner / k
    return found


def derivative(a: Array, half: Array) -> Array:
    """Return the series of df/dt, one shorter, on intervals of half widths (I,)."""
    return np.asarray(a[1:] * np.arange(1.0, len(a))[:, None] / half)


def of_polynomial(coefficients: Array) -> Array:
    """Return the series of polynomials Σ c_k uᵏ (m + 1, …) on |u| ≤ 1: Σ_j C(j, k) |c_j|."""
    size = len(coefficients)
    found = np.zeros((LENGTH, *coefficients.shape[1:]))
    found[:size] = np.tensordot(_binomials(size), np.abs(coefficients), 1)
    return found


def of_vectors(coefficients: Array) -> Array:
    """Return the series of vectors of polynomials (m + 1, I, 3) on |u| ≤ 1."""
    return of_polynomial(np.linalg.norm(coefficients, axis=2))


def of_pieces(breaks: Array, coefficients: Array, middle: Array, half: Array) -> Array:
    """Return piecewise polynomials on intervals, as polynomials of u, (m + 1, I, …).

    Coefficients (m + 1, P, …) are those of 1, x, x² … with x from the beginning of each piece; the
    piece is that of the middle.
    """
    k = np.clip(np.searchsorted(breaks, middle, side="right") - 1, 0, len(breaks) - 2)
    shape = (-1, *np.ones(coefficients.ndim - 2, dtype=int))
    inside = (middle - breaks[k]).reshape(shape)
    return recentred(coefficients[:, k], inside, half.reshape(shape))


def of_chebyshev(coefficients: Array, share: Array) -> Array:
    """Return the series of vectors Σ a_j T_j(x) (m + 1, I, 3) where x = x₀ + share · u in [-1, 1].

    V. A. Markov: the derivatives of T_j are largest at 1.
    """
    sizes, found = np.linalg.norm(coefficients, axis=2), np.zeros((LENGTH, len(share)))
    slopes, j = np.ones(len(coefficients)), np.arange(float(len(coefficients)))
    for k in range(LENGTH):
        found[k] = slopes @ sizes * share**k
        slopes = slopes * np.maximum(j**2 - k**2, 0.0) / ((2.0 * k + 1.0) * (k + 1.0))
    return found


@cache
def bernstein(degree: int) -> Array:
    """Return the matrix from coefficients of 1, s, s² … on 0 ≤ s ≤ 1 to control points.

    The points of degree m, (m + 1, m + 1): their hull contains the polynomial (G. Farin, Curves and
    Surfaces for CAGD, 5th ed. 2002, ch. 5). The first columns are of a lower degree, elevated.
    """
    size = degree + 1
    return np.array([[comb(i, k) / comb(degree, k) for k in range(size)] for i in range(size)])


def recentred(coefficients: Array, middle: Array, half: Array) -> Array:
    """Return the coefficients of p(middle + half · u); both broadcast with one coefficient."""
    shape = np.broadcast_shapes(coefficients.shape[1:], middle.shape)
    size = len(coefficients)
    given = np.broadcast_to(coefficients, (size, *shape)).reshape(size, -1)
    centre, reach = (np.broadcast_to(x, shape).reshape(-1) for x in (middle, half))
    found = np.zeros(given.shape)
    _recentre(plain(given), plain(centre), plain(reach), found)
    return found.reshape(size, *shape)


def holds_for(item: object, *methods: str, says: str = "series") -> bool:
    """Return whether what an object `says` is valid for these methods of its class.

    A class of one's own that derives from one of ours and moves otherwise says nothing, unless it
    says it itself.
    """
    order = type(item).__mro__
    first = next(k for k, kind in enumerate(order) if says in vars(kind))
    return not any(name in vars(kind) for kind in order[:first] for name in methods)


def after_first(a: Array) -> Array:
    """Return a bound of the function's distance from its value in the interval's middle, (I,)."""
    return np.asarray(a[1:].sum(axis=0))


@cache
def _binomials(size: int) -> Array:
    return np.array([[comb(j, k) for j in range(size)] for k in range(size)], dtype=np.float64)


@kernel
def _multiply(a: Array, b: Array, found: Array) -> None:
    for k in range(len(found)):
        for j in range(k + 1):
            for i in range(found.shape[1]):
                found[k, i] += a[j, i] * b[k - j, i]


@kernel
def _exponentiate(a: Array, found: Array) -> None:
    """Set the coefficients of E = exp(A - a₀) by those of E' = A' E."""
    for i in range(found.shape[1]):
        found[0, i] = 1.0
    for k in range(1, len(found)):
        for j in range(1, k + 1):
            share = j / k
            for i in range(found.shape[1]):
                found[k, i] += share * a[j, i] * found[k - j, i]


@kernel
def _compose(outer: Array, inner: Array, found: Array) -> None:
    """Set f(g - g₀) by Horner's scheme.

    Each product shifts by at least one, so that the first ones need few terms. Many outer series
    are polynomials of a low degree, with zeros above.
    """
    length, last = len(inner), min(len(outer), len(inner)) - 1
    while last > 0 and not outer[last].any():
        last -= 1
    for left in range(last, -1, -1):
        for k in range(length - left - 1, -1, -1):
            # One row after the other: neighbours in memory are neighbouring intervals.
            found[k] = 0.0
            for j in range(1, k + 1):
                for i in range(found.shape[1]):
                    found[k, i] += inner[j, i] * found[k - j, i]
        for i in range(found.shape[1]):
            found[0, i] += outer[left, i]


@kernel
def _recentre(coefficients: Array, middle: Array, half: Array, found: Array) -> None:
    for c in range(len(coefficients) - 1, -1, -1):
        for k in range(len(coefficients) - 1, -1, -1):
            for i in range(found.shape[1]):
                before = half[i] * found[k - 1, i] if k > 0 else coefficients[c, i]
                found[k, i] = middle[i] * found[k, i] + before
