"""The global search: curves at all waypoints, vertices on them, the shortest chains of vertices."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import (
    Array,
    Flags,
    NoSequenceError,
    Progress,
)
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import Follows
from selfmotion.planning.search.chains import (
    Sequence,
    best_chains,
    connected,
    diverse_chains,
    ranked,
    why_blocked,
)
from selfmotion.planning.search.curves import SPACING, CurveSet, SelfMotion, curves_along
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import JointTravel, Measure, RunningCost
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.shortest import improved_by
from selfmotion.planning.search.starts import TRACING_SEEDS, spread
from selfmotion.planning.search.vertices import place_vertices

# Inverse kinematics is restarted at every 10th waypoint.
_RESTART_EVERY = 10
# Chains in the first stage, which decides which ones are refined.
_CANDIDATES = 8


@dataclass(frozen=True, eq=False)
class Layers:
    """The vertices of a search: free configurations at the waypoints of a path.

    Attributes
    ----------
    waypoints : OnPath
    t : (W,)
        Their times [s].
    steps : (W - 1, n)
        No joint may move more from one waypoint to the next [rad or m].
    bounds : SearchBounds
    samples : list of (K, n)
        Each at one of its turns.
    why : callable
        Returns the cause why no chain reaches a waypoint: for its number, reached vertices before
        it (A, n), the vertices there (K, n), and their bounds.
    """

    waypoints: OnPath
    t: Array
    steps: Array
    bounds: SearchBounds
    samples: list[Array]
    why: Callable[[int, Array, Array, SearchBounds], str]

    def refused(self, i: int, reason: str, parts: str = "") -> NoSequenceError:
        """Return the error that no motion, in any number of parts, passes waypoint i."""
        time = float(self.t[i])
        return NoSequenceError(
            f"{self.waypoints.robot.name}: no motion along the path{parts} passes "
            f"t = {time:.6g} s: {reason}",
            time=time,
            reason=reason,
        )


def curve_layers(
    follows: Follows,
    t: Array,
    steps: Array,
    limits: tuple[Array, Array],
    bodies: tuple[tuple[CollisionModel, float], ...],
    rng: np.random.Generator | int,
    progress: Progress,
) -> Layers:
    """Return the free samples of all self-motion curves of a task that leaves redundancy 1.

    At every waypoint all curves are traced by numerical continuation, from inverse kinematics at
    many seeds and from the curves of the neighbouring waypoints; samples are about 0.1 rad apart.

    Parameters
    ----------
    follows : Follows
    t : (W,)
        Times of the waypoints [s], increasing, within the path.
    steps : (W - 1, n)
        Largest change of each joint from one waypoint to the next [rad or m].
    limits : (n,), (n,)
        Joint limits [rad or m]; ±inf for joints without. Angles are not taken modulo turns.
    bodies : tuple of (CollisionModel, float)
        Bodies with a minimum distance at the waypoints [m].
    rng : Generator or int
        Shifts the seeds of the inverse kinematics.
    progress : Progress
        Called with the present waypoint.
    """
    motion, x = SelfMotion(follows, SPACING), follows.targets(t)
    bounds = SearchBounds(*limits, motion.revolute, bodies)
    seeds = spread(follows.coordinates, TRACING_SEEDS, np.random.default_rng(rng))
    curves = curves_along(motion, x, seeds, _RESTART_EVERY, progress)
    samples = _free_samples(motion, x, curves, bounds, progress)

    def why(i: int, alive: Array, layer: Array, kept: SearchBounds) -> str:
        return why_blocked(motion, x[i], curves[i], alive, layer, kept, steps[max(i - 1, 0)])

    return Layers(OnPath(follows, t, *limits), t, steps, bounds, samples, why)


def best_sequences(
    layers: Layers, count: int, given: Measure | None, progress: Progress
) -> list[Sequence]:
    """Return the best joint sequences over vertices that differ from each other.

    Dynamic programming finds the chain of least Σ w|Δq|, or least by another measure, with every
    step within the largest: the global optimum over the vertices. The best chains, which differ
    from each other by 0.3 rad in some joint at a tenth of the waypoints, are then optimised
    locally: see `shortest.py`.

    Parameters
    ----------
    layers : Layers
    count : int
        Largest number of sequences.
    given : Measure or None
        Their measure; by default their length.
    progress : Progress
        Called with the present sequence.

    Returns
    -------
    list of Sequence
        The best first, at least one.

    Raises
    ------
    NoSequenceError
        No chain exists among the vertices; with the waypoint at which the last one ends, and the
        cause.
    """
    rough, turning, measure = _rough_motions(layers, given)
    better = improved_by(layers.waypoints, layers.bounds, layers.steps, measure)
    stages = [("search: optimising finalist", False)]
    if isinstance(measure, JointTravel):
        # Lengths of chains predict those of the shortest ones nearby badly; a rough stage does it
        # well.
        stages.insert(0, ("search: optimising sequence", True))
    else:
        del rough[count:]
    for stage, roughly in stages:
        for number, q in enumerate(rough):
            progress(stage, number + 1, len(rough))
            rough[number] = better(q, roughly)
        best = ranked(layers.t, rough, turning, layers.waypoints.coordinates.weights, measure)
        best = best[:count]
        rough = [np.array(sequence.q) for sequence in best]
    return best


def _rough_motions(vertices: Layers, given: Measure | None) -> tuple[list[Array], Flags, Measure]:
    """Return the best different motions (W, n) over samples modulo turns, and their measure.

    Turns of joints with room for several are ignored at first, and the motion put inside the limits
    as a whole; if it does not fit, the search is repeated with all turns of these joints.
    """
    bounds = vertices.bounds
    length = (
        given
        if isinstance(given, JointTravel)
        else JointTravel(vertices.waypoints.coordinates.weights)
    )
    any_turn = bounds.with_unbounded_turns()
    while True:
        layers, turning = [any_turn.layer(q) for q in vertices.samples], any_turn.is_unbounded
        chains = best_chains(layers, vertices.steps, turning, length)
        if chains.blocked is not None:
            i = chains.blocked
            alive = layers[i - 1][np.isfinite(chains.cost[i - 1])] if i else layers[0][:0]
            raise vertices.refused(i, vertices.why(i, alive, layers[i], any_turn))
        measure: Measure = length
        if isinstance(given, RunningCost):
            shortest = chains.back(len(layers) - 1, int(np.argmin(chains.cost[-1])))
            measure = given.with_speed_of(connected(layers, shortest, turning))
            chains = best_chains(layers, vertices.steps, turning, measure)
        found = diverse_chains(layers, chains, vertices.steps, turning, _CANDIDATES, measure)
        rough = [bounds.centred(connected(layers, q, turning)) for q in found]
        beyond = bounds.exceeded(rough[0])
        if not np.any(beyond):
            return [q for q in rough if not np.any(bounds.exceeded(q))], turning, measure
        any_turn = any_turn.with_limits_of(bounds, beyond)


def _free_samples(
    motion: SelfMotion, x: Array, curves: list[CurveSet], bounds: SearchBounds, progress: Progress
) -> list[Array]:
    """Return the free samples of the curves at every waypoint, without turns."""
    found: list[Array] = []
    before = np.empty((0, motion.coordinates.dof))
    for number, (target, here) in enumerate(zip(x, curves, strict=True), 1):
        progress("search: sampling waypoint", number, len(x))
        carried, arrived = motion.project_all(before, target)
        before = place_vertices(motion, target, here, carried[arrived], bounds, SPACING)
        found.append(before)
    return found
