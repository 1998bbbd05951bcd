"""Dynamic programming over waypoints: the best chains of vertices, and why there is none."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, Flags, Ints, read_only
from selfmotion.model.collision import Closest, CollisionModel
from selfmotion.planning.search.curves import CurveSet, SelfMotion
from selfmotion.planning.search.layer_steps import unturned
from selfmotion.planning.search.measures import JointTravel, Measure
from selfmotion.planning.search.search_bounds import SearchBounds

# Intervals of the spline that smooths a chain, per interval of the chain.
_SMOOTHING = 3
# Difference of some joint [rad or m] by which chains count as different …
UNLIKE = 0.3
# … at this share of the waypoints.
_UNLIKE_FOR = 0.1
# Evenly spread waypoints through which different chains are sought.
_STATIONS = 7


@dataclass(frozen=True, eq=False)
class Sequence:
    """Configurations along a path, and the smooth motion near them: a `Guide`.

    Attributes
    ----------
    t : (W,)
        Times of the waypoints [s].
    q : (W, n)
        Configurations [rad or m], each with the tool on the path.
    length : float
        Σ w|Δq| over waypoints and joints, w being the joints' weights (`RobotModel.joint_weights`).
    cost : float
        Its cost by the measure; see `Measure`.
    """

    t: Array
    q: Array
    length: float
    cost: float = np.nan

    def __post_init__(self) -> None:
        object.__setattr__(self, "t", read_only(self.t))
        object.__setattr__(self, "q", read_only(self.q))

    @property
    def start(self) -> Array:
        """Its first configuration, (n,)."""
        return np.asarray(self.q[0])

    @cached_property
    def _rate(self) -> Callable[[Array], Array]:
        from scipy.interpolate import make_lsq_spline

        t = self.t
        # Where samples are dense in time, so are knots.
        inner = np.append(t[:-_SMOOTHING:_SMOOTHING], t[-1])
        knots = np.concatenate([[t[0]] * 3, inner, [t[-1]] * 3])
        return make_lsq_spline(t, self.q, knots).derivative()

    def __call__(self, t: Array) -> Array:
        """Return q̇ at times `t` (S,), (S, n): the motion of x = 0 along a guide."""
        return np.asarray(self._rate(t))


@dataclass(frozen=True, eq=False)
class Chains:
    """The cheapest chains to every vertex, or from every vertex when made backwards.

    Attributes
    ----------
    cost : tuple of (N_i,)
        The least from the first waypoint; inf where no chain arrives.
    parent : tuple of (N_i,)
        The vertex before on that chain, -1 for none.
    """

    cost: tuple[Array, ...]
    parent: tuple[Ints, ...]

    @property
    def blocked(self) -> int | None:
        """The first waypoint that no chain reaches."""
        for i, cost in enumerate(self.cost):
            if not np.any(np.isfinite(cost)):
                return i
        return None

    def back(self, waypoint: int, vertex: int) -> list[int]:
        """Return the vertices of the chain that arrives at a vertex, first to last."""
        chain = [vertex]
        for i in range(waypoint, 0, -1):
            chain.append(int(self.parent[i][chain[-1]]))
        return chain[::-1]


def best_chains(
    layers: list[Array], largest_step: Array, turning: Flags, measure: Measure | None = None
) -> Chains:
    """Return the cheapest chains from the first layer on (Bellman's recursion, exact).

    Parameters
    ----------
    layers : list of (N_i, n)
        Vertices at the waypoints, each layer sorted by the first joint.
    largest_step : (n,) or (W - 1, n)
        No joint may move more between waypoints.
    turning : (n,)
        Joints that count modulo turns.
    measure : Measure, optional
        By default the length, all joints alike.
    """
    measure = JointTravel(np.ones(len(turning))) if measure is None else measure
    cost = [np.zeros(len(layers[0]))]
    parent = [np.full(len(layers[0]), -1, dtype=np.intp)]
    steps = np.broadcast_to(largest_step, (len(layers) - 1, len(turning)))
    for k, (before, after) in enumerate(itertools.pairwise(layers)):
        reach, source = measure.relaxed_layer(k, before, cost[-1], after, steps[k], turning)
        cost.append(reach)
        parent.append(source)
    return Chains(tuple(cost), tuple(parent))


def diverse_chains(
    layers: list[Array],
    forward: Chains,
    largest_step: Array,
    turning: Flags,
    count: int,
    measure: Measure | None = None,
) -> list[list[int]]:
    """Return up to `count` chains: the cheapest one, then the cheapest unlike the others.

    Each is the cheapest chain through some vertex of a few waypoints spread over the motion. Mirror
    images, whose joints move by the same amounts (a wrist turned over), come only where there are
    too few others.
    """
    backwards = largest_step if largest_step.ndim == 1 else largest_step[::-1]
    back = None if measure is None else measure.reversed()
    reverse = best_chains(layers[::-1], backwards, turning, back)
    stations = stations_of(len(layers))
    through = [
        (float(forward.cost[i][k] + reverse.cost[-1 - i][k]), i, k)
        for i in stations
        for k in range(len(layers[i]))
    ]
    chosen: list[list[int]] = []
    mirrored: list[list[int]] = []
    taken: list[Array] = []
    # A chain through a vertex near a chosen one is rarely different, and another vertex finds it.
    covered = {i: np.zeros(len(layers[i]), dtype=bool) for i in stations}
    for total, i, vertex in sorted(through):
        if not np.isfinite(total) or len(chosen) == count:
            break
        if covered[i][vertex]:
            continue
        chain = forward.back(i, vertex) + reverse.back(len(layers) - 1 - i, vertex)[-2::-1]
        q = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
        if all(unlike(q, other, turning) for other in taken):
            images = any(_mirrors(q, other, turning) for other in taken)
            (mirrored if images else chosen).append(chain)
            taken.append(q)
            for station, near in covered.items():
                near |= _distance(layers[station], q[station], turning) <= UNLIKE
    return (chosen + mirrored)[:count]


def connected(layers: list[Array], chain: list[int], turning: Flags) -> Array:
    """Return a chain's configurations (W, n); joints that turn without end do not jump."""
    q = np.array([layer[k] for layer, k in zip(layers, chain, strict=True)])
    steps = unturned(np.diff(q, axis=0), turning)
    return np.where(turning, np.vstack([q[:1], q[0] + np.cumsum(steps, axis=0)]), q)


def ranked(
    times: Array, motions: list[Array], turning: Flags, weights: Array, measure: Measure
) -> list[Sequence]:
    """Return the sequences, the best first, without those that became like a better one."""
    length = JointTravel(weights)
    sequences = [Sequence(times, q, length.cost_of(q), measure.cost_of(q)) for q in motions]
    selected: list[Sequence] = []
    for sequence in sorted(sequences, key=lambda sequence: sequence.cost):
        if all(unlike(sequence.q, other.q, turning) for other in selected):
            selected.append(sequence)
    return selected


def stations_of(count: int) -> list[int]:
    """Return numbers of a few waypoints of `count`, first and last included, evenly spread."""
    return sorted({round(k) for k in np.linspace(0, count - 1, _STATIONS).tolist()})


def in_order(q: Array) -> Array:
    """Return vertices (K, n) of one waypoint, sorted by the first joint."""
    return np.ascontiguousarray(q[np.argsort(q[:, 0], kind="stable")])


def unlike(q: Array, other: Array, turning: Flags) -> bool:
    """Whether two motions (W, n) differ by much for long."""
    return bool(np.mean(_distance(q, other, turning) > UNLIKE) >= _UNLIKE_FOR)


def _mirrors(q: Array, other: Array, turning: Flags) -> bool:
    """Whether each joint has moved by about as much in both motions, at all times."""
    moved, also = (
        np.cumsum(np.abs(unturned(np.diff(motion, axis=0), turning)), axis=0)
        for motion in (q, other)
    )
    return bool(np.abs(moved - also).max() < UNLIKE)


def _distance(q: Array, other: Array, turning: Flags) -> Array:
    """Return the largest difference of any joint, (…,)."""
    return np.asarray(np.abs(unturned(q - other, turning)).max(axis=-1))


def why_blocked(
    motion: SelfMotion,
    target: Array,
    curves: CurveSet,
    alive: Array,
    vertices: Array,
    bounds: SearchBounds,
    largest_step: Array,
) -> str:
    """Return why no chain reaches a waypoint.

    Parameters
    ----------
    motion : SelfMotion
    target : (12,)
        The tool at the waypoint.
    curves : CurveSet
        All configurations there.
    alive : (A, n)
        Vertices of the waypoint before that chains reach; empty at the first waypoint.
    vertices : (N, n)
        Vertices at the waypoint.
    bounds : SearchBounds
    largest_step : (n,)
    """
    if not curves.curves:
        return f"no configuration puts '{motion.robot.tool}' on the path there"
    if len(vertices) == 0:
        samples = np.vstack([curve.q for curve in curves.curves])
        return f"of all configurations there, {_refusals(samples, bounds, motion)}"
    continued, arrived = motion.project_all(alive, target)
    ending = continued[arrived]
    ending = ending[~bounds.is_admissible_modulo_turns(ending)]
    step = _step(alive, vertices, bounds, largest_step, motion)
    if not len(ending):
        return step
    # The one that ends is the cause; the others are out of reach in consequence.
    return (
        f"of the configurations that continue what was reached before, "
        f"{_refusals(ending, bounds, motion)}; to the others there is {step}"
    )


def _refusals(samples: Array, bounds: SearchBounds, motion: SelfMotion) -> str:
    """Return in words what excludes configurations: the joint or pair nearest to being allowed."""
    excess = bounds.excess(samples)
    outside = excess.max(axis=1) > 0.0
    parts = []
    if np.any(outside):
        least = excess[outside][np.argmin(excess[outside].sum(axis=1))]
        k = int(np.argmax(least))
        parts.append(
            f"{int(outside.sum())} of {len(samples)} are outside the joint limits, the nearest "
            f"by {_amount(motion, k, least[k])} in {motion.coordinates.label(k)}"
        )
    inside = samples[~outside]
    if len(inside) and bounds.bodies:
        configurations = bounds.representative(inside)
        distance, best = min(
            ((required, _roomiest(model, configurations)) for model, required in bounds.bodies),
            key=lambda found: found[1].value - found[0],
        )
        parts.append(
            f"{len(inside)} of {len(samples)} are in collision or nearer than "
            f"{1e3 * distance:.3g} mm, at best '{best.first}' and '{best.second}' with "
            f"{1e3 * best.value:.3g} mm"
        )
    return "; ".join(parts)


def _roomiest(model: CollisionModel, configurations: Array) -> Closest:
    """Return the closest pair of the configuration (of K, n) with the largest distance."""
    own = configurations[:, : model.robot.dof]
    return max((model.distance(q) for q in own), key=lambda closest: closest.value)


def _step(
    alive: Array, vertices: Array, bounds: SearchBounds, largest_step: Array, motion: SelfMotion
) -> str:
    """Name the joint whose step limit keeps the nearest vertex away."""
    steps = np.abs(unturned(vertices[None] - alive[:, None], bounds.is_unbounded))
    ratios = (steps / largest_step).max(axis=-1)
    a, b = np.unravel_index(int(np.argmin(ratios)), ratios.shape)
    k = int(np.argmax(steps[a, b] / largest_step))
    moved, allowed = (_amount(motion, k, each) for each in (steps[a, b, k], largest_step[k]))
    return (
        f"the step limit: {motion.coordinates.label(k)} would have to move by {moved} in one step, "
        f"allowed are {allowed}"
    )


def _amount(motion: SelfMotion, k: int, change: float) -> str:
    """Return in words the motion of a joint for a change of its coordinate."""
    own = motion.coordinates
    far = change * own.sizes[k]
    return f"{far:.3g} {own.unit(k)}"
