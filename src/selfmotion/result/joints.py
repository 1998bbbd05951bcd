"""How motions that are judged one by one hang together: from rest to rest, without a jump."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import ARRIVED, STILL_ACCELERATION, JointLimits, Requirement
from selfmotion.motion import Trajectory
from selfmotion.problem import Problem, rest_orders
from selfmotion.result.move import Move
from selfmotion.result.plan import Plan
from selfmotion.robot import RobotModel

# Where one motion ends, the next begins, up to rounding [rad or m].
_JOINED = 1e-9
_START, _END = 0, -1
_SMOOTH = 2


class Piece(NamedTuple):
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
    def of(cls, name: str, made: Plan | Move) -> "Piece | None":
        """Return a plan or a move as a piece; None for a move that was not found."""
        if isinstance(made, Plan):
            return cls(name, made.trajectory, _accelerates(made.problem, made.requirements))
        return None if made.trajectory is None else cls(name, made.trajectory)


def _accelerates(problem: Problem, requirements: Sequence[Requirement]) -> tuple[bool, bool]:
    limited = any(
        isinstance(item, JointLimits) and item.order > _SMOOTH and np.isfinite(item.upper).any()
        for item in requirements
    )
    if limited:
        # No limited jerk makes a step of acceleration.
        return False, False
    orders = [rest_orders(item.path, item.task) for item in problem.follows.items]
    start, end = (min(order[k] for order in orders) < _SMOOTH for k in (0, 1))
    return start, end


def gaps(robot: RobotModel, pieces: Sequence[Piece], allowed: float = _JOINED) -> Iterator[str]:
    """Yield where from one piece to the next the arm jumps, moves or accelerates.

    Configurations have to agree within what is allowed, by default 1e-9 rad or m; at both sides the
    arm has to rest, within 1e-6 rad/s or m/s and 1e-3 rad/s² or m/s². All of them have to state
    accelerations, or none: between the samples of the whole some would be other motions than were
    judged.
    """
    yield from _mixed(pieces)
    for one, other in pairwise(pieces):
        last, first = one.motion.q[_END], other.motion.q[_START]
        yield from _jump(robot, one.name, other.name, last, first, allowed)
        yield from moving_end(robot, one, _END)
        yield from moving_end(robot, other, _START)


def _mixed(pieces: Sequence[Piece]) -> Iterator[str]:
    cubic = [piece.name for piece in pieces if piece.motion.qdd is None]
    if cubic and len(cubic) < len(pieces):
        yield (
            f"{cubic[0]} states no accelerations, and others do, so that it is another motion "
            f"between its samples in the whole; give its accelerations (Trajectory(qdd=…)), and "
            f"judge it again"
        )


def _jump(
    robot: RobotModel, one: str, other: str, last: Array, first: Array, allowed: float = _JOINED
) -> Iterator[str]:
    apart = np.abs(first - last)
    worst = int(np.argmax(apart))
    # Written so that NaN is a jump.
    if not apart[worst] <= allowed:
        joint = robot.joint_names[worst]
        yield (
            f"from {one} to {other} joint '{joint}' would jump by {apart[worst]:.3g} "
            f"{robot.unit_of(joint)} ({allowed:g} allowed); plan one of them again, from where the "
            f"other is"
        )


def elsewhere(
    robot: RobotModel, piece: Piece, end: int, asked: Array, allowed: float = _JOINED
) -> Iterator[str]:
    """Yield where a piece does not begin (0) or end (-1) at a configuration (n,)."""
    apart = np.abs(piece.motion.q[end] - asked)
    worst = int(np.argmax(apart))
    if not apart[worst] <= allowed:
        joint, verb = robot.joint_names[worst], "end" if end else "begin"
        yield (
            f"{piece.name} does not {verb} where it was asked to: joint '{joint}' is "
            f"{apart[worst]:.3g} {robot.unit_of(joint)} away ({allowed:g} allowed); plan it again, "
            f"{'to' if end else 'from'} there"
        )


def moving_end(robot: RobotModel, piece: Piece, end: int) -> Iterator[str]:
    """Yield where a piece does not rest at its start (0) or its end (-1)."""
    motion, verb = piece.motion, "end" if end else "begin"
    rates = ((1, "moves", ARRIVED, ""), (2, "accelerates", STILL_ACCELERATION, "²"))
    for order, what, allowed, power in rates:
        # What a file does not state is not judged: between its samples the controller accelerates.
        if order == _SMOOTH and (motion.qdd is None or piece.accelerates[end]):
            continue
        rate = np.abs(motion(motion.t[end], order))
        worst = int(np.argmax(rate))
        if not rate[worst] <= allowed:
            joint = robot.joint_names[worst]
            yield (
                f"{piece.name} does not {verb} at rest: joint '{joint}' {what} at "
                f"{rate[worst]:.2g} {robot.unit_of(joint)}/s{power} ({allowed:g} allowed); plan it "
                f"along a path that rests there, with rest=True"
            )
            return
