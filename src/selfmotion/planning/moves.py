"""Joint motions between parts of a path, after a retreat where asked."""

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Progress, SelfmotionError
from selfmotion.costs import JointVelocity
from selfmotion.motion import Trajectory, joined_motions, reversed_motion
from selfmotion.path import Line
from selfmotion.planning.run import plan
from selfmotion.planning.settings import BRIEFEST_RETREAT, RETREAT_SPEED
from selfmotion.problem import Problem, at_all_times
from selfmotion.result import Move
from selfmotion.task import SE3
from selfmotion.transfer import FreeMotions


@dataclass(frozen=True, eq=False)
class Retreat:
    """How the tool leaves the path before a move, and comes back to it.

    Attributes
    ----------
    length : float
        How far [m].
    axis : (3,)
        Where to, in tool axes, of length 1.
    """

    length: float
    axis: Array


class Mover:
    """Finds moves between configurations of a problem.

    Parameters
    ----------
    problem : Problem
        What it asks of all times is asked of moves as well.
    retreat : Retreat or None
    rng : Generator
    progress : Progress
    """

    def __init__(
        self,
        problem: Problem,
        retreat: Retreat | None,
        rng: np.random.Generator,
        progress: Progress,
    ) -> None:
        self._problem, self._retreat = problem, retreat
        self._free = FreeMotions(problem.robot, problem.all_constraints, rng, progress)

    def move(self, first: Array, last: Array) -> Move:
        """Return a move from a configuration (n,) to another one, or why there is none."""
        if self._retreat is None:
            return self._free.between(first, last)
        try:
            away, back = (self._lead(q, self._retreat) for q in (first, last))
        except SelfmotionError as error:
            trouble = f"the tool cannot retreat along its axis: {error}"
            return Move(self._free.robot, self._free.constraints, None, trouble)
        between = self._free.between(away.q[-1], back.q[-1])
        if between.trajectory is None:
            return between
        whole = joined_motions([away, between.trajectory, reversed_motion(back)])
        return Move(self._free.robot, self._free.constraints, whole)

    def _lead(self, q: Array, retreat: Retreat) -> Trajectory:
        """Return the motion of the tool away from where q has it; SelfmotionError for none."""
        pose = self._problem.robot.pose(q)
        away = pose * SE3(np.eye(3), retreat.length * retreat.axis)
        duration = max(retreat.length / RETREAT_SPEED, BRIEFEST_RETREAT)
        line = Line(pose, away, duration)
        return plan(replace(self._problem, path=line, start=q)).require().trajectory


def between_parts(problem: Problem) -> Problem:
    """Return a problem with what it asks of all times, and nothing that it asks of an end."""
    return replace(
        problem,
        start=None,
        costs=(JointVelocity.usual(problem.robot),),
        constraints=at_all_times(problem.constraints),
        relaxations=(),
        rest=True,
    )
