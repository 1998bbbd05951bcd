"""Motions of seams and paths of moves from an earlier program of the same or a similar job."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from selfmotion.basics import (
    Array,
    ProblemError,
    description_of,
    digest_of,
    shown,
)
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.planner import check_joints
from selfmotion.planning.result import (
    Move,
    Plan,
    arm_digest,
)
from selfmotion.problem.constraints import Clearance, Constraint
from selfmotion.problem.costs import Cost, FunctionCost
from selfmotion.problem.problem import Problem
from selfmotion.work.job.program import Program
from selfmotion.work.job.seam import Seam, precedences

# A move whose ends are farther away than this in all is of no use [rad or m].
_NEAR = 1.5
# Samples of an earlier move, from which its corners are found.
_SAMPLES = 65
# Deviation of the samples from the polyline of these corners [rad or m].
_STRAIGHT = 0.02


@dataclass(frozen=True, eq=False)
class EarlierProgram:
    """Results of an earlier program.

    Parameters
    ----------
    program : Program
    """

    program: Program

    @cached_property
    def _of_seams(self) -> dict[str, tuple[Plan, bool]]:
        steps = self.program.steps
        return {
            step.name: (step.made, step.turned) for step in steps if isinstance(step.made, Plan)
        }

    def plan_of(self, seam: Seam) -> tuple[Plan, bool] | None:
        """Return the plan of a seam by its name, and whether it is turned; None for none."""
        plan, turned = self._of_seams.get(seam.name, (None, False))
        return None if plan is None or (turned and not seam.either_way) else (plan, turned)

    def unchanged_plan(
        self,
        seam: Seam,
        problem: Problem,
        constraints: Sequence[Constraint],
        clearances: Sequence[Clearance],
    ) -> tuple[Plan | None, str]:
        """Return the plan of an unchanged seam, or the reason why there is none.

        It is certified anew for its `problem`, in its direction, since files of bodies may have
        changed. `constraints` and `clearances` are those of the job.
        """
        earlier_plan = self.plan_of(seam)
        if seam.name not in self._of_seams:
            return None, "the earlier program does not make it"
        if earlier_plan is None:
            return None, "it was made from its end to its start, and may not be any more"
        changed = self._changed(seam, problem.robot, constraints, clearances)
        if changed:
            return None, changed
        plan, _ = earlier_plan
        again = replace(plan, problem=replace(problem, start=plan.problem.start))
        again = replace(again, certificate=again.check())
        if again.certificate.verified:
            return again, ""
        return None, f"it is not verified any more: {again.certificate.summary}"

    def _changed(
        self,
        seam: Seam,
        robot: RobotModel,
        constraints: Sequence[Constraint],
        clearances: Sequence[Clearance],
    ) -> str:
        """Return in words what of a seam's specification has changed; "" for nothing."""
        before = self.program.specification
        if before is None:
            return "the earlier program does not say what was asked for"
        seam_before = next((item for item in before.seams if item.name == seam.name), None)
        if seam_before is None:
            return "the earlier program does not say what was asked of it"
        if before.arm != arm_digest(robot):
            return "the arm is another, or its tool, reference, limits or locked joints are"
        if Task.of(seam_before.task) is not Task.of(seam.task):
            return "its task is another"
        if not _cost_the_same(seam_before.costs, seam.costs):
            return "its costs are others"
        pairs: dict[str, tuple[Sequence[Any], Sequence[Any]]] = {
            "its path is another": ([seam_before.path], [seam.path]),
            "its tolerances are others": (seam_before.relaxations, seam.relaxations),
            "its constraints are others": (seam_before.constraints, seam.constraints),
            "the constraints of the job are others": (before.constraints, constraints),
            "what the job is kept clear of is another": (before.clearances, clearances),
        }
        for text, (some, others) in pairs.items():
            if _described(some) != _described(others):
                return text
        return ""

    def kept_seams(self, program: Program, changed: Mapping[str, str], why: str) -> dict[str, str]:
        """Return for each seam of a program "" where its motion is kept, else why it is not.

        `changed` has seams whose specification changed; `why` says what was wrong with a program
        of all unchanged motions.
        """
        kept = dict[str, str]()
        for name, plan in program.plans.items():
            plan_before, _ = self._of_seams.get(name, (None, False))
            motion = None if plan_before is None else plan_before.trajectory
            same = motion is not None and all(
                np.array_equal(getattr(motion, part), getattr(plan.trajectory, part))
                for part in ("t", "q", "qd")
            )
            reason = changed.get(name) or f"no program comes of what could be kept: {why}"
            kept[name] = "" if same else reason
        return kept

    def order_of(self, seams: Sequence[Seam]) -> list[Seam] | None:
        """Return the seams in its order, if it has the same seams and this order is allowed."""
        named, order = {seam.name: seam for seam in seams}, self.program.order
        if sorted(order) != sorted(named):
            return None
        listed = [named[name] for name in order]
        return listed if precedences(listed).keeps(range(len(listed))) else None

    def move_like(self, ends: Array) -> Move | None:
        """Return the move whose ends are nearest to others (2, n), or None for none near."""
        moves = [move for move in self.program.moves if _moves_the_arm(move)]
        far = [_distance(move.motion.q[[0, -1]], ends) for move in moves]
        k = int(np.argmin(far)) if far else -1
        return moves[k] if k >= 0 and far[k] < _NEAR else None


