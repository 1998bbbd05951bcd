"""Motions from many starts: rough ones of all, optimised ones of the best."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.optimise import Status
from selfmotion.planning.draft import Draft
from selfmotion.planning.heats import Heats
from selfmotion.planning.rough import OnNodes, Ranking, RoughMotion
from selfmotion.planning.session import Session
from selfmotion.problem import Problem
from selfmotion.search import start_candidates


def optimise_starts(draft: Draft, starts: int, finalists: int) -> None:
    """Draw so many starts, and optimise from the best of them; from all where they are few.

    Raises
    ------
    InverseKinematicsError
        None reaches the start of the path.
    """
    candidates = _candidates(draft, starts)
    ranked = False
    for ranking in _rankings(draft, candidates) if len(candidates) > finalists else ():
        draft.rankings = [*draft.rankings, ranking]
        if ranking.run(candidates, finalists):
            ranked = True
            rough = ranking.ranked
            _optimise_each(draft, _resumed(draft, rough), len(rough))
            if draft.is_over or draft.dearest < np.inf:
                break
    if not ranked:
        sessions = _sessions(draft, candidates)
        _optimise_each(draft, sessions, len(sessions))


def _candidates(draft: Draft, count: int) -> list[Array]:
    """Return so many starts: on the path itself, or as near to it as tolerances allow."""
    problem = draft.problem
    try:
        found = _on_start(problem.asked, draft, count)
    except InverseKinematicsError:
        if problem.asked is problem:
            raise
        return _on_start(problem, draft, count)
    return list(problem.at(np.zeros(len(found)), np.array(found)))


def _on_start(problem: Problem, draft: Draft, count: int) -> list[Array]:
    arm, asked = problem.envelope.arm(problem.robot), problem.envelope
    admits = asked.admits if asked.quantities else None
    return start_candidates(problem.follows.for_robot(arm), count, draft.rng, admits)


def _rankings(draft: Draft, candidates: Sequence[Array]) -> list[Ranking]:
    """Return how to rank starts: the second way where the first says nothing, or leads nowhere."""
    given = draft.problem, draft.effort, draft.progress
    nodes = OnNodes.takes(draft.problem, draft.effort, candidates[0])
    return [*([OnNodes(*given)] if nodes else []), Heats(*given)]


def _optimise_each(draft: Draft, sessions: Iterable[Session], count: int) -> None:
    """Optimise on nodes first: where that leads to a motion, no long way to another is worth it."""
    done, told = 0, 0
    left: list[Session] = []
    draft.waiting = ()
    for session in sessions:
        draft.waiting = (*draft.waiting, session)
        if told == done:
            told += 1
            draft.progress("optimising start", told, count)
        if _optimise_on_nodes(draft, session):
            done += 1
        else:
            left.append(session)
    for session in left:
        if draft.is_over:
            break
        if told == done:
            told += 1
            draft.progress("optimising start", told, count)
        draft.optimise(session)
        done += 1
        # What nothing can reach, no other start will.
        if draft.is_out_of_reach():
            break
    draft.waiting = ()


def _optimise_on_nodes(draft: Draft, session: Session) -> bool:
    """Optimise on nodes alone; return whether that is all there is to do with a session."""
    if draft.is_over:
        return False
    try:
        done = session.take_nodes(draft.dearest) or session.is_hopeless
    except KeyboardInterrupt:
        session.end(Status.INTERRUPTED)
        done = True
    if done:
        draft.note(session)
    return done


def _resumed(draft: Draft, rough: Sequence[RoughMotion]) -> Iterator[Session]:
    """Yield sessions that begin at rough motions; at optima, only when their turn comes."""
    if any(motion.cost is None for motion in rough):
        yield from draft.resumed(rough)
        return
    for motion in rough:
        session = None if draft.is_over else draft.taken_up(motion)
        if session is not None:
            yield session


def _sessions(draft: Draft, starts: Sequence[Array]) -> list[Session]:
    begun = (draft.begin(start, free=True) for start in starts)
    return sorted((session for session in begun if session is not None), key=Session.merit)
