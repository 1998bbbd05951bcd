"""Proposals of more than a line: many starts, chains over all self-motions, postures.

The shortest chain becomes a motion of nodes directly, where length is the only cost.

Along paths that are many times as long as the arm, motions keep a posture. Without self-motion an
arm drifts from loop to loop, until it is folded or stretched, and rough motions of few steps say
nothing about hundreds of loops. The best posture on a segment of such a path is a good one for the
rest: from a motion whose self-motion returns to it, Newton's method on nodes takes a few
iterations, for any number of loops.
"""

import contextlib
from collections import abc
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from selfmotion.basics import (
    Array,
    Flags,
    InverseKinematicsError,
    NoSequenceError,
    SelfmotionError,
)
from selfmotion.model.follow import completed, within_limits
from selfmotion.model.motion import Grid, Sampling, Trajectory
from selfmotion.model.path import Section
from selfmotion.planning.formulation import Formulation, without_tolerances
from selfmotion.planning.nodes import NodeGrid, NodeMotion, broken_intervals
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.grids import is_on_nodes, most_nodes, resolves, rough_grid
from selfmotion.planning.planner.guess import Guess, on_start
from selfmotion.planning.planner.local_search import LocalSearch
from selfmotion.planning.planner.outcomes import NodeOutcome
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.rough import distance_of
from selfmotion.planning.planner.screening import ONE_VALLEY, Ranking, most_promising
from selfmotion.planning.planner.solution import Solution, is_chain
from selfmotion.planning.search import (
    LAST_SMOOTHINGS,
    Sequence,
    SinglePoses,
    Stacked,
    carried,
    carried_within,
    guides,
    inside,
    is_joint_travel,
    metrics,
    pushed,
    shortest_along,
    start_candidates,
)
from selfmotion.problem.problem import along_other_paths, constraints_of_part

# Length of a long path, in reaches of the arm: x = 0 starts to drift.
LONG_PATH = 5.0
# Length above which rough motions from many starts say nothing.
VERY_LONG_PATH = 12.0
# Length of a segment that determines the posture, likewise.
_SEGMENT_LENGTH = 2.0
# Number of the first nodes.
_FIRST_NODES = 64
# Nodes per waypoint of a chain that becomes a motion …
_FINER_CHAIN = 3
# … which are refined between violated ones in this number of rounds.
_CHAIN_ROUNDS = 4
# Sequences dearer by this factor than a feasible one are not refined.
_DEARER = 1.25
# The same if that is a chain itself, which optimisation hardly improves.
_DEARER_CHAIN = 1.005
# Share of a joint at rest in the correction of a velocity, relative to the fastest joint's.
_MIN_SPEED_SHARE = 1e-2
# Speed below which all joints rest [rad/s or m/s].
_REST = 1e-9
# Samples between two nodes for limits.
_SAMPLES = 16


def optimise_starts(planner: Planner, count: int, finalists: int) -> None:
    """Draw `count` starts, and optimise the best of them; all if they are few.

    Raises
    ------
    InverseKinematicsError
        None reaches the start of the path.
    """
    starts = _starts(planner, count)
    if len(starts) > finalists and is_on_nodes(planner.formulation, planner.effort):
        ranking = _ranking(planner)
        if ranking.run(starts, finalists):
            ranked = _trajectories(ranking.ranked)
            _optimise_near(planner, ranked)
            if planner.is_unmet and planner.incumbent is not None and not planner.is_over:
                before = [*ranked, planner.incumbent.evaluation.trajectory]
                others = ranking.left_aside(before, finalists)
                _optimise_near(planner, _trajectories(others))
            return
    elif len(starts) > finalists:
        starts = _best(planner.formulation, starts)[:finalists]
    started = (planner.guess(start, free=True) for start in starts)
    known = (guess for guess in started if guess is not None)
    guesses = sorted(known, key=lambda guess: guess.minimum_norm.merit())
    _optimise_each(planner, guesses, len(guesses))


def _ranking(planner: Planner) -> Ranking:
    """Return a new ranking of starts, which an interruption finds."""
    found = Ranking(planner.formulation, planner.effort, planner.setup.progress)
    planner.ranking = found
    return found


