"""Joint motions from one configuration to another, at rest at both ends, free of collision."""

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Progress, SelfmotionError
from selfmotion.certificate import Finding, FinishedMotion, Requirement, arm_limits
from selfmotion.constraints import Envelope
from selfmotion.costs import JointVelocity
from selfmotion.motion import Trajectory, joined_motions, reversed_motion
from selfmotion.path import Line
from selfmotion.planning.roadmap import Roadmap
from selfmotion.planning.run import plan
from selfmotion.planning.settings import (
    BRIEFEST_RETREAT,
    MOVE_MARGIN,
    RETREAT_SPEED,
    SHORTEST_LEG,
    SLOWER_FACTOR,
    SLOWER_TRIES,
    USED,
    WAYS,
)
from selfmotion.problem import Problem
from selfmotion.result import Move
from selfmotion.task import SE3

# Largest velocity, acceleration and jerk of 10τ³ - 15τ⁴ + 6τ⁵ for 0 ≤ τ ≤ 1.
_SPEED, _ACCELERATION, _JERK = 1.875, 10.0 / np.sqrt(3.0), 60.0


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
        self._problem, self._retreat, self._rng = problem, retreat, rng
        self._progress = progress
        self._asked: Envelope = problem.envelope
        own = tuple(item.requirement(problem.robot) for item in problem.all_constraints)
        self._requirements: tuple[Requirement, ...] = (*arm_limits(problem.robot, own), *own)

    def move(self, first: Array, last: Array) -> Move:
        """Return a move from a configuration (n,) to another one, or why there is none."""
        self._progress("move", 1, 1)
        if self._retreat is None:
            return self._between(first, last)
        try:
            away, back = (self._lead(q, self._retreat) for q in (first, last))
        except SelfmotionError as error:
            return Move(None, trouble=f"the tool cannot retreat along its axis: {error}")
        between = self._between(away.q[-1], back.q[-1])
        if between.trajectory is None:
            return between
        whole = joined_motions([away, between.trajectory, reversed_motion(back)])
        findings = self._judge(whole)
        return Move(whole, findings, _told(findings))

    def _lead(self, q: Array, retreat: Retreat) -> Trajectory:
        """Return the motion of the tool away from where q has it; SelfmotionError for none."""
        pose = self._problem.robot.pose(q)
        away = pose * SE3(np.eye(3), retreat.length * retreat.axis)
        duration = max(retreat.length / RETREAT_SPEED, BRIEFEST_RETREAT)
        line = Line(pose, away, duration)
        return plan(replace(self._problem, path=line, start=q)).require().trajectory

    def _between(self, first: Array, last: Array) -> Move:
        robot, asked = self._problem.robot, self._asked
        arm = asked.arm(robot)
        ways = Roadmap(
            first, last, arm.finite_limits(), robot.joint_weights, self._is_free, self._rng
        )
        worst: tuple[Finding, ...] = ()
        for _ in range(WAYS):
            way = ways.way()
            if way is None:
                break
            motion, findings = self._at_its_pace(way)
            trouble = [item for item in findings if not item.kept]
            if not trouble:
                return Move(motion, findings)
            worst = worst or findings
            leg = int(np.searchsorted(motion.t, trouble[0].time)) - 1
            ways.close(int(np.clip(leg, 0, len(way) - 2)))
        found = f": {_told(worst)}" if worst else ""
        return Move(None, worst, f"no way was found between the configurations{found}")

    def _is_free(self, q: Array) -> bool:
        if np.any(q < self._asked.lower) or np.any(q > self._asked.upper):
            return False
        return not any(model.collides(q, far + MOVE_MARGIN) for model, far in self._asked.bodies)

    def _at_its_pace(self, way: Array) -> tuple[Trajectory, tuple[Finding, ...]]:
        """Return the motion that stops at each configuration of a way (m, n), and its findings."""
        durations = np.array([self._time(step) for step in np.diff(way, axis=0)])
        still = np.zeros_like(way)
        for _ in range(SLOWER_TRIES):
            t = np.concatenate([[0.0], np.cumsum(durations)])
            motion = Trajectory(t, way, still, self._problem.robot.joint_names, still)
            findings = self._judge(motion)
            if not any(not item.kept and item.of_pace for item in findings):
                break
            durations = SLOWER_FACTOR * durations
        return motion, findings

    def _time(self, step: Array) -> float:
        """Return the shortest time [s] of a straight leg from rest to rest within the limits."""
        far, asked = np.abs(step), self._asked
        times = (
            _SPEED * far / (USED * asked.speed),
            np.sqrt(_ACCELERATION * far / (USED * asked.acceleration)),
            np.cbrt(_JERK * far / (USED * asked.jerk)),
        )
        return max(SHORTEST_LEG, *(float(each.max()) for each in times))

    def _judge(self, motion: Trajectory) -> tuple[Finding, ...]:
        finished = FinishedMotion(self._problem.robot, motion)
        return tuple(item.judge(finished) for item in self._requirements)


def _told(findings: tuple[Finding, ...]) -> str:
    return "; ".join(item.text for item in findings if not item.kept)


def between_parts(problem: Problem) -> Problem:
    """Return a problem with what it asks of all times, and nothing that it asks of an end."""
    parts = (item.on_part() for item in problem.constraints)
    inner = [part.on_last_part() for part in parts if part is not None]
    kept = [item for item in inner if item is not None]
    return replace(
        problem,
        start=None,
        costs=(JointVelocity.usual(problem.robot),),
        constraints=kept,
        relaxations=(),
        rest=True,
    )
