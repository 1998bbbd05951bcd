"""The global search: curves at all waypoints, nodes on them, the shortest chains of nodes."""

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
from selfmotion.planning.search.measures import Length, Measure, RunningCost
from selfmotion.planning.search.nodes import Admissible, place_nodes
from selfmotion.planning.search.shortest import improved_by
from selfmotion.planning.search.starts import TRACING_SEEDS, spread

# Inverse kinematics starts anew at every so manieth waypoint.
_ANEW_EVERY = 10
# So many chains go through the first stage, after which it shows which are worth the others.
_LOOKED_AT = 8


@dataclass(frozen=True, eq=False)
class Layers:
    """The nodes of a search: free configurations at the waypoints of a path.

    Attributes
    ----------
    waypoints : OnPath
    t : (W,)
        Their times [s].
    steps : (W - 1, n)
        No joint may move more from one waypoint to the next [rad or m].
    bounds : Admissible
    samples : list of (K, n)
        Each at one of its turns.
    why : callable
        Returns why no chain reaches a waypoint, by its number, what chains reach before it (A, n),
        the nodes there (K, n), and the bounds that these keep.
    """

    waypoints: OnPath
    t: Array
    steps: Array
    bounds: Admissible
    samples: list[Array]
    why: Callable[[int, Array, Array, Admissible], str]

    def refused(self, i: int, reason: str, parts: str = "") -> NoSequenceError:
        """Return the error that no motion, in however many parts, passes waypoint i."""
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
        Joint limits [rad or m]; ±inf for joints without. An angle is what it is: turns count.
    bodies : tuple of (CollisionModel, float)
        Bodies to keep apart at the waypoints, and the distance [m].
    rng : Generator or int
        Shifts the seeds of the inverse kinematics.
    progress : Progress
        Told the waypoint that is worked on.
    """
    motion, x = SelfMotion(follows, SPACING), follows.targets(t)
    bounds = Admissible(*limits, motion.revolute, bodies)
    seeds = spread(follows.robot, TRACING_SEEDS, np.random.default_rng(rng))
    curves = curves_along(motion, x, seeds, _ANEW_EVERY, progress)
    samples = _free_samples(motion, x, curves, bounds, progress)

    def why(i: int, alive: Array, layer: Array, kept: Admissible) -> str:
        return why_blocked(motion, x[i], curves[i], alive, layer, kept, steps[max(i - 1, 0)])

    return Layers(OnPath(follows, t, *limits), t, steps, bounds, samples, why)


def best_sequences(
    layers: Layers, count: int, asked: Measure | None, progress: Progress
) -> list[Sequence]:
    """Return the best joint sequences over nodes that are unlike each other.

    Dynamic programming finds the chain of least Σ w|Δq|, or of the least of another measure, with
    every step within the largest: the global optimum over the nodes. The best chains, unlike each
    other by 0.3 rad in some joint at a tenth of the waypoints, are then moved aside, locally, to
    where they are better: see `shortest.py`.

    Parameters
    ----------
    layers : Layers
    count : int
        How many sequences at most.
    asked : Measure or None
        What they are chosen by; by default their length.
    progress : Progress
        Told the sequence that is worked on.

    Returns
    -------
    list of Sequence
        The best first, at least one.

    Raises
    ------
    NoSequenceError
        No chain exists among the nodes; tells the waypoint at which the last one ends, and why.
    """
    rough, turning, measure = _rough_motions(layers, asked)
    better = improved_by(layers.waypoints, layers.bounds, layers.steps, measure)
    stages = [("search: optimising finalist", False)]
    if isinstance(measure, Length):
        # A chain's length says little of that of the shortest one near it, a rough look says much.
        stages.insert(0, ("search: optimising sequence", True))
    else:
        del rough[count:]
    for stage, roughly in stages:
        for number, q in enumerate(rough):
            progress(stage, number + 1, len(rough))
            rough[number] = better(q, roughly)
        best = ranked(layers.t, rough, turning, layers.waypoints.robot.joint_weights, measure)
        best = best[:count]
        rough = [np.array(sequence.q) for sequence in best]
    return best


def _rough_motions(nodes: Layers, asked: Measure | None) -> tuple[list[Array], Flags, Measure]:
    """Return the best unlike motions (W, n) over samples, whose turns did not count, and by what.

    Turns of joints with room for several are left out at first, and the motion put inside the
    limits as a whole; where it does not fit, it is looked for among all turns of these joints.
    """
    bounds = nodes.bounds
    length = asked if isinstance(asked, Length) else Length(nodes.waypoints.robot.joint_weights)
    any_turn = bounds.without_turns()
    while True:
        layers, turning = [any_turn.layer(q) for q in nodes.samples], any_turn.turning
        chains = best_chains(layers, nodes.steps, turning, length)
        if chains.blocked is not None:
            i = chains.blocked
            alive = layers[i - 1][np.isfinite(chains.cost[i - 1])] if i else layers[0][:0]
            raise nodes.refused(i, nodes.why(i, alive, layers[i], any_turn))
        measure: Measure = length
        if isinstance(asked, RunningCost):
            shortest = chains.back(len(layers) - 1, int(np.argmin(chains.cost[-1])))
            measure = asked.at_pace_of(connected(layers, shortest, turning))
            chains = best_chains(layers, nodes.steps, turning, measure)
        found = diverse_chains(layers, chains, nodes.steps, turning, _LOOKED_AT, measure)
        rough = [bounds.turned_inside(connected(layers, q, turning)) for q in found]
        beyond = bounds.beyond(rough[0])
        if not np.any(beyond):
            return [q for q in rough if not np.any(bounds.beyond(q))], turning, measure
        any_turn = any_turn.counting_turns(beyond, bounds)


def _free_samples(
    motion: SelfMotion, x: Array, curves: list[CurveSet], bounds: Admissible, progress: Progress
) -> list[Array]:
    """Return the free samples of the curves at every waypoint, without turns."""
    found: list[Array] = []
    before = np.empty((0, motion.robot.dof))
    for number, (target, here) in enumerate(zip(x, curves, strict=True), 1):
        progress("search: sampling waypoint", number, len(x))
        carried, arrived = motion.project_all(before, target)
        before = place_nodes(motion, target, here, carried[arrived], bounds, SPACING)
        found.append(before)
    return found
