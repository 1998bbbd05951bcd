"""What the tool is to do over the horizon: from where it is now, back to its path."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, as_number
from selfmotion.follow import Follows
from selfmotion.path import Path, PathSamples
from selfmotion.realtime import law
from selfmotion.realtime.settings import OFFSET_STEP
from selfmotion.task import SE3, Jexp3, exp3


@dataclass(frozen=True)
class Approach:
    """How the tool comes back to a path that jumped, or that it was pushed off.

    Attributes
    ----------
    rate : float
        Near the path, what is left fades with this rate [1/s].
    speed, acceleration : float
        Limits of the approach, on top of the path's own motion [m/s, m/s²].
    turning, turning_acceleration : float
        The same of rotation [rad/s, rad/s²].
    """

    rate: float = 10.0
    speed: float = 0.5
    acceleration: float = 3.0
    turning: float = 2.0
    turning_acceleration: float = 10.0

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            as_number(getattr(self, name), f"approach: {name}", above=0.0)

    @property
    def numbers(self) -> Array:
        """All of them, (5,)."""
        return np.array([float(getattr(self, name)) for name in self.__dataclass_fields__])


class Reference:
    """A tool motion that begins where the tool is, as fast as it is, and fades to the path.

    Parameters
    ----------
    follows : Follows
    approach : Approach
    times : (M,)
        From now on [s].

    Attributes
    ----------
    table : (M, 18)
        Position, rotation and twist at the times.
    jacobian : (m, n)
        Task Jacobian where the arm is.
    """

    def __init__(self, follows: Follows, approach: Approach, times: Array) -> None:
        task = follows.task
        self._task, self._times = task, times
        self._kinematics = follows.only.chain.kinematics()
        self._approach = approach.numbers
        self._offsets = np.zeros((int(np.ceil(times.max() / OFFSET_STEP)) + 2, 12))
        self.table = np.zeros((len(times), law.REFERENCE))
        self.jacobian = np.zeros((task.dimension, follows.robot.dof))
        # What the task does not prescribe is left where it is; of an axis all three rows turn.
        self._free = np.full(6, not task.tool_axes)
        self._free[task.rows] = False

    def begin(
        self, q: Array, rate: Array, target: PathSamples, twist: Array | None = None
    ) -> Array:
        """Let the motion begin at q with q̇ = `rate`, and fade to a path given at the times.

        With `twist` (6,) in place of the tool's own. Returns how far the tool is off the path, (2,)
        [m, rad].
        """
        jacobian = self._kinematics.at(q)
        rotation, translation = self._kinematics.rotation, self._kinematics.translation
        twist = jacobian @ rate if twist is None else twist
        goal = SE3(target.rotation[0], target.translation[0])
        # The twist that takes the target to the tool.
        offset = -self._task.twist_error(goal, SE3(rotation, translation))
        relative = twist[3:] - exp3(offset[3:]) @ target.twist[0, 3:]
        if self._task.tool_axes:
            relative -= rotation[:, 2] * (rotation[:, 2] @ relative)
        slope = np.empty(6)
        slope[:3] = twist[:3] - target.twist[0, :3]
        slope[3:] = np.linalg.solve(_left_jacobian(offset[3:]), relative)
        offset[self._free] = slope[self._free] = 0.0
        self.jacobian = self._task.select(jacobian, rotation)
        law.approach(offset, slope, self._approach, OFFSET_STEP, self._offsets)
        law.shift_reference(
            self._times,
            target.translation,
            target.rotation,
            target.twist,
            self._offsets,
            OFFSET_STEP,
            self.table,
        )
        return np.array([np.linalg.norm(offset[:3]), np.linalg.norm(offset[3:])])


def resting(path: Path, t: Array) -> PathSamples:
    """Return a path at times that may lie outside of it, where it rests; finite, or ValueError."""
    inside = np.clip(t, 0.0, path.duration)
    found = path.samples(inside)
    twist = np.where((t == inside)[:, None], found.twist, 0.0)
    for name, values in (("pose", found.translation), ("pose", found.rotation), ("twist", twist)):
        if not np.all(np.isfinite(values)):
            raise ValueError(f"its {name} is not finite")
    return PathSamples(
        t,
        np.ascontiguousarray(found.translation),
        np.ascontiguousarray(found.rotation),
        np.ascontiguousarray(twist),
    )


def _left_jacobian(phi: Array) -> Array:
    """Return Jl(φ), which takes φ̇ to the angular velocity of exp(φ), world axes."""
    return np.asarray(Jexp3(-phi))
