"""Polylines with rounded corners."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    Array,
    PathError,
    as_number,
    as_numbers,
    read_only,
    series,
    shown,
)
from selfmotion.model.path.base import Path, PathSamples, PathSeries, path_pose, rotvecs, unit
from selfmotion.model.path.waypoints import of_file, scalar_first
from selfmotion.model.task import SE3, Quaternion

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation
from selfmotion.model.path.simplified import merged

# Speed of a polyline before `Feed` [m/s].
_SPEED = 1.0
# The same where it only turns [rad/s].
_TURN_RATE = 10.0
# Poses nearer than this [s of the pace above] are the same.
_SAME = 1e-9
# Corners that are apart by less than this share of either meet.
_HARDLY = 1e-2
# Distance of the path from a corner, in units of d |Δv|, for a change of velocity Δv within ± d.
_ROUNDED = 5.0 / 32.0
# Coefficients of m(x) / d by u = x / d in the corner, of 1, u, u² …: ∫∫ 15/16 (1 - u²)² du du.
_CORNER = np.array([_ROUNDED, 0.5, 15.0 / 32.0, 0.0, -15.0 / 96.0, 0.0, 1.0 / 32.0])


class Polyline(Path, kind="polyline"):
    """Straight legs from pose to pose; corners are rounded within tolerances.

    In a leg the tool moves at a constant speed and turns about a fixed axis. Within a time ± d of a
    corner its velocity changes from that of one leg to that of the next by v₁ + Δv m'(x) with
    m''(x) ∝ (1 - x²/d²)²: the path is C³, and its distance from the corner is 5/32 d |Δv|.

    Poses on legs are no corners, and legs shorter than the tolerance between far longer ones are
    left out.

    Its own pace is 1 m/s, or 10 rad/s where it mostly turns: `Feed` gives it one that fits.

    Parameters
    ----------
    positions : (N, 3)
        [m], world axes.
    quaternions_wxyz : (N, 4) or scipy.spatial.transform.Rotation, optional
        Orientations [w, x, y, z]; normalised, either sign. Rotations of SciPy know their order,
        numbers have to be in this one. By default none is prescribed, for
        tasks that leave it free ('position').
    tolerance : float
        How far the tool may pass from a corner [m].
    turn_tolerance : float
        Likewise [rad].

    Raises
    ------
    PathError
        Shapes do not agree, fewer than two poses, all the same, a zero quaternion, a leg that turns
        back on the one before.
    """

    def __init__(
        self,
        positions: npt.ArrayLike,
        quaternions_wxyz: npt.ArrayLike | Rotation | None = None,
        *,
        tolerance: float = 1e-3,
        turn_tolerance: float = 1e-2,
    ) -> None:
        points = as_numbers(positions, "polyline: positions", error=PathError)
        self._oriented = quaternions_wxyz is not None
        if quaternions_wxyz is None:
            quaternions_wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (len(np.atleast_1d(points)), 1))
        turns = as_numbers(scalar_first(quaternions_wxyz), "polyline: quaternions", error=PathError)
        if points.ndim != 2 or points.shape[1:] != (3,) or len(points) < 2:
            raise PathError(
                f"polyline: positions have shape {points.shape}, expected (N, 3) with N ≥ 2"
            )
        if turns.shape != (len(points), 4):
            raise PathError(
                f"polyline: quaternions have shape {turns.shape}, expected ({len(points)}, 4)"
            )
        zero = np.flatnonzero(~np.any(turns, axis=1))
        if zero.size:
            raise PathError(f"polyline: quaternions[{zero[0]}] is zero, expected an orientation")
        what = "polyline: tolerance"
        self._tolerance = as_number(tolerance, what, above=0.0, error=PathError)
        what = "polyline: turn_tolerance"
        self._turn_tolerance = as_number(turn_tolerance, what, above=0.0, error=PathError)
        self._given = read_only(points), read_only(unit(turns))
        self._merged = merged(*self._given, self._tolerance, self._turn_tolerance)
        self._points, self._turns = (read_only(given[self._merged.kept]) for given in self._given)
        lasts = self._lasts
        if np.any(lasts <= _SAME):
            raise PathError(
                f"polyline: all {len(points)} poses are the same within its tolerances; a Dwell "
                f"stays where it is"
            )
        self._times = read_only(np.append(0.0, np.cumsum(lasts)))
        self.duration = float(self._times[-1])
        self._check_reversals()

    @classmethod
    def from_poses(cls, poses: list[SE3], **options: Any) -> Polyline:
        """Return the path through `poses` (SE3 or (4, 4)); options as in the class."""
        if not isinstance(poses, Sequence | np.ndarray):
            raise PathError(f"polyline: poses is {shown(poses)}, expected a list of poses")
        frames = [path_pose(pose, f"polyline: poses[{k}]") for k, pose in enumerate(poses)]
        turns = [np.roll(Quaternion(frame.rotation).coeffs(), 1) for frame in frames]
        return cls([frame.translation for frame in frames], turns, **options)

    @property
    @override
    def oriented(self) -> bool:
        """Where quaternions are given."""
        return self._oriented

    @property
    @override
    def knots(self) -> Array:
        """Starts and ends of corners, so that steps end there.

        Where there is hardly any straight leg between two corners, the second starts at the end of
        the first: very short steps would turn rounding into accelerations.
        """
        half = self._corners.half
        ends, starts = self._times[:-1] + half[:-1], self._times[1:] - half[1:]
        hardly = starts - ends <= _HARDLY * np.minimum(half[:-1], half[1:])
        dropped = np.isin(self._edges, starts[1:-1][hardly[1:-1]])
        return read_only(self._edges[~dropped])

    @property
    @override
    def marks(self) -> Array:
        """Starts and ends of all corners."""
        return read_only(self._edges)

    @property
    @override
    def rounded(self) -> Array:
        half, at = self._corners.half[1:-1], self.corner_times
        return np.stack([at - half, at + half], axis=1)

    @property
    def corner_times(self) -> Array:
        """When the corners between legs are passed [s]."""
        return self._times[1:-1]

    @property
    def pose_times(self) -> Array:
        """When each pose is passed, within the tolerance [s], (N,)."""
        shares = self._merged.shares
        return np.interp(shares, np.arange(len(self._times)), self._times)

    @cached_property
    def _edges(self) -> Array:
        legs = self._corners
        inner = self._times[1:-1]
        edges = np.concatenate([inner - legs.half[1:-1], inner + legs.half[1:-1]])
        edges = np.sort(np.concatenate([[0.0, self.duration], edges]))
        return np.asarray(edges[np.append(True, np.diff(edges) > _SAME * self.duration)])

    @cached_property
    def _lasts(self) -> Array:
        """Duration of each leg, (N - 1,)."""
        lengths_ = np.linalg.norm(np.diff(self._points, axis=0), axis=1) / _SPEED
        turning = np.linalg.norm(self._rotvecs, axis=1) / _TURN_RATE
        return np.asarray(np.maximum(lengths_, turning))

    @cached_property
    def _rotvecs(self) -> Array:
        """Rotation vector of each leg, in tool axes [rad], (N - 1, 3)."""
        return rotvecs(self._turns)

    @cached_property
    def _rotations(self) -> Any:
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self._turns, scalar_first=True)

    @cached_property
    def _corners(self) -> _Corners:
        # The ends are corners without a change.
        lasts = self._lasts
        speeds = np.diff(self._points, axis=0) / lasts[:, None]
        rates = self._rotvecs / lasts[:, None]
        before, after = np.r_[0, : len(lasts)], np.r_[: len(lasts), len(lasts) - 1]
        jumps = np.linalg.norm(speeds[after] - speeds[before], axis=1)
        turns = np.linalg.norm(rates[after] - rates[before], axis=1)
        tiny = np.finfo(float).tiny
        # The error of legs reduces the tolerance of the corners at their ends.
        errors, turned = (np.maximum(off[before], off[after]) for off in self._merged[2:])
        half = np.minimum(
            (self._tolerance - errors) / (_ROUNDED * np.maximum(jumps, tiny)),
            (self._turn_tolerance - turned) / (_ROUNDED * np.maximum(turns, tiny)),
        )
        half = np.minimum(half, 0.5 * np.minimum(lasts[before], lasts[after]))
        return _Corners(speeds[before], speeds[after], rates[before], rates[after], half)

    def _check_reversals(self) -> None:
        corners = self._corners
        middle = np.linalg.norm(corners.speed_in + corners.speed_out, axis=1) / _SPEED
        middle += np.linalg.norm(corners.rate_in + corners.rate_out, axis=1) / _TURN_RATE
        back = np.flatnonzero(middle < 1e-6)
        if back.size:
            raise PathError(
                f"polyline: at poses[{self._merged.kept[back[0]]}] the tool turns straight back; "
                f"end one polyline there and begin another: Feed(first, …) + Feed(second, …)"
            )

    @override
    def evaluate(self, t: Array) -> PathSamples:
        from scipy.spatial.transform import Rotation

        middles = 0.5 * (self._times[:-1] + self._times[1:])
        k = np.searchsorted(middles, t, side="right")
        corners, x = self._corners, t - self._times[k]
        after, share = _passed(x, corners.half[k])
        before = (x - after)[:, None]
        after, share = after[:, None], share[:, None]
        slow, fast = corners.speed_in[k], corners.speed_out[k]
        position = self._points[k] + slow * before + fast * after
        first = rotation = self._rotations[k]
        turning = np.zeros_like(position)
        # Products of rotations are by far the dearest part of it.
        if corners.rate_in.any() or corners.rate_out.any():
            first = rotation * Rotation.from_rotvec(corners.rate_in[k] * before)
            turning = rotation.apply(corners.rate_in[k]) * (1.0 - share)
            turning += first.apply(corners.rate_out[k]) * share
            rotation = first * Rotation.from_rotvec(corners.rate_out[k] * after)
        twist = np.hstack([slow + (fast - slow) * share, turning])
        return PathSamples(t, position, rotation.as_matrix(), twist)

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        k = np.searchsorted(0.5 * (self._times[:-1] + self._times[1:]), middle, side="right")
        corners, x = self._corners, middle - self._times[k]
        wide = np.where(corners.half[k] > 0.0, corners.half[k], 1.0)
        inside = np.abs(x) < corners.half[k]
        bend = wide * series.recentred(_CORNER[:, None], x / wide, half / wide)
        beside = np.zeros_like(bend)
        beside[:2] = np.where(x > 0.0, np.stack([x, half]), 0.0)
        after = np.where(inside, bend, beside)
        before = -after
        before[:2] += np.stack([x, half])
        parts = series.of_polynomial(before), series.of_polynomial(after)
        moved, turned = (
            np.linalg.norm(slow[k], axis=1) * parts[0] + np.linalg.norm(fast[k], axis=1) * parts[1]
            for slow, fast in (corners[:2], corners[2:4])
        )
        return PathSeries(moved, series.exponential(turned))

    @override
    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "positions": self._given[0].tolist(),
            "quaternions": self._given[1].tolist() if self._oriented else None,
            "tolerance": self._tolerance,
            "turn_tolerance": self._turn_tolerance,
        }

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        """Files say `quaternions`."""
        return super().from_dict(of_file(values), **context)


class _Corners(NamedTuple):
    """Velocities [m/s], rates in tool axes [rad/s] before and after each pose, and d [s]."""

    speed_in: Array
    speed_out: Array
    rate_in: Array
    rate_out: Array
    half: Array


def _passed(x: Array, half: Array) -> tuple[Array, Array]:
    """Return m(x), which goes over from 0 to x within ± d, and m'(x)."""
    u = np.clip(x / np.where(half > 0.0, half, 1.0), -1.0, 1.0)
    # ∫ 15/16 (1 - u²)² du.
    share = 0.5 + 15.0 / 16.0 * (u - 2.0 / 3.0 * u**3 + u**5 / 5.0)
    lengths_ = np.polynomial.polynomial.polyval(u, _CORNER)
    inside = np.abs(x) < half
    return np.where(inside, half * lengths_, np.maximum(x, 0.0)), np.where(inside, share, x > 0.0)
