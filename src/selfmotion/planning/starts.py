"""Motions from many starts: rough ones of all, optimised ones of the best."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from selfmotion.basics import Array, InverseKinematicsError
from selfmotion.nodes import NodeMotion
from selfmotion.planning.candidate import Candidate
from selfmotion.planning.grids import is_on_nodes, rough_grid
from selfmotion.planning.planner import Planner
from selfmotion.planning.screening import Ranking, apart_of, most_promising
from selfmotion.problem import Problem
from selfmotion.search import carried, start_candidates


def optimise_starts(planner: Planner, count: int, finalists: int) -> None:
    """Draw so many starts, and optimise from the best of them; from all where they are few.

    Raises
    ------
    InverseKinematicsError
        None reaches the start of the path.
    """
    starts = _starts(planner, count)
    if len(starts) > finalists and is_on_nodes(planner.problem, planner.effort):
        ranking = planner.ranking = Ranking(planner.problem, planner.effort, planner.progress)
        if ranking.run(starts, finalists):
            ranked = ranking.ranked
            _optimise_each(planner, _resumed(planner, ranked), len(ranked))
            return
    elif len(starts) > finalists:
        starts = _best(planner.problem, starts)[:finalists]
    begun = (planner.begin(start, free=True) for start in starts)
    known = (candidate for candidate in begun if candidate is not None)
    candidates = sorted(known, key=lambda candidate: candidate.solution.merit())
    _optimise_each(planner, candidates, len(candidates))


def _best(problem: Problem, starts: Sequence[Array]) -> list[Array]:
    """Return starts, the best first, by their motions without self-motion."""
    t = rough_grid(problem).nodes
    motions, arrived = carried(problem.follows, np.array(starts), t)
    order = most_promising(problem, starts, motions, arrived, t, apart_of(problem.robot))
    return [starts[k] for k in order]


def _starts(planner: Planner, count: int) -> list[Array]:
    """Return so many starts: on the path itself, or as near to it as tolerances allow."""
    problem = planner.problem
    try:
        found = _on_start(problem.asked, planner, count)
    except InverseKinematicsError:
        if problem.asked is problem:
            raise
        return _on_start(problem, planner, count)
    return list(problem.at(np.zeros(len(found)), np.array(found)))


def _on_start(problem: Problem, planner: Planner, count: int) -> list[Array]:
    arm, asked = problem.envelope.arm(problem.robot), problem.envelope
    admits = asked.admits if asked.quantities else None
    return start_candidates(problem.follows.for_robot(arm), count, planner.rng, admits)


def _optimise_each(planner: Planner, candidates: Iterable[Candidate], count: int) -> None:
    planner.waiting = ()
    for number, candidate in enumerate(candidates, 1):
        if planner.is_over:
            break
        planner.waiting = (*planner.waiting, candidate)
        planner.progress("optimising start", number, count)
        planner.polish(candidate)
        # What nothing can reach, no other start will.
        if planner.is_out_of_reach():
            break
    planner.waiting = ()


def _resumed(planner: Planner, rough: Sequence[NodeMotion]) -> Iterator[Candidate]:
    """Yield candidates that begin at rough motions, only when their turn comes."""
    for motion in rough:
        candidate = None if planner.is_over else planner.taken_up(motion.trajectory)
        if candidate is not None:
            yield candidate