def optimise_where_it_breaks(
    planner: Planner, breaks_at: float, count: int, finalists: int
) -> None:
    """Draw configurations at the largest violation, a time [s], and optimise.

    The fewest configurations are feasible there, as a rule: motions through one of these, which are
    carried to both ends of the path from there, start feasible.
    """
    formulation, t = planner.formulation, rough_grid(planner.formulation).nodes
    at = int(np.argmin(np.abs(t - breaks_at)))
    try:
        starts = _drawn(formulation, planner, count, float(t[at]))
    except InverseKinematicsError:
        return
    _optimise_near(planner, _pushed(planner, starts, t, at)[:finalists])
    ranking = _ranking(planner)
    if ranking.run(starts, finalists, at):
        _optimise_near(planner, _trajectories(ranking.ranked))


def _pushed(planner: Planner, starts: abc.Sequence[Array], t: Array, at: int) -> list[Trajectory]:
    """Return motions at times t (N,) through free configurations at the time of number `at`.

    Through those that bodies push others into: the starts, and the best motion. None where some
    starts are free, which lead to motions as well.
    """
    from scipy.interpolate import CubicSpline

    if not planner.formulation.envelope_without_arm.bodies:
        return []
    # Motions at their limits break them between nodes.
    poses = inside(SinglePoses(planner.formulation, np.random.default_rng(0)))
    q = np.array(starts)
    if poses.bounds.is_admissible(q).any():
        return []
    best, follows = planner.incumbent, planner.formulation.follows
    if best is not None:
        own = best.evaluation.trajectory(t[at : at + 1])[:, : follows.robot.dof]
        q = np.concatenate([completed(follows, t[at : at + 1], own), q])
    motions = carried_within(poses, pushed(poses, float(t[at]), q), t, at)
    curves, names = [CubicSpline(t, motion) for motion in motions], follows.coordinates.names
    return [Trajectory(t, curve(t), curve(t, 1), names, curve(t, 2)) for curve in curves]


def may_stack(planner: Planner) -> bool:
    """Whether a quantity of q is violated, or several parts share the motion."""
    formulation, best = planner.formulation, planner.incumbent
    names = [item.name for item in formulation.envelope.quantities]
    broken = (
        names
        if best is None
        else [
            name for name in names if any(text.startswith(f"{name}: ") for text in best.violations)
        ]
    )
    return bool(broken) or len(metrics(formulation.coordinates)) > 1


def optimise_stacked(planner: Planner, finalists: int) -> bool:
    """Optimise from motions that keep limits and quantities as rows of their task.

    In several metrics, each part of a cell heavy in turn; from both ends of the path, and from
    where the best motion breaks something. Return whether there was any.
    """
    formulation = planner.formulation
    # Between two nodes of a rough motion a part of a cell may turn by half a radian.
    t = rough_grid(formulation).halved().halved().nodes
    motions = [*_stacked(planner, t)]
    found = np.concatenate(motions) if motions else np.zeros((0, 0, 0))
    if len(found):
        ranking = _ranking(planner)
        ranking.run_along(found, t, finalists)
        _optimise_near(planner, _trajectories(ranking.ranked))
    return bool(len(found))


def _stacked(planner: Planner, t: Array) -> Iterator[Array]:
    """Yield motions (K, N, n) through times t (N,) [s] that satisfy conditions at all of them."""
    formulation, allowed = planner.formulation, planner.formulation.envelope
    drawn = _configurations_at(planner, t)
    for weights in metrics(formulation.coordinates):
        task = Stacked(
            formulation.follows, allowed.quantities, allowed.lower, allowed.upper, weights
        )
        for place, starts in drawn.items():
            if planner.setup.is_free:
                q, feasible = task.placed(starts, float(t[place]))
                starts = q[feasible]
            motions, arrived = task.carried(starts, t, place)
            yield motions[arrived]