def _described(several: Sequence[Any]) -> str:
    """Return a digest of values."""
    return digest_of([description_of(item) for item in several])


def _cost_the_same(some: Sequence[Cost] | None, others: Sequence[Cost] | None) -> bool:
    """Whether costs are equal; functions are equal only if they are the same object."""
    if some is None or others is None:
        return some is others
    if len(some) != len(others):
        return False
    return all(
        one is other
        or (not isinstance(one, FunctionCost) and description_of(one) == description_of(other))
        for one, other in zip(some, others, strict=True)
    )


def check_earlier(earlier: object, robot: RobotModel) -> None:
    """Raise ProblemError where an earlier program is none, or one of another arm."""
    if not isinstance(earlier, Program):
        raise ProblemError(
            f"warm_start is {shown(earlier)}, expected a Program; load_program reads one"
        )
    check_joints(earlier.robot, robot)


def adapted_waypoints(motion: Trajectory, ends: Array) -> Array:
    """Return the corners (m, n) of a motion, moved so that it has other ends (2, n).

    The displacement of each end fades out towards the other one.
    """
    q = motion(np.linspace(motion.t[0], motion.t[-1], _SAMPLES))
    gone = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1))])
    even = np.linspace(0.0, 1.0, _SAMPLES)
    share = (gone / gone[-1] if gone[-1] > 0.0 else even)[:, None]
    points = q + (1.0 - share) * (ends[0] - q[0]) + share * (ends[1] - q[-1])
    return np.asarray(points[_corners(points, 0, _SAMPLES - 1)])


def _corners(points: Array, first: int, last: int) -> list[int]:
    """Return which of the points (m, n) a polyline needs (Ramer, Douglas and Peucker)."""
    share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    chord = points[first] + share * (points[last] - points[first])
    off = np.abs(points[first : last + 1] - chord).max(axis=1)
    k = first + int(np.argmax(off))
    if off.max() <= _STRAIGHT:
        return [first, last]
    return [*_corners(points, first, k)[:-1], *_corners(points, k, last)]


def _moves_the_arm(move: Move) -> bool:
    """Whether it is a move that was found, not a wait."""
    motion = move.trajectory
    return motion is not None and float(np.abs(motion.q[-1] - motion.q[0]).max()) > 0.0


def _distance(ends: Array, others: Array) -> float:
    """Return the distance of two pairs of ends (2, n), the sum of both [rad or m]."""
    return float(np.abs(ends - others).max(axis=1).sum())
