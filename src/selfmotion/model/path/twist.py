"""A tool motion given by its velocity."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_numbers, plain_numbers, series, shown
from selfmotion.model.path.base import Path, PathSamples, PathSeries, check_duration, path_pose
from selfmotion.model.task import SE3, Quaternion

# Degree of the Chebyshev segments.
_DEGREE = 24
# Chebyshev tail, relative to the largest velocity, at which a segment counts as resolved.
_TAIL = 1e-13
# Shortest segment, as a share of the duration.
_SHORTEST = 2.0**-12
# Places between its nodes at which a segment is compared with the velocity …
_BESIDES = 16
# … or as many as lie in it of this number on the whole path …
_IN_ALL = 2048
# … and the largest difference, relative to the largest velocity.
_DIFFERENCE = 1e-9
# Largest difference of two segments at their common end, likewise.
_JUMP = 1e-9
# Largest step of the orientation's integration, as a share of a segment.
_STEP = 0.25
# A path that turns farther than this [rad] is an error.
_MAX_TURNED = 300.0


class TwistPath(Path, kind="twist"):
    """A start pose and a velocity function.

    The function is approximated by piecewise Chebyshev polynomials to 13 digits at its samples, of
    which there are 2,048 at least: changes within less than a thousandth of the duration may be
    missed. Positions are their exact integral, orientations that of an eighth-order Runge-Kutta
    method (DOP853) by segments.

    Parameters
    ----------
    start : SE3 or (4, 4)
        Pose of the tool at t = 0 [m], world axes.
    velocity : callable
        ``velocity(t)`` → [v, ω] (6,) or [v] (3,) at time t [s], world axes, smooth.
    duration : float
        [s].

    Raises
    ------
    PathError
        The function returns something else, or jumps.
    """

    def __init__(
        self,
        start: SE3 | npt.ArrayLike,
        velocity: Callable[[float], npt.ArrayLike],
        duration: float,
    ) -> None:
        pose = path_pose(start, "twist path: start")
        if not callable(velocity):
            raise PathError(f"twist path: velocity is {shown(velocity)}, expected a function of t")
        self._set(pose, *_resolve(velocity, check_duration(duration)))

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> TwistPath:
        """Restore it from the polynomials: the function is not in a file."""
        path = cls.__new__(cls)
        path._set(
            path_pose(values["start"], "twist path: start"),
            values["breaks"],
            values["coefficients"],
        )
        return path

    def _set(self, start: SE3, breaks: npt.ArrayLike, coefficients: npt.ArrayLike) -> None:
        self._start = start
        self._breaks = as_numbers(breaks, "twist path: breaks", error=PathError)
        what = "twist path: coefficients"
        self._coefficients = as_numbers(coefficients, what, error=PathError)
        self.duration = float(self._breaks[-1])
        # |T_k| ≤ 1. A number that cannot be meant would be integrated for ever.
        rates = np.abs(self._coefficients[:, :, 3:]).sum(axis=(1, 2))
        angle = float(np.diff(self._breaks) @ rates)
        if not angle <= _MAX_TURNED:
            raise PathError(
                f"twist path: turns by up to {angle:.3g} rad on its way, expected at most "
                f"{_MAX_TURNED:g}; join shorter ones"
            )

    @property
    def start(self) -> SE3:
        """Pose of the tool at t = 0."""
        return SE3(self._start)

    @property
    @override
    def knots(self) -> Array:
        return self._breaks

    @cached_property
    def _displacements(self) -> tuple[Array, Array]:
        """Position polynomials of the pieces (K, d + 2, 3) and displacement at their start."""
        half = 0.5 * np.diff(self._breaks)
        integrals = np.array(
            [
                chebyshev.chebint(segment[:, :3], lbnd=-1) * h
                for segment, h in zip(self._coefficients, half, strict=True)
            ]
        )
        lengths = np.array([chebyshev.chebval(1.0, integral) for integral in integrals])
        return integrals, np.vstack([np.zeros(3), np.cumsum(lengths, axis=0)])

    @cached_property
    def _orientation(self) -> Callable[[Array], Array] | None:
        """Quaternions [x, y, z, w] over time, (4, K), or None where the tool does not turn."""
        if not np.any(self._coefficients[:, :, 3:]):
            return None
        from scipy.integrate import solve_ivp

        def rate(t: float, quaternion: Array) -> Array:
            omega = self._twist(np.array([t]))[0, 3:]
            x, w = quaternion[:3], quaternion[3]
            return 0.5 * np.append(w * omega + np.cross(omega, x), -omega @ x)

        # Segment by segment: steps across segments would not resolve them.
        at, solutions = Quaternion(self._start.rotation).coeffs(), []
        for left, right in pairwise(self._breaks.tolist()):
            # Of errors too small for numbers the solver divides nothing by nothing.
            with np.errstate(invalid="ignore"):
                solution = solve_ivp(
                    rate,
                    (left, right),
                    at,
                    method="DOP853",
                    rtol=1e-12,
                    atol=1e-13,
                    max_step=_STEP * (right - left),
                    dense_output=True,
                )
            solutions.append(solution.sol)
            at = solution.y[:, -1]

        def quaternions(t: Array) -> Array:
            k, _ = self._local(t)
            found = np.empty((4, len(t)))
            for number in np.unique(k):
                found[:, k == number] = solutions[number](t[k == number])
            return found

        return quaternions

    @override
    def twist(self, t: npt.ArrayLike) -> Array:
        """Without the pose, which takes most of the time."""
        times, single = self._given_times(t)
        twists = self._twist(times)
        return twists[0] if single else twists

    def _local(self, t: Array) -> tuple[npt.NDArray[np.intp], Array]:
        k = np.clip(np.searchsorted(self._breaks, t, side="right") - 1, 0, len(self._breaks) - 2)
        left, right = self._breaks[k], self._breaks[k + 1]
        return k, (2.0 * t - left - right) / (right - left)

    def _twist(self, t: Array) -> Array:
        k, s = self._local(t)
        basis = _chebyshev(s, self._coefficients.shape[1])
        twist: Array = np.einsum("kd,kdi->ki", basis, self._coefficients[k])
        return twist

    @override
    def evaluate(self, t: Array) -> PathSamples:
        k, s = self._local(t)
        integrals, offsets = self._displacements
        basis = _chebyshev(s, integrals.shape[1])
        position = self._start.translation + offsets[k]
        position = position + np.einsum("kd,kdi->ki", basis, integrals[k])
        return PathSamples(t, position, self._rotation(t), self._twist(t))

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        """With Ṙ = [ω]R, R is bounded by the exponential of ∫|ω|."""
        k, _ = self._local(middle)
        share = 2.0 * half / np.diff(self._breaks)[k]
        segments = self._coefficients[k].transpose(1, 0, 2)
        step = half / np.arange(1.0, series.LENGTH)[:, None]
        found = []
        for rates in (segments[:, :, :3], segments[:, :, 3:]):
            angle_series = np.zeros((series.LENGTH, len(middle)))
            angle_series[1:] = series.of_chebyshev(rates, share)[:-1] * step
            found.append(angle_series)
        return PathSeries(found[0], series.exponential(found[1]))

    def _rotation(self, t: Array) -> Array:
        if self._orientation is None:
            return np.tile(self._start.rotation, (len(t), 1, 1))
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_quat(self._orientation(t).T).as_matrix())

    @override
    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "start": self._start.homogeneous.tolist(),
            "breaks": self._breaks.tolist(),
            "coefficients": self._coefficients.tolist(),
        }


def _chebyshev(s: Array, count: int) -> Array:
    """Return T_j(s) for j below count, (K, count): cos(j arccos s), at once for all j."""
    angles = np.arccos(np.clip(s, -1.0, 1.0))
    return np.asarray(np.cos(angles[:, None] * np.arange(float(count))))


def _resolve(
    velocity: Callable[[float], npt.ArrayLike], duration: float
) -> tuple[list[float], list[Array]]:
    """Return breaks and Chebyshev coefficients of pieces that resolve the velocity."""
    scale = float(np.abs(_samples(velocity, np.linspace(0.0, duration, 9))).max())
    pending, breaks, segments = [(0.0, duration)], [0.0], []
    nodes = chebyshev.chebpts1(_DEGREE + 1)
    while pending:
        left, right = pending.pop()
        times = 0.5 * (left + right) + 0.5 * (right - left) * nodes
        values = _samples(velocity, times)
        coefficients = np.asarray(chebyshev.chebfit(nodes, values, _DEGREE), dtype=np.float64)
        scale = max(scale, float(np.abs(values).max()))
        resolved = np.abs(coefficients[-3:]).max() <= _TAIL * max(scale, 1e-300)
        if resolved and _fits(velocity, left, right, coefficients, duration, scale):
            segments.append(coefficients)
            breaks.append(right)
        elif right - left < _SHORTEST * duration:
            raise PathError(
                f"twist path: the velocity is not smooth near t = {left:.6g} s; "
                f"split the path there, or give poses (Waypoints)"
            )
        else:
            middle = 0.5 * (left + right)
            pending += [(middle, right), (left, middle)]
    _check_jumps(breaks, segments, scale)
    _check_ends(velocity, duration, segments, scale)
    return breaks, segments


def _fits(
    velocity: Callable[[float], npt.ArrayLike],
    left: float,
    right: float,
    coefficients: Array,
    duration: float,
    scale: float,
) -> bool:
    """Return whether a segment equals the velocity between its nodes."""
    count = max(_BESIDES, int(np.ceil(_IN_ALL * (right - left) / duration)))
    s = np.linspace(-1.0, 1.0, count + 1)[:-1] + 1.0 / count
    values = _samples(velocity, 0.5 * (left + right + (right - left) * s))
    difference = np.abs(chebyshev.chebval(s, coefficients).T - values).max()
    return bool(difference <= _DIFFERENCE * max(scale, 1e-300))


def _check_jumps(breaks: list[float], segments: list[Array], scale: float) -> None:
    """Refuse a velocity that jumps from one piece to the next, which each by itself may not."""
    for time, before, after in zip(breaks[1:-1], segments[:-1], segments[1:], strict=True):
        jump = chebyshev.chebval(-1.0, after) - chebyshev.chebval(1.0, before)
        size = float(np.abs(jump).max())
        if not size <= _JUMP * max(scale, 1e-300):
            raise PathError(
                f"twist path: the velocity jumps by {size:.3g} m/s or rad/s at t = {time:.6g} s; "
                f"no arm follows that: split the path there, or give poses (Waypoints)"
            )


def _check_ends(
    velocity: Callable[[float], npt.ArrayLike], duration: float, segments: list[Array], scale: float
) -> None:
    """Refuse a velocity that jumps next to an end, beyond all samples."""
    for time, place, segment in ((0.0, -1.0, segments[0]), (duration, 1.0, segments[-1])):
        at_end = _samples(velocity, np.array([time]))[0]
        jump = float(np.abs(chebyshev.chebval(place, segment) - at_end).max())
        if not jump <= _JUMP * max(scale, 1e-300):
            raise PathError(
                f"twist path: the velocity jumps by {jump:.3g} m/s or rad/s next to t = "
                f"{time:.6g} s; no arm follows that"
            )


def _samples(velocity: Callable[[float], npt.ArrayLike], times: Array) -> Array:
    """Return the velocity at times (K,) as rows (K, 6)."""
    # Of a copy, as a function may return the same array each time.
    given = [copy(velocity(t)) for t in times.tolist()]
    # Thousands of samples are checked at once; one of several kinds, or a bad one, by itself.
    values = plain_numbers(given)
    if values is not None and np.isfinite(values).all():
        if values.shape == (len(times), 6):
            return values
        if values.shape == (len(times), 3):
            return np.hstack([values, np.zeros_like(values)])
    return np.array([_as_twist(value, t) for value, t in zip(given, times, strict=True)])


def _as_twist(given: npt.ArrayLike, t: float) -> Array:
    """Return what the velocity is at a time as a twist (6,)."""
    what, expected = f"twist path: velocity({t:.6g})", "[v, ω] (6,) or [v] (3,), finite"
    value = as_numbers(given, what, expected, error=PathError)
    if value.shape == (3,):
        value = np.concatenate([value, np.zeros(3)])
    return as_numbers(value, what, expected, (6,), PathError)
