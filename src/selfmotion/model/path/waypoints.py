"""A smooth tool motion through given poses at given times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import (
    Array,
    FileFormatError,
    Ints,
    PathError,
    as_choice,
    as_number,
    as_numbers,
    as_path,
    read_only,
    read_table,
    series,
    shown,
)
from selfmotion.model.path.base import Path, PathSamples, PathSeries, path_pose, rotvecs, unit
from selfmotion.model.task import SE3, Quaternion

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation
from selfmotion.model.path.splines import Cubics, Turning

# Key of quaternions in files.
_IN_FILES = "quaternions"
# Their argument.
_ARGUMENT = "quaternions_wxyz"


def bends(legs: Array, angle: float, least: float) -> npt.NDArray[np.bool_]:
    """Return the mask of direction changes of legs (N - 1, 3) above `angle`, (N - 2,)."""
    lengths = np.linalg.norm(legs, axis=1)
    cosine = np.einsum("ki,ki->k", legs[:-1], legs[1:])
    # Very short legs have no direction, hence no kink.
    moves = (lengths[:-1] > least) & (lengths[1:] > least)
    return np.asarray((cosine < np.cos(angle) * lengths[:-1] * lengths[1:]) & moves)


def as_table(values: npt.ArrayLike, name: str) -> Array:
    """Return numbers of waypoints; PathError with the first that is none."""
    return as_numbers(values, f"waypoints: {name}", error=PathError)


def scalar_first(orientations: npt.ArrayLike | Rotation) -> npt.ArrayLike:
    """Return orientations as quaternions [w, x, y, z]: SciPy's know their own order."""
    if hasattr(orientations, "as_quat"):
        return np.asarray(orientations.as_quat(scalar_first=True), dtype=np.float64)
    return orientations


