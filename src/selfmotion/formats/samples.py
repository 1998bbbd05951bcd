"""A joint motion at the times that a file has it."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.motion import Trajectory

# Messages count whole nanoseconds.
_DIGITS = 9


@dataclass(frozen=True, eq=False)
class MotionSamples:
    """A joint motion at K times.

    Attributes
    ----------
    joint_names : tuple of str
    t : (K,)
        From 0 [s], in whole nanoseconds.
    q, qd, qdd : (K, n)
        [rad or m], per s, per s².
    """

    joint_names: tuple[str, ...]
    t: Array
    q: Array
    qd: Array
    qdd: Array

    @classmethod
    def of(cls, motion: Trajectory, rate: float | None = None) -> "MotionSamples":
        """Sample a motion at a `rate` [Hz] and at its end; by default where it has samples.

        Raises
        ------
        ProblemError
            The rate is not positive, or gives no two samples.
        """
        if rate is None:
            t = np.round(motion.t - motion.t[0], _DIGITS)
        else:
            if not (np.isfinite(rate) and rate * motion.duration >= 1.0):
                raise ProblemError(
                    f"rate is {rate} Hz, expected a number above {1.0 / motion.duration:.4g}, so "
                    f"that the motion of {motion.duration:.6g} s has samples"
                )
            t = np.round(motion.sample_times(rate), _DIGITS)
        times = np.clip(motion.t[0] + t, motion.t[0], motion.t[-1])
        return cls(motion.joint_names, t, *(motion(times, order) for order in (0, 1, 2)))
