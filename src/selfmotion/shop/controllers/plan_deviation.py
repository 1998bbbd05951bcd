"""Deviation of a program's motion from the plan that it was written for."""

from selfmotion.basics import FileFormatError
from selfmotion.planning.result import Move, Parts, Plan
from selfmotion.shop.controllers.controller_program import ControllerProgram
from selfmotion.shop.controllers.deviations import NO_DEVIATION, Deviations, deviation_of
from selfmotion.shop.controllers.operations import operations_of
from selfmotion.shop.controllers.pose_numbers import TIME_TOLERANCE
from selfmotion.work.job import Program


def deviation_from_plan(
    program: ControllerProgram, plan: Plan | Parts | Move | Program
) -> Deviations:
    """Return the deviation of a program's motion from that of a plan, parts, a move or a program.

    Raises
    ------
    FileFormatError
        It has other joints, or other segments.
    """
    operations, order = operations_of(plan), _joint_order(program, plan)
    worst = Deviations(NO_DEVIATION, NO_DEVIATION)
    # The present operation, and the time within it [s].
    number, elapsed = 0, 0.0
    for k, segment in enumerate(program.segments):
        if segment.is_slow and program.shift is None:
            following = program.segments[min(k + 1, len(program.segments) - 1)].name
            raise FileFormatError(
                f"the arm is not where '{following}' begins, by the poses before: it is singular "
                f"there"
            )
        operation = operations[min(number, len(operations) - 1)]
        motion = operation.motion
        deviation = deviation_of(
            segment.in_order(order), motion, operation.chains, motion.t[0] + elapsed
        )
        worst = worst.worse(
            Deviations(NO_DEVIATION, deviation)
            if operation.is_move
            else Deviations(deviation, NO_DEVIATION)
        )
        elapsed += segment.duration
        if elapsed >= motion.duration - TIME_TOLERANCE:
            number, elapsed = number + 1, 0.0
    if number > len(operations):
        raise FileFormatError("goes on when the motion has ended")
    if number < len(operations):
        raise FileFormatError(
            f"ends {len(operations) - number} seams or moves before the motion does"
        )
    return worst


def _joint_order(program: ControllerProgram, plan: Plan | Parts | Move | Program) -> list[int]:
    """Return which axis of a program each joint of a plan is; FileFormatError for other joints."""
    names = [axis.joint for axis in program.axes]
    joint_names = plan.robot.joint_names
    if sorted(names) != sorted(joint_names):
        raise FileFormatError(f"has joints {', '.join(names)}, expected {', '.join(joint_names)}")
    return [names.index(name) for name in joint_names]
