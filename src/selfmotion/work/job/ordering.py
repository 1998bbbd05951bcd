"""The order of the seams of a job, by what is known of its moves."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.planning.result import Plan
from selfmotion.planning.transfer import FreeMotions
from selfmotion.problem.problem import Problem
from selfmotion.work.job.order import EXACT, best_round
from selfmotion.work.job.seam import JOB_END, JOB_START, Seam, backwards_plan, precedences
from selfmotion.work.job.stops import Round, Stops
from selfmotion.work.job.work import Work

# Rounds in which motions are added that start near the end of the seam before.
_NEARBY_ROUNDS = 4
# The same with many seams.
_NEARBY_ROUNDS_OF_MANY = 2
# Moves shorter than this need no such motion [s].
_SHORT = 0.1
# Least time that an added motion has to save [s].
_WORTH = 0.02


@dataclass(frozen=True, eq=False)
class State:
    """A motion of a seam, in one direction.

    Attributes
    ----------
    seam : int
        Which one.
    plan : Plan
    turned : bool
        Whether from the seam's end to its start.
    mirrored : bool
        Whether the plan is that of the other direction, and is to be reversed.
    """

    seam: int
    plan: Plan
    turned: bool = False
    mirrored: bool = False

    @property
    def ends(self) -> Array:
        """The configurations at its start and end, (2, n)."""
        ends = self.plan.trajectory.q[[0, -1]]
        return ends[::-1] if self.mirrored else ends


class Ordering:
    """The states of all seams, the moves between them, and the best round.

    Parameters
    ----------
    seams : sequence of Seam
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program starts and ends.
    price : float
        Time that a unit of cost counts as [s].
    is_free : bool
        Whether the order is to be found; otherwise it is that of the list.

    Attributes
    ----------
    is_free : bool
        Whether the order is to be found.
    states : list of State
    missing : dict
        Seams without a state, and why.
    changed : dict
        Seams that are not as in an earlier program, and why; "" without such a program.

    Raises
    ------
    ProblemError
        Precedences are circular, or are not kept by the order that is given.
    """

    def __init__(
        self,
        seams: Sequence[Seam],
        work: Work,
        ends: tuple[Array | None, ...],
        price: float,
        is_free: bool,
    ) -> None:
        self.seams, self._work, self._ends = list(seams), work, ends
        self._price, self.is_free = price, is_free
        settings = work.settings
        constraints = settings.move_constraints(())
        self._free = FreeMotions(settings.robot, constraints, np.random.default_rng(0))
        self.states: list[State] = []
        self._mirrored: dict[int, Plan] = {}
        self.missing: dict[str, str] = {}
        self._check_order()
        # Times of planned moves from state to state; None for the ends of the program.
        self._known: dict[tuple[int | None, int | None], float] = {}
        # The seams that plans cannot come after.
        self._too_late: dict[Plan, set[int]] = {}
        self.problems: list[Problem] = [settings.problem(seam) for seam in self.seams]
        # Seams of an earlier program stay near its motions.
        program = work.earlier
        earlier = [None if program is None else program.plan_of(seam) for seam in self.seams]
        self._with_earlier = {number for number, one in enumerate(earlier) if one is not None}
        self.changed: dict[str, str] = {}
        wanted = dict[int, tuple[Seam, Problem, Plan | None]]()
        for number, (seam, one) in enumerate(zip(self.seams, earlier, strict=True)):
            unchanged, why = work.unchanged_plan(seam)
            if unchanged is not None:
                # As it is, in its direction.
                self.states.append(State(number, unchanged, one is not None and one[1]))
                continue
            self.changed[seam.name] = why
            problem = self.problems[number]
            wanted[number] = (
                (seam, problem, None)
                if one is None
                else (seam, settings.problem(seam, turned=one[1]), one[0])
            )
        self._unchanged = tuple(self.states)
        previous = work.like_before(list(wanted.values())) if wanted else []
        for number, (plans, reason) in zip(wanted, previous, strict=True):
            one = earlier[number]
            if not plans:
                self.missing[self.seams[number].name] = reason
            for plan in plans:
                self.add(number, plan, one is not None and one[1])
        self._drop_dependents()
        if self.states:
            self._add_alike()
            self._add_nearby()
        self._missing_at_first = dict(self.missing)

    @property
    def has_unchanged(self) -> bool:
        """Whether some seams are as in an earlier program, and in its directions."""
        return bool(self._unchanged)

    def free(self, *, order: bool, directions: bool) -> None:
        """Let the order be found anew, and unchanged seams be reversed as well."""
        self.missing = dict(self._missing_at_first)
        self.is_free = self.is_free or order
        if directions:
            for state in self._unchanged:
                if self.seams[state.seam].either_way:
                    turned = not state.turned
                    self.states.append(State(state.seam, state.plan, turned, mirrored=True))
            self._unchanged = ()
            self.__dict__.pop("estimates", None)

    def plan_of(self, state: int) -> Plan:
        """Return the plan of a state in the direction in which it is followed."""
        one = self.states[state]
        if not one.mirrored:
            return one.plan
        if state not in self._mirrored:
            seam = self.seams[one.seam]
            problem = self._work.settings.problem(seam, turned=one.turned)
            self._mirrored[state] = backwards_plan(one.plan, problem)
        return self._mirrored[state]

    def add(self, seam: int, plan: Plan, turned: bool = False) -> None:
        """Add a motion of a seam, and its reverse where the seam has either direction."""
        self.states.append(State(seam, plan, turned))
        if self.seams[seam].either_way:
            self.states.append(State(seam, plan, not turned, mirrored=True))
        self.__dict__.pop("estimates", None)

    def cost_of(self, state: int) -> float:
        """Return the cost of a state without moves [s]."""
        return self._price * self.states[state].plan.report.cost

    def name_of(self, state: int) -> str:
        """Return the name of a state's seam."""
        return self.seams[self.states[state].seam].name

    def name_of_move(self, first: int | None, last: int | None) -> str:
        """Return the name of a move between states; None is the start or the end of the program."""
        one = JOB_START if first is None else self.name_of(first)
        return f"{one} → {JOB_END if last is None else self.name_of(last)}"

    def seconds(self, first: Array, last: Array) -> float:
        """Return a lower bound of the time of a move between configurations (n,) [s]."""
        return float(self._free.time_of(first, last))

    def drop(self, seam: int, reason: str) -> None:
        """Leave out a seam, and those that cannot come without it."""
        self.missing[self.seams[seam].name] = reason
        self._drop_dependents()

    def count_without(self, seam: int) -> int:
        """Return how many seams remain in an order without this one; 0 for no order."""
        missing = dict(self.missing)
        self.drop(seam, "")
        count = len(self.planned) if self.best().states else 0
        self.missing = missing
        return count

    def _drop_dependents(self) -> None:
        """Leave out seams that depend on missing ones."""
        never = [self.seams[k] for k in self._impossible()]
        names = {seam.name for seam in never} | self.missing.keys()
        for seam in never:
            gone = [name for name in seam.after if name in names]
            self.missing[seam.name] = (
                f"it comes after '{gone[0]}', which is not made"
                if gone
                else "nothing that supports it is made before it"
            )

    def _impossible(self) -> list[int]:
        """Return the seams whose precedences cannot be met by those that are not missing."""
        before = precedences(self.seams)
        allowed, count = set[int](), -1
        while len(allowed) > count:
            count = len(allowed)
            for seam in self.planned:
                if before.allows(seam, allowed):
                    allowed.add(seam)
            if not self.is_free:
                break
        return [seam for seam in self.planned if seam not in allowed]

    def _check_order(self) -> None:
        """Raise ProblemError where seams cannot come in any order, or in the one that is given."""
        if not self._impossible():
            return
        if self.is_free:
            raise ProblemError("the order of seams (after=) is circular")
        raise ProblemError(
            "the seams are in an order in which one comes before what it has to come after; "
            "give order='free', or another list"
        )

    def record_time(self, first: int | None, last: int | None, seconds: float) -> None:
        """Record the time of a move between states; inf if there is none."""
        self._known[first, last] = seconds

    def forbid_after(self, state: int, seams: Iterable[int]) -> None:
        """Record that a state, and its reverse, cannot come after seams."""
        self._too_late.setdefault(self.states[state].plan, set()).update(seams)

    @property
    def planned(self) -> list[int]:
        """The seams that are not missing."""
        return [k for k, seam in enumerate(self.seams) if seam.name not in self.missing]

    @property
    def _places(self) -> dict[int, int]:
        """The seams that are not missing, numbered anew from 0 on."""
        return {seam: k for k, seam in enumerate(self.planned)}

    def best(self, near: Sequence[int] | None = None) -> Round:
        """Return the best round of states by the known times; its states are indices of `states`.

        For many seams the local search begins at the round `near`, where one is given.
        """
        place = self._places
        present = [k for k, state in enumerate(self.states) if state.seam in place]
        if not place:
            return Round((), 0.0, 0.0)
        stops = self._stops(present, place)
        fixed_order = None if self.is_free else list(range(len(place)))
        order = None if near is None else [place[self.states[k].seam] for k in near]
        best = best_round(stops, fixed_order, order)
        return Round(tuple(present[k] for k in best.states), best.cost, best.bound)

    def bound(self) -> float:
        """Return a lower bound of the cost of any round, by lower bounds of all moves."""
        known, too_late = self._known, self._too_late
        self._known, self._too_late = {}, {}
        least = self.best().bound
        self._known, self._too_late = known, too_late
        return least

    def _stops(self, present: list[int], place: dict[int, int]) -> Stops:
        first, last, between = self.estimates
        first, last = first[present].copy(), last[present].copy()
        between = between[np.ix_(present, present)]
        row = {state: k for k, state in enumerate(present)}
        for (one, other), seconds in self._known.items():
            if one is None and other in row:
                first[row[other]] = seconds
            elif other is None and one in row:
                last[row[one]] = seconds
            elif one in row and other in row:
                between[row[one], row[other]] = seconds
        before = precedences([self.seams[seam] for seam in place])
        too_late = np.zeros((len(present), len(place)), dtype=bool)
        for k, state in enumerate(present):
            seams = self._too_late.get(self.states[state].plan, ())
            too_late[k, [place[seam] for seam in seams if seam in place]] = True
        return Stops(
            before.after,
            before.after_any,
            np.array([place[self.states[k].seam] for k in present]),
            np.array([self.cost_of(k) for k in present]),
            between,
            first,
            last,
            too_late,
        )

    @cached_property
    def estimates(self) -> tuple[Array, Array, Array]:
        """Least times of moves: to states (m,), from them (m,), between them (m, m) [s]."""
        starts = np.array([state.ends[0] for state in self.states])
        ends = np.array([state.ends[1] for state in self.states])
        start, end = self._ends
        none = np.zeros(len(self.states))
        first = none if start is None else self._free.time_of(start, starts)
        last = none if end is None else self._free.time_of(ends, end)
        between = np.array([self._free.time_of(q, starts) for q in ends])
        return first, last, between

    def _add_alike(self) -> None:
        """Add a motion of each seam that starts as near as possible to one configuration.

        Motions near to the same configuration are near to each other.
        """
        here = self.states[0].ends[0] if self._ends[0] is None else self._ends[0]
        new = [seam for seam in self.planned if seam not in self._with_earlier]
        plans = self._work.nearby([(self.seams[k], self.problems[k], here) for k in new])
        for seam, found in zip(new, plans, strict=True):
            states_of_seam = [state for state in self.states if state.seam == seam]
            for plan in found:
                starts = [
                    self.seconds(plan.trajectory.q[0], state.ends[0]) for state in states_of_seam
                ]
                if min(starts) > _WORTH:
                    self.add(seam, plan)

    def _add_nearby(self) -> None:
        """Add motions that start near the end of the seam before, along the best round."""
        tried: set[tuple[int | None, int]] = set()
        few = len(self.planned) <= EXACT
        for _ in range(_NEARBY_ROUNDS if few else _NEARBY_ROUNDS_OF_MANY):
            states = self.best().states
            wanted = []
            for number, state in enumerate(states):
                here = self.states[state]
                before = self._ends[0] if number == 0 else self.states[states[number - 1]].ends[1]
                pair = (states[number - 1] if number else None, state)
                if before is None or pair in tried or here.seam in self._with_earlier:
                    continue
                if self.seconds(before, here.ends[0]) <= _SHORT:
                    continue
                tried.add(pair)
                seam = self.seams[here.seam]
                problem = self._work.settings.problem(seam, turned=here.turned)
                wanted.append((here, seam, problem, before))
            if not wanted:
                break
            plans = self._work.nearby([item[1:] for item in wanted])
            added = 0
            for (here, _, _, before), found in zip(wanted, plans, strict=True):
                for plan in found:
                    starts = plan.trajectory.q[0], here.ends[0]
                    nearer, present = (self.seconds(before, q) for q in starts)
                    if nearer < present - _WORTH:
                        self.add(here.seam, plan, here.turned)
                        added += 1
            if not added:
                break
