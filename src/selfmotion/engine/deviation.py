"""The tool's deviation from the path as a function of decision variables.

In each group of rows that are relaxed together the deviation is δ = g(|s|) s with a cubic spline
s(t) = Σ c_i B_i(t) and g(r) = b sin(r)/r for a band b, or g = 1 without one: |δ| ≤ b holds by
construction at all times, and the optimisation stays unconstrained (the transformation of bounded
parameters of F. James and M. Roos, "Minuit", Comput. Phys. Commun. 10, 1975). s is an angle: in
metres a step of the optimiser would wind it up many times in a narrow band. With the path's pose
(p, R) and Q = I or R for positions in world or tool axes, the target is

    p + Q δ_v,  R exp(δ_ω),  ẋ_v + Q δ̇_v + Q̇ δ_v,  ω + R Jl(δ_ω) δ̇_ω,

with the left Jacobian Jl of SO(3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.path import Path, PathSamples
from selfmotion.task import (
    SMALL_TURN,
    Relaxation,
    left_derivative,
    left_matrices,
    skews,
    turn,
    turning,
)

_DEGREE = 3


@dataclass(frozen=True, eq=False)
class _Group:
    """The spline of one relaxation at the stages: B and dB/dt, (S, K) each."""

    indices: list[int]
    band: float
    values: Array
    rates: Array

    @property
    def size(self) -> int:
        return len(self.indices) * int(self.values.shape[1])


class _Bent(NamedTuple):
    """A group's s and ṡ (S, k), g, g'/r, (g'/r)'/r and s·ṡ (S,) at the stages."""

    s: Array
    sd: Array
    g: Array
    h: Array
    third: Array
    along: Array


class Deviation:
    """The path's poses and twists at S times, displaced by c (size,).

    Parameters
    ----------
    path : Path
    relaxations : sequence of Relaxation
    t : (S,)
        Times [s], for a Runge-Kutta grid those of its stages.
    pinned : (bool, bool)
        Whether the deviation vanishes, with its first two derivatives, at the first and the last
        time of the path, as it does at all other ends of windows.
    rests : (bool, bool)
        Whether only its first two derivatives vanish there, so that the tool rests.
    around : (size,), optional
        The deviation of c = 0; by default none.

    Attributes
    ----------
    size : int
        Number of entries of c.
    banded : (size,) of bool
        Which of them belong to a relaxation with a band.
    """

    def __init__(
        self,
        path: Path,
        relaxations: Sequence[Relaxation],
        t: Array,
        pinned: tuple[bool, bool],
        rests: tuple[bool, bool] = (False, False),
        around: Array | None = None,
    ) -> None:
        self._path, self._t = path, t
        self._groups = [_group(item, path.duration, t, pinned, rests) for item in relaxations]
        self._in_tool_axes = any(item.in_tool_axes for item in relaxations)
        self.size = sum(group.size for group in self._groups)
        banded = [np.full(group.size, np.isfinite(group.band)) for group in self._groups]
        self.banded = np.concatenate([np.zeros(0, dtype=bool), *banded])
        self._around = np.zeros(self.size) if around is None else around

    @cached_property
    def _nominal(self) -> PathSamples:
        return self._path.samples(self._t)

    def whole(self, c: Array) -> Array:
        """Return the deviation of c with that of c = 0, (size,)."""
        return self._around + c

    def target(self, c: Array) -> PathSamples:
        """Return the poses and twists that the tool follows."""
        nominal = self._nominal
        rows, rates = self._rows(self._bent(c))
        rotation, twist = nominal.rotation, nominal.twist.copy()
        twist[:, :3] += self._to_world(rows[:, :3], rates[:, :3])
        turned, angular = turning(rows[:, 3:], rates[:, 3:])
        twist[:, 3:] += turn(rotation, angular)
        translation = nominal.translation + self._shift(rows[:, :3])
        return PathSamples(nominal.t, translation, rotation @ turned, twist)

    def matrix(self, c: Array) -> Array:
        """Return ∂target/∂c, (S, 12, size): [∂p; world rotation vector of ∂R; ∂twist]."""
        stages = len(self._nominal.t)
        bent = self._bent(c)
        rows, rates = self._rows(bent)
        by_rows, by_rates = np.zeros((stages, 6, self.size)), np.zeros((stages, 6, self.size))
        first = 0
        for group, one in zip(self._groups, bent, strict=True):
            by_s, change = _slopes(one)
            part = slice(first, first + group.size)
            shape = (stages, len(group.indices), group.size)
            direct = by_s[:, :, :, None] * group.values[:, None, None, :]
            moving = by_s[:, :, :, None] * group.rates[:, None, None, :]
            moving += change[:, :, :, None] * group.values[:, None, None, :]
            by_rows[:, group.indices, part] = direct.reshape(shape)
            by_rates[:, group.indices, part] = moving.reshape(shape)
            first += group.size
        rotation = self._nominal.rotation
        result = np.zeros((stages, 12, self.size))
        result[:, 0:3] = self._shift(by_rows[:, :3])
        result[:, 6:9] = self._to_world(by_rows[:, :3], by_rates[:, :3])
        jacobian = left_matrices(rows[:, 3:])
        result[:, 3:6] = rotation @ jacobian @ by_rows[:, 3:]
        turning = left_derivative(rows[:, 3:], rates[:, 3:]) @ by_rows[:, 3:]
        result[:, 9:12] = rotation @ (turning + jacobian @ by_rates[:, 3:])
        return result

    def pullback(self, c: Array, cotangents: Array) -> Array:
        """Return Σ cotangentsᵀ ∂target/∂c for cotangents (S, 12) in the order of `matrix`."""
        bent, nominal = self._bent(c), self._nominal
        rows, rates = self._rows(bent)
        back = nominal.rotation.transpose(0, 2, 1)
        by_rows, by_rates = np.empty((len(cotangents), 6)), np.empty((len(cotangents), 6))
        place, rate = cotangents[:, :3], cotangents[:, 6:9]
        if self._in_tool_axes:
            spin = skews(nominal.twist[:, 3:])
            place, rate = turn(back, place - turn(spin, rate)), turn(back, rate)
        by_rows[:, :3], by_rates[:, :3] = place, rate
        tilt, spun = turn(back, cotangents[:, 3:6]), turn(back, cotangents[:, 9:])
        jacobian = left_matrices(rows[:, 3:]).transpose(0, 2, 1)
        slope = left_derivative(rows[:, 3:], rates[:, 3:]).transpose(0, 2, 1)
        by_rows[:, 3:] = turn(jacobian, tilt) + turn(slope, spun)
        by_rates[:, 3:] = turn(jacobian, spun)
        parts = [np.zeros(0)]
        for group, one in zip(self._groups, bent, strict=True):
            # Both matrices are symmetric.
            by_s, change = _slopes(one)
            own, moving = by_rows[:, group.indices], by_rates[:, group.indices]
            direct = np.einsum("sij,sj->si", by_s, own) + np.einsum("sij,sj->si", change, moving)
            along = np.einsum("sij,sj->si", by_s, moving)
            parts.append((direct.T @ group.values + along.T @ group.rates).ravel())
        return np.concatenate(parts)

    def nearest(self, rows: Array) -> Array:
        """Return c (size,) whose deviations are nearest to some rows (S, 6), which are in band."""
        found: list[Array] = [np.zeros(0)]
        for group in self._groups:
            delta = rows[:, group.indices]
            s = delta
            if np.isfinite(group.band):
                share = np.linalg.norm(delta, axis=1)[:, None] / group.band
                s = (
                    delta
                    * np.arcsin(np.clip(share, 0.0, 1.0))
                    / np.maximum(group.band * share, np.finfo(float).tiny)
                )
            found.append(
                np.asarray(np.linalg.lstsq(group.values, s)[0].T.ravel(), dtype=np.float64)
            )
        return np.concatenate(found) - self._around

    def _bent(self, c: Array) -> list[_Bent]:
        """Return the groups' splines and what the sine makes of them."""
        bent, first, total = [], 0, self.whole(c)
        for group in self._groups:
            part = total[first : first + group.size].reshape(len(group.indices), -1)
            first += group.size
            s, sd = group.values @ part.T, group.rates @ part.T
            bent.append(_Bent(s, sd, *_squash(s, group.band), np.einsum("si,si->s", s, sd)))
        return bent

    def _rows(self, bent: list[_Bent]) -> tuple[Array, Array]:
        """Return δ and δ̇, rows x, y, z, rx, ry, rz, (S, 6) each."""
        rows, rates = np.zeros((len(self._nominal.t), 6)), np.zeros((len(self._nominal.t), 6))
        for group, (s, sd, g, h, _, along) in zip(self._groups, bent, strict=True):
            rows[:, group.indices] += g[:, None] * s
            rates[:, group.indices] += g[:, None] * sd + (h * along)[:, None] * s
        return rows, rates

    def _shift(self, delta: Array) -> Array:
        """Return Q δ for δ (S, 3) or (S, 3, k)."""
        return turn(self._nominal.rotation, delta) if self._in_tool_axes else delta

    def _to_world(self, delta: Array, rate: Array) -> Array:
        """Return Q δ̇ + Q̇ δ, Q̇ = [ω]× Q in tool axes."""
        if not self._in_tool_axes:
            return rate
        spin = skews(self._nominal.twist[:, 3:])
        return self._shift(rate) + turn(spin, self._shift(delta))


def _group(
    item: Relaxation,
    duration: float,
    t: Array,
    pinned: tuple[bool, bool],
    rests: tuple[bool, bool],
) -> _Group:
    from scipy.interpolate import BSpline

    start, end = item.window(duration)
    knots = np.concatenate(
        [[start] * _DEGREE, np.linspace(start, end, item.intervals + 1), [end] * _DEGREE]
    )
    count = item.intervals + _DEGREE
    # A clamped spline's value and first two derivatives at an end depend on the three functions
    # nearest to it.
    slack = 1e-9 * duration
    keep_first = start <= slack and not pinned[0]
    keep_last = end >= duration - slack and not pinned[1]
    # Coefficients with the same label are equal, those with a negative one are zero: three equal
    # ones at an end leave a value there, without slope or curvature.
    labels = np.arange(count)
    for first, keep, rest in ((0, keep_first, rests[0]), (count - 3, keep_last, rests[1])):
        if rest or not keep:
            own = labels[first : first + 3]
            labels[np.isin(labels, own)] = own.min() if keep else -1
    kept = np.array([labels == label for label in np.unique(labels) if label >= 0], dtype=float).T
    kept = kept.reshape(count, -1)
    inside = (t >= start) & (t <= end)
    spline = BSpline(knots, np.eye(count), _DEGREE, extrapolate=True)
    values, rates = np.zeros((len(t), count)), np.zeros((len(t), count))
    values[inside] = spline(t[inside])
    rates[inside] = spline(t[inside], 1)
    return _Group(item.indices, item.band, values @ kept, rates @ kept)


def _slopes(bent: _Bent) -> tuple[Array, Array]:
    """Return ∂δ/∂s = g I + h s sᵀ, which is ∂δ̇/∂ṡ as well, and its derivative in time ∂δ̇/∂s."""
    s, sd, g, h, third, along = bent
    eye = np.eye(s.shape[1])
    outer, mixed = s[:, :, None] * s[:, None, :], s[:, :, None] * sd[:, None, :]
    by_s = g[:, None, None] * eye + h[:, None, None] * outer
    change = (h * along)[:, None, None] * eye + (third * along)[:, None, None] * outer
    change += h[:, None, None] * (mixed + mixed.transpose(0, 2, 1))
    return by_s, change


def _squash(s: Array, band: float) -> tuple[Array, Array, Array]:
    """Return g(r), g'/r and (g'/r)'/r at r = |s|, for g = b sin(r)/r; 1, 0, 0 without a band."""
    if not np.isfinite(band):
        return np.ones(len(s)), np.zeros(len(s)), np.zeros(len(s))
    first, second, third = _sine_series(np.linalg.norm(s, axis=1))
    return band * first, band * second, band * third


def _sine_series(u: Array) -> tuple[Array, Array, Array]:
    """Return f = sin u / u, f'/u and (f'/u)'/u."""
    small = np.abs(u) < SMALL_TURN
    safe = np.where(small, 1.0, u)
    sine, cosine = np.sin(safe), np.cos(safe)
    first = np.where(small, 1.0 - u**2 / 6.0 + u**4 / 120.0, sine / safe)
    second = np.where(
        small, -1.0 / 3.0 + u**2 / 30.0 - u**4 / 840.0, (safe * cosine - sine) / safe**3
    )
    third = np.where(
        small,
        1.0 / 15.0 - u**2 / 210.0 + u**4 / 7560.0,
        (3.0 * sine - 3.0 * safe * cosine - safe**2 * sine) / safe**5,
    )
    return first, second, third
