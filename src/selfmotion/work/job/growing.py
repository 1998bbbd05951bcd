"""Jobs whose seams leave something behind: each is planned past what stands there by then."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import FinishedMotion
from selfmotion.model.collision import Obstacle
from selfmotion.planning.result import Move, Plan
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.seam import Seam, Step
from selfmotion.work.job.work import Asked, Work, seam_steps

# Tries to find another motion of a seam.
_TRIES = 3
# Motions whose ends are nearer than this are one [rad or m].
_SAME = 1e-6
# Moves to a seam that are not found, each after all its seconds; from then on only those that
# were found before lead to it.
_NOT_FOUND = 20
# From which state to which one past what; None is the start or the end of the program.
_Way = tuple[int | None, int | None, frozenset[str]]


# Obstacles by name.
Standing = dict[str, Obstacle]


class Meeting:
    """Looks at what plans meet, at each plan and body once.

    Parameters
    ----------
    asked : Asked
    """

    def __init__(self, asked: Asked) -> None:
        self._asked = asked
        # Obstacles that plans are known to keep clear of.
        self._clear: dict[Plan, set[str]] = {}

    def is_near(self, q: Array, *bodies: Obstacle) -> bool:
        """Whether the arm at q (n,) is nearer to one of some bodies than it may be."""
        apart = self._asked.apart(bodies)
        return apart is not None and bool(
            apart.model(self._asked.robot).distance(q).value < apart.distance
        )

    def met(self, plan: Plan, past: Standing) -> tuple[set[str], str]:
        """Return the obstacles that a plan collides with, and a sentence on the first."""
        asked = self._asked
        clear = self._clear.setdefault(plan, set())
        met, why = set[str](), ""
        while new := {n: item for n, item in past.items() if n not in clear and n not in met}:
            apart = asked.apart(tuple(new.values()))
            motion = FinishedMotion(asked.robot, plan.trajectory)
            found = None if apart is None else apart.requirement(asked.robot).judge(motion)
            if found is None or found.satisfied:
                clear |= set(new)
                break
            why = why or found.text
            # An obstacle without a name may be any of them.
            met |= {name for name in found.subject.split(" - ") if name in new} or set(new)
        return met, why


def without(standing: Standing, *seams: Seam | None) -> Standing:
    """Return the obstacles without those that seams may touch."""
    may = {name for seam in seams if seam is not None for name in seam.may_meet}
    return {name: item for name, item in standing.items() if name not in may}


class Growing:
    """Builds the program of a job that leaves something behind.

    The order is that by what moves take at least. A state that meets what stands there by then is
    too late for it, for good: what stands there stays. With that known the order is looked for
    again, until each seam can be made at its place and reached. Where no order is left, other ways
    are looked for to make the seams in question; where there are none, these are missing, and said
    to be.

    Parameters
    ----------
    ordering : Ordering
    work : Work
    ends : ((n,) or None, (n,) or None)
        Where the program begins and ends.
    """

    def __init__(self, ordering: Ordering, work: Work, ends: tuple[Array | None, ...]) -> None:
        self._ordering, self._work, self._ends = ordering, work, ends
        # Each once, in order.
        self._notes: dict[str, None] = {}
        self._leaves_it = {
            item.name: number for number, seam in enumerate(ordering.seams) for item in seam.leaves
        }
        # Collisions of plans; states checked against obstacles; moves; obstacles at the ends.
        self._meeting = Meeting(work.asked)
        self._checked: dict[tuple[int, frozenset[str]], Plan] = {}
        self._moves: dict[_Way, Move] = {}
        self._held: dict[int, set[str]] = {}
        # Seams that did not go at their place: past what, from where, and why; the last one last.
        self._troubles: dict[int, tuple[Standing, Array | None, str]] = {}
        self._tries: dict[int, int] = {}
        self._not_found: dict[int, int] = {}
        # Seams whose leavings others meet, and how.
        self._in_the_way: dict[int, str] = {}

    def program(self) -> Program:
        """Return the program; what could not be made is named."""
        states: Sequence[int] = self._ordering.best().states
        while states and not self._goes(states):
            states = self._ordering.best(states).states or self._otherwise(states)
        robot, missing = self._work.asked.robot, dict(self._ordering.missing)
        # By now there may be more states and fewer seams than at first.
        steps, bound = tuple(self._steps(states)), self._ordering.bound()
        return Program(robot, steps, missing, bound, tuple(self._notes))

    def _goes(self, states: Sequence[int]) -> bool:
        """Whether an order is possible; obstacles in its way are recorded."""
        return self._all_clear(states) and self._all_verified(states) and self._all_reached(states)

    def _places(self, states: Sequence[int]) -> Iterator[tuple[int, Array | None, Standing]]:
        """Yield each state with where the arm comes from, and what stands in its way by then."""
        q, standing = self._ends[0], Standing()
        for state in states:
            seam = self._seam(state)
            yield state, q, without(standing, seam)
            q = self._ordering.states[state].ends[1]
            standing |= {item.name: item for item in seam.leaves}

    def _all_clear(self, states: Sequence[int]) -> bool:
        """Whether each seam keeps clear of what stands there by then, and its end of its own."""
        goes, following = True, (*states[1:], None)
        for number, (state, q, past) in enumerate(self._places(states), start=1):
            self._work.tell("program", number, len(states))
            met, why = self._meeting.met(self._ordering.states[state].plan, past)
            if met:
                owners = {self._leaves_it[name] for name in met}
                self._ordering.learn_late(state, owners)
                name = self._ordering.name_of(state)
                told = f"it leaves what is in the way of '{name}': {why}"
                self._in_the_way |= dict.fromkeys(owners, told)
            elif not self._leads_on(state, following[number - 1]):
                why = f"it ends in what it leaves: '{min(self._held_by(state))}'"
                for other in (*range(len(self._ordering.states)), None):
                    if not self._leads_on(state, other):
                        self._ordering.learn(state, other, np.inf)
            if why:
                goes = False
                self._trouble(state, q, past, why)
        return goes

    def _leads_on(self, state: int, other: int | None) -> bool:
        """Whether a state may end in what it leaves: nothing rests there, or moves away past it."""
        held, seam = self._held_by(state), self._seam(state)
        may = set() if other is None else set(self._seam(other).may_meet)
        is_over = other is None and self._ends[1] is None
        return not held or (seam.wait == 0.0 and (is_over or held <= may))

    def _held_by(self, state: int) -> set[str]:
        """Return the obstacles left by its own seam at the end of a state: few moves lead away."""
        if state not in self._held:
            q, seam = self._ordering.states[state].ends[1], self._seam(state)
            left = without({item.name: item for item in seam.leaves}, seam)
            is_near = self._meeting.is_near(q, *left.values())
            held = {
                name for name, item in left.items() if is_near and self._meeting.is_near(q, item)
            }
            self._held[state] = held
        return self._held[state]

    def _all_verified(self, states: Sequence[int]) -> bool:
        """Whether each seam is verified with all that stands there by then."""
        goes = True
        for state, q, past in self._places(states):
            check = self._past(state, past).certificate
            if past and not check.verified:
                goes = False
                self._ordering.learn_late(state, {self._leaves_it[name] for name in past})
                self._trouble(state, q, past, check.verdict)
        return goes

    def _past(self, state: int, past: Standing) -> Plan:
        """Return the plan of a state, checked with what stands there."""
        key = state, frozenset(past)
        if key not in self._checked:
            one, plan = self._ordering.states[state], self._ordering.made_of(state)
            if past:
                seam = self._ordering.seams[one.seam]
                problem = self._work.asked.problem(seam, tuple(past.values()), one.turned)
                plan = replace(plan, problem=problem)
                plan = replace(plan, certificate=plan.check())
            self._checked[key] = plan
        return self._checked[key]

    def _all_reached(self, states: Sequence[int]) -> bool:
        """Whether the move to each seam is found."""
        ways = self._ways(states)
        new = [way for way in ways if way not in self._moves]
        asked = [(*self._ends_of(way), tuple(ways[way].values())) for way in new]
        names = [self._ordering.name_of_move(*way[:2]) for way in new]
        self._moves |= zip(new, self._work.moves(asked, names), strict=True)
        goes = True
        for way, past in ways.items():
            first, last, _ = way
            # The end of the program is the given one in every order.
            if last is not None and not self._moves[way].verified:
                goes = False
                self._ordering.learn(first, last, np.inf)
                why = f"the move to it: {self._moves[way].trouble}"
                self._trouble(last, self._ends_of(way)[0], past, why)
                self._count_not_found(self._ordering.states[last].seam)
        return goes

    def _count_not_found(self, seam: int) -> None:
        """Count that a move to a seam was not found; after many no others are tried."""
        self._not_found[seam] = self._not_found.get(seam, 0) + 1
        if self._not_found[seam] < _NOT_FOUND:
            return
        found = {way[:2] for way, move in self._moves.items() if move.verified}
        states = range(len(self._ordering.states))
        for last in [k for k in states if self._ordering.states[k].seam == seam]:
            for first in (None, *states):
                if (first, last) not in found:
                    self._ordering.learn(first, last, np.inf)

    def _ways(self, states: Sequence[int]) -> dict[_Way, Standing]:
        """Return the moves of an order, and what stands in the way of each."""
        found = dict[_Way, Standing]()
        standing, before = Standing(), None
        for state in (*states, None):
            ends = [None if k is None else self._seam(k) for k in (before, state)]
            past = without(standing, *ends)
            if self._goes_between(before, state):
                found[before, state, frozenset(past)] = past
            if state is not None:
                standing |= {item.name: item for item in self._seam(state).leaves}
            before = state
        return found

    def _goes_between(self, first: int | None, last: int | None) -> bool:
        """Whether there is a move: not to ends of the program that were not asked for."""
        asked = self._ends[0] is not None, self._ends[1] is not None
        return (first is not None or asked[0]) and (last is not None or asked[1])

    def _ends_of(self, way: _Way) -> tuple[Array, Array]:
        """Return start and end of a move, (n,) each."""
        states = self._ordering.states
        first = self._ends[0] if way[0] is None else states[way[0]].ends[1]
        last = self._ends[1] if way[1] is None else states[way[1]].ends[0]
        if first is None or last is None:
            raise RuntimeError("no move leads to where nothing was asked for")
        return first, last

    def _trouble(self, state: int, q: Array | None, past: Standing, why: str) -> None:
        """Keep it in mind that a state did not go past something, from a configuration (n,)."""
        seam = self._ordering.states[state].seam
        self._troubles.pop(seam, None)
        self._troubles[seam] = past, q, why
        self._notes[f"'{self._ordering.name_of(state)}' is planned differently: {why}"] = None

    def _otherwise(self, states: Sequence[int]) -> Sequence[int]:
        """Return an order with other ways to make seams that did not go, or without some seam."""
        ordering = self._ordering
        for seam, (past, q, _) in list(reversed(self._troubles.items())):
            tries = self._tries[seam] = self._tries.get(seam, 0) + 1
            if tries <= _TRIES and seam in ordering.made and self._added(seam, q, past):
                found = ordering.best(states).states
                if found:
                    return found
        while reasons := self._reasons_to_drop():
            # The one without which most of the others are made; as a rule one that did not go.
            seam = max(reasons, key=ordering.left_without)
            ordering.drop(seam, reasons[seam])
            made = set(ordering.made)
            near = [state for state in states if ordering.states[state].seam in made]
            found = ordering.best(near).states
            if found:
                return found
        return ()

    def _reasons_to_drop(self) -> dict[int, str]:
        """Return the seams without which there may be an order, and what to say of each."""
        troubles = {seam: why for seam, (_, _, why) in reversed(self._troubles.items())}
        # Those that did not go come first.
        reasons = troubles | {k: why for k, why in self._in_the_way.items() if k not in troubles}
        return {seam: why for seam, why in reasons.items() if seam in self._ordering.made}

    def _added(self, number: int, q: Array | None, past: Standing) -> bool:
        """Add new ways to make a seam that keep clear of what stands there; whether any were."""
        seam, work = self._ordering.seams[number], self._work
        turns = [False, True] if seam.either_way else [False]
        alone = {turned: work.asked.problem(seam, (), turned) for turned in turns}
        wanted = [] if q is None else [(seam, alone[turned], q) for turned in turns]
        ways = [*zip(turns, work.nearby(wanted), strict=True)] if wanted else []
        if not self._added_of(number, ways, past):
            # Others begin clear of what stands there; what they meet later is judged as well.
            allowed = [work.asked.problem(seam, tuple(past.values()), turned) for turned in turns]
            ways = [
                (turned, work.branches([(seam, alone[turned])], problem)[0][0])
                for turned, problem in zip(turns, allowed, strict=True)
            ]
            return self._added_of(number, ways, past)
        return True

    def _added_of(
        self, number: int, ways: Sequence[tuple[bool, Sequence[Plan]]], past: Standing
    ) -> bool:
        """Add those plans of a seam that are new and keep clear of what stands there."""
        ordering, count = self._ordering, len(self._ordering.states)
        known = [one.plan.trajectory.q for one in ordering.states if one.seam == number]
        for turned, plans in ways:
            for plan in plans:
                ends = plan.trajectory.q[[0, -1]]
                is_known = any(np.abs(q[[0, -1]] - ends).max() < _SAME for q in known)
                if not is_known and not self._meeting.met(plan, past)[0]:
                    ordering.add(number, plan, turned)
        return len(ordering.states) > count

    def _steps(self, states: Sequence[int]) -> Iterator[Step]:
        """Yield the steps of a program: moves, seams and waits."""
        moves = {way[1]: (way, self._moves[way]) for way in self._ways(states)} if states else {}
        for state, _, past in self._places(states):
            if state in moves:
                yield self._move_step(*moves[state])
            seam, turned = self._seam(state), self._ordering.states[state].turned
            plan, standing = self._past(state, past), tuple(past.values())
            yield from seam_steps(seam, plan, turned, self._work, standing)
        if None in moves:
            yield self._move_step(*moves[None])

    def _move_step(self, way: _Way, move: Move) -> Step:
        ends = [self._seam(k) for k in way[:2] if k is not None]
        may = tuple(name for one in ends for name in one.may_meet)
        return Step(self._ordering.name_of_move(*way[:2]), move, may_meet=may)

    def _seam(self, state: int) -> Seam:
        return self._ordering.seams[self._ordering.states[state].seam]
