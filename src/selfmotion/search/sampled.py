"""The search for two and more degrees of redundancy: samples of smooth motions as nodes."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, NoSequenceError, Progress, silent
from selfmotion.collision import CollisionModel
from selfmotion.search.chains import best_chains, diverse_chains
from selfmotion.search.manifold import OnPath
from selfmotion.search.measures import Length, Measure, spread_out
from selfmotion.search.nodes import Admissible
from selfmotion.search.sequences import Sequence, connected, ranked
from selfmotion.search.shortest import SMOOTHINGS, Shortest
from selfmotion.search.starts import spread

# Motions begin at so many times, evenly, from so many configurations each: of those that inverse
# kinematics finds from so many seeds.
_BEGINNINGS = 7
_BEGUN = 45
_BEGINNING_SEEDS = 200
# Constant null motions drift so far over the whole path [rad or m], one standard deviation; every
# other motion has none.
_DRIFT = 1.0
# Of the samples that a chain reaches, so many are followed to the next waypoint, those that are so
# far from each other [rad or m] first.
_PARENTS = 80
_PARENTS_APART = (1.6, 0.8, 0.4, 0.2, 0.1)
# So many tries around each of them, about this far off [rad].
_STRAYS = 2
_STRAYED = 0.15
# Around a chain, samples at these distances [rad or m], one after the other, so often each at most;
# a round that shortens the chain by less than this share is the last one of its ring.
_RINGS = (0.3, 0.1, 0.03, 0.01)
_RING_ROUNDS = 5
_RING_GAIN = 5e-3
# So many chains go through the first stage, after which it shows which are worth the others.
_LOOKED_AT = 8


@dataclass(frozen=True, eq=False)
class SampledLayers:
    """Samples of smooth motions at the waypoints of a path.

    Attributes
    ----------
    waypoints : OnPath
    bounds : Admissible
    layers : list of (K, n)
        Free samples, sorted by the first joint.
    """

    waypoints: OnPath
    bounds: Admissible
    layers: list[Array]

    @classmethod
    def of(
        cls,
        waypoints: OnPath,
        limits: tuple[Array, Array],
        bodies: tuple[tuple[CollisionModel, float], ...],
        largest_step: Array,
        weights: Array,
        rng: np.random.Generator | int,
        progress: Progress,
    ) -> "SampledLayers":
        """Return those of a task that leaves any redundancy; see `sampled_sequences`."""
        bounds = Admissible(*limits, waypoints.robot.is_revolute, bodies)
        generator = np.random.default_rng(rng)
        layers = _layers(waypoints, bounds, largest_step, weights, generator, progress)
        return cls(waypoints, bounds, layers)

    def why_blocked(self, i: int) -> str:
        """Return why no chain reaches waypoint i."""
        if not len(self.layers[i]):
            return "no sample there is within the limits and free"
        return (
            f"none of {len(self.layers[i])} samples that are within the limits and free can be "
            f"reached from those before within the step limits"
        )


def sampled_sequences(
    waypoints: OnPath,
    t: Array,
    *,
    lower: Array,
    upper: Array,
    largest_step: Array,
    bodies: Iterable[tuple[CollisionModel, float]] = (),
    weights: Array,
    count: int,
    measure: Measure | None = None,
    rng: np.random.Generator | int = 0,
    progress: Progress = silent,
) -> list[Sequence]:
    """Return good joint sequences along a path that are unlike each other, for any redundancy.

    Self-motions of two and more dimensions are too large to be sampled evenly at every waypoint.
    The nodes are those of many smooth motions instead, which begin all over the self-motions of
    some waypoints and follow the path both ways, with different constant null motions; dynamic
    programming changes from one to another where that is cheaper, or where one ends or meets
    something. Then samples around the best chains take their place, nearer and nearer.

    Parameters
    ----------
    waypoints : OnPath
    t : (W,)
        Their times [s].
    lower, upper : (n,)
        Joint limits [rad or m].
    largest_step : (W - 1, n)
        Largest change of each joint from one waypoint to the next [rad or m].
    bodies : sequence of (CollisionModel, float)
        Bodies to keep apart at the waypoints, and the distance [m].
    weights : (n,)
        Of the joints in a sequence's length.
    count : int
        How many sequences at most.
    measure : Measure, optional
        What they are chosen by; by default their length.
    rng : Generator or int
    progress : Progress

    Returns
    -------
    list of Sequence
        The best first, at least one.

    Raises
    ------
    NoSequenceError
        No chain exists among the samples; tells the waypoint at which the last one ends.
    """
    nodes = SampledLayers.of(
        waypoints, (lower, upper), tuple(bodies), largest_step, weights, rng, progress
    )
    bounds, layers, turning = nodes.bounds, nodes.layers, nodes.bounds.turning
    length = Length(weights)
    measure = measure or length
    chains = best_chains(layers, largest_step, turning, length)
    if chains.blocked is not None:
        time = float(t[chains.blocked])
        reason = nodes.why_blocked(chains.blocked)
        raise NoSequenceError(
            f"{waypoints.robot.name}: no motion along the path passes t = {time:.6g} s: {reason}",
            time=time,
            reason=reason,
        )
    if isinstance(measure, Length):
        found = diverse_chains(layers, chains, largest_step, turning, _LOOKED_AT, measure)
        rough = [connected(layers, chain, turning) for chain in found]
        shortest = Shortest(waypoints, bounds, largest_step, measure.weights)
        for number, q in enumerate(rough):
            progress("search: optimising sequence", number + 1, len(rough))
            rough[number] = shortest.near(q, SMOOTHINGS[:1])
        # Length among the samples says little of that of the shortest chain near, this says much.
        rough = [item.q for item in ranked(t, rough, turning, weights, measure)[:count]]
    else:
        one = chains.back(len(t) - 1, int(np.argmin(chains.cost[-1])))
        measure = measure.at_pace_of(connected(layers, one, turning))
        chains = best_chains(layers, largest_step, turning, measure)
        found = diverse_chains(layers, chains, largest_step, turning, count, measure)
        rough = [connected(layers, chain, turning) for chain in found]
    for number, q in enumerate(rough):
        progress("search: optimising sequence", number + 1, len(rough))
        rough[number] = _shortened(waypoints, bounds, q, largest_step, measure)
    return ranked(t, rough, turning, weights, measure)


def _layers(
    waypoints: OnPath,
    bounds: Admissible,
    largest_step: Array,
    weights: Array,
    rng: np.random.Generator,
    progress: Progress,
) -> list[Array]:
    """Return free samples at all waypoints, each (K, n), sorted by the first joint.

    Those of smooth motions; what follows from samples that a chain reaches, without self-motion;
    and what is near that: so there is a way around where smooth motions end.
    """
    smooth = _smooth_motions(waypoints, bounds, rng, progress)
    turning = bounds.turning
    layers, cost = [_sorted(smooth[0][bounds.keep(smooth[0])])], np.empty(0)
    for i in range(1, waypoints.count):
        progress("search: sampling waypoint", i + 1, waypoints.count)
        before = layers[-1]
        cost = np.zeros(len(before)) if i == 1 else cost
        parents = _spread_out(before[np.isfinite(cost)], cost[np.isfinite(cost)], _PARENTS)
        strays = np.repeat(parents, _STRAYS, axis=0)
        away = rng.normal(scale=_STRAYED, size=strays.shape) / weights
        step = 0.5 * largest_step[i - 1]
        guesses = np.concatenate([parents, strays + np.clip(away, -step, step)])
        q, arrived = waypoints.project(guesses, i)
        q = np.concatenate([q[arrived], smooth[i]])
        layers.append(_sorted(q[bounds.keep(q)]))
        cost, _ = Length(weights).extended(
            i - 1, before, cost, layers[-1], largest_step[i - 1], turning
        )
        if not np.any(np.isfinite(cost)):
            # What lies beyond is for chains that begin here.
            cost = np.zeros(len(cost))
    return layers


def _smooth_motions(
    waypoints: OnPath, bounds: Admissible, rng: np.random.Generator, progress: Progress
) -> list[Array]:
    """Return at all waypoints where motions with constant null motions are, each (K, n)."""
    dof, last = waypoints.robot.dof, waypoints.count - 1
    nodes = [[np.empty((0, dof))] for _ in range(waypoints.count)]
    stations = np.unique(np.linspace(0, last, _BEGINNINGS).round().astype(int))
    for number, station in enumerate(stations.tolist(), 1):
        progress("search: motions from waypoint", number, len(stations))
        begun = _starts(waypoints, bounds, station, rng)
        drift = rng.normal(scale=_DRIFT / max(last, 1), size=begun.shape)
        drift[::2] = 0.0
        nodes[station].append(begun)
        for direction in (1, -1):
            q, slope = begun, direction * drift
            end = waypoints.count if direction > 0 else -1
            for i in range(station + direction, end, direction):
                q, arrived = waypoints.project(q + slope, i)
                q, slope = q[arrived], slope[arrived]
                nodes[i].append(q)
    return [np.concatenate(parts) for parts in nodes]


def _spread_out(q: Array, cost: Array, count: int) -> Array:
    """Return up to `count` of q (K, n), far from each other first, the cheaper of near ones."""
    ranked = np.ascontiguousarray(q[np.argsort(cost, kind="stable")])
    return np.asarray(ranked[spread_out(ranked, np.array(_PARENTS_APART), count)])


def _sorted(q: Array) -> Array:
    return np.ascontiguousarray(q[np.argsort(q[:, 0], kind="stable")])


def _starts(waypoints: OnPath, bounds: Admissible, station: int, rng: np.random.Generator) -> Array:
    """Return configurations within the limits, free where there are such, (K, n)."""
    seeds = np.array(list(spread(waypoints.robot, _BEGINNING_SEEDS, rng)))
    q, arrived = waypoints.project(seeds, station, far=True)
    q = q[arrived]
    free = bounds.keep(q)
    return np.concatenate([q[free], q[~free]])[:_BEGUN]


def _shortened(
    waypoints: OnPath,
    bounds: Admissible,
    q: Array,
    largest_step: Array,
    measure: Measure,
) -> Array:
    """Return a better chain near q (W, n), never a worse one."""
    if isinstance(measure, Length):
        return Shortest(waypoints, bounds, largest_step, measure.weights).near(q)
    fixed = np.zeros(q.shape[1], dtype=bool)
    cost = measure.of(q)
    for ring in _RINGS:
        for _ in range(_RING_ROUNDS):
            layers = _around(waypoints, bounds, q, ring)
            chains = best_chains(layers, largest_step, fixed, measure)
            before, cost = cost, float(chains.cost[-1].min())
            chain = chains.back(len(q) - 1, int(np.argmin(chains.cost[-1])))
            q = connected(layers, chain, fixed)
            if cost > before - _RING_GAIN * abs(before):
                break
    return q


def _around(waypoints: OnPath, bounds: Admissible, q: Array, ring: float) -> list[Array]:
    """Return q (W, n) and the free samples around it at each waypoint, each (K, n).

    At one and two times `ring` to both sides along each axis of a basis of the null space that is
    carried along q: so a chain can move aside as a whole, without zigzag.
    """
    basis = waypoints.bases(q)
    offsets = ring * np.array([-2.0, -1.0, 1.0, 2.0])
    moves = np.einsum("wnr,k->wrkn", basis, offsets).reshape(len(q), -1, q.shape[1])
    guesses = q[:, None] + moves
    flat = guesses.reshape(-1, q.shape[1])
    found, arrived = waypoints.project_each(flat, np.repeat(np.arange(len(q)), moves.shape[1]))
    # Far corrections lead elsewhere.
    arrived &= np.linalg.norm(found - flat, axis=1) < 1.5 * ring
    arrived[arrived] = bounds.keep(found[arrived])
    found, kept = found.reshape(guesses.shape), arrived.reshape(guesses.shape[:2])
    layers = [
        np.concatenate([here[None], near[free]])
        for here, near, free in zip(q, found, kept, strict=True)
    ]
    return [_sorted(layer) for layer in layers]
