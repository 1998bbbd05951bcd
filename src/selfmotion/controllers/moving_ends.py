"""Motions that begin or end while the arm moves: no controller takes one unasked."""

from pathlib import Path

import numpy as np

from selfmotion.basics import PlanError
from selfmotion.constraints import ClosedPath, EndVelocity, StartVelocity
from selfmotion.job import Program
from selfmotion.result import Move, Parts, Plan

# What is slower than this rests [rad/s or m/s], as certificates judge it.
_REST = 1e-6


def moving_ends(plan: Plan | Parts | Move | Program) -> str:
    """Return in words which joint moves at an end of a motion that nobody asked to; "" for none.

    A problem asks for it by `StartVelocity`, `EndVelocity`, `ClosedPath` or ``rest=False``.
    """
    motion = plan.motion if isinstance(plan, Move) else plan.trajectory
    asked = plan.problem.constraints if isinstance(plan, Plan) else ()
    allowed = [
        any(isinstance(item, kind | ClosedPath) for item in asked)
        for kind in (StartVelocity, EndVelocity)
    ]
    if isinstance(plan, Plan) and not plan.problem.rest:
        allowed = [True, True]
    for row, verb, may in ((0, "begins", allowed[0]), (-1, "ends", allowed[1])):
        speeds = np.abs(motion.qd[row])
        joint = int(speeds.argmax())
        if speeds[joint] > _REST and not may:
            unit = "m/s" if plan.robot.is_prismatic(motion.joint_names[joint]) else "rad/s"
            return (
                f"joint '{motion.joint_names[joint]}' {verb} at {speeds[joint]:.3g} {unit} at "
                f"t = {motion.t[row]:.6g} s, and controllers take motions from rest to rest: plan "
                f"it with a ramp (--ramp 0.5)"
            )
    return ""


def check_ends(plan: Plan | Parts | Move | Program, file: Path, force: bool) -> None:
    """Raise PlanError for a motion that begins or ends moving unasked, unless it is forced."""
    said = "" if force else moving_ends(plan)
    if said:
        raise PlanError(f"{file}: is not written: {said}, or give force=True to write it as it is")
