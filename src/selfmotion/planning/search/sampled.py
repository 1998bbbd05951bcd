"""The search for two and more degrees of redundancy: samples of smooth motions as vertices."""

import numpy as np

from selfmotion.basics import Array, Ints, Progress, kernel
from selfmotion.model.collision import CollisionModel
from selfmotion.planning.search.chains import in_order, stations_of
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import JointTravel
from selfmotion.planning.search.pushing import Pushing
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.sequences import Layers
from selfmotion.planning.search.starts import spread

# Initial configurations of motions at each station …
_STARTS = 45
# … of the solutions of inverse kinematics from this number of seeds.
_START_SEEDS = 200
# Standard deviation of the drift of constant null motions over the whole path [rad or m]; every
# other motion has none.
_DRIFT = 1.0
# Reached samples that are followed to the next waypoint …
_PARENTS = 80
# … chosen by these distances from each other, the largest first [rad or m].
_PARENT_DISTANCES = (1.6, 0.8, 0.4, 0.2, 0.1)
# Random tries around each of them …
_TRIES = 2
# … with this standard deviation [rad].
_SPREAD = 0.15


def sampled_layers(
    waypoints: OnPath,
    t: Array,
    steps: Array,
    limits: tuple[Array, Array],
    bodies: tuple[tuple[CollisionModel, float], ...],
    weights: Array,
    rng: np.random.Generator | int,
    progress: Progress,
) -> Layers:
    """Return samples of smooth motions of a task that leaves any redundancy.

    Self-motions of two and more dimensions are too large to be sampled evenly at every waypoint.
    The vertices are those of many smooth motions instead, which start all over the self-motions of
    some waypoints and follow the path in both directions, with different constant null motions:
    chains change between them where that is cheaper, or where one ends or collides.

    Parameters
    ----------
    waypoints : OnPath
    t : (W,)
        Their times [s].
    steps : (W - 1, n)
        Largest change of each joint from one waypoint to the next [rad or m].
    limits : (n,), (n,)
        Joint limits [rad or m].
    bodies : tuple of (CollisionModel, float)
        Bodies with a minimum distance at the waypoints [m].
    weights : (n,)
        Of the joints in a chain's length.
    rng : Generator or int
    progress : Progress
    """
    bounds = SearchBounds(*limits, waypoints.coordinates.is_revolute, bodies)
    generator = np.random.default_rng(rng)
    samples = _layers(waypoints, bounds, steps, weights, generator, progress)

    def why(i: int, alive: Array, layer: Array, selected: SearchBounds) -> str:
        if not len(samples[i]):
            return (
                "no sample there is within the limits and free; what may help: a smaller "
                "clearance, wider limits, or what is in the way or the path elsewhere"
            )
        return (
            f"none of {len(samples[i])} samples that are within the limits and free can be "
            f"reached from those before within the step limits"
        )

    return Layers(waypoints, t, steps, bounds, samples, why)


def _layers(
    waypoints: OnPath,
    bounds: SearchBounds,
    largest_step: Array,
    weights: Array,
    rng: np.random.Generator,
    progress: Progress,
) -> list[Array]:
    """Return free samples at all waypoints, each (K, n), sorted by the first joint.

    Vertices of smooth motions; continuations of reached samples without self-motion; and samples
    near these: so there is a detour where smooth motions end.
    """
    smooth = _smooth_motions(waypoints, bounds, rng, progress)
    turning, pushing = bounds.is_unbounded, Pushing(waypoints.follows, bounds)

    def free(q: Array, i: int) -> Array:
        selected = q[bounds.is_admissible(q)]
        # Where bodies leave little room, samples miss it; no chain passes one without any.
        if not len(selected) and all(map(len, layers)):
            selected = pushing.free(q, lambda x: waypoints.project(x, i), waypoints.held(i))
        return in_order(selected)

    layers = list[Array]()
    layers.append(free(smooth[0], 0))
    cost = np.empty(0)
    for i in range(1, waypoints.count):
        progress("search: sampling waypoint", i + 1, waypoints.count)
        before = layers[-1]
        cost = np.zeros(len(before)) if i == 1 else cost
        parents = _spread_out(before[np.isfinite(cost)], cost[np.isfinite(cost)], _PARENTS)
        strays = np.repeat(parents, _TRIES, axis=0)
        away = rng.normal(scale=_SPREAD, size=strays.shape) / weights
        step = 0.5 * largest_step[i - 1]
        guesses = np.concatenate([parents, strays + np.clip(away, -step, step)])
        q, arrived = waypoints.project(guesses, i)
        q = np.concatenate([q[arrived], smooth[i]])
        layers.append(free(q, i))
        cost, _ = JointTravel(weights).relaxed_layer(
            i - 1, before, cost, layers[-1], largest_step[i - 1], turning
        )
        if not np.any(np.isfinite(cost)):
            # Later layers are for chains that start here.
            cost = np.zeros(len(cost))
    return layers


def _smooth_motions(
    waypoints: OnPath, bounds: SearchBounds, rng: np.random.Generator, progress: Progress
) -> list[Array]:
    """Return at all waypoints where motions with constant null motions are, each (K, n)."""
    dof, last = waypoints.coordinates.dof, waypoints.count - 1
    vertices = [[np.empty((0, dof))] for _ in range(waypoints.count)]
    stations = stations_of(waypoints.count)
    for number, station in enumerate(stations, 1):
        progress("search: motions from waypoint", number, len(stations))
        started = _starts(waypoints, bounds, station, rng)
        drift = rng.normal(scale=_DRIFT / max(last, 1), size=started.shape)
        drift[::2] = 0.0
        vertices[station].append(started)
        for direction in (1, -1):
            q, slope = started, direction * drift
            end = waypoints.count if direction > 0 else -1
            for i in range(station + direction, end, direction):
                q, arrived = waypoints.project(q + slope, i)
                q, slope = q[arrived], slope[arrived]
                vertices[i].append(q)
    return [np.concatenate(parts) for parts in vertices]


def _spread_out(q: Array, cost: Array, count: int) -> Array:
    """Return up to `count` of q (K, n), far from each other first, the cheaper of near ones."""
    ranked = np.ascontiguousarray(q[np.argsort(cost, kind="stable")])
    return np.asarray(ranked[spread_out(ranked, np.array(_PARENT_DISTANCES), count)])


def _starts(
    waypoints: OnPath, bounds: SearchBounds, station: int, rng: np.random.Generator
) -> Array:
    """Return configurations within the limits, free where there are such, (K, n)."""
    seeds = spread(waypoints.coordinates, _START_SEEDS, rng)
    q, arrived = waypoints.project(seeds, station, far=True)
    q = q[arrived]
    free = bounds.is_admissible(q)
    return np.concatenate([q[free], q[~free]])[:_STARTS]


@kernel
def spread_out(q: Array, distances: Array, most: int) -> Ints:
    """Return the rows of q (K, n) to keep, at most `most`: the earlier ones of near ones.

    First those farther from all kept ones in some coordinate than apart[0], then apart[1], ….
    """
    n, many = q.shape[1], len(q)
    selected, count = np.empty(min(most, many), dtype=np.intp), 0
    taken = np.zeros(many, dtype=np.bool_)
    for distance in distances:
        for k in range(many):
            if taken[k] or count == len(selected):
                continue
            alone = True
            for other in range(count):
                far = False
                for i in range(n):
                    if abs(q[k, i] - q[selected[other], i]) > distance:
                        far = True
                        break
                if not far:
                    alone = False
                    break
            if alone:
                taken[k], selected[count] = True, k
                count += 1
    return selected[:count]
