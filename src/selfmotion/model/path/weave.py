"""A tool that swings from side to side while it goes along a path."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_number, read_only, series
from selfmotion.model.path.base import (
    Path,
    PathSamples,
    PathSeries,
    _InStep,
    check_path,
    check_vector,
    path_series,
    unit,
)
from selfmotion.model.path.pace import Pace, times_when

# Approximate number of samples of the seam's length, and all marks.
_ABOUT = 400
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
# Distance from a node at which changes of the speed are evaluated, relative to that of nodes.
_BESIDE = 1e-4
# Largest number of swings: an hour of a fast weld has some 6,000.
_MAX_SWINGS = 20_000
# A swing as wide as this [m] is an error of units.
_WIDEST = 0.5
# Polynomial from 0 to 1 with slopes and curvatures 0 at both ends: 10x³ - 15x⁴ + 6x⁵.
_STEP = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])


class Weave(_InStep, kind="weave"):
    """A path along which the tool swings from side to side, as welders do.

    At the time t the tool is next to the path by y(ψ(t)) along an axis of its own frame, with the
    path's orientation. ψ counts swings by the length of the path, so that they are equally long at
    any feed; their number is whole. The swing grows over the first one and vanishes over the last
    one as g(x) = 10x³ - 15x⁴ + 6x⁵, so that y, y′ and y″ are 0 at both ends.

    Parameters
    ----------
    path : Path
        The seam, at its own pace; its feed is that along the seam.
    amplitude : float
        How far the tool goes to each side [m].
    pitch : float
        Length of a swing there and back along the seam [m], about: a whole number fits.
    axis : (3,)
        Direction of the swing in the tool's frame.
    dwell : float
        Share of a swing that the tool stays at each edge, from 0 to below 0.5. With 0 the swing is
        the sine y = amplitude · g · sin 2πψ; otherwise the tool goes from edge to edge as g over ½
        - dwell of a swing, with continuous accelerations, half of it at whole ψ.

    Raises
    ------
    PathError
        A number is not as above, the axis is zero, or the path is shorter than two swings.
    """

    def __init__(
        self,
        path: Path,
        amplitude: float,
        pitch: float,
        *,
        axis: npt.ArrayLike = (0.0, 1.0, 0.0),
        dwell: float = 0.0,
    ) -> None:
        self._path = check_path(path, "weave: path")
        self._amplitude = as_number(
            amplitude, "weave: amplitude", above=0.0, most=_WIDEST, error=PathError
        )
        self._pitch = as_number(pitch, "weave: pitch", above=0.0, error=PathError)
        self._dwell = as_number(dwell, "weave: dwell", least=0.0, error=PathError)
        if self._dwell >= 0.5:
            raise PathError(
                f"weave: dwell is {self._dwell:g}, expected less than 0.5: that share of a swing "
                f"at each of two edges"
            )
        given = check_vector(axis, "weave: axis")
        if not np.any(given):
            raise PathError("weave: axis is zero, expected the direction of the swing")
        self._axis = read_only(unit(given))
        self.duration = path.duration
        length = float(self._lengths[1][-1])
        if length < 2.0 * self._pitch:
            raise PathError(
                f"weave: the path is {length:.6g} m long, expected two swings of {self._pitch:g} m "
                f"at least; lengths are in metres"
            )
        if length > _MAX_SWINGS * self._pitch:
            raise PathError(
                f"weave: a pitch of {self._pitch:g} m makes {length / self._pitch:.3g} swings, "
                f"expected {_MAX_SWINGS:,} at most; lengths are in metres"
            )

    @override
    def at_constant_speed(self) -> Weave:
        """As the seam, along which the swings stay where they are."""
        return Weave(
            self._path.at_constant_speed(),
            self._amplitude,
            self._pitch,
            axis=self._axis,
            dwell=self._dwell,
        )

    @property
    def swings(self) -> int:
        """Number of swings there and back."""
        return round(float(self._lengths[1][-1]) / self._pitch)

    @cached_property
    @override
    def marks(self) -> Array:
        """Also where the shape of the swing goes on by another formula."""
        breaks = np.array([1.0, self.swings - 1.0])
        if self._dwell:
            cycle = self._cycle[0][:-1]
            breaks = (np.arange(float(self.swings))[:, None] + cycle).ravel()
            breaks = np.append(breaks, self.swings)
        pace = self._count
        ends = np.zeros(len(breaks)), np.full(len(breaks), self.duration)
        found = np.concatenate([self._path.marks, pace.t, times_when(pace, breaks, *ends)])
        found = np.unique(found[(found >= 0.0) & (found <= self.duration)])
        # Of two equal times one is dropped; the last one is the end.
        distinct = np.append(np.diff(found) > 1e-12 * self.duration, True)
        return read_only(np.append(0.0, found[distinct & (found > 1e-12 * self.duration)]))

    @override
    def evaluate(self, t: Array) -> PathSamples:
        seam, count = self._path.evaluate(t), self._count
        away, slope = self._swing(count(t))
        beside = seam.rotation @ self._axis
        turning = np.cross(seam.twist[:, 3:], beside) * away[:, None]
        moving = beside * (slope * count(t, 1))[:, None]
        twist = np.hstack([seam.twist[:, :3] + turning + moving, seam.twist[:, 3:]])
        return PathSamples(t, seam.translation + beside * away[:, None], seam.rotation, twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries | None:
        """P + R axis y(ψ(t))."""
        known = path_series(self._path, middle, half)
        if known is None:
            return None
        count = self._count
        inner = count.series(middle, half)
        reach = series.after_first(inner)
        # Where the seam rests, nothing swings.
        reach = np.where(reach > 1e-12, reach, 1.0)
        outer = self._swing_series(count(middle), reach)
        beside = series.product(known.rotation, series.composed(outer, inner / reach))
        return PathSeries(known.translation + beside, known.rotation)

    def _swing(self, count: Array) -> tuple[Array, Array]:
        """Return y and dy/dψ at numbers of swings (K,)."""
        grown, grows = self._grown(count)
        inside = count - np.floor(count)
        if self._dwell:
            breaks, segments = self._cycle
            k = np.clip(np.searchsorted(breaks, inside, side="right") - 1, 0, len(breaks) - 2)
            x, segment = inside - breaks[k], segments[:, k]
            beside = _horner(segment, x)
            slope = _horner(segment[1:] * np.arange(1.0, len(segment))[:, None], x)
        else:
            angle = 2.0 * np.pi * inside
            beside, slope = np.sin(angle), 2.0 * np.pi * np.cos(angle)
        a = self._amplitude
        return a * grown * beside, a * (grows * beside + grown * slope)

    def _grown(self, count: Array) -> tuple[Array, Array]:
        """Return the share of the amplitude of a swing, and its slope."""
        last = float(self.swings)
        near = np.clip(np.minimum(count, last - count), 0.0, 1.0)
        slope = _horner(_STEP[1:, None] * np.arange(1.0, 6.0)[:, None], near)
        return _horner(_STEP[:, None], near), np.where(2.0 * count < last, slope, -slope)

    def _swing_series(self, count: Array, reach: Array) -> Array:
        """Return majorants of y on |ψ - count| ≤ reach (I,), no break being inside."""
        last = float(self.swings)
        near = np.minimum(count, last - count)
        # Between the first and the last swing nothing grows.
        steps = np.tile(_STEP[:, None], (1, len(count)))
        steps[:, near >= 1.0] = np.eye(6)[:1].T
        grown = series.of_polynomial(series.recentred(steps, near, reach))
        inside = count - np.floor(count)
        if self._dwell:
            breaks, segments = self._cycle
            beside = series.of_polynomial(series.of_pieces(breaks, segments, inside, reach))
        else:
            powers = np.arange(float(series.LENGTH))[:, None]
            each = 2.0 * np.pi * reach / np.maximum(powers, 1.0)
            each[0] = 1.0
            beside = np.cumprod(each, axis=0)
        return np.asarray(self._amplitude * series.product(grown, beside))

    @cached_property
    def _cycle(self) -> tuple[Array, Array]:
        """Return ends and coefficients of segments of a swing with dwells, (P + 1,), (6, P).

        From the middle to one edge, across to the other one, and back to the middle.
        """
        step = 0.5 - self._dwell
        lengths = [0.5 * step, self._dwell, step, self._dwell, 0.5 * step]
        across = (_STEP * 2.0)[:, None] / step ** np.arange(6.0)[:, None]
        across[0] -= 1.0
        # Half of it has gone by when the seam is crossed.
        half = series.recentred(across, np.array([0.5 * step]), np.array([1.0]))
        held = np.eye(6)[:1].T
        segments = np.hstack([half, held, -across, -held, across])
        return np.append(0.0, np.cumsum(lengths)), segments

    @cached_property
    def _count(self) -> Pace:
        """Number of swings as a function of time."""
        t, lengths = self._lengths
        share = self.swings / lengths[-1]
        step = _BESIDE * np.min(np.diff(t))
        before, after = np.maximum(t - step, 0.0), np.minimum(t + step, self.duration)
        bend = (self._speed(after) - self._speed(before)) / (after - before)
        return Pace(t, share * lengths, share * self._speed(t), share * bend)

    @cached_property
    def _lengths(self) -> tuple[Array, Array]:
        """Return times and how long the seam is by then [m]."""
        marks = self._path.marks
        segments = np.ceil(np.diff(marks) / self.duration * _ABOUT).astype(int)
        parts = [
            np.linspace(first, last, count, endpoint=False)
            for first, last, count in zip(marks[:-1], marks[1:], segments, strict=True)
        ]
        t = np.append(np.concatenate(parts), self.duration)
        h = np.diff(t)
        inside = t[:-1, None] + 0.5 * h[:, None] * (1.0 + _NODES)
        steps = 0.5 * h * (self._speed(inside.ravel()).reshape(inside.shape) @ _WEIGHTS)
        return t, np.append(0.0, np.cumsum(steps))

    def _speed(self, t: Array) -> Array:
        return np.asarray(np.linalg.norm(self._path.evaluate(t).twist[:, :3], axis=1))

    @override
    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "path": self._path.to_dict(),
            "amplitude": self._amplitude,
            "pitch": self._pitch,
            "axis": self._axis.tolist(),
            "dwell": self._dwell,
        }


def _horner(coefficients: Array, x: Array) -> Array:
    """Return Σ c_k xᵏ of coefficients (m + 1, K) or (m + 1, 1) at (K,)."""
    found = np.zeros_like(x)
    for coefficient in coefficients[::-1]:
        found = found * x + coefficient
    return found
