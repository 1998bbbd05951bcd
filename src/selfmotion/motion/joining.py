"""Motions one after the other, backwards, and slower."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.motion.trajectory import Trajectory


def joined_motions(motions: Sequence[Trajectory]) -> Trajectory:
    """Return motions one after the other as one, from t = 0 on.

    Each begins in the configuration in which the one before it ends, as fast, and accelerating as
    much. Cubic where all of them are; where some are, these are quintic in the whole, and so not
    quite the same between their samples.
    """
    orders = _orders(motions)
    t, tables = [motions[0].t[:1] * 0.0], [[motions[0](motions[0].t[:1], k)] for k in orders]
    for motion in motions:
        t.append(t[-1][-1] + motion.t[1:] - motion.t[0])
        for order, table in enumerate(tables):
            table.append(motion(motion.t[1:], order))
    q, qd, *faster = (np.concatenate(table) for table in tables)
    return Trajectory(np.concatenate(t), q, qd, motions[0].joint_names, *faster)


def reversed_motion(motion: Trajectory) -> Trajectory:
    """Return a motion backwards in time, from t = 0 on."""
    t = motion.t
    q, qd, *faster = (motion(t, order)[::-1] for order in _orders([motion]))
    return Trajectory(t[-1] - t[::-1], q, -qd, motion.joint_names, *faster)


def _orders(motions: Sequence[Trajectory]) -> range:
    """Return which derivatives say what motions are between their samples."""
    return range(2 if all(motion.qdd is None for motion in motions) else 3)


def slowdown_of(motion: Trajectory, limits: Sequence[Array]) -> float:
    """Return how many times as long a motion would have to take to keep limits at all times.

    Of q̇, q̈, … in turn, (n,) each; inf where there is none. Below 1 it might be faster.
    """
    shares = (
        float((np.abs(motion.extremes(order)[1]) / limit).max()) ** (1.0 / order)
        for order, limit in enumerate(limits, 1)
        if np.isfinite(limit).any()
    )
    return max(shares, default=0.0)
