"""What waypoints are given, checked; and where they bend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    PathError,
    as_numbers,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


# What quaternions are called in files, and as an argument.
_IN_FILES, _ARGUMENT = "quaternions", "quaternions_wxyz"


def bends(legs: Array, angle: float, least: float) -> npt.NDArray[np.bool_]:
    """Return where legs (N - 1, 3) change their direction by more than `angle`, (N - 2,)."""
    lengths = np.linalg.norm(legs, axis=1)
    cosine = np.einsum("ki,ki->k", legs[:-1], legs[1:])
    # What hardly moves on one side has no direction there, hence no kink.
    moves = (lengths[:-1] > least) & (lengths[1:] > least)
    return np.asarray((cosine < np.cos(angle) * lengths[:-1] * lengths[1:]) & moves)


def as_table(values: npt.ArrayLike, name: str) -> Array:
    """Return numbers of waypoints; PathError names what is none."""
    return as_numbers(values, f"waypoints: {name}", error=PathError)


def scalar_first(orientations: npt.ArrayLike | Rotation) -> npt.ArrayLike:
    """Return orientations as quaternions [w, x, y, z]: SciPy's know their own order."""
    if hasattr(orientations, "as_quat"):
        return np.asarray(orientations.as_quat(scalar_first=True), dtype=np.float64)
    return orientations


def of_file(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file says as arguments: its `quaternions` are w, x, y, z."""
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
