"""The order of a job by what is known of its moves."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.planning.result import Plan
from selfmotion.planning.transfer import FreeMotions
from selfmotion.problem.problem import Problem
from selfmotion.work.job.order import EXACT, best_round
from selfmotion.work.job.seam import JOB_END, JOB_START, Seam, backwards_plan, waiting
from selfmotion.work.job.stops import Round, Stops
from selfmotion.work.job.work import Work

# Rounds in which motions are added that begin where the seam before ends.
_NEARBY_ROUNDS = 4
# The same with many seams.
_NEARBY_ROUNDS_OF_MANY = 2
# Moves shorter than this need no such motion [s].
_SHORT = 0.1
# Least time that an added motion has to save [s].
_WORTH = 0.02


@dataclass(frozen=True, eq=False)
class State:
    """One way to make a seam.

    Attributes
    ----------
    seam : int
        Which one.
    plan : Plan
    turned : bool
        Whether from the seam's end to its start.
    mirrored : bool
        Whether the plan is that of the other direction, to be turned round.
    """

    seam: int
    plan: Plan
    turned: bool = False
    mirrored: bool = False

    @property
    def ends(self) -> Array:
        """The configurations at its begin and end, (2, n)."""
        ends = self.plan.trajectory.q[[0, -1]]
        return ends[::-1] if self.mirrored else ends


class Ordering:
    """Which states there are, what leads from one to another, and the best round of them.

    Parameters
    ----------
    seams : sequence of Seam
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    price : float
        What a unit of cost counts [s].
    is_free : bool
        Whether the order is.

    Attributes
    ----------
    is_free : bool
        Whether the order is.
    states : list of State
    missing : dict
        Seams without a state, and why.
    changed : dict
        Seams that are not made as in an earlier program, and why; "" without any.

    Raises
    ------
    ProblemError
        What has to come first is circular, or comes later in the order that is given.
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
        asked = work.asked
        self._free = FreeMotions(asked.robot, asked.of_moves(()), np.random.default_rng(0))
        self.states: list[State] = []
        self._mirrored: dict[int, Plan] = {}
        self.missing: dict[str, str] = {}
        self._check_order()
        # Times that are known better than by limits, from state to state; None for the ends.
        self._known: dict[tuple[int | None, int | None], float] = {}
        # The seams that plans cannot come after.
        self._too_late: dict[Plan, set[int]] = {}
        self.problems: list[Problem] = [asked.problem(seam) for seam in self.seams]
        # Orders that begin with an earlier program stay near its motions.
        known = work.earlier
        before = [None if known is None else known.plan_of(seam) for seam in self.seams]
        self._begun = {number for number, one in enumerate(before) if one is not None}
        self.changed: dict[str, str] = {}
        wanted = dict[int, tuple[Seam, Problem, Plan | None]]()
        for number, (seam, one) in enumerate(zip(self.seams, before, strict=True)):
            kept, why = work.kept(seam)
            if kept is not None:
                # As it is, in its direction.
                self.states.append(State(number, kept, one is not None and one[1]))
                continue
            self.changed[seam.name] = why
            problem = self.problems[number]
            wanted[number] = (
                (seam, problem, None)
                if one is None
                else (seam, asked.problem(seam, turned=one[1]), one[0])
            )
        self._kept = tuple(self.states)
        made = work.like_before(list(wanted.values())) if wanted else []
        for number, (plans, reason) in zip(wanted, made, strict=True):
            one = before[number]
            if not plans:
                self.missing[self.seams[number].name] = reason
            for plan in plans:
                self.add(number, plan, one is not None and one[1])
        self._drop_what_hangs()
        if self.states:
            self._add_alike()
            self._add_nearby()
        self._missing_at_first = dict(self.missing)

    @property
    def keeps(self) -> bool:
        """Whether seams are made as an earlier program makes them, and in its directions."""
        return bool(self._kept)

    def free(self, *, order: bool, directions: bool) -> None:
        """Let the order be looked for, and what is kept be made the other way round as well."""
        self.missing = dict(self._missing_at_first)
        self.is_free = self.is_free or order
        if directions:
            for state in self._kept:
                if self.seams[state.seam].either_way:
                    turned = not state.turned
                    self.states.append(State(state.seam, state.plan, turned, mirrored=True))
            self._kept = ()
            self.__dict__.pop("estimates", None)

    def made_of(self, state: int) -> Plan:
        """Return the plan of a state in the direction in which it is followed."""
        one = self.states[state]
        if not one.mirrored:
            return one.plan
        if state not in self._mirrored:
            seam = self.seams[one.seam]
            problem = self._work.asked.problem(seam, turned=one.turned)
            self._mirrored[state] = backwards_plan(one.plan, problem)
        return self._mirrored[state]

    def add(self, seam: int, plan: Plan, turned: bool = False) -> None:
        """Add a way to make a seam, and the same the other way round where that is one."""
        self.states.append(State(seam, plan, turned))
        if self.seams[seam].either_way:
            self.states.append(State(seam, plan, not turned, mirrored=True))
        self.__dict__.pop("estimates", None)

    def own(self, state: int) -> float:
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
        """Leave a seam out of all that follows, and what cannot be made without it."""
        self.missing[self.seams[seam].name] = reason
        self._drop_what_hangs()

    def left_without(self, seam: int) -> int:
        """Return how many seams there is an order of when one is left out; 0 for no order."""
        known = dict(self.missing)
        self.drop(seam, "")
        count = len(self.made) if self.best().states else 0
        self.missing = known
        return count

    def _drop_what_hangs(self) -> None:
        """Leave out what cannot come any more without seams that are not made."""
        never = [self.seams[k] for k in self._never()]
        names = {seam.name for seam in never} | self.missing.keys()
        for seam in never:
            gone = [name for name in seam.after if name in names]
            self.missing[seam.name] = (
                f"it comes after '{gone[0]}', which is not made"
                if gone
                else "nothing that supports it is made before it"
            )

    def _never(self) -> list[int]:
        """Return the seams that are not missing, but before which something always is."""
        before = waiting(self.seams)
        made, count = set[int](), -1
        while len(made) > count:
            count = len(made)
            for seam in self.made:
                if before.allows(seam, made):
                    made.add(seam)
            if not self.is_free:
                break
        return [seam for seam in self.made if seam not in made]

    def _check_order(self) -> None:
        """Raise ProblemError where seams cannot come in any order, or in the one that is given."""
        if not self._never():
            return
        if self.is_free:
            raise ProblemError("the order of seams (after=) is circular")
        raise ProblemError(
            "the seams are in an order in which one comes before what it has to come after; "
            "give order='free', or another list"
        )

    def learn(self, first: int | None, last: int | None, seconds: float) -> None:
        """Record the time of a move between states; inf if there is none."""
        self._known[first, last] = seconds

    def learn_late(self, state: int, seams: Iterable[int]) -> None:
        """Take it from now on that a state, and its mirror image, cannot come after seams."""
        self._too_late.setdefault(self.states[state].plan, set()).update(seams)

    @property
    def made(self) -> list[int]:
        """The seams that are not missing."""
        return [k for k, seam in enumerate(self.seams) if seam.name not in self.missing]

    @property
    def _places(self) -> dict[int, int]:
        """The seams that are not missing, numbered anew from 0 on."""
        return {seam: k for k, seam in enumerate(self.made)}

    def best(self, near: Sequence[int] | None = None) -> Round:
        """Return the best round of states by what is known; its states are numbers of `states`.

        Many seams are ordered from a round of states that is `near` to it, where there is one.
        """
        place = self._places
        kept = [k for k, state in enumerate(self.states) if state.seam in place]
        if not place:
            return Round((), 0.0, 0.0)
        stops = self._stops(kept, place)
        given = None if self.is_free else list(range(len(place)))
        beside = None if near is None else [place[self.states[k].seam] for k in near]
        found = best_round(stops, given, beside)
        return Round(tuple(kept[k] for k in found.states), found.cost, found.bound)

    def bound(self) -> float:
        """Return a cost that no round of the states there are is below, whatever is learnt."""
        known, too_late = self._known, self._too_late
        self._known, self._too_late = {}, {}
        least = self.best().bound
        self._known, self._too_late = known, too_late
        return least

    def _stops(self, kept: list[int], place: dict[int, int]) -> Stops:
        first, last, between = self.estimates
        first, last, between = first[kept].copy(), last[kept].copy(), between[np.ix_(kept, kept)]
        row = {state: k for k, state in enumerate(kept)}
        for (one, other), seconds in self._known.items():
            if one is None and other in row:
                first[row[other]] = seconds
            elif other is None and one in row:
                last[row[one]] = seconds
            elif one in row and other in row:
                between[row[one], row[other]] = seconds
        before = waiting([self.seams[seam] for seam in place])
        too_late = np.zeros((len(kept), len(place)), dtype=bool)
        for k, state in enumerate(kept):
            seams = self._too_late.get(self.states[state].plan, ())
            too_late[k, [place[seam] for seam in seams if seam in place]] = True
        return Stops(
            before.after,
            before.after_any,
            np.array([place[self.states[k].seam] for k in kept]),
            np.array([self.own(k) for k in kept]),
            between,
            first,
            last,
            too_late,
        )

    @cached_property
    def estimates(self) -> tuple[Array, Array, Array]:
        """Least times of moves: to states (m,), from them (m,), between them (m, m) [s]."""
        begins = np.array([state.ends[0] for state in self.states])
        ends = np.array([state.ends[1] for state in self.states])
        start, end = self._ends
        none = np.zeros(len(self.states))
        first = none if start is None else self._free.time_of(start, begins)
        last = none if end is None else self._free.time_of(ends, end)
        between = np.array([self._free.time_of(q, begins) for q in ends])
        return first, last, between

    def _add_alike(self) -> None:
        """Add a motion of each seam that begins as near as possible to the start of the program.

        What is near to the same configuration is near to each other.
        """
        here = self.states[0].ends[0] if self._ends[0] is None else self._ends[0]
        made = [seam for seam in self.made if seam not in self._begun]
        plans = self._work.nearby([(self.seams[k], self.problems[k], here) for k in made])
        for seam, found in zip(made, plans, strict=True):
            known = [state for state in self.states if state.seam == seam]
            for plan in found:
                starts = [self.seconds(plan.trajectory.q[0], state.ends[0]) for state in known]
                if min(starts) > _WORTH:
                    self.add(seam, plan)

    def _add_nearby(self) -> None:
        """Add motions that begin near where the one before ends, along the best round."""
        tried: set[tuple[int | None, int]] = set()
        few = len(self.made) <= EXACT
        for _ in range(_NEARBY_ROUNDS if few else _NEARBY_ROUNDS_OF_MANY):
            states = self.best().states
            wanted = []
            for number, state in enumerate(states):
                here = self.states[state]
                before = self._ends[0] if number == 0 else self.states[states[number - 1]].ends[1]
                pair = (states[number - 1] if number else None, state)
                if before is None or pair in tried or here.seam in self._begun:
                    continue
                if self.seconds(before, here.ends[0]) <= _SHORT:
                    continue
                tried.add(pair)
                seam = self.seams[here.seam]
                problem = self._work.asked.problem(seam, turned=here.turned)
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