def _configurations_at(planner: Planner, t: Array) -> dict[int, Array]:
    """Return initial configurations (K, n), by the number of their time among some (N,).

    The given start; or random ones at both ends, and at the largest violation of the best motion.
    """
    formulation, best = planner.formulation, planner.incumbent
    if formulation.given_start is not None:
        return {0: formulation.given_start[None]}
    breaks = best.outcome.breaks_at if best is not None else None
    places = {0, len(t) - 1, *([] if breaks is None else [int(np.argmin(np.abs(t - breaks)))])}
    found = dict[int, Array]()
    allowed = formulation.envelope
    arm = within_limits(formulation.follows, allowed.lower, allowed.upper)
    for place in sorted(places):
        with contextlib.suppress(InverseKinematicsError):
            # Few random ones satisfy all conditions: they are moved there.
            drawn = start_candidates(
                arm, planner.setup.search.starts, planner.rng, time=float(t[place])
            )
            found[place] = np.array(drawn)
    return found


def _best(formulation: Formulation, starts: abc.Sequence[Array]) -> list[Array]:
    """Return starts, the best first, by their motions without self-motion."""
    t = rough_grid(formulation).nodes
    motions, arrived = carried(formulation.follows, np.array(starts), t)
    order = most_promising(
        formulation, starts, motions, arrived, t, distance_of(formulation.coordinates)
    )
    return [starts[k] for k in order]


def _starts(planner: Planner, count: int) -> list[Array]:
    """Return `count` starts: on the path itself, or as near to it as tolerances allow."""
    formulation = planner.formulation
    try:
        found = _drawn(without_tolerances(formulation), planner, count)
    except InverseKinematicsError:
        if not formulation.problem.relaxations:
            raise
        return _drawn(formulation, planner, count)
    return list(completed(formulation.follows, np.zeros(len(found)), np.array(found)))


def _drawn(
    formulation: Formulation, planner: Planner, count: int, time: float = 0.0
) -> list[Array]:
    """Return `count` configurations on the path at a time [s]."""
    allowed = formulation.envelope
    follows = within_limits(formulation.follows, allowed.lower, allowed.upper)
    admits = allowed.admits if allowed.quantities else None
    return start_candidates(follows, count, planner.rng, admits, time)


def _optimise_each(planner: Planner, guesses: Iterable[Guess], count: int) -> None:
    planner.waiting = ()
    for number, guess in enumerate(guesses, 1):
        if planner.is_over:
            break
        planner.waiting = (*planner.waiting, guess)
        planner.setup.progress("optimising start", number, count)
        planner.take(guess)
        # A pose out of reach is so for any start.
        if planner.is_out_of_reach():
            break
    planner.waiting = ()


def _optimise_near(planner: Planner, known: abc.Sequence[Trajectory]) -> None:
    """Optimise from motions that are known, in turn; guesses are made when it is their turn."""
    started = (
        planner.guess(motion.q[0], free=planner.setup.is_free, motion=motion)
        for motion in known
        if not planner.is_over
    )
    _optimise_each(planner, (guess for guess in started if guess is not None), len(known))


def _trajectories(rough: abc.Sequence[NodeMotion]) -> list[Trajectory]:
    return [motion.trajectory for motion in rough]


def optimise_sequences(planner: Planner, *, chosen: bool) -> None:
    """Search, and optimise from the best sequences in turn; note a search that finds nothing.

    They are compared with the present motion, and `chosen` only if allowed.
    """
    try:
        planner.sequences = guides(
            planner.formulation, planner.setup.search.rng, planner.setup.progress
        )
    except NoSequenceError as error:
        planner.failure = error
        planner.notes.append(f"global search: {error}")
    started: list[Solution] = []
    for number, guide in enumerate(planner.sequences, 1):
        planner.setup.progress("refining sequence", number, len(planner.sequences))
        guess = planner.guess(guide.start, free=True, guide=guide)
        if guess is None or (started and _is_hopeless(planner, guide, guess, started[0])):
            continue
        found = along_chain(guess, guide)
        if started and is_chain(started[0]) and found is None:
            continue
        given = guess if found is None else Solution(guess, found)
        solution = planner.take(given, chosen=chosen)
        if planner.is_over:
            return
        started = sorted([*started, solution], key=Solution.score)
    if started:
        planner.rival = started[0]


def _is_hopeless(planner: Planner, guide: Sequence, guess: Guess, best: Solution) -> bool:
    """Whether a sequence is much dearer than the best one, and costs more than the present motion.

    Optimising gains some percent on a sequence.
    """
    if best.violations:
        return False
    least = planner.sequences[0].cost
    share = _DEARER_CHAIN if is_chain(best) else _DEARER
    dearer = guide.cost > least + (share - 1.0) * abs(least)
    return dearer and guess.minimum_norm.merit() > best.score()[-1]


