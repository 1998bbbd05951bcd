"""Motions worth starting from, found by the global search over self-motions."""

import numpy as np

from selfmotion.basics import Array, Progress
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.chains import Sequence
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import joint_weights, measure_of
from selfmotion.planning.search.sampled import sampled_layers
from selfmotion.planning.search.search_bounds import with_clearance_margin
from selfmotion.planning.search.search_times import has_curves, waypoint_times
from selfmotion.planning.search.sequences import Layers, best_sequences, curve_layers

# Number of refined sequences: the best among the samples is not always that of the best motion.
_REFINED = 3


def guides(
    formulation: Formulation, rng: np.random.Generator | int, progress: Progress
) -> list[Sequence]:
    """Return guides from the best sequences over the self-motions, by the problem's own costs.

    Raises
    ------
    NoSequenceError
        No chain of configurations follows the path; says where it ends and why.
    """
    weights = joint_weights(formulation)
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
    envelope, t = formulation.envelope, waypoint_times(formulation)
    largest_steps = np.minimum(envelope.speed * np.diff(t)[:, None], np.pi)
    bodies = with_clearance_margin(envelope.bodies)
    limits = envelope.lower, envelope.upper
    if has_curves(formulation):
        return curve_layers(formulation.follows, t, largest_steps, limits, bodies, rng, progress)
    waypoints = OnPath(formulation.follows, t, *limits)
    return sampled_layers(waypoints, t, largest_steps, limits, bodies, weights, rng, progress)
