"""Continuity of several motions of an arm, one after the other: q agrees, and the arm rests."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import ARRIVED, REST_ACCELERATION, Requirement, limits_of_joints
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result.move import Move
from selfmotion.planning.result.plan import Plan
from selfmotion.problem.problem import Problem, rest_orders

# Largest difference of q between the end of one motion and the start of the next, from rounding
# [rad or m].
_JUMP = 1e-9
# Index of the first sample.
_START = 0
# Index of the last sample.
_END = -1
# Order of the derivative up to which rest is required.
_ACCELERATION = 2


class CheckedMotion(NamedTuple):
    """One of several motions of an arm, each after the one before.

    Attributes
    ----------
    name : str
        In words: ``"'top'"``, ``"part 1"``.
    motion : Trajectory
    accelerates : (bool, bool)
        Whether it may accelerate at its start and its end: only where its tool's own motion does.
    """

    name: str
    motion: Trajectory
    accelerates: tuple[bool, bool] = (False, False)

    @classmethod
    def of(cls, name: str, result: Plan | Move) -> "CheckedMotion | None":
        """Return the motion of a plan or a move; None for a move that was not found."""
        if isinstance(result, Plan):
            accelerates = _path_accelerations(result.problem, result.requirements)
            return cls(name, result.trajectory, accelerates)
        return None if result.trajectory is None else cls(name, result.trajectory)


def _path_accelerations(problem: Problem, requirements: Sequence[Requirement]) -> tuple[bool, bool]:
    """Whether the paths of a problem accelerate the arm at their start, and at their end."""
    limits_jerk = any(
        item.order > _ACCELERATION and np.isfinite(item.upper).any()
        for item in limits_of_joints(requirements)
    )
    if limits_jerk:
        # Acceleration would step there, which no finite jerk does.
        return False, False
    orders = [rest_orders(item.path, item.task) for item in problem.follows.items]
    start, end = (min(order[k] for order in orders) < _ACCELERATION for k in (0, 1))
    return start, end


def continuity_faults(
    robot: RobotModel, motions: Sequence[CheckedMotion], max_jump: float = _JUMP
) -> Iterator[str]:
    """Yield where the arm jumps, moves or accelerates from one motion to the next.

    Configurations have to agree within `max_jump`, by default 1e-9 rad or m. At both sides the arm
    has to rest, within 1e-6 rad/s or m/s and 1e-3 rad/s² or m/s². Either all motions have
    accelerations or none has: joined with others, a motion without them is interpolated
    differently between its samples than when it was judged.
    """
    yield from _interpolation_faults(motions)
    for one, other in pairwise(motions):
        yield from _jump_faults(robot, one, other, max_jump)
        yield from rest_faults(robot, one, _END)
        yield from rest_faults(robot, other, _START)


def _interpolation_faults(motions: Sequence[CheckedMotion]) -> Iterator[str]:
    """Yield a motion without accelerations among others that have some."""
    cubic = [item.name for item in motions if item.motion.qdd is None]
    if cubic and len(cubic) < len(motions):
        yield (
            f"{cubic[0]} states no accelerations, and others do, so that it is another motion "
            f"between its samples in the whole; give its accelerations (Trajectory(qdd=…)), and "
            f"judge it again"
        )


def _jump_faults(
    robot: RobotModel, one: CheckedMotion, other: CheckedMotion, max_jump: float
) -> Iterator[str]:
    """Yield the largest jump of a joint from the end of a motion to the start of the next."""
    jump = np.abs(other.motion.q[_START] - one.motion.q[_END])
    worst = int(np.argmax(jump))
    # Written so that NaN is a jump.
    if not jump[worst] <= max_jump:
        joint = robot.joint_names[worst]
        yield (
            f"from {one.name} to {other.name} joint '{joint}' would jump by {jump[worst]:.3g} "
            f"{robot.unit_of(joint)} ({max_jump:g} allowed); plan one of them again, from where "
            f"the other is"
        )


def end_position_faults(
    robot: RobotModel, checked: CheckedMotion, end: int, required: Array, max_error: float = _JUMP
) -> Iterator[str]:
    """Yield that a motion does not start (`end` 0) or end (-1) at the required q (n,)."""
    error = np.abs(checked.motion.q[end] - required)
    worst = int(np.argmax(error))
    if not error[worst] <= max_error:
        joint, verb = robot.joint_names[worst], "end" if end else "begin"
        yield (
            f"{checked.name} does not {verb} where it was asked to: joint '{joint}' is "
            f"{error[worst]:.3g} {robot.unit_of(joint)} away ({max_error:g} allowed); plan it "
            f"again, {'to' if end else 'from'} there"
        )


def rest_faults(robot: RobotModel, checked: CheckedMotion, end: int) -> Iterator[str]:
    """Yield that a motion does not rest at its start (`end` 0) or its end (-1)."""
    motion, verb = checked.motion, "end" if end else "begin"
    rates = ((1, "moves", ARRIVED, ""), (2, "accelerates", REST_ACCELERATION, "²"))
    for order, what, max_rate, power in rates:
        # Without accelerations in a file, the controller interpolates, and rest cannot be judged.
        if order == _ACCELERATION and (motion.qdd is None or checked.accelerates[end]):
            continue
        rate = np.abs(motion(motion.t[end], order))
        worst = int(np.argmax(rate))
        if not rate[worst] <= max_rate:
            joint = robot.joint_names[worst]
            yield (
                f"{checked.name} does not {verb} at rest: joint '{joint}' {what} at "
                f"{rate[worst]:.2g} {robot.unit_of(joint)}/s{power} ({max_rate:g} allowed); plan "
                f"it along a path that rests there, with rest=True"
            )
            return
