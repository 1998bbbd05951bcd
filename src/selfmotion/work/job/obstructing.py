"""Jobs whose seams leave obstacles behind, such as what they print: later seams avoid them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import FinishedMotion
from selfmotion.model.collision import Obstacle
from selfmotion.planning.result import Move, Plan
from selfmotion.work.job.ordering import Ordering
from selfmotion.work.job.program import Program
from selfmotion.work.job.seam import Seam
from selfmotion.work.job.step import Step
from selfmotion.work.job.work import JobSettings, Work, seam_steps

# Tries to find another motion of a seam.
_MAX_TRIES = 3
# Motions whose ends are nearer than this are the same [rad or m].
_SAME = 1e-6
# Moves to a seam that may fail, each after all its seconds; then only moves that were found before
# may lead to it.
_MAX_FAILED_MOVES = 20
# A move: its first and its last state, and the names of the obstacles that it avoids. None is the
# start or the end of the program.
_MoveKey = tuple[int | None, int | None, frozenset[str]]


# Obstacles by name.
Obstacles = dict[str, Obstacle]


class CollisionChecks:
    """Collisions of plans with obstacles, each pair checked once.

    Parameters
    ----------
    settings : JobSettings
    """

    def __init__(self, settings: JobSettings) -> None:
        self._settings = settings
        # Obstacles that plans are known to keep clear of.
        self._clear: dict[Plan, set[str]] = {}

    def is_near(self, q: Array, *bodies: Obstacle) -> bool:
        """Whether the arm at q (n,) is nearer to one of the bodies than the clearance allows."""
        if not bodies:
            return False
        clearance = self._settings.clearance_from(bodies)
        return clearance.model(self._settings.robot).distance(q).value < clearance.distance

    def collisions(self, plan: Plan, avoided: Obstacles) -> tuple[set[str], str]:
        """Return the names of obstacles that a plan collides with, and a sentence on the first."""
        settings = self._settings
        clear = self._clear.setdefault(plan, set())
        met, why = set[str](), ""
        while new := {n: item for n, item in avoided.items() if n not in clear and n not in met}:
            clearance = settings.clearance_from(tuple(new.values()))
            motion = FinishedMotion(settings.robot, plan.trajectory)
            collisions = clearance.requirement(settings.robot).judge(motion)
            if collisions.satisfied:
                clear |= set(new)
                break
            why = why or collisions.text
            # An obstacle without a name may be any of them.
            met |= {name for name in collisions.subject.split(" - ") if name in new} or set(new)
        return met, why


def except_touched(left_behind: Obstacles, *seams: Seam | None) -> Obstacles:
    """Return the obstacles without those that seams may touch (`Seam.may_meet`)."""
    may = {name for seam in seams if seam is not None for name in seam.may_meet}
    return {name: item for name, item in left_behind.items() if name not in may}


class ObstructingBuilder:
    """Builds the program of a job whose seams leave obstacles behind.

    The first order is the best by lower bounds of the times of moves. A motion that collides with
    an obstacle cannot come after the seam that leaves it, since obstacles stay. With that known the
    best order is computed again, until each seam can be followed at its place and reached. Where no
    order is left, other motions of the seams in question are planned. Where there are none, these
    seams are missing from the program, with the reason.

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
        self._owner_of = {
            item.name: number for number, seam in enumerate(ordering.seams) for item in seam.leaves
        }
        # Results so far: collisions, plans certified with obstacles, moves, obstacles at ends.
        self._collisions = CollisionChecks(work.settings)
        self._checked: dict[tuple[int, frozenset[str]], Plan] = {}
        self._moves: dict[_MoveKey, Move] = {}
        self._at_end: dict[int, set[str]] = {}
        # Seams that failed at their place, the last one last: the obstacles, where the arm came
        # from, and why.
        self._failures: dict[int, tuple[Obstacles, Array | None, str]] = {}
        self._tries: dict[int, int] = {}
        self._failed_moves: dict[int, int] = {}
        # Seams whose obstacles other seams collide with, and how.
        self._obstructing: dict[int, str] = {}

    def program(self) -> Program:
        """Return the program; seams without a motion are named in it."""
        states: Sequence[int] = self._ordering.best().states
        while states and not self._is_possible(states):
            states = self._ordering.best(states).states or self._alternative(states)
        robot, missing = self._work.settings.robot, dict(self._ordering.missing)
        # There may be more states and fewer seams than at first.
        steps, bound = tuple(self._steps(states)), self._ordering.bound()
        return Program(robot, steps, missing, bound, tuple(self._notes))

    def _is_possible(self, states: Sequence[int]) -> bool:
        """Whether an order is possible; what hinders it is recorded."""
        return self._all_clear(states) and self._all_verified(states) and self._all_reached(states)

    def _visits(self, states: Sequence[int]) -> Iterator[tuple[int, Array | None, Obstacles]]:
        """Yield each state, where the arm comes from (n,), and the obstacles to avoid by then."""
        q, left_behind = self._ends[0], Obstacles()
        for state in states:
            seam = self._seam(state)
            yield state, q, except_touched(left_behind, seam)
            q = self._ordering.states[state].ends[1]
            left_behind |= {item.name: item for item in seam.leaves}

    def _all_clear(self, states: Sequence[int]) -> bool:
        """Whether no seam collides with earlier obstacles, nor its end with its own."""
        possible, following = True, (*states[1:], None)
        for number, (state, q, avoided) in enumerate(self._visits(states), start=1):
            self._work.tell("program", number, len(states))
            met, why = self._collisions.collisions(self._ordering.states[state].plan, avoided)
            if met:
                owners = {self._owner_of[name] for name in met}
                self._ordering.forbid_after(state, owners)
                name = self._ordering.name_of(state)
                text = f"it leaves what is in the way of '{name}': {why}"
                self._obstructing |= dict.fromkeys(owners, text)
            elif not self._can_end_before(state, following[number - 1]):
                why = f"it ends in what it leaves: '{min(self._obstacles_at_end(state))}'"
                for other in (*range(len(self._ordering.states)), None):
                    if not self._can_end_before(state, other):
                        self._ordering.record_time(state, other, np.inf)
            if why:
                possible = False
                self._record_failure(state, q, avoided, why)
        return possible

    def _can_end_before(self, state: int, other: int | None) -> bool:
        """Whether a state may end at its own obstacles: the next seam may touch them."""
        at_end, seam = self._obstacles_at_end(state), self._seam(state)
        may = set() if other is None else set(self._seam(other).may_meet)
        is_over = other is None and self._ends[1] is None
        return not at_end or (seam.wait == 0.0 and (is_over or at_end <= may))

    def _obstacles_at_end(self, state: int) -> set[str]:
        """Return the names of obstacles of its own seam that a state collides with at its end."""
        if state not in self._at_end:
            q, seam = self._ordering.states[state].ends[1], self._seam(state)
            left = except_touched({item.name: item for item in seam.leaves}, seam)
            is_near = self._collisions.is_near(q, *left.values())
            at_end = {
                name for name, item in left.items() if is_near and self._collisions.is_near(q, item)
            }
            self._at_end[state] = at_end
        return self._at_end[state]

    def _all_verified(self, states: Sequence[int]) -> bool:
        """Whether each seam is verified with all obstacles that are there by then."""
        possible = True
        for state, q, avoided in self._visits(states):
            check = self._checked_plan(state, avoided).certificate
            if avoided and not check.verified:
                possible = False
                self._ordering.forbid_after(state, {self._owner_of[name] for name in avoided})
                self._record_failure(state, q, avoided, check.verdict)
        return possible

    def _checked_plan(self, state: int, avoided: Obstacles) -> Plan:
        """Return the plan of a state, certified with the obstacles."""
        key = state, frozenset(avoided)
        if key not in self._checked:
            one, plan = self._ordering.states[state], self._ordering.plan_of(state)
            if avoided:
                seam = self._ordering.seams[one.seam]
                problem = self._work.settings.problem(seam, tuple(avoided.values()), one.turned)
                plan = replace(plan, problem=problem)
                plan = replace(plan, certificate=plan.check())
            self._checked[key] = plan
        return self._checked[key]

    def _all_reached(self, states: Sequence[int]) -> bool:
        """Whether the move to each seam is found."""
        moves = self._move_keys(states)
        new = [key for key in moves if key not in self._moves]
        wanted = [(*self._ends_of(key), tuple(moves[key].values())) for key in new]
        names = [self._ordering.name_of_move(*key[:2]) for key in new]
        self._moves |= zip(new, self._work.moves(wanted, names), strict=True)
        possible = True
        for key, avoided in moves.items():
            first, last, _ = key
            # The end of the program is the given one in every order.
            if last is not None and not self._moves[key].verified:
                possible = False
                self._ordering.record_time(first, last, np.inf)
                why = f"the move to it: {self._moves[key].trouble}"
                self._record_failure(last, self._ends_of(key)[0], avoided, why)
                self._count_failed_move(self._ordering.states[last].seam)
        return possible

    def _count_failed_move(self, seam: int) -> None:
        """Count a move to a seam that was not found; after many no others are tried."""
        self._failed_moves[seam] = self._failed_moves.get(seam, 0) + 1
        if self._failed_moves[seam] < _MAX_FAILED_MOVES:
            return
        verified = {key[:2] for key, move in self._moves.items() if move.verified}
        states = range(len(self._ordering.states))
        for last in [k for k in states if self._ordering.states[k].seam == seam]:
            for first in (None, *states):
                if (first, last) not in verified:
                    self._ordering.record_time(first, last, np.inf)

    def _move_keys(self, states: Sequence[int]) -> dict[_MoveKey, Obstacles]:
        """Return the moves of an order, and the obstacles that each has to avoid."""
        keys = dict[_MoveKey, Obstacles]()
        left_behind, before = Obstacles(), None
        for state in (*states, None):
            ends = [None if k is None else self._seam(k) for k in (before, state)]
            avoided = except_touched(left_behind, *ends)
            if self._goes_between(before, state):
                keys[before, state, frozenset(avoided)] = avoided
            if state is not None:
                left_behind |= {item.name: item for item in self._seam(state).leaves}
            before = state
        return keys

    def _goes_between(self, first: int | None, last: int | None) -> bool:
        """Whether there is a move: ends of the program that are not given have none."""
        given = self._ends[0] is not None, self._ends[1] is not None
        return (first is not None or given[0]) and (last is not None or given[1])

    def _ends_of(self, key: _MoveKey) -> tuple[Array, Array]:
        """Return start and end of a move, (n,) each."""
        states = self._ordering.states
        first = self._ends[0] if key[0] is None else states[key[0]].ends[1]
        last = self._ends[1] if key[1] is None else states[key[1]].ends[0]
        if first is None or last is None:
            raise RuntimeError("a move has an end that is not given")
        return first, last

    def _record_failure(self, state: int, q: Array | None, avoided: Obstacles, why: str) -> None:
        """Record why a state failed with obstacles, reached from a configuration (n,)."""
        seam = self._ordering.states[state].seam
        self._failures.pop(seam, None)
        self._failures[seam] = avoided, q, why
        self._notes[f"'{self._ordering.name_of(state)}' is planned differently: {why}"] = None

    def _alternative(self, states: Sequence[int]) -> Sequence[int]:
        """Return an order with other motions of the seams that failed, or without one of them."""
        ordering = self._ordering
        for seam, (avoided, q, _) in list(reversed(self._failures.items())):
            tries = self._tries[seam] = self._tries.get(seam, 0) + 1
            if tries > _MAX_TRIES or seam not in ordering.planned:
                continue
            if self._add_alternatives(seam, q, avoided):
                best_round = ordering.best(states).states
                if best_round:
                    return best_round
        while reasons := self._reasons_to_drop():
            # The one without which most of the others remain; as a rule one that failed.
            seam = max(reasons, key=ordering.count_without)
            ordering.drop(seam, reasons[seam])
            left = set(ordering.planned)
            near = [state for state in states if ordering.states[state].seam in left]
            best_round = ordering.best(near).states
            if best_round:
                return best_round
        return ()

    def _reasons_to_drop(self) -> dict[int, str]:
        """Return the seams without which there may be an order, and the reason to drop each."""
        failures = {seam: why for seam, (_, _, why) in reversed(self._failures.items())}
        # Those that failed come first.
        reasons = failures | {k: why for k, why in self._obstructing.items() if k not in failures}
        return {seam: why for seam, why in reasons.items() if seam in self._ordering.planned}

    def _add_alternatives(self, number: int, q: Array | None, avoided: Obstacles) -> bool:
        """Add new motions of a seam that avoid the obstacles; return whether there are any."""
        seam, work = self._ordering.seams[number], self._work
        turns = [False, True] if seam.either_way else [False]
        alone = {turned: work.settings.problem(seam, (), turned) for turned in turns}
        wanted = [] if q is None else [(seam, alone[turned], q) for turned in turns]
        plans = [*zip(turns, work.nearby(wanted), strict=True)] if wanted else []
        if not self._add_new(number, plans, avoided):
            # Others begin clear of the obstacles; later collisions are found by `_add_new`.
            obstacles = tuple(avoided.values())
            allowed = [work.settings.problem(seam, obstacles, turned) for turned in turns]
            plans = [
                (turned, work.branches([(seam, alone[turned])], problem)[0][0])
                for turned, problem in zip(turns, allowed, strict=True)
            ]
            return self._add_new(number, plans, avoided)
        return True

    def _add_new(
        self, number: int, results: Sequence[tuple[bool, Sequence[Plan]]], avoided: Obstacles
    ) -> bool:
        """Add those plans of a seam that are new and avoid the obstacles."""
        ordering, count = self._ordering, len(self._ordering.states)
        configurations = [one.plan.trajectory.q for one in ordering.states if one.seam == number]
        for turned, plans in results:
            for plan in plans:
                ends = plan.trajectory.q[[0, -1]]
                is_known = any(np.abs(q[[0, -1]] - ends).max() < _SAME for q in configurations)
                if not is_known and not self._collisions.collisions(plan, avoided)[0]:
                    ordering.add(number, plan, turned)
        return len(ordering.states) > count

    def _steps(self, states: Sequence[int]) -> Iterator[Step]:
        """Yield the steps of a program: moves, seams and waits."""
        keys = self._move_keys(states) if states else {}
        moves = {key[1]: (key, self._moves[key]) for key in keys}
        for state, _, avoided in self._visits(states):
            if state in moves:
                yield self._move_step(*moves[state])
            seam, turned = self._seam(state), self._ordering.states[state].turned
            plan = self._checked_plan(state, avoided)
            yield from seam_steps(seam, plan, turned, self._work, tuple(avoided.values()))
        if None in moves:
            yield self._move_step(*moves[None])

    def _move_step(self, key: _MoveKey, move: Move) -> Step:
        ends = [self._seam(k) for k in key[:2] if k is not None]
        may = tuple(name for one in ends for name in one.may_meet)
        return Step(self._ordering.name_of_move(*key[:2]), move, may_meet=may)

    def _seam(self, state: int) -> Seam:
        return self._ordering.seams[self._ordering.states[state].seam]
