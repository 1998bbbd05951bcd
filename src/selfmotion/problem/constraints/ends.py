"""Conditions on the end of the motion: a configuration, rest, repetition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from selfmotion.basics import Array, ProblemError, as_flag, as_numbers, per_joint, read_only
from selfmotion.certificate import QUANTITIES, ClosedMotion, EndState
from selfmotion.model.follow import Follows, row_names
from selfmotion.model.path import REST_SPEED
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.base import Constraint, Ends
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.bound_ends import EndCondition

# Largest difference of a start velocity from that of the path [m/s, rad/s].
_NEAR_TWIST = 1e-6
# Poses nearer than this are equal: far above rounding, far below any tolerance.
_SAME_POSE = 1e-7


@dataclass(frozen=True, eq=False)
class EndConfiguration(Constraint):
    """The motion ends in a configuration that puts the tool on the end of the path.

    Where tolerances allow it, beside that.

    Parameters
    ----------
    q : (n,)
        q(T) [rad or m].
    """

    ends: ClassVar[Ends] = Ends(pins=(False, True))

    q: npt.ArrayLike

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        target = read_only(robot.configuration(self.q))
        return Conditions(ends=(EndCondition("end configuration", (0,), target, is_whole=True),))

    @override
    def requirement(self, robot: RobotModel) -> EndState:
        return EndState(0, read_only(robot.configuration(self.q)))


class _EndRate(Constraint):
    """A velocity or an acceleration at one end: the one field of each class."""

    order: ClassVar[int]
    at_start: ClassVar[bool]

    def __init_subclass__(cls, *, order: int, at_start: bool, **options: Any) -> None:
        cls.order, cls.at_start = order, at_start
        here = (at_start, not at_start)
        none = (False, False)
        velocity, acceleration = (here, none) if order == 1 else (none, here)
        cls.ends = Ends(pins=here, velocity=velocity, acceleration=acceleration)
        super().__init_subclass__(**options)

    @property
    def given(self) -> npt.ArrayLike:
        """The prescribed value, (n,) or one number."""
        given: npt.ArrayLike = getattr(self, "q" + "d" * self.order)
        return given

    @property
    def _name(self) -> str:
        return f"{'start' if self.at_start else 'end'} {QUANTITIES[self.order]}"

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        target = self.target(robot)
        return Conditions(ends=(EndCondition(self._name, (self.order,), target, self.at_start),))

    @override
    def requirement(self, robot: RobotModel) -> EndState:
        return EndState(self.order, self.target(robot), self.at_start)

    def target(self, robot: RobotModel) -> Array:
        """Return the prescribed value for an arm, (n,) [rad or m, per s^order]."""
        what = f"{robot.name}: {self._name}"
        return as_numbers(per_joint(self.given, robot.dof, what), what)


@dataclass(frozen=True, eq=False)
class EndVelocity(_EndRate, order=1, at_start=False):
    """The motion ends with a joint velocity; 0 for rest.

    The tool's rows of it have to be those of the path's end: for rest, the path has to end at rest.

    Parameters
    ----------
    qd : (n,) or 0
        q̇(T) [rad/s or m/s].
    """

    qd: npt.ArrayLike = 0.0

    @override
    def check(self, follows: Follows) -> None:
        """Require a path that ends at rest: a motion ends at rest only there."""
        if np.any(self.target(follows.robot)):
            return
        speed = float(np.abs(follows.twists(np.array([follows.duration]))).max())
        if speed > REST_SPEED:
            raise ProblemError(
                f"the motion cannot end at rest: the path ends at {speed:.3g} m/s or rad/s; give "
                f"the path a time law that ends at rest (time_law='minimum_jerk'), or ask for "
                f"another end velocity"
            )


@dataclass(frozen=True, eq=False)
class StartVelocity(_EndRate, order=1, at_start=True):
    """The motion starts with a joint velocity: that of an arm that moves already.

    Needs a given start, where the tool's rows of it have to be those of the path's start.

    Parameters
    ----------
    qd : (n,) or 0
        q̇(0) [rad/s or m/s].
    """

    qd: npt.ArrayLike = 0.0

    @override
    def check_start(self, follows: Follows, start: Array | None) -> None:
        """Require that the tool's twist at the start is the path's."""
        robot = follows.robot
        if start is None:
            raise ProblemError("a start velocity needs a given start (start=)")
        moved = follows.jacobian(start) @ self.target(robot)
        twist = follows.twists(np.zeros(1))[0]
        row = int(np.argmax(np.abs(moved - twist)))
        if abs(moved[row] - twist[row]) > _NEAR_TWIST:
            begins = round(float(twist[row]), 9) + 0.0
            raise ProblemError(
                f"the start velocity moves '{robot.tool}' at {moved[row]:.6g} m/s or rad/s in row "
                f"'{row_names(follows)[row]}', but the path begins at {begins:g}; give "
                f"the path that speed, or the arm another one"
            )


@dataclass(frozen=True, eq=False)
class StartAcceleration(_EndRate, order=2, at_start=True):
    """The motion starts with a joint acceleration: with `StartVelocity`, the hand-over of an arm.

    Its part that moves the tool has to agree with the path and the velocity. Without a
    `StartVelocity` the arm starts at rest.

    Parameters
    ----------
    qdd : (n,) or 0
        q̈(0) [rad/s² or m/s²].
    """

    qdd: npt.ArrayLike = 0.0

    @override
    def check_start(self, follows: Follows, start: Array | None) -> None:
        """Of a free start no acceleration is known."""
        if start is None:
            raise ProblemError("a start acceleration needs a given start (start=)")


@dataclass(frozen=True, eq=False)
class EndAcceleration(_EndRate, order=2, at_start=False):
    """The motion ends with a joint acceleration; see `StartAcceleration`.

    Parameters
    ----------
    qdd : (n,) or 0
        q̈(T) [rad/s² or m/s²].
    """

    qdd: npt.ArrayLike = 0.0


@dataclass(frozen=True)
class ClosedPath(Constraint):
    """The motion ends as it began, so that it can be repeated: q(T) = q(0).

    Parameters
    ----------
    velocity : bool
        Also q̇(T) = q̇(0), for repetition without a jump in speed.
    """

    ends: ClassVar[Ends] = Ends(closes=True)

    velocity: bool = True

    def __post_init__(self) -> None:
        as_flag(self.velocity, "closed path: velocity")

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        orders = (0, 1) if self.velocity else (0,)
        return Conditions(ends=(EndCondition("closed path", orders, None, is_whole=True),))

    @override
    def requirement(self, robot: RobotModel) -> ClosedMotion:
        return ClosedMotion(self.velocity)

    @override
    def check(self, follows: Follows) -> None:
        """Require that the tool's path is closed as well."""
        for item in follows.items:
            path = item.path
            position, rotation = item.task.miss(path.pose(0.0), path.pose(path.duration))
            if max(position, rotation) > _SAME_POSE:
                raise ProblemError(
                    f"a closed joint path needs a closed tool path, but the tool ends "
                    f"{position:.3g} m and {rotation:.3g} rad from where it began"
                )

    @override
    def at_rest(self) -> ClosedPath:
        """Both velocities are 0."""
        return ClosedPath(velocity=False)
