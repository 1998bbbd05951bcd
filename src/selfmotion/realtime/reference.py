"""Reference of the tool over the horizon, for moving paths and poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, PathError, as_number, as_numbers, restore
from selfmotion.model.follow import Follows, single_tip
from selfmotion.model.path import Path, PathSamples, check_duration, path_pose, rotations_about
from selfmotion.model.task import SE3, Jexp3, exp3
from selfmotion.realtime import law
from selfmotion.realtime.settings import OFFSET_STEP

# Duration of moving poses [s]: replaced long before.
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

    @override
    def evaluate(self, t: Array) -> PathSamples:
        twist, since = np.asarray(self.rate), t - self.seen
        turning = float(np.linalg.norm(twist[3:]))
        axis = twist[3:] / turning if turning > 0.0 else np.zeros(3)
        return PathSamples(
            t,
            self.at.translation + since[:, None] * twist[:3],
            rotations_about(axis, turning * since) @ self.at.rotation,
            np.tile(twist, (len(t), 1)),
        )


@dataclass(frozen=True, eq=False)
class Conveyed(Path):
    """A path that is carried along at a constant velocity.

    Where the velocity changes, or is measured anew, another one takes over: `Replanner.step` is
    given the path as it is known by then.

    Parameters
    ----------
    carried : Path
        The tool's motion where nothing moves.
    velocity : (3,)
        Of its carrier [m/s].
    offset : (3,)
        How far it would have been carried at time 0 [m].
    """

    carried: Path
    velocity: npt.ArrayLike
    offset: npt.ArrayLike = (0.0, 0.0, 0.0)

    @property
    @override
    def duration(self) -> float:  # type: ignore[override]
        return self.carried.duration

    @property
    @override
    def knots(self) -> Array:
        return self.carried.knots

    @override
    def evaluate(self, t: Array) -> PathSamples:
        return self.moved(self.carried.evaluate(t))

    def moved(self, inner: PathSamples) -> PathSamples:
        """Return samples of what is carried where they are by then."""
        t, velocity = inner.t, np.asarray(self.velocity, dtype=np.float64)
        translation = inner.translation + np.asarray(self.offset) + t[:, None] * velocity
        twist = inner.twist + np.concatenate([velocity, np.zeros(3)])
        return PathSamples(t, translation, inner.rotation, twist)

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Self:
        return cls(**{**values, "carried": restore(Path, values["carried"])})


# What the tool is to do over the horizon: from where it is now, back to its path.
@dataclass(frozen=True)
class Approach:
    """Return of the tool to a path after a jump or a displacement.

    Attributes
    ----------
    rate : float
        Rate at which a small error fades [1/s].
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

    def within(self, limit: Array) -> Approach:
        """Return the approach that leaves half of the tool's limits (4,) to the path's own motion.

        Of speed, turn rate, acceleration and turn acceleration.
        """
        names = "speed", "turning", "acceleration", "turning_acceleration"
        return replace(
            self,
            **{
                name: min(getattr(self, name), 0.5 * float(most))
                for name, most in zip(names, limit, strict=True)
            },
        )

    @property
    def numbers(self) -> Array:
        """All of them, (5,)."""
        return np.array([float(getattr(self, name)) for name in self.__dataclass_fields__])


class Reference:
    """A tool motion that starts with the tool's pose and twist, and fades to the path.

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
        task = single_tip(follows).task
        self._task, self._times = task, times
        self._kinematics = single_tip(follows).chain.kinematics()
        self._approach = approach.numbers
        self._offsets = np.zeros((int(np.ceil(times.max() / OFFSET_STEP)) + 2, 12))
        self.table = np.zeros((len(times), law.REFERENCE))
        self.jacobian = np.zeros((task.dimension, follows.robot.dof))
        # Free rows are constant; of an axis all three rows turn.
        self._free = np.full(6, not task.tool_axes)
        self._free[task.rows] = False

    def begin(
        self, q: Array, rate: Array, target: PathSamples, twist: Array | None = None
    ) -> Array:
        """Start the motion at q with q̇ = `rate`, and fade to a path given at the times.

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
        slope[3:] = np.linalg.solve(left_jacobian(offset[3:]), relative)
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


def left_jacobian(phi: Array) -> Array:
    """Return Jl(φ), which takes φ̇ to the angular velocity of exp(φ), world axes."""
    return np.asarray(Jexp3(-phi))
