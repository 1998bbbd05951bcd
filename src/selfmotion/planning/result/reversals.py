"""Reversals: where the joints of a motion change their direction."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.model.motion import Trajectory

# Smallest backward motion of a joint that counts as a reversal [rad or m].
MIN_REVERSAL = 1e-3
# Evaluations of joint speeds per sample of the motion.
_REVERSAL_OVERSAMPLING = 4
# Bisections of the time of a reversal.
_HALVINGS = 40


@dataclass(frozen=True, eq=False)
class Reversals:
    """Times at which joints reverse, each by more than 1 mrad or 1 mm.

    Attributes
    ----------
    times : mapping
        Joint → times [s], (K,).
    """

    times: Mapping[str, Array]

    @classmethod
    def of(cls, motion: Trajectory) -> Reversals:
        """Return those of a motion."""
        shares = np.arange(_REVERSAL_OVERSAMPLING) / _REVERSAL_OVERSAMPLING
        steps = np.diff(motion.t)[:, None] * shares
        t = np.append((motion.t[:-1, None] + steps).ravel(), motion.t[-1])
        speeds = motion(t, 1)
        reversals = {
            name: read_only(_reversal_times(motion, number, t, speeds[:, number]))
            for number, name in enumerate(motion.joint_names)
        }
        return cls(MappingProxyType(reversals))

    @property
    def count(self) -> int:
        """Number of reversals, of all joints together."""
        return sum(map(len, self.times.values()))

    def __str__(self) -> str:
        """Return the number of reversals, by joint, those with most first."""
        order = sorted(self.times, key=lambda name: -len(self.times[name]))
        turning = [f"{name} {len(self.times[name])}" for name in order if len(self.times[name])]
        return f"{self.count} ({', '.join(turning)})" if turning else "0"


def _reversal_times(motion: Trajectory, joint: int, t: Array, speed: Array) -> Array:
    """Return the times at which a joint with these speeds at t (K,) reverses."""
    moving = np.flatnonzero(speed)
    change = np.flatnonzero(np.diff(np.sign(speed[moving])))
    early, late, sign = t[moving[change]], t[moving[change + 1]], np.sign(speed[moving[change]])
    for _ in range(_HALVINGS):
        middle = 0.5 * (early + late)
        before = motion(middle, 1)[:, joint] * sign > 0.0 if len(middle) else sign > 0.0
        early, late = np.where(before, middle, early), np.where(before, late, middle)
    places = motion(np.concatenate([t[:1], late, t[-1:]]))[:, joint]
    # Pairs of reversals nearer than MIN_REVERSAL are jitter: they go, the nearest pair first.
    selected = list(range(len(places)))
    while len(selected) > 2:
        lengths = np.abs(np.diff(places[selected]))
        least = int(np.argmin(lengths))
        if lengths[least] > MIN_REVERSAL:
            break
        if least == 0:
            del selected[1]
        elif least == len(lengths) - 1:
            del selected[-2]
        else:
            del selected[least : least + 2]
    return np.asarray(late[np.array(selected[1:-1], dtype=int) - 1])
