"""Optimise from an initial guess: the one way from a guess to a solution."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from selfmotion.planning.formulation import (
    keeps_off_itself,
    require_finite_gradients,
    require_finite_values,
)
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.grids import is_on_nodes
from selfmotion.planning.planner.guess import Guess
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.outcomes import NodeOutcome, on_the_way
from selfmotion.planning.planner.published import solve_as_published
from selfmotion.planning.planner.refinement import settled
from selfmotion.planning.planner.solution import Solution, is_chain

_Search = Callable[[LocalSearch], NodeOutcome | None]


def solve(begun: Guess | Solution, cost_to_beat: float = np.inf) -> Solution:
    """Return the optimum near an initial guess, on few nodes, or near a solution, on its own.

    Where a motion is known that costs `cost_to_beat`, it ends as soon as it is clear that this one
    will cost more.

    Raises
    ------
    BreakdownError, ProblemError
        A cost, or its gradient, is not finite.
    KeyboardInterrupt
        The interruption came before there was a motion that satisfies all conditions.
    """
    solution = Solution.of(begun) if isinstance(begun, Guess) else begun
    guess = solution.guess
    if solution.ended is not None or is_chain(solution):
        return solution
    if not np.isfinite(guess.minimum_norm.cost):
        require_finite_values(guess.formulation.costs, guess.minimum_norm.sampled.arm)
    if guess.effort.optimizer is not None:
        return solve_as_published(solution, guess.effort.optimizer)
    if not is_on_nodes(guess.formulation, guess.effort):
        return solution
    before = solution.on_nodes

    def optimum(search: LocalSearch) -> NodeOutcome | None:
        if before is not None:
            return search.again(before)
        return search.near(*guess.first_motions(), cost_to_beat)

    found = _searched(solution, optimum)
    nodes = found.on_nodes
    # One that costs more already is none to take either way.
    is_cheaper = nodes is not None and nodes.cost < cost_to_beat
    try:
        if is_cheaper and not found.outcome.keeps_off_itself:
            found = kept_off_itself(found) or found
    except KeyboardInterrupt:
        # There is a motion by now.
        found = found.ended_by(Status.INTERRUPTED)
    if found.status is Status.GRADIENT:
        # A gradient that is not finite is named with its time.
        require_finite_gradients(guess.formulation.costs, guess.minimum_norm.sampled.arm)
    return found


def settle(solution: Solution) -> Solution:
    """Return the optimum on nodes so near to each other that more change nothing.

    The published method has done so on its grids.
    """
    outcome = solution.on_nodes
    if solution.ended is not None or outcome is None or outcome.is_chain:
        return solution
    return _searched(solution, lambda search: settled(search, outcome))


def kept_off_itself(solution: Solution) -> Solution | None:
    """Return the optimum near one that takes the arm into itself, with that as a constraint.

    Few do, so that the others need not wait for distances. None where there is no other one.
    """
    guess, outcome = solution.guess, solution.on_nodes
    if outcome is None or outcome.violations or outcome.is_chain:
        return None
    # Of a given start in which it meets itself, nothing else begins.
    can = guess.free or keeps_off_itself(guess.formulation, outcome.motion.place.q[:1])
    if solution.ended is not None or guess.effort.apart or not can:
        return None
    apart = guess.kept_apart()

    def optimum(search: LocalSearch) -> NodeOutcome | None:
        first = apart.motion or apart.minimum_norm.evaluation.trajectory
        return search.with_more(outcome) or search.near([first], outcome.motion.grid.t)

    return _searched(replace(solution, guess=apart), optimum)


def at_warm_start(guess: Guess) -> Solution | None:
    """Return the motion of the plan that a guess begins with; None where there is none."""
    if guess.plan is None or not is_on_nodes(guess.formulation, guess.effort):
        return None
    motions, t = guess.first_motions()
    if len(motions) < 2:
        return None
    motion = LocalSearch.of(guess).grid(t).near(*(motions[0](t, order) for order in range(3)))
    if motion is None:
        return None
    # Nothing better was found.
    return Solution(guess, on_the_way(motion, Status.PRECISION))


def _searched(solution: Solution, find: _Search) -> Solution:
    """Return the solution with what a search finds, if it finds something."""
    search = LocalSearch.of(solution.guess)
    ended = solution.ended
    try:
        found = find(search)
    except KeyboardInterrupt:
        found = search.recorder.latest
        if found is None and solution.on_nodes is None:
            raise
        ended = Status.INTERRUPTED
    if search.recorder.ended is Status.STOPPED:
        # A motion that was better before it is left as it was, and does not say so.
        ended = Status.STOPPED
        if found is not None and found.violations:
            found = search.recorder.latest or found
    return replace(
        solution,
        outcome=found or solution.outcome,
        history=(*solution.history, *search.recorder.history),
        ended=ended,
        is_hopeless=search.is_hopeless,
    )