def of_file(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a file as arguments: its `quaternions` are w, x, y, z."""
    given = dict(values)
    if _IN_FILES in given:
        if _ARGUMENT in given:
            raise PathError(f"{_IN_FILES} and {_ARGUMENT} are one thing; give one of them")
        given[_ARGUMENT] = given.pop(_IN_FILES)
    return given


def check_waypoints(t: Array, points: Array, turns: Array) -> None:
    """Raise PathError unless times (N,) increase, with positions and quaternions for each."""
    if t.ndim != 1 or len(t) < 2:
        raise PathError(f"waypoints: t has shape {t.shape}, expected (N,) with N ≥ 2")
    for name, array, width in (("positions", points, 3), ("quaternions", turns, 4)):
        if array.shape != (len(t), width):
            raise PathError(
                f"waypoints: {name} has shape {array.shape}, expected ({len(t)}, {width})"
            )
    late = np.flatnonzero(np.diff(t) <= 0)
    if late.size:
        row = int(late[0]) + 1
        raise PathError(
            f"waypoints: t[{row}] = {t[row]} does not come after t[{row - 1}] = {t[row - 1]}"
        )
    zero = np.flatnonzero(np.linalg.norm(turns, axis=1) < 1e-9)
    if zero.size:
        raise PathError(f"waypoints: quaternions[{zero[0]}] is zero")


_COLUMNS = ("t", "x", "y", "z")
_QUATERNION = ("qw", "qx", "qy", "qz")
# Poses nearer than this [m], and cosine of half the angle, are the same.
_REST = 1e-12
# Legs that turn by less than this [rad] have no direction of rotation.
_TURNED = 1e-3


class Waypoints(Path, kind="waypoints"):
    """Poses with times, joined smoothly in position and on SO(3), exact at each waypoint.

    Positions follow a cubic spline (C², not-a-knot), orientations scipy's `RotationSpline` (C²).
    Two equal poses in a row are a pause, before and after which the tool comes to rest.

    Parameters
    ----------
    t : (N,)
        Times [s], increasing; the first one becomes 0.
    positions : (N, 3)
        [m], world axes.
    quaternions_wxyz : (N, 4) or scipy.spatial.transform.Rotation, optional
        Orientations [w, x, y, z]; normalised, either sign. Rotations of SciPy know their order,
        numbers have to be in this one. By default none is prescribed, for
        tasks that leave it free ('position').
    corners : {"blend", "stop"}
        Motion at kinks of the path (see `corner_angle`): a smooth one through the waypoint, which
        deviates from the straight legs on both sides, or a rest in it, and at both ends, on the
        legs. Either way each waypoint is reached at its time.
    corner_angle : float
        Change of direction from one leg to the next, of motion or of rotation, that counts as a
        kink [rad].

    Raises
    ------
    PathError
        Shapes do not agree, fewer than two poses, times do not increase, a zero quaternion.
    """

    def __init__(
        self,
        t: npt.ArrayLike,
        positions: npt.ArrayLike,
        quaternions_wxyz: npt.ArrayLike | Rotation | None = None,
        *,
        corners: str = "blend",
        corner_angle: float = np.pi / 6,
    ) -> None:
        times, points = as_table(t, "t"), as_table(positions, "positions")
        self._oriented = quaternions_wxyz is not None
        if quaternions_wxyz is None:
            quaternions_wxyz = np.tile([1.0, 0.0, 0.0, 0.0], (len(np.atleast_1d(points)), 1))
        turns = as_table(scalar_first(quaternions_wxyz), "quaternions")
        check_waypoints(times, points, turns)
        as_choice(corners, "waypoints: corners", ("blend", "stop"), PathError)
        what = "waypoints: corner_angle"
        corner_angle = as_number(corner_angle, what, above=0.0, error=PathError)
        self._t = read_only(times - times[0])
        self.duration = float(self._t[-1])
        self._points = read_only(points)
        self._turns = read_only(unit(turns))
        self._corners = corners
        self._corner_angle = float(corner_angle)

    @classmethod
    def from_poses(cls, t: npt.ArrayLike, poses: list[SE3], **options: Any) -> Waypoints:
        """Return the path through `poses` (SE3 or (4, 4)) at times `t`; options as in the class."""
        if not isinstance(poses, Sequence | np.ndarray):
            raise PathError(f"waypoints: poses is {shown(poses)}, expected a list of poses")
        frames = [path_pose(pose, f"waypoints: poses[{k}]") for k, pose in enumerate(poses)]
        turns = [np.roll(Quaternion(frame.rotation).coeffs(), 1) for frame in frames]
        return cls(t, [frame.translation for frame in frames], turns, **options)

    @classmethod
    def from_csv(cls, file: str | FilePath, **options: Any) -> Waypoints:
        """Read ``t,x,y,z,qw,qx,qy,qz`` with a header line [s, m]; the quaternion may be missing.

        Raises
        ------
        FileFormatError
            The file cannot be read, a column is missing or unknown, a row is short or not
            numeric; the row is named.
        """
        header, table = read_table(as_path(file))
        wanted = {*_COLUMNS, *_QUATERNION} if "qw" in header else {*_COLUMNS}
        if set(header) != wanted:
            raise FileFormatError(
                f"{file}: the header is {','.join(header)}, expected {','.join(_COLUMNS)} or "
                f"{','.join(_COLUMNS + _QUATERNION)}"
            )
        if len(table) < 2:
            raise FileFormatError(f"{file}: has {len(table)} rows, expected at least two poses")
        column = {name: table[:, i] for i, name in enumerate(header)}
        turns = None
        if "qw" in column:
            turns = np.stack([column[name] for name in _QUATERNION], axis=1)
        points = np.stack([column[name] for name in _COLUMNS[1:]], axis=1)
        try:
            return cls(column["t"], points, turns, **options)
        except PathError as error:
            raise FileFormatError(f"{file}: {error}") from error

    @property
    @override
    def oriented(self) -> bool:
        """Where quaternions are given."""
        return self._oriented

    @property
    def knots(self) -> Array:
        """The corners' times [s], with start and end; in between the path is C²."""
        return read_only(self._t[self._bounds])

    @property
    @override
    def marks(self) -> Array:
        """The waypoints' times."""
        return self._t

    @property
    def waypoint_times(self) -> Array:
        """The waypoints' times [s], (N,)."""
        return self._t

    @property
    def corner_times(self) -> Array:
        """Times [s] of the waypoints where the tool comes to rest: corners and pauses."""
        return self._t[self._stops]

    def between_corners(self) -> list[Waypoints]:
        """Return the path in pieces that rest nowhere, from one corner to the next."""
        turns = self._turns if self._oriented else None
        parts = [slice(first, last + 1) for first, last in pairwise(self._bounds)]
        return [
            Waypoints(self._t[part], self._points[part], None if turns is None else turns[part])
            for part in parts
        ]

    @cached_property
    def _stops(self) -> npt.NDArray[np.bool_]:
        legs = np.diff(self._points, axis=0)
        lengths = np.linalg.norm(legs, axis=1)
        stops = np.zeros(len(self._t), dtype=bool)
        if self._corners == "stop":
            stops[1:-1] = bends(legs, self._corner_angle, 0.0)
            stops[1:-1] |= bends(rotvecs(self._turns), self._corner_angle, _TURNED)
            stops[[0, -1]] = True
        # Two equal poses in a row are a pause: the tool comes to rest, and stays.
        alike = np.abs(np.einsum("ki,ki->k", self._turns[:-1], self._turns[1:]))
        pauses = (lengths <= _REST) & (alike >= 1.0 - _REST)
        stops[:-1] |= pauses
        stops[1:] |= pauses
        return stops

    @cached_property
    def _bounds(self) -> npt.NDArray[np.intp]:
        """Waypoints at the ends of the path's smooth sections."""
        return np.flatnonzero(self._stops | (self._t == 0.0) | (self._t == self.duration))

    @cached_property
    def _sections(self) -> tuple[npt.NDArray[np.intp], list[tuple[Cubics, Turning]]]:
        """First waypoint of each piece between corners, and its (position, rotation) splines."""
        bounds, splines = self._bounds, []
        for first, last in pairwise(bounds):
            part = slice(first, last + 1)
            t = self._t[part]
            splines.append((Cubics(t, self._points[part]), Turning(t, self._turns[part])))
        return bounds[:-1], splines

    def _warp(self, t: Array) -> tuple[Array, Array]:
        """Return the time τ on the splines and dτ/dt: τ = t, but resting at the corners."""
        k, h, (a, c3, c4, c5) = self._warps(t)
        u = (t - self._t[k]) / h
        tau = a * u + u**3 * (c3 + u * (c4 + u * c5))
        slope = a + u**2 * (3 * c3 + u * (4 * c4 + 5 * u * c5))
        return self._t[k] + h * tau, slope

    def _warps(self, t: Array) -> tuple[Ints, Array, Array]:
        """Return the legs of times (K,), how long they last, and their `_warp_powers`, (4, K)."""
        k = np.searchsorted(self._t[1:-1], t, side="right")
        return k, self._t[k + 1] - self._t[k], self._warp_powers.take(k, axis=1)

    @cached_property
    def _warp_powers(self) -> Array:
        """The coefficients of u, u³, u⁴, u⁵ in τ on each leg, (4, N - 1).

        Next to a corner τ is the quintic between the waypoints' times with slope 0 at the corner,
        1 at the other end, and no acceleration at either.
        """
        a, b = 1.0 * ~self._stops[:-1], 1.0 * ~self._stops[1:]
        return np.stack([a, 10 - 6 * a - 4 * b, -15 + 8 * a + 7 * b, 6 - 3 * a - 3 * b])

    @override
    def evaluate(self, t: Array) -> PathSamples:
        tau, slope = self._warp(t)
        starts, splines = self._sections
        section = np.searchsorted(self._t[starts], tau, side="right") - 1
        position, rotation = np.empty((len(t), 3)), np.empty((len(t), 3, 3))
        twist = np.empty((len(t), 6))
        for index, (line, turned) in enumerate(splines):
            here: Any = slice(None) if len(splines) == 1 else np.flatnonzero(section == index)
            own = tau[here]
            if len(own):
                position[here], twist[here, :3] = line.at(own)
                rotation[here], twist[here, 3:] = turned.at(own)
        return PathSamples(t, position, rotation, twist * slope[:, None])

    @override
    def series(self, middle: Array, half: Array) -> PathSeries:
        """Cubics of positions and of rotation vectors, after the warp."""
        k, lasts, (first, *higher) = self._warps(middle)
        none = np.zeros_like(first)
        warp = np.stack([none, first, none, *higher]) * lasts
        tau = series.of_polynomial(
            series.recentred(warp, (middle - self._t[k]) / lasts, half / lasts)
        )
        at, _ = self._warp(middle)
        # Of the range of τ; where it does not move, of any.
        reach = np.where(series.after_first(tau) > 0.0, series.after_first(tau), 1.0)
        starts, splines = self._sections
        section = np.searchsorted(self._t[starts], at, side="right") - 1
        found = PathSeries(np.empty_like(tau), np.empty_like(tau))
        for index, (line, turned) in enumerate(splines):
            here = section == index
            if not np.any(here):
                continue
            inner = tau[:, here] / reach[here]
            moved, turns = (
                series.of_vectors(series.of_pieces(x, c[::-1], at[here], reach[here]))
                for x, c in ((line.x, line.c), (turned.x, turned.c))
            )
            found.translation[:, here] = series.composed(moved, inner)
            found.rotation[:, here] = series.composed(series.exponential(turns), inner)
        return found

    @override
    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "t": self._t.tolist(),
            "positions": self._points.tolist(),
            "quaternions": self._turns.tolist() if self._oriented else None,
            "corners": self._corners,
            "corner_angle": self._corner_angle,
        }

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        """Files say `quaternions`."""
        return super().from_dict(of_file(values), **context)
