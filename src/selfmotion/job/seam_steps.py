"""The steps of a program that a seam becomes."""

from collections.abc import Sequence

import numpy as np

from selfmotion.collision import Obstacle
from selfmotion.job.seam import Seam
from selfmotion.job.step import Step
from selfmotion.job.work import Work
from selfmotion.motion import Trajectory
from selfmotion.result import Move, Plan


def seam_steps(
    seam: Seam, plan: Plan, turned: bool, work: Work, standing: Sequence[Obstacle] = ()
) -> list[Step]:
    """Return the steps of a seam: itself, and the wait after it."""
    steps = [
        Step(
            seam.name,
            plan,
            turned,
            tuple(seam.events),
            tuple(seam.leaves),
            tuple(seam.may_meet),
        )
    ]
    if seam.wait > 0.0:
        q = np.tile(plan.trajectory.q[-1], (2, 1))
        times, names = np.array([0.0, seam.wait]), plan.robot.joint_names
        still = Trajectory(times, q, np.zeros_like(q), names, np.zeros_like(q))
        # What it leaves stands there by then.
        left = [item for item in seam.leaves if item.name not in seam.may_meet]
        wait = Move(plan.robot, work.asked.of_moves((*standing, *left)), still)
        steps.append(Step(f"{seam.name}, wait", wait, may_meet=tuple(seam.may_meet)))
    return steps
