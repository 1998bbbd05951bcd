"""Jobs whose seams leave something behind: each is planned past what stands there by then."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from selfmotion.basics import Array
from selfmotion.certificate import FinishedMotion
from selfmotion.collision import Obstacle
from selfmotion.job.ordering import Ordering, State
from selfmotion.job.program import Program
from selfmotion.job.seam import JOB_END, JOB_START, Seam
from selfmotion.job.seam_steps import seam_steps
from selfmotion.job.step import Step
from selfmotion.job.work import Work
from selfmotion.problem import Problem
from selfmotion.result import Move, Plan

# A seam is tried in so many ways that are known, before others are looked for; and comes earlier,
# where something stands in its way, so often.
_WAYS, _EARLIER = 8, 3


@dataclass(frozen=True, eq=False)
class _Sofar:
    """What is made: steps, what stands there, where the arm is, and after which seam."""

    steps: tuple[Step, ...] = ()
    standing: tuple[Obstacle, ...] = ()
    q: Array | None = None
    seam: Seam | None = None

    def without(self, *seams: Seam | None) -> tuple[Obstacle, ...]:
        """Return what stands there but for what seams may meet."""
        may = {name for seam in seams if seam is not None for name in seam.may_meet}
        return tuple(item for item in self.standing if item.name not in may)


class Growing:
    """Builds the program of a job that leaves something behind, one seam after the other.

    The order is that by what moves take at least. A seam that cannot be made any more at its place
    comes earlier, before what stands in its way; where that does not help, or the order is given,
    it is missing, and said to be.

    Parameters
    ----------
    ordering : Ordering
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """

    def __init__(self, ordering: Ordering, work: Work, ends: tuple[Array | None, ...]) -> None:
        self._ordering, self._work, self._ends = ordering, work, ends
        self._notes: list[str] = []
        self._blockers: set[str] = set()

    def program(self) -> Program:
        """Return the program; what could not be made is named."""
        ordering, found = self._ordering, self._ordering.best()
        order = [ordering.states[k] for k in found.states]
        # What is made before each place.
        sofar = [_Sofar(q=self._ends[0])]
        earlier: dict[int, int] = {}
        while len(sofar) <= len(order):
            place = len(sofar) - 1
            state = order[place]
            self._work.tell("program", place + 1, len(order))
            following = order[place + 1] if place + 1 < len(order) else None
            made, why = self._next(sofar[-1], state, following)
            if made is not None:
                sofar.append(made)
                continue
            tries = earlier[state.seam] = earlier.get(state.seam, 0) + 1
            earlier_may_help = ordering.is_free and tries <= _EARLIER
            before = self._before_blockers(order, place) if earlier_may_help else place
            name = ordering.seams[state.seam].name
            if before < place:
                self._notes.append(f"'{name}' comes earlier: {why}")
                order.insert(before, order.pop(place))
                del sofar[before + 1 :]
            else:
                ordering.drop(state.seam, why)
                kept = set(ordering.made)
                order = [item for item in order if item.seam in kept]
        steps = self._to_the_end(sofar[-1])
        robot, missing = self._work.asked.robot, dict(ordering.missing)
        return Program(robot, steps, missing, found.bound, tuple(self._notes))

    def _next(
        self, sofar: _Sofar, state: State, following: State | None
    ) -> tuple[_Sofar | None, str]:
        """Return what is made after a seam; or None, and why it cannot be made."""
        seam = self._ordering.seams[state.seam]
        self._blockers, why = set(), ""
        # The first that can be made and reached.
        for plan, turned, reason in self._ways(sofar, state, following):
            if plan is None:
                why = why or reason
                continue
            start = plan.trajectory.q[0]
            steps: list[Step] = []
            if sofar.q is not None:
                standing = sofar.without(sofar.seam, seam)
                (move,) = self._work.moves([(sofar.q, start, standing)])
                if not move.verified:
                    why = why or f"the move to it: {move.trouble}"
                    continue
                steps.append(self._move_step(sofar, seam, move))
            steps += seam_steps(seam, plan, turned, self._work, sofar.without(seam))
            standing = (*sofar.standing, *seam.leaves)
            whole = (*sofar.steps, *steps)
            return _Sofar(whole, standing, plan.trajectory.q[-1], seam), ""
        return None, why

    def _ways(
        self, sofar: _Sofar, state: State, following: State | None
    ) -> Iterator[tuple[Plan | None, bool, str]]:
        """Yield plans of a seam past what stands there, those known first, or why one is none."""
        seam = self._ordering.seams[state.seam]
        standing = sofar.without(seam)
        problems = {
            turned: self._work.asked.problem(seam, standing, turned)
            for turned in ([False, True] if seam.either_way else [False])
        }
        for one in self._known_ways(sofar, state, following):
            if not standing:
                yield one.made, one.turned, ""
                continue
            plan, reason = self._past(one.made, problems[one.turned])
            yield plan, one.turned, reason
        # Others begin clear of what stands there; what they meet later is judged as well.
        alone = {turned: self._work.asked.problem(seam, (), turned) for turned in problems}
        if sofar.q is not None:
            wanted = [(seam, problem, sofar.q) for problem in alone.values()]
            for turned, plans in zip(alone, self._work.nearby(wanted), strict=True):
                for plan in plans:
                    past, why = self._past(plan, problems[turned])
                    yield past, turned, why
        for turned, problem in problems.items():
            ((plans, reason),) = self._work.branches([(seam, alone[turned])], problem)
            for plan in plans:
                past, why = self._past(plan, problem)
                yield past, turned, why
            if not plans:
                yield None, turned, reason

    def _known_ways(self, sofar: _Sofar, state: State, following: State | None) -> list[State]:
        """Return the states of a seam, the one that was chosen and then the nearest first."""
        ordering = self._ordering
        same = [one for one in ordering.states if one.seam == state.seam and one is not state]

        def far(one: State) -> float:
            to = 0.0 if sofar.q is None else ordering.seconds(sofar.q, one.ends[0])
            away = 0.0 if following is None else ordering.seconds(one.ends[1], following.ends[0])
            return to + away

        return [state, *sorted(same, key=far)][:_WAYS]

    def _past(self, plan: Plan, problem: Problem) -> tuple[Plan | None, str]:
        """Return a plan for a problem with more that stands there; or None, and what it meets."""
        apart = problem.own_collision
        if apart is not None:
            found = apart.requirement(problem.robot).judge(
                FinishedMotion(problem.robot, plan.trajectory)
            )
            if not found.kept:
                self._blockers |= set(found.subject.split(" - "))
                return None, found.text
        checked = replace(plan, problem=problem)
        checked = replace(checked, certificate=checked.check())
        verified = checked.certificate.verified
        return (checked, "") if verified else (None, checked.certificate.verdict)

    def _before_blockers(self, order: list[State], place: int) -> int:
        """Return an earlier place for a seam, before what stands in its way; its own for none."""
        ordering = self._ordering
        for at, state in enumerate(order[:place]):
            left = {item.name for item in ordering.seams[state.seam].leaves}
            if left & self._blockers:
                moved = [one.seam for one in order]
                moved.insert(at, moved.pop(place))
                return at if ordering.keeps(moved) else place
        return place

    def _move_step(self, sofar: _Sofar, seam: Seam | None, move: Move) -> Step:
        first = JOB_START if sofar.seam is None else sofar.seam.name
        last = JOB_END if seam is None else seam.name
        may = tuple(name for one in (sofar.seam, seam) if one is not None for name in one.may_meet)
        return Step(f"{first} → {last}", move, may_meet=may)

    def _to_the_end(self, sofar: _Sofar) -> tuple[Step, ...]:
        if self._ends[1] is None or sofar.q is None:
            return sofar.steps
        (move,) = self._work.moves([(sofar.q, self._ends[1], sofar.without(sofar.seam))])
        return (*sofar.steps, self._move_step(sofar, None, move))