def along_chain(guess: Guess, guide: Sequence) -> NodeOutcome | None:
    """Return the motion through the shortest chain near a sequence; None where it will not do.

    Where length is the only cost, joints rest and start again all over the path: a motion of few
    nodes cannot, and second derivatives at kinks are useless for Newton's method. The chain is at
    its optimum already, so that only velocities are missing.
    """
    formulation, effort, conditions = guess.formulation, guess.effort, guess.conditions
    if not is_on_nodes(formulation, effort) or not is_joint_travel(formulation):
        return None
    if conditions.ends:
        # The search's sequences know nothing of given ends.
        return None
    t, q = guide.t, guide.q
    finer = Grid.aligned(formulation.knots, _FINER_CHAIN * len(t))
    for number in range(_CHAIN_ROUNDS):
        # A few nodes more change little.
        stages = LAST_SMOOTHINGS[2:] if number else LAST_SMOOTHINGS
        found = shortest_along(formulation, t, q, finer.nodes, stages)
        if found is None:
            return None
        t, q = found
        grid = NodeGrid(formulation, t, conditions, free=True, counts=effort.counts)
        motion = _through(grid, q)
        if motion is None:
            return None
        broken = broken_intervals(motion) | _beyond_limits(motion)
        if not broken.any():
            none = np.zeros(len(motion.h))
            return NodeOutcome(motion, Status.PRECISION, none, is_chain=True)
        finer = Grid(t).halved(np.convolve(broken, np.ones(3), "same") > 0.0)
    return None


def _beyond_limits(motion: NodeMotion) -> Flags:
    """Return on which intervals a joint passes a limit, also for a moment, (N,)."""
    allowed, t = motion.grid.formulation.envelope, motion.grid.t
    samples = (t[:-1, None] + np.diff(t)[:, None] * np.arange(_SAMPLES) / _SAMPLES).ravel()
    q, qd = motion.trajectory(samples), motion.trajectory(samples, 1)
    beyond = (q < allowed.lower) | (q > allowed.upper) | (np.abs(qd) > allowed.speed)
    return np.asarray(beyond.reshape(len(t) - 1, -1).any(axis=1))


def _through(grid: NodeGrid, q: Array) -> NodeMotion | None:
    """Return the motion through nodes q (K, n), with smooth velocities."""
    from scipy.interpolate import PchipInterpolator

    # Monotone cubics pass no limit that the nodes keep.
    near = PchipInterpolator(grid.t, q).derivative()(grid.t)
    motion = grid.near(q, near)
    return motion and grid.near(q, _resting(motion, near))


def _resting(motion: NodeMotion, near: Array) -> Array:
    """Return q̇ on the path that is nearest to another one, `near` (K, n), with the same rests.

    The error from the path is left to the joints that move, so that others go on resting.
    """
    share = np.abs(near) / np.maximum(np.abs(near).max(axis=1, keepdims=True), _REST)
    rows = motion.grid.formulation.follows.jacobians(motion.place.q)
    lack = np.einsum("kmn,kn->km", rows, motion.place.qd - near)
    shared = np.maximum(share, _MIN_SPEED_SHARE)[:, :, None] * rows.transpose(0, 2, 1)
    return np.asarray(near + (shared @ np.linalg.solve(rows @ shared, lack[:, :, None]))[:, :, 0])


def is_long(planner: Planner) -> bool:
    """Whether the path is many times the arm's reach, and the formulation is solved on nodes."""
    formulation = planner.formulation
    return formulation.length_in_reaches > LONG_PATH and is_on_nodes(formulation, planner.effort)


def keep_to_posture(planner: Planner) -> None:
    """Optimise a segment in the middle, then the whole path from motions in its postures.

    After an interruption of the segment, the motion in its posture is the result.
    """
    postures, ended = _postures(planner)
    for number, posture in enumerate(postures, 1):
        planner.setup.progress("posture", number, len(postures))
        _optimise(planner, posture, ended)
        if planner.is_over:
            break
    if ended is not None:
        _end(planner, ended)


