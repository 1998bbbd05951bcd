"""A pose that goes on as it was seen to move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, PathError, as_number, as_numbers
from selfmotion.path import Path, PathSamples, check_duration, path_pose, rotations_about
from selfmotion.task import SE3

# Who follows it has another pose long before [s].
LONG = 1e9


@dataclass(frozen=True, eq=False)
class MovingPose(Path):
    """A pose of the tool that moves on at a constant twist, as a camera sees it.

    ``p(t) = p + v (t - seen)``, ``R(t) = exp([ω] (t - seen)) R``.

    Parameters
    ----------
    at : SE3 or (4, 4)
        Where the tool is to be when it was seen [m], world axes.
    rate : (6,)
        How it moves: velocity of its origin [m/s] and angular velocity [rad/s], world axes.
    seen : float
        When [s].
    duration : float
        When it comes to rest [s].

    Raises
    ------
    PathError
        A number is not finite, or the pose is none.
    """

    at: SE3
    rate: npt.ArrayLike = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    seen: float = 0.0
    duration: float = LONG

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", path_pose(self.at, "target"))
        what = "6 finite numbers: a velocity [m/s] and an angular velocity [rad/s]"
        object.__setattr__(self, "rate", as_numbers(self.rate, "twist", what, (6,), PathError))
        object.__setattr__(self, "seen", as_number(self.seen, "seen", error=PathError))
        object.__setattr__(self, "duration", check_duration(self.duration))

    def evaluate(self, t: Array) -> PathSamples:
        """See `Path.evaluate`."""
        twist, since = np.asarray(self.rate), t - self.seen
        turning = float(np.linalg.norm(twist[3:]))
        axis = twist[3:] / turning if turning > 0.0 else np.zeros(3)
        return PathSamples(
            t,
            self.at.translation + since[:, None] * twist[:3],
            rotations_about(axis, turning * since) @ self.at.rotation,
            np.tile(twist, (len(t), 1)),
        )
