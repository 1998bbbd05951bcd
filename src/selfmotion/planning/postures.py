"""Motions along paths that are many times as long as the arm: they keep to a posture.

Without self-motion an arm drifts from loop to loop, until it is folded or stretched, and rough
motions of few steps tell nothing of hundreds of loops. A stretch of such a path tells in which
posture the rest is best followed, too: from a motion whose self-motion goes back to it, Newton's
method on nodes takes a handful of iterations, however many loops there are.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from selfmotion.basics import Array, SelfmotionError
from selfmotion.motion import Grid, Sampling
from selfmotion.nodes import NodeMotion
from selfmotion.optimise import Status
from selfmotion.path import Section
from selfmotion.planning.grids import is_on_nodes, most_nodes, resolves
from selfmotion.planning.planner import Planner
from selfmotion.planning.polish import Polisher
from selfmotion.planning.settings import (
    FIRST_NODES,
    LONG_AGREEMENT,
    LONG_WAY,
    ONE_VALLEY,
    STRETCH_WAY,
)
from selfmotion.planning.starts import optimise_starts
from selfmotion.planning.warm_start import on_start
from selfmotion.problem import Problem, asked_of_part


def is_long(planner: Planner) -> bool:
    """Whether the tool's way is many times the arm's reach, and nodes will do for the problem."""
    problem = planner.problem
    return problem.way_in_reaches > LONG_WAY and is_on_nodes(problem, planner.effort)


def keep_to_posture(planner: Planner) -> None:
    """Optimise a stretch in the middle, then the whole path from motions in its postures.

    Where the user wants no more after the stretch, the motion in its posture has to do.
    """
    postures, ended = _postures(planner)
    for number, posture in enumerate(postures, 1):
        planner.progress("posture", number, len(postures))
        _optimise(planner, posture, ended)
        if planner.is_over:
            break
    if ended is not None:
        _end(planner, ended)


def _end(planner: Planner, ended: Status) -> None:
    """Let what stands be it, where the user wants no more; KeyboardInterrupt where nothing does."""
    if planner.best is not None:
        planner.best.end(ended)
    elif ended is Status.INTERRUPTED:
        raise KeyboardInterrupt


def _optimise(planner: Planner, posture: Array, ended: Status | None) -> None:
    """Consider the best motion near one in a posture (n,), if it keeps the conditions.

    Where the user wants no more, it has to do where there is no other.
    """
    problem, start = planner.problem, planner.problem.given_start
    if start is None:
        try:
            start = on_start(problem, posture)
        except SelfmotionError:
            return
    constraints = problem.bind_constraints(start, start, apart=planner.effort.apart)
    polisher = Polisher(problem, planner.effort, constraints, free=planner.is_free)
    if ended is not None:
        polisher.end(ended)
    motion = _near(polisher, problem, start, posture)
    if motion is None:
        return
    try:
        found = polisher.best_near(motion, planner.cost_to_beat)
    except KeyboardInterrupt:
        found, ended = polisher.latest, Status.INTERRUPTED
        if found is None:
            raise
    if polisher.is_stopped:
        ended = Status.STOPPED
    will_do = found is not None and not found.violations and found.cost < planner.cost_to_beat
    if found is None or not (will_do or (ended is not None and planner.best is None)):
        if ended is not None:
            _end(planner, ended)
        return
    # Of its velocities eq. 4 keeps the self-motion.
    rates, grid = partial(motion.trajectory, order=1), Grid(motion.grid.t)
    candidate = planner.begin(start, free=planner.is_free, guide=rates, grid=grid)
    if candidate is not None:
        candidate.take(found, polisher.history)
        if ended is not None:
            candidate.end(ended)
        planner.consider(candidate)


def _postures(planner: Planner) -> tuple[list[Array], Status | None]:
    """Return mean configurations (n,) of the best motions along a stretch in the middle.

    And what ended the search for them, if the user did.
    """
    problem = planner.problem
    middle, half = 0.5, 0.5 * STRETCH_WAY / problem.way_in_reaches
    first, last = (problem.path.duration * share for share in (middle - half, middle + half))
    stretch = problem.changed(
        **problem.along(lambda path: Section(path, first, last)),
        start=None,
        constraints=list(asked_of_part(problem, is_first=False, is_last=False)),
        rest=False,
    )
    inner = replace(
        planner, problem=stretch, best=None, failure=None, waiting=(), ranking=None, attempts=[]
    )
    try:
        optimise_starts(inner, planner.search.starts, planner.search.finalists)
    except SelfmotionError:
        return [], None
    motions = [] if inner.best is None else [inner.best.evaluation().trajectory]
    ranked = [] if inner.ranking is None else inner.ranking.ranked
    motions += [motion.trajectory for motion in ranked]
    found: list[Array] = []
    for motion in motions:
        weights = Sampling.trapezoidal(motion.t).weights
        posture = np.asarray(weights @ motion.q / weights.sum())
        if all(np.abs(posture - other).max() > ONE_VALLEY for other in found):
            found.append(posture)
    return found, inner.best.status if inner.is_over and inner.best is not None else None


def _near(polisher: Polisher, problem: Problem, start: Array, posture: Array) -> NodeMotion | None:
    """Return the motion from a start (n,) that goes to a posture (n,) by self-motion.

    On the coarsest nodes on which it costs what it does; None where there is none.
    """
    # As long as it takes the tool to go as far as the arm reaches.
    time = problem.path.duration / problem.way_in_reaches
    grid, most = Grid.aligned(problem.knots, FIRST_NODES), most_nodes(problem)
    while grid.steps <= most:
        motion = polisher.grid(grid.nodes).motion_towards(start, posture, time)
        if motion is not None and resolves(motion, LONG_AGREEMENT):
            return motion
        grid = grid.halved()
    return None
