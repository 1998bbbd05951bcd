"""Motions worth starting from, found by the global search over self-motions."""

import itertools
from collections import abc

import numpy as np

from selfmotion.basics import Array, Progress
from selfmotion.model.follow import has_windows
from selfmotion.model.path import Path, spread_along
from selfmotion.model.task import log3
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.chains import Sequence
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import JointTravel, measure_of
from selfmotion.planning.search.sampled import sampled_layers
from selfmotion.planning.search.search_bounds import SearchBounds
from selfmotion.planning.search.sequences import Layers, best_sequences, curve_layers
from selfmotion.planning.search.shortest import Shortest
from selfmotion.problem.costs import PathLength

# Number of refined sequences: the best among the samples is not always that of the best motion.
_REFINED = 3
# Translation of the tool between two times of the search [m], whatever the path's own waypoints:
# more times take longer, and chains are smoothed anyway.
_STRIDE = 0.02
# The same of its rotation [rad].
_TURN = 0.1
# Smallest number of times with self-motion curves, which resolve more than samples of larger
# spaces.
_MIN_TIMES_ON_CURVES = 150
# The same without: fewer would miss obstacles.
_MIN_TIMES = 60
# Largest number of times.
_MAX_TIMES = 400
# Samples of the path for the length of the tool's motion.
_PATH_SAMPLES = 2000
# Clearance of sequences in addition to the required one [m]: they are checked at waypoints only.
_MARGIN = 2.5e-4
# The best chain is made a motion at the smallest δ with this distance from limits [rad or m]:
# between waypoints it bulges.
_CHAIN_EDGE = 5e-4
# Share of the largest speeds there.
_CHAIN_SPEED = 0.95
# Shift of a time at which a vertex does not converge, towards the next one; not 0.5, since a halved
# grid could then have equal times.
BESIDE = 0.3
# δ of the last stages, as multiples of the chain's mean step.
LAST_SMOOTHINGS = (3.0, 1.0, 0.3, 0.1, 0.03)


def guides(
    formulation: Formulation, rng: np.random.Generator | int, progress: Progress
) -> list[Sequence]:
    """Return guides from the best sequences over the self-motions, by the problem's own costs.

    Raises
    ------
    NoSequenceError
        No chain of configurations follows the path; says where it ends and why.
    """
    weights = _weights(formulation)
    layers = layers_of(formulation, weights, rng, progress)
    measure = measure_of(formulation, layers.t, weights)
    return best_sequences(layers, _REFINED, measure, progress)


def layers_of(
    formulation: Formulation, weights: Array, rng: np.random.Generator | int, progress: Progress
) -> Layers:
    """Return the vertices of a formulation: samples of all self-motions, free and within limits.

    Parameters
    ----------
    formulation : Formulation
    weights : (n,)
        Weight of a unit of each joint.
    rng : Generator or int
    progress : Progress
    """
    allowed, t = formulation.envelope, waypoint_times(formulation)
    steps = np.minimum(allowed.speed * np.diff(t)[:, None], np.pi)
    bodies = tuple((model, distance + _MARGIN) for model, distance in allowed.bodies)
    limits = allowed.lower, allowed.upper
    if has_curves(formulation):
        return curve_layers(formulation.follows, t, steps, limits, bodies, rng, progress)
    waypoints = OnPath(formulation.follows, t, *limits)
    return sampled_layers(waypoints, t, steps, limits, bodies, weights, rng, progress)


def shortest_along(
    formulation: Formulation, t: Array, q: Array, where: Array, smoothings: abc.Sequence[float]
) -> tuple[Array, Array] | None:
    """Return the shortest configurations near those q (W, n) at t, at times `where`, (K,), (K, n).

    In stages with these δ, see `Shortest.near`. Where nothing near comes onto the path, it is tried
    a little later instead: at a singular pose rounding may put it beyond reach, by next to nothing.
    None where that does not help, or one meets something.
    """
    weights, allowed = _weights(formulation), formulation.envelope
    edge = np.minimum(_CHAIN_EDGE, 1e-2 * (allowed.upper - allowed.lower))
    limits = allowed.lower + edge, allowed.upper - edge
    waypoints = OnPath(formulation.follows, where, *limits)
    here, arrived = waypoints.project_each(_between(t, q, where), np.arange(len(where)))
    if not arrived[[0, -1]].all():
        return None
    if not arrived.all():
        where = np.where(arrived, where, where + BESIDE * np.diff(where, append=where[-1]))
        waypoints = OnPath(formulation.follows, where, *limits)
        here, arrived = waypoints.project_each(_between(t, q, where), np.arange(len(where)))
        if not arrived.all():
            return None
    bodies = tuple((model, distance + _MARGIN) for model, distance in allowed.bodies)
    bounds = SearchBounds(*limits, formulation.coordinates.is_revolute, bodies)
    largest = np.minimum(_CHAIN_SPEED * allowed.speed * np.diff(where)[:, None], np.pi)
    here = Shortest(waypoints, bounds, largest, weights).near(here, smoothings)
    return (where, here) if bounds.is_admissible(here).all() else None


def _between(t: Array, q: Array, where: Array) -> Array:
    """Return the linear interpolation of configurations q (W, n) at t, at times `where`, (K, n)."""
    return np.column_stack([np.interp(where, t, joint) for joint in q.T])


def asks_length(formulation: Formulation) -> bool:
    """Whether sequences are chosen by their length."""
    t, weights = np.array([0.0, formulation.path.duration]), _weights(formulation)
    return isinstance(measure_of(formulation, t, weights), JointTravel)


def has_curves(formulation: Formulation) -> bool:
    """Whether the self-motions of a problem are curves, at all times."""
    return formulation.follows.redundancy == 1 and not has_windows(formulation.follows)


def waypoint_times(formulation: Formulation) -> Array:
    """Return times (W,) [s] at which to search for a problem's configurations."""
    fewest = _MIN_TIMES_ON_CURVES if has_curves(formulation) else _MIN_TIMES
    return search_times(formulation.path, fewest)


def search_times(path: Path, fewest: int) -> Array:
    """Return times (W,) [s] at which to search for configurations, as the tool moves on."""
    t = spread_along(path, _PATH_SAMPLES)
    tool = path.samples(t)
    moved = np.linalg.norm(np.diff(tool.translation, axis=0), axis=1) / _STRIDE
    turned = np.array([np.linalg.norm(log3(a.T @ b)) for a, b in itertools.pairwise(tool.rotation)])
    travel = np.concatenate([[0.0], np.cumsum(moved + turned / _TURN)])
    # Time counts as well, so that times increase where the tool rests.
    count = int(np.clip(np.ceil(travel[-1]), fewest, _MAX_TIMES))
    travel += t * (1e-3 * count / path.duration)
    times = np.interp(np.linspace(0.0, travel[-1], count + 1), travel, t)
    times[-1] = path.duration
    return np.asarray(times)


def _weights(formulation: Formulation) -> Array:
    """Return the weight of each joint's unit, (n,): that of the path's length, if it is a cost."""
    virtual = formulation.coordinates.weights[formulation.robot.dof :]
    for cost in formulation.costs:
        if isinstance(cost, PathLength) and cost.joint_weights is not None:
            return np.append(np.asarray(cost.joint_weights, dtype=np.float64), virtual)
    return formulation.coordinates.weights
