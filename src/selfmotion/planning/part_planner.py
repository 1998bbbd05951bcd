"""Plans of parts along chains of configurations, and the moves between them."""

import itertools
from dataclasses import replace

import numpy as np

from selfmotion.basics import (
    Array,
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    PlanError,
    Progress,
    SelfmotionError,
)
from selfmotion.certificate import Tolerance
from selfmotion.path import Retimed, Section, section_at_rest
from selfmotion.planning.moves import Mover, Retreat, between_parts
from selfmotion.planning.run import plan_along
from selfmotion.planning.settings import ELSEWHERE, GUIDE_SAMPLES
from selfmotion.problem import Problem, asked_of_part, rest_orders, times_along
from selfmotion.result import Move, Parts, Plan
from selfmotion.search import Sequence, SequenceGuide, Stretch, Stretches, turned_towards

# How smoothly a tool motion has to rest that needs no ramp; see `rest_orders`.
_AT_REST = 2


class PartPlanner:
    """Plans the parts along chains, and the moves between them.

    Attributes
    ----------
    failure : SelfmotionError
        Why a part had no complete motion, of the last one that had none.
    """

    def __init__(
        self,
        problem: Problem,
        stretches: Stretches,
        retreat: Retreat | None,
        ramp: float,
        rng: np.random.Generator | int,
        tolerance: Tolerance,
        progress: Progress,
    ) -> None:
        self._problem, self._stretches, self._ramp = problem, stretches, ramp
        self._tolerance, self._progress = tolerance, progress
        self._closed = any(item.closes for item in problem.constraints)
        generator = np.random.default_rng(rng)
        self._mover = Mover(between_parts(problem), retreat, generator, progress)
        self.failure: SelfmotionError = PlanError("no part was planned")
        # Other chains have many parts in common.
        self._known: dict[tuple[int, bytes], Plan] = {}
        self._turning = np.isinf(problem.robot.lower) & np.isinf(problem.robot.upper)

    def plan(self, chains: list[Stretch]) -> tuple[Parts | None, set[int]]:
        """Return the parts, and the waypoints where a cut has led to one that fails.

        None where one has no complete motion; `failure` then says why.
        """
        plans: list[Plan] = []
        failed: set[int] = set()
        for number, stretch in enumerate(chains, 1):
            self._progress("part", number, len(chains))
            try:
                plans.append(self._part(stretch, plans[-1] if plans else None))
            except (BreakdownError, InverseKinematicsError, NoSequenceError) as error:
                self.failure = error
                return None, failed | self._around(stretch)
            if not plans[-1].certificate.verified:
                failed |= self._around(stretch)
        cuts = tuple(float(stretch.t[-1]) for stretch in chains[:-1])
        endings = tuple(stretch.ending for stretch in chains[:-1])
        moves = self._moves(plans)
        parts = Parts(self._problem, tuple(plans), moves, cuts, endings, tolerance=self._tolerance)
        return parts, failed

    def _moves(self, plans: list[Plan]) -> tuple[Move, ...]:
        pairs = list(itertools.pairwise(plans))
        if self._closed:
            pairs.append((plans[-1], plans[0]))
        if not all(plan.certificate.verified for plan in plans):
            trouble = "not looked for, since a part is not verified"
            missing = Move(self._problem.robot, (), None, trouble)
            return tuple(missing for _ in pairs)
        ends = [(one.trajectory.q[-1], other.trajectory.q[0]) for one, other in pairs]
        return tuple(self._mover.move(*each) for each in ends)

    def _around(self, stretch: Stretch) -> set[int]:
        """Return the waypoints at which the parts to both sides of a stretch's ends are not cut."""
        last = len(self._stretches.t) - 1
        width = max(1, round(ELSEWHERE * last))
        cuts = {stretch.first, stretch.last} - {0, last}
        return {i for cut in cuts for i in range(cut - width, cut + width + 1)}

    def _part(self, stretch: Stretch, before: Plan | None) -> Plan:
        """Return the plan along a stretch that follows another one's plan."""
        t, q = stretch.t, stretch.q
        if before is not None:
            q = turned_towards(q, before.trajectory.q[-1], self._turning)
        key = stretch.first, q.tobytes()
        if key not in self._known:
            self._known[key] = self._planned(self._part_problem(stretch), t, q)
        return self._known[key]

    def _planned(self, problem: Problem, t: Array, q: Array) -> Plan:
        """Return the plan along a chain q (W, n) at the path's times t (W,)."""
        if isinstance(problem.path, Retimed):
            t = problem.path.when(t - t[0])
        if len(t) < GUIDE_SAMPLES:
            t, few = np.linspace(0.0, problem.path.duration, GUIDE_SAMPLES), t
            q = np.stack([np.interp(t, few, joint) for joint in q.T], axis=1)
        guide = SequenceGuide(Sequence(t, q, 0.0))
        return plan_along(problem, guide, self._tolerance, self._progress)

    def _part_problem(self, stretch: Stretch) -> Problem:
        """Return the problem of a stretch: at rest where it is cut, with what is asked of it."""
        whole, last = self._problem, len(self._stretches.t) - 1
        cut = stretch.first > 0 or self._closed, stretch.last < last or self._closed
        if not any(cut):
            return whole
        ends = float(stretch.t[0]), float(stretch.t[-1])
        orders = rest_orders(Section(whole.path, *ends), whole.task)
        ramped = cut[0] and orders[0] < _AT_REST, cut[1] and orders[1] < _AT_REST
        path = section_at_rest(whole.path, *ends, min(self._ramp, ends[1] - ends[0]), ramped)
        return replace(
            whole,
            **whole.along(lambda _: path, times_along(path, ends)),
            start=whole.start if stretch.first == 0 else None,
            constraints=list(asked_of_part(whole, stretch.first == 0, stretch.last == last)),
            rest=True,
        )
