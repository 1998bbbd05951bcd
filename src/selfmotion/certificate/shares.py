"""How much of its limits a smooth function of a motion uses at all times: bounds, not only samples.

Between the trajectory's samples such functions are smooth in time. Its intervals are halved until
no joint goes far in one: forces and velocities are trigonometric in q, and points whole turns apart
look alike. On each they are computed at five points; the polynomial through every other of them
predicts the rest, and the largest miss of these predictions is added to what the polynomial through
all points reaches. Intervals on which this does not decide are halved.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.interpolation import SAG, stencil
from selfmotion.certificate.requirement import FinishedMotion
from selfmotion.motion import Trajectory

# Points per interval, and how often one is halved before it counts as undecided.
_POINTS, _DEPTH = 5, 12
# The farthest that a joint goes in an interval [rad or m]; its sines and cosines are then nearly
# parabolas. How often intervals are halved for that, and how many of them are looked at.
_FAR, _FINEST, _MOST = 0.2, 40, 200_000
# At a sample a trajectory belongs to the interval after it: ends are looked at this share before.
_BEFORE = 1e-9

# q, q̇, q̈ (K, n) each → shares of limits (K, m), which may be negative.
Shares = Callable[[Array, Array, Array], Array]


class Largest(NamedTuple):
    """The largest share of a limit: how much, when [s], of which column."""

    share: float
    time: float
    column: int


def largest_share(motion: Trajectory, shares: Shares) -> Largest | None:
    """Return a bound of the largest |share|, or None where the motion is too long to be looked at.

    It is near the true one, and above 1 wherever that is; a bound up to 1 is proof.
    """
    pending = _short_intervals(motion)
    if pending is None:
        return None
    worst = Largest(0.0, float(motion.t[0]), 0)
    for depth in range(_DEPTH + 1):
        bounds, measured, times = _bounds(motion, pending, shares)
        # Written so that NaN settles nothing.
        settled = (bounds.max(axis=1) <= 1.0) | (measured.max(axis=1) > 1.0)
        if depth == _DEPTH:
            settled[:] = True
        if settled.any():
            rows = np.flatnonzero(settled)
            row, column = np.unravel_index(int(np.argmax(bounds[rows])), bounds[rows].shape)
            if not bounds[rows][row, column] <= worst.share:
                found = float(bounds[rows][row, column])
                worst = Largest(found, float(times[rows][row, column]), int(column))
        if settled.all():
            break
        pending = _halves(pending[~settled])
    return worst


def _bounds(motion: Trajectory, intervals: Array, shares: Shares) -> tuple[Array, Array, Array]:
    """Return bounds of |share|, what was measured, and about when, (I, m) each."""
    places, predict, between, dense = stencil(_POINTS)
    starts, lengths = intervals[:, :1], np.diff(intervals, axis=1)
    t = (starts + lengths * np.minimum(places, 1.0 - _BEFORE)).ravel()
    used = shares(motion(t), motion(t, 1), motion(t, 2)).reshape(len(intervals), _POINTS, -1)
    missed = np.abs(used[:, 1::2] - np.einsum("ab,ibn->ian", predict, used[:, ::2]))
    inside = np.einsum("ab,ibn->ian", dense, used)
    missed_peaks = SAG * np.abs(np.diff(inside, 2, axis=1)).max(axis=1)
    size = np.abs(inside)
    times = starts + lengths * between[np.argmax(size, axis=1)]
    bounds = size.max(axis=1) + missed.max(axis=1) + missed_peaks
    return bounds, np.abs(used).max(axis=1), times


def _short_intervals(motion: Trajectory) -> Array | None:
    """Return intervals (I, 2) in which no joint goes far, or None if they are too many."""
    pending, done, count = np.stack([motion.t[:-1], motion.t[1:]], axis=1), [], 0
    for _ in range(_FINEST):
        way = motion.travelled(pending[:, 1]) - motion.travelled(pending[:, 0])
        # Written so that NaN is far.
        far = ~(way.max(axis=1) <= _FAR)
        done.append(pending[~far])
        count += len(done[-1])
        pending = _halves(pending[far])
        if not len(pending):
            return np.concatenate(done)
        if count + len(pending) > _MOST:
            break
    return None


def _halves(intervals: Array) -> Array:
    """Return both halves of each interval, (2 I, 2)."""
    middle = intervals.mean(axis=1)
    halves = np.stack([intervals[:, 0], middle, middle, intervals[:, 1]], axis=1)
    return halves.reshape(-1, 2)


def too_far(requirement: str, motion: FinishedMotion) -> Finding:
    """Return what is said of a motion that is too long to be looked at."""
    trajectory = motion.trajectory
    way = trajectory.travelled(trajectory.t[-1:])[0]
    joint = int(np.argmax(way))
    name = motion.robot.joint_names[joint]
    text = (
        f"{requirement}: joint '{name}' travels {way[joint]:.3g} rad or m, too far to look at all "
        f"of it; check the motion in parts"
    )
    return Finding(requirement, name, float(trajectory.t[0]), np.inf, 1.0, False, text)
