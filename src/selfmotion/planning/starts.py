"""Motions from many starts: rough ones of all, optimised ones of the best."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.nodes import NodeMotion
from selfmotion.planning.apart import apart_of
from selfmotion.planning.draft import Draft
from selfmotion.planning.for_nodes import is_on_nodes
from selfmotion.planning.promise import most_promising
from selfmotion.planning.rough import Ranking, rough_grid
from selfmotion.planning.session import Session
from selfmotion.problem import Problem
from selfmotion.search import carried, start_candidates


def optimise_starts(draft: Draft, starts: int, finalists: int) -> None:
    """Draw so many starts, and optimise from the best of them; from all where they are few.

    Raises
    ------
    InverseKinematicsError
        None reaches the start of the path.
    """
    candidates = _candidates(draft, starts)
    if len(candidates) > finalists and is_on_nodes(draft.problem, draft.effort):
        ranking = draft.ranking = Ranking(draft.problem, draft.effort, draft.progress)
        if ranking.run(candidates, finalists):
            ranked = ranking.ranked
            _optimise_each(draft, _resumed(draft, ranked), len(ranked))
            return
    elif len(candidates) > finalists:
        candidates = _best(draft.problem, candidates)[:finalists]
    begun = (draft.begin(start, free=True) for start in candidates)
    sessions = sorted((one for one in begun if one is not None), key=Session.merit)
    _optimise_each(draft, sessions, len(sessions))


def _best(problem: Problem, candidates: Sequence[Array]) -> list[Array]:
    """Return starts, the best first, by their motions without self-motion."""
    t = rough_grid(problem).nodes
    motions, arrived = carried(problem.follows, np.array(candidates), t)
    apart = apart_of(problem.robot)
    order = most_promising(problem, candidates, motions, arrived, t, apart)
    return [candidates[k] for k in order]


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


def _optimise_each(draft: Draft, sessions: Iterable[Session], count: int) -> None:
    draft.waiting = ()
    for number, session in enumerate(sessions, 1):
        if draft.is_over:
            break
        draft.waiting = (*draft.waiting, session)
        draft.progress("optimising start", number, count)
        draft.optimise(session)
        # What nothing can reach, no other start will.
        if draft.is_out_of_reach():
            break
    draft.waiting = ()


def _resumed(draft: Draft, rough: Sequence[NodeMotion]) -> Iterator[Session]:
    """Yield sessions that begin at rough motions, only when their turn comes."""
    for motion in rough:
        session = None if draft.is_over else draft.taken_up(motion.trajectory)
        if session is not None:
            yield session
