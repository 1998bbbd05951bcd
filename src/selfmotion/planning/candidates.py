"""The best motion of a problem: from its start, from many starts, from global sequences."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NoReturn

import numpy as np

from selfmotion.basics import (
    Array,
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    ProblemError,
    Progress,
    SelfmotionError,
)
from selfmotion.motion import Trajectory
from selfmotion.optimise import Status
from selfmotion.planning.effort import Effort
from selfmotion.planning.heats import Heats
from selfmotion.planning.refusal import leaves_path
from selfmotion.planning.search import Search
from selfmotion.planning.session import Session
from selfmotion.planning.settings import DEARER, DEARER_CHAIN, FIRST_EVALUATIONS, SECOND_EFFORT
from selfmotion.planning.warm_start import start_of
from selfmotion.problem import Problem
from selfmotion.result import Plan
from selfmotion.search import Admits, Reach, SequenceGuide, guides, guides_near, start_candidates

_Searched = Callable[[Problem, np.random.Generator | int, Progress], list[SequenceGuide]]


class _CutShortError(Exception):
    """The user wants no more: the best so far has to do."""


class Candidates:
    """Optimises motions from several starts and keeps the best.

    Parameters
    ----------
    problem : Problem
    effort : Effort
        What all sessions share.
    search : Search
    progress : Progress
    reach : callable
        Returns how far single poses are in reach, looking closely at a time [s]: what is beyond is
        so from any start.
    warm_start : Plan, optional
        Tried first; where its motion will do, nothing else is.
    guide : SequenceGuide, optional
        Likewise a motion that a search over the whole path has found.

    Attributes
    ----------
    best : Session or None
    sequences : list of SequenceGuide
        What the global search found; empty where it was not asked for or in vain.
    rival : Session or None
        The best motion from these. It is not chosen where the start is given or the search local,
        and only compared with.
    notes : list of str
        Why the global search was in vain.
    """

    def __init__(
        self,
        problem: Problem,
        effort: Effort,
        search: Search,
        progress: Progress,
        reach: Callable[[float], Reach],
        warm_start: Plan | None = None,
        guide: SequenceGuide | None = None,
    ) -> None:
        self._reach, self._warm_start, self._guide = reach, warm_start, guide
        self._problem, self._effort = problem, effort
        self._begin = partial(Session.begin, problem, effort)
        self._settings, self._progress = search, progress
        self.best: Session | None = None
        # Complete motions that are not optimised yet.
        self._waiting: Sequence[Session] = ()
        self._heats: Heats | None = None
        self._failure: SelfmotionError | None = None
        self.sequences: list[SequenceGuide] = []
        self.rival: Session | None = None
        self.notes: list[str] = []

    def run(self) -> Session:
        """Return the best session; where the user interrupts, the best that is known by then.

        Raises
        ------
        BreakdownError, InverseKinematicsError, NoSequenceError
            There is no complete motion.
        KeyboardInterrupt
            The user interrupted before there was one.
        """
        try:
            self._search()
        except _CutShortError:
            pass
        except KeyboardInterrupt:
            self._interrupted()
        if self.best is None:
            self._give_up()
        return self.best

    def _search(self) -> None:
        problem, search = self._problem, self._settings
        start = problem.given_start
        redundancy = problem.follows.redundancy
        can_search = redundancy > 0
        if search.compare and redundancy != 1:
            raise ProblemError(
                f"compare: the global search needs redundancy 1, but {problem.robot.name} has "
                f"{redundancy} for task '{problem.task.value}'"
            )
        off = start is None and leaves_path(problem, search)
        starts = start is None and (search.mode != "global" or not can_search) and not off
        rng = np.random.default_rng(search.rng)
        if self._guide is not None:
            self._follow(self._guide)
            if not self._fell_short:
                return
        if self._warm_start is not None and start is None:
            self._try_again(self._warm_start)
            if not self._fell_short and not search.compare:
                return
        if start is not None:
            session = self._begin(start, free=False)
            if self._warm_start is not None:
                session.adopt(self._warm_start)
            self._try(session)
        elif starts:
            self._try_candidates(search.starts, search.finalists, rng)
        if self._is_out_of_reach():
            return
        chosen = start is None and search.mode != "local"
        if can_search and not off and (search.compare or (chosen and self._fell_short)):
            self._try_sequences(guides, chosen)
        if problem.relaxations and self._fell_short and (chosen or off):
            self._try_sequences(guides_near, True)
        # Where the search knows that nothing follows the path, more starts do not help.
        if starts and self._fell_short and not self.notes:
            more = SECOND_EFFORT
            self._try_candidates(more * search.starts, more * search.finalists, rng)

    def _try_again(self, plan: Plan) -> None:
        """Optimise from a plan of this problem or of one like it, if it leads to a motion."""
        try:
            session = self._begin(start_of(plan, self._problem), free=True)
        except (BreakdownError, InverseKinematicsError) as error:
            self._failure = error
            return
        session.adopt(plan)
        self._progress("warm start", 1, 1)
        self._try(session)

    def _follow(self, guide: SequenceGuide) -> None:
        """Optimise from a motion that is known."""
        try:
            session = self._begin(guide.start, free=self._problem.given_start is None, guide=guide)
        except BreakdownError as error:
            self._failure = error
            return
        self._try(session)

    @property
    def _fell_short(self) -> bool:
        return self.best is None or bool(self.best.violations)

    def _is_out_of_reach(self) -> bool:
        """Whether no start led anywhere because the path leaves the workspace."""
        if self.best is not None:
            return bool(self.best.violations) and bool(self._reach(0.0).reason)
        failure = self._failure
        return isinstance(failure, BreakdownError) and bool(self._reach(failure.time).reason)

    def _try_candidates(self, starts: int, finalists: int, rng: np.random.Generator) -> None:
        problem = self._problem
        arm = problem.envelope.arm(problem.robot)
        candidates = start_candidates(problem.follows.for_robot(arm), starts, rng, self._admits)
        rough = self._best_of(candidates, finalists) if len(candidates) > finalists else []
        self._waiting = sessions = self._resumed(rough) if rough else self._sessions(candidates)
        for number, session in enumerate(sessions, 1):
            self._progress("optimising start", number, len(sessions))
            self._try(session)
            # What nothing can reach, no other start will.
            if self._is_out_of_reach():
                break
        self._waiting = ()

    @property
    def _admits(self) -> Admits | None:
        asked = self._problem.envelope
        return asked.admits if asked.quantities else None

    def _best_of(self, candidates: list[Array], finalists: int) -> list[Trajectory]:
        """Return the best rough motions; none where these all break down."""
        self._heats = Heats(self._problem, self._effort, self._progress)
        self._heats.run(candidates, finalists)
        return self._heats.ranked

    def _resumed(self, rough: Sequence[Trajectory]) -> list[Session]:
        """Return sessions that begin at rough motions, the best first."""
        sessions = []
        for motion in rough:
            for session in self._sessions([motion.q[0]]):
                session.resume(motion)
                sessions.append(session)
        return sorted(sessions, key=Session.merit)

    def _sessions(self, starts: Sequence[Array]) -> list[Session]:
        sessions = []
        for start in starts:
            try:
                sessions.append(self._begin(start, free=True))
            except BreakdownError as error:
                self._failure = error
        return sorted(sessions, key=Session.merit)

    def _try_sequences(self, searched: _Searched, chosen: bool) -> None:
        """Optimise from the best sequences over all self-motions."""
        try:
            self.sequences = searched(self._problem, self._settings.rng, self._progress)
        except NoSequenceError as error:
            self._failure = error
            self.notes.append(f"global search: {error}")
        begun: list[Session] = []
        for number, guide in enumerate(self.sequences, 1):
            self._progress("refining sequence", number, len(self.sequences))
            try:
                session = self._begin(
                    guide.start, free=True, guide=guide, deviation=guide.deviation
                )
            except BreakdownError as error:
                self._failure = error
                continue
            if begun and self._hopeless(guide, session, begun[0]):
                continue
            session.take_chain(guide)
            if begun and begun[0].of_chain and not session.of_chain:
                continue
            # What happens to it first tells which one is worth the rest.
            self._try(session, chosen=chosen, evaluations=FIRST_EVALUATIONS)
            begun = sorted([*begun, session], key=Session.score)
        if begun:
            self.rival = begun[0]
            if begun[0].status is Status.MAX_EVALUATIONS:
                self._try(begun[0], chosen=chosen)

    def _hopeless(self, guide: SequenceGuide, session: Session, best: Session) -> bool:
        """Whether a sequence is much dearer than the best, and costs more than what there is.

        Optimising gains some percent on a sequence.
        """
        if best.violations:
            return False
        least = self.sequences[0].sequence.cost
        share = DEARER_CHAIN if best.of_chain else DEARER
        dearer = guide.sequence.cost > least + (share - 1.0) * abs(least)
        return dearer and session.merit() > best.score()[1]

    def _try(
        self, session: Session, *, chosen: bool = True, evaluations: int | None = None
    ) -> None:
        """Optimise a session; keep it if it is the best one and may be chosen.

        With so many evaluations at most, which ends nothing else.
        """
        try:
            session.minimize(evaluations)
        except KeyboardInterrupt:
            session.end(Status.INTERRUPTED)
        if chosen:
            self._consider(session)
        unfinished = evaluations is not None and session.status is Status.MAX_EVALUATIONS
        if session.cut_short and not unfinished and self.best is not None:
            self.best.end(session.status)
            raise _CutShortError

    def _consider(self, session: Session) -> None:
        if self.best is None or session.score() < self.best.score():
            self.best = session

    def _interrupted(self) -> None:
        """Make the best that is known the outcome; raise KeyboardInterrupt where nothing is."""
        if self.best is None and not self._waiting and self._heats is not None:
            self._waiting = self._resumed(self._heats.ranked[:1])
        for session in self._waiting if self.best is None else ():
            session.end(Status.INTERRUPTED)
            self._consider(session)
        if self.best is None:
            raise KeyboardInterrupt
        self.best.end(Status.INTERRUPTED)

    def _give_up(self) -> NoReturn:
        if self._failure is None:
            raise RuntimeError("each start leads to a motion or to an error")
        raise self._failure
