"""Ways of straight legs as smooth joint paths: their corners are rounded, as far as there is room.

The path is a cubic B-spline whose control points lie on the legs: it stays within the hulls of four
neighbours, so that it differs from the legs near corners only, the less the denser the points are.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.motion import Trajectory
from selfmotion.transfer.settings import FINE_STEP, FINEST, FIRST_POINTS, PATH_SAMPLES
from selfmotion.transfer.ways import Room

_DEGREE = 3


def rounded(room: Room, way: Array, passed: Sequence[int] = ()) -> Trajectory | None:
    """Return a way (m, n) as a smooth joint path over a time of its own from 0 to 1.

    It begins and ends where the way does, and goes through those of its corners that are to be
    `passed`. None where it is not free even when it hardly leaves the legs.
    """
    lengths = (np.abs(np.diff(way, axis=0)) * room.rates).max(axis=1)
    whole = max(float(lengths.sum()), np.finfo(float).tiny)
    spacing = np.full(len(lengths), whole / FIRST_POINTS)
    # Near its ends a clamped spline goes through no other control point.
    fewest = _DEGREE + 1 if len(passed) else 1
    while True:
        counts = np.maximum(fewest, np.ceil(lengths / spacing)).astype(np.int64)
        legs = np.repeat(np.arange(len(lengths)), counts)
        points = [
            np.linspace(way[k], way[k + 1], count, endpoint=False)
            for k, count in enumerate(counts.tolist())
        ]
        path = _spline(_through(points, way, passed))
        blocked = _blocked(room, path)
        if not blocked.size:
            return path
        # Of the legs around what is blocked.
        at = np.clip(blocked * len(legs), 0, len(legs) - 1).astype(np.int64)
        near = np.unique(np.clip(at[:, None] + np.arange(-2, 3), 0, len(legs) - 1))
        tight = np.unique(legs[near])
        if np.all(spacing[tight] <= whole * FINEST):
            return None
        spacing[tight] *= 0.5


def _through(points: Sequence[Array], way: Array, passed: Sequence[int]) -> Array:
    """Return control points of legs as one list, with three in line around corners to pass.

    The spline goes through a control point that lies halfway between its neighbours.
    """
    legs = list(points)
    for corner in passed:
        here, (one, other) = way[corner], (legs[corner - 1][-1], legs[corner][1])
        step = 0.25 * (other - one)
        legs[corner] = np.concatenate([[here - step, here, here + step], legs[corner][1:]])
    return np.concatenate([*legs, way[-1:]])


def _spline(points: Array) -> Trajectory:
    """Return the clamped cubic B-spline of control points (k, n) over 0 to 1."""
    from scipy.interpolate import BSpline

    joints = points.shape[1]
    if len(points) <= _DEGREE:
        points = np.stack(
            [
                np.interp(np.linspace(0, 1, _DEGREE + 1), np.linspace(0, 1, len(points)), column)
                for column in points.T
            ],
            axis=1,
        )
    inner = np.linspace(0.0, 1.0, len(points) - _DEGREE + 1)
    knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
    spline = BSpline(knots, points, _DEGREE)
    # Between knots a quintic with these ends is the cubic itself.
    split = max(1, -(-PATH_SAMPLES // (len(inner) - 1)))
    t = np.linspace(0.0, 1.0, split * (len(inner) - 1) + 1)
    names = tuple(map(str, range(joints)))
    q = spline(t)
    q[0], q[-1] = points[0], points[-1]
    return Trajectory(t, q, spline(t, 1), names, spline(t, 2))


def _blocked(room: Room, path: Trajectory) -> Array:
    """Return at which times a path is not free, looked at closely."""
    counts = room.steps(path.q, FINE_STEP)
    steps = [
        np.linspace(one, other, count, endpoint=False)
        for one, other, count in zip(path.t[:-1], path.t[1:], counts.tolist(), strict=True)
    ]
    t = np.concatenate([*steps, path.t[-1:]])
    return t[~room.free(path(t))]
