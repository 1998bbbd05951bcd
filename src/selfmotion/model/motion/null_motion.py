"""The null motion ε(t), linear in the coefficients x that are optimised: ε(t) = R(t) E φ(t)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from typing_extensions import override

from selfmotion.basics import (
    Array,
    ProblemError,
    Saved,
    as_choice,
    as_numbers,
    as_whole,
    shown,
)

# Highest degree of polynomials: more resolves nothing, and takes minutes.
_HIGHEST = 100
# Largest number of intervals of splines, for the same reason.
_MAX_INTERVALS = 2000


# Share of the duration in which a null motion found by a search fades to 0 at the ends.
_FADE = 0.05


def resting_window(t: Array, duration: float, orders: tuple[int, int]) -> Array:
    """Return w(t) = c s^a (1 - s)^b with s = t / duration, (S,): at most 1.

    Where a null motion is multiplied by it, that comes to rest at the start with its first a - 1
    derivatives, and at the end with its first b - 1; `orders` are a and b.
    """
    a, b = orders
    s = np.asarray(t) / duration
    most = a**a * b**b / float((a + b) ** (a + b))
    return np.asarray(s**a * (1.0 - s) ** b / most)


def fading_window(t: Array, duration: float, ends: tuple[bool, bool]) -> Array:
    """Return w(t), (S,): 1, except near those `ends` where it falls smoothly to 0."""
    s = np.asarray(t) / duration
    start, end = (_fade(x) if falls else 1.0 for x, falls in zip((s, 1.0 - s), ends, strict=True))
    return np.asarray(np.ones(len(s)) * start * end)


def _fade(s: Array) -> Array:
    """Return a function of s (S,) that rises smoothly from 0 to 1 and stays there."""
    u = np.minimum(s / _FADE, 1.0)
    return np.asarray(u * u * (3.0 - 2.0 * u))


class NullMotion(Saved, ABC, family="null motion"):
    """A parameterisation of ε(t): functions φ of time, and the space that E maps them to.

    One of your own gives `functions`; `selfmotion.testing.check_null_motion` checks it.

    Attributes
    ----------
    space : {"null", "joint"}
        ``"null"``: E is (r, K) in a null-space basis; ``"joint"``: E is (n, K), R = I.
    """

    space: str = "null"

    @property
    @abstractmethod
    def fewest_steps(self) -> int:
        """Steps below which a grid does not resolve the functions."""

    @abstractmethod
    def functions(self, t: Array, duration: float) -> Array:
        """Return φ at times `t` (S,) of a motion of length `duration` [s], (S, K)."""

    def resting(self, t: Array, duration: float, orders: tuple[int, int]) -> Array:
        """Return φ of a motion that comes to rest at its ends, (S, K).

        At the start with its first a - 1 derivatives, at the end with its first b - 1; `orders` are
        a and b, 0 to 2. By default φ times a function that does; see `resting_window`.
        """
        return self.functions(t, duration) * resting_window(t, duration, orders)[:, None]


@dataclass(frozen=True)
class PolynomialNullMotion(NullMotion):
    """ε(t) as a polynomial in time.

    ``space="joint", basis="monomial"`` is the paper's: ε(t) = Σ e_k t^k (eq. 6), with the decision
    vector [e_00 … e_0p e_10 …] (eq. 8), n(p + 1) entries of which only the null-space part acts.
    The default has r(p + 1): polynomials in a basis R(t) of the null space, transported along the
    x = 0 motion. The projector (I - J⁺J) of eq. 4 still acts: the basis need not be exact where the
    motion differs from that of x = 0.

    Parameters
    ----------
    degree : int
        p ≥ 0.
    space : {"null", "joint"}
        Whether E has a row per null-space direction (r) or per joint (n).
    basis : {"legendre", "monomial"}
        Legendre polynomials, orthonormal over the motion: ∫ φ_i φ_j dt = δ_ij; or powers t^k [s^k].
    """

    degree: int = 3
    space: str = "null"
    basis: str = "legendre"

    def __post_init__(self) -> None:
        _check_degree(self.degree)
        _check_space(self.space)
        as_choice(self.basis, "null motion: basis", ("legendre", "monomial"))

    @property
    @override
    def fewest_steps(self) -> int:
        """Four for each coefficient."""
        return 4 * (self.degree + 1)

    @override
    def functions(self, t: Array, duration: float) -> Array:
        if self.basis == "monomial":
            return np.asarray(np.vander(t, self.degree + 1, increasing=True))
        norms = np.sqrt((2.0 * np.arange(self.degree + 1) + 1.0) / duration)
        return np.asarray(legendre.legvander(2.0 * t / duration - 1.0, self.degree) * norms)


@dataclass(frozen=True)
class BSplineNullMotion(NullMotion):
    """ε(t) as a B-spline with equal intervals: for long paths, where one polynomial is too stiff.

    Each coefficient acts on degree + 1 intervals only.

    Parameters
    ----------
    intervals : int
        Number of polynomial pieces, ≥ 1.
    degree : int
        p ≥ 0; C^(p-1) between pieces.
    space : {"null", "joint"}
        As in `PolynomialNullMotion`.
    """

    intervals: int = 8
    degree: int = 3
    space: str = "null"

    def __post_init__(self) -> None:
        _check_degree(self.degree)
        _check_space(self.space)
        as_whole(self.intervals, "null motion: intervals", 1, _MAX_INTERVALS)

    @property
    @override
    def fewest_steps(self) -> int:
        """Four for each interval."""
        return 4 * self.intervals

    @override
    def functions(self, t: Array, duration: float) -> Array:
        from scipy.interpolate import BSpline

        inner = np.linspace(0.0, duration, self.intervals + 1)
        knots = np.concatenate([[0.0] * self.degree, inner, [duration] * self.degree])
        return np.asarray(BSpline.design_matrix(t, knots, self.degree).toarray())


@dataclass(frozen=True)
class FreeNullMotion(NullMotion):
    """Any ε(t): the motion is optimised at nodes, as many as its cost needs.

    Newton's method finds where each node is on its self-motion; `Report.null_motion` has the nodes.
    An optimiser of one's own, or damping, uses the published method; there, it is a cubic.
    """

    @property
    @override
    def fewest_steps(self) -> int:
        """Those of the cubic."""
        return PolynomialNullMotion().fewest_steps

    @override
    def functions(self, t: Array, duration: float) -> Array:
        """Those of the cubic."""
        return PolynomialNullMotion().functions(t, duration)


@dataclass(frozen=True)
class NodeNullMotion(NullMotion):
    """ε(t) by its values at nodes, joint by joint, with a cubic spline between: a finished plan's.

    Parameters
    ----------
    times : sequence of float
        Of the nodes, as shares of the duration, from 0 to 1.
    """

    times: tuple[float, ...] = (0.0, 0.25, 0.5, 0.75, 1.0)
    space: str = "joint"

    def __post_init__(self) -> None:
        times = as_numbers(self.times, "null motion: times", "shares of the duration")
        rising = times.ndim == 1 and len(times) > 3 and bool((np.diff(times) > 0.0).all())
        if not rising or times[0] != 0.0 or times[-1] != 1.0:
            raise ProblemError(
                f"null motion: times are {shown(self.times)}, expected at least four, rising from "
                f"0 to 1"
            )
        as_choice(self.space, "null motion: space", ("joint",))
        object.__setattr__(self, "times", tuple(float(time) for time in times))

    @property
    @override
    def fewest_steps(self) -> int:
        """One for each interval."""
        return len(self.times) - 1

    @override
    def functions(self, t: Array, duration: float) -> Array:
        """Each is 1 at one node and 0 at the others."""
        return self.resting(t, duration, (0, 0))

    @override
    def resting(self, t: Array, duration: float, orders: tuple[int, int]) -> Array:
        """Return functions of which the end's own one is 0; the others start without slope."""
        from scipy.interpolate import CubicSpline

        values = np.eye(len(self.times))
        for end, order in zip((0, -1), orders, strict=True):
            values[end, end] = 0.0 if order else 1.0
        level = (1, np.zeros(len(self.times)))
        ends: Any = tuple(level if order > 1 else "not-a-knot" for order in orders)
        return np.asarray(CubicSpline(self.times, values, bc_type=ends)(t / duration))


