"""A job planned anew from its program: seams and moves begin with their old motions."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, one_blas_thread
from selfmotion.constraints import Constraint
from selfmotion.job.program import Program
from selfmotion.job.seam import JOB_END, JOB_START, Seam
from selfmotion.job.seam_steps import seam_steps
from selfmotion.job.step import Step
from selfmotion.job.work import Asked, Work
from selfmotion.planning import from_start, near_start
from selfmotion.problem import Problem, problem_to_dict
from selfmotion.result import Move, Plan
from selfmotion.transfer import FreeMotions

# An old way is followed through so many points of it.
_POINTS = 24
# Configurations that are the same [rad or m].
_SAME = 1e-12


class Replanned:
    """The program of a job, as near to one that was planned before as may be.

    In the same order and directions. A seam that asks for what it asked for before keeps its
    motion; another one begins as near as may be to where it began. A move whose ends stay is kept,
    another one looks first along the old way, bent to its ends.

    Parameters
    ----------
    before : Program
    seams : sequence of Seam
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """

    def __init__(
        self,
        before: Program,
        seams: Sequence[Seam],
        work: Work,
        ends: tuple[Array | None, ...],
    ) -> None:
        self._before, self._work, self._ends = before, work, ends
        self._seams = {seam.name: seam for seam in seams}
        self._asked: Asked = work.asked
        self._free = FreeMotions(
            self._asked.robot, self._asked.of_moves(()), np.random.default_rng(self._asked.seed)
        )
        self._moves = {step.name: step.made for step in before.steps if not step.is_seam}

    def program(self) -> Program | None:
        """Return the program; None where it is to be planned from nothing.

        That is where the seams are others, one leaves something behind, or a seam or a move is not
        found from what there was.
        """
        if sorted(self._before.order) != sorted(self._seams):
            return None
        if any(seam.leaves for seam in self._seams.values()):
            return None
        steps, at, last = list[Step](), self._ends[0], JOB_START
        old_steps = [step for step in self._before.steps if step.is_seam]
        for number, step in enumerate(old_steps, 1):
            self._work.tell("seam", number, len(old_steps))
            seam = self._seams[step.name]
            plan = self._plan_of(seam, step)
            if plan is None:
                return None
            if at is not None:
                name = f"{last} → {seam.name}"
                move = self._move(name, at, plan.trajectory.q[0])
                if not move.verified:
                    return None
                steps.append(Step(name, move))
            steps += seam_steps(seam, plan, step.turned, self._work)
            at, last = plan.trajectory.q[-1], seam.name
        if self._ends[1] is not None and at is not None:
            name = f"{last} → {JOB_END}"
            move = self._move(name, at, self._ends[1])
            if not move.verified:
                return None
            steps.append(Step(name, move))
        return Program(self._asked.robot, tuple(steps), {})

    def _plan_of(self, seam: Seam, step: Step) -> Plan | None:
        old = step.made
        if not isinstance(old, Plan):
            return None
        problem = self._asked.problem(seam, (), step.turned)
        if _same(problem, old.problem) and old.certificate.verified:
            return old
        with one_blas_thread():
            start = near_start(problem, old.trajectory.q[0])
            return None if start is None else from_start(problem, start)[0]

    def _move(self, name: str, first: Array, last: Array) -> Move:
        """Return the move between configurations, by the old one of its name where there is one."""
        old = self._moves.get(name)
        guide = None
        if isinstance(old, Move) and old.trajectory is not None:
            ends = np.stack([first, last])
            same = np.abs(ends - old.motion.q[[0, -1]]).max() <= _SAME
            if same and _as_before(old, self._free.constraints):
                return old
            guide = _bent(old.motion.q, ends)
        with one_blas_thread():
            return self._free.between(first, last, self._asked.deadline, guide)


def _same(problem: Problem, other: Problem) -> bool:
    """Whether two problems ask for the same, wherever they begin."""
    one, two = (problem_to_dict(item) for item in (problem, other))
    return {**one, "start": ""} == {**two, "start": ""}


def _as_before(move: Move, constraints: Sequence[Constraint]) -> bool:
    """Whether a move was judged by the same, and keeps it."""
    own = [item.to_dict() for item in move.constraints]
    asked = [item.to_dict() for item in constraints]
    return own == asked and move.verified


def _bent(q: Array, ends: Array) -> Array:
    """Return a way (m, n) from one end to the other, as the samples of an old one go."""
    lengths = np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1)))
    if lengths[-1] == 0.0:
        return ends
    share = np.linspace(0.0, 1.0, _POINTS)
    old = np.stack([np.interp(share * lengths[-1], lengths, column) for column in q.T], axis=1)
    first, last = ends - old[[0, -1]]
    way: Array = old + (1.0 - share)[:, None] * first + share[:, None] * last
    way[[0, -1]] = ends
    return way