def _end(planner: Planner, ended: Status) -> None:
    """Keep the present motion after an interruption; KeyboardInterrupt if there is none."""
    if planner.incumbent is not None:
        planner.end(ended)
    elif ended is Status.INTERRUPTED:
        raise KeyboardInterrupt


def _optimise(planner: Planner, posture: Array, ended: Status | None) -> None:
    """Consider the best motion near one in a posture (n,), if it keeps the conditions.

    Where the user wants no more, it has to do where there is no other.
    """
    formulation, start = planner.formulation, planner.formulation.given_start
    if start is None:
        try:
            start = on_start(formulation, posture)
        except SelfmotionError:
            return
    conditions = formulation.conditions(start, start, apart=planner.effort.apart)
    search = LocalSearch(formulation, planner.effort, conditions, free=planner.setup.is_free)
    search.recorder.ended = ended
    motion = _near(search, start, posture)
    if motion is None:
        return
    best = planner.incumbent
    least = best.outcome.cost if best is not None and best.will_do else np.inf
    try:
        found = search.best_near(motion, least)
    except KeyboardInterrupt:
        found, ended = search.recorder.latest, Status.INTERRUPTED
        if found is None:
            raise
    if search.recorder.ended is Status.STOPPED:
        ended = Status.STOPPED
    will_do = found is not None and not found.violations and found.cost < least
    if found is None or not (will_do or (ended is not None and planner.incumbent is None)):
        if ended is not None:
            _end(planner, ended)
        return
    # Of its velocities eq. 4 keeps the self-motion.
    rates, grid = partial(motion.trajectory, order=1), Grid(motion.grid.t)
    guess = planner.guess(start, free=planner.setup.is_free, guide=rates, grid=grid)
    if guess is not None:
        history = tuple(search.recorder.history)
        planner.consider(Solution(guess, found, history, ended))


def _postures(planner: Planner) -> tuple[list[Array], Status | None]:
    """Return mean configurations (n,) of the best motions along a segment in the middle.

    And what ended the search for them, if the user did.
    """
    formulation = planner.formulation
    middle, half = 0.5, 0.5 * _SEGMENT_LENGTH / formulation.length_in_reaches
    first, last = (formulation.path.duration * share for share in (middle - half, middle + half))
    problem = formulation.problem
    section = problem.changed(
        **along_other_paths(problem, lambda path: Section(path, first, last)),
        start=None,
        constraints=list(constraints_of_part(problem, is_first=False, is_last=False)),
        rest=False,
    )
    own = replace(planner.setup, formulation=Formulation.of(section))
    inner = replace(
        planner,
        setup=own,
        incumbent=None,
        failure=None,
        waiting=(),
        ranking=None,
        attempts=[],
    )
    try:
        optimise_starts(inner, planner.setup.search.starts, planner.setup.search.finalists)
    except SelfmotionError:
        return [], None
    motions = [] if inner.incumbent is None else [inner.incumbent.evaluation.trajectory]
    ranked = [] if inner.ranking is None else inner.ranking.ranked
    motions += [motion.trajectory for motion in ranked]
    found: list[Array] = []
    for motion in motions:
        weights = Sampling.trapezoidal(motion.t).weights
        posture = np.asarray(weights @ motion.q / weights.sum())
        if all(np.abs(posture - other).max() > ONE_VALLEY for other in found):
            found.append(posture)
    return found, inner.incumbent.status if inner.is_over and inner.incumbent is not None else None


def _near(search: LocalSearch, start: Array, posture: Array) -> NodeMotion | None:
    """Return the motion from a start (n,) that goes to a posture (n,) by self-motion.

    On the coarsest nodes with about its cost; None without any.
    """
    formulation = search.formulation
    # As long as it takes the tool to go as far as the arm reaches.
    time = formulation.path.duration / formulation.length_in_reaches
    grid, most = Grid.aligned(formulation.knots, _FIRST_NODES), most_nodes(formulation)
    while grid.steps <= most:
        motion = search.grid(grid.nodes).motion_towards(start, posture, time)
        if motion is not None and resolves(motion):
            return motion
        grid = grid.halved()
    return None