def _check_degree(degree: int) -> None:
    as_whole(degree, "null motion: degree", 0, _HIGHEST)


def _check_space(space: str) -> None:
    as_choice(space, "null motion: space", ("null", "joint"))


@dataclass(frozen=True, eq=False)
class NullMotionTable:
    """A null motion at S stages, bound to one motion: ε = ε_0 + R E φ.

    Attributes
    ----------
    functions : (S, K)
        φ at the stages.
    frame : callable or None
        Returns R at the stages, (S, n, r), once it counts; None for the identity.
    rows : int
        Rows of E: r, or n without a frame.
    offset : (S, n) or None
        ε_0, the null motion of x = 0; None for zero.
    """

    functions: Array
    frame: Callable[[], Array] | None
    rows: int
    offset: Array | None = None

    @cached_property
    def _frame(self) -> Array | None:
        return self.frame and self.frame()

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.rows * int(self.functions.shape[1])

    def epsilon(self, x: Array) -> Array:
        """Return ε at the stages for coefficients `x`, (S, n)."""
        if self.offset is not None and not x.any():
            return self.offset
        inner: Array = self.functions @ x.reshape(self.rows, self.functions.shape[1]).T
        outer = inner if self._frame is None else np.einsum("snr,sr->sn", self._frame, inner)
        return outer if self.offset is None else outer + self.offset

    def pullback(self, epsilon_gradient: Array) -> Array:
        """Return ∂F/∂x for ∂F/∂ε (S, n): the transpose of the linear part of `epsilon`."""
        inner = epsilon_gradient
        if self._frame is not None:
            inner = np.einsum("snr,sn->sr", self._frame, inner)
        return np.asarray((inner.T @ self.functions).ravel())

    def matrix(self, before: int = 0) -> Array:
        """Return ∂ε/∂x at the stages, (S, n, size), after `before` columns of zeros."""
        frame = np.eye(self.rows)[None] if self._frame is None else self._frame
        (stages, count), n = self.functions.shape, frame.shape[1]
        full = np.zeros((stages, n, before + self.size))
        own = full[:, :, before:].reshape(stages, n, self.rows, count)
        np.multiply(frame[:, :, :, None], self.functions[:, None, None, :], out=own)
        return full
