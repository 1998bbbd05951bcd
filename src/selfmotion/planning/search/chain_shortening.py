"""The shortest chain of configurations near another one, at other times of the path."""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.manifold import OnPath
from selfmotion.planning.search.measures import joint_weights
from selfmotion.planning.search.search_bounds import SearchBounds, with_clearance_margin
from selfmotion.planning.search.shortest import Shortest

# Distance from limits of position that a chain keeps [rad or m]: between its configurations the
# motion bulges …
_LIMIT_MARGIN = 5e-4
# … at most as a share of the range.
_LIMIT_MARGIN_SHARE = 1e-2
# Share of the largest speeds that it uses.
_SPEED_SHARE = 0.95
# Shift of a time at which a vertex does not converge, as a share of the way to the next time; not
# 0.5, since a halved grid could then have equal times.
TIME_SHIFT = 0.3
# δ of the last stages of shortening, as multiples of the chain's mean step.
LAST_SMOOTHINGS = (3.0, 1.0, 0.3, 0.1, 0.03)


def shortest_along(
    formulation: Formulation, t: Array, q: Array, new_t: Array, smoothings: Sequence[float]
) -> tuple[Array, Array] | None:
    """Return the shortest configurations near a chain, at new times.

    Where no configuration near the chain is on the path, it is looked for a little later instead:
    at a singular pose rounding may put it beyond reach, by next to nothing.

    Parameters
    ----------
    formulation : Formulation
    t, q : (W,), (W, n)
        Times and configurations of the chain.
    new_t : (K,)
        Times to find configurations at [s].
    smoothings : sequence of float
        δ of the stages; see `Shortest.near`.

    Returns
    -------
    (K,), (K, n), or None
        Times and configurations; None where some are not on the path, or not admissible.
    """
    weights, envelope = joint_weights(formulation), formulation.envelope
    margin = np.minimum(_LIMIT_MARGIN, _LIMIT_MARGIN_SHARE * (envelope.upper - envelope.lower))
    limits = envelope.lower + margin, envelope.upper - margin
    waypoints = OnPath(formulation.follows, new_t, *limits)
    new_q, arrived = _projected(waypoints, t, q, new_t)
    if not arrived[[0, -1]].all():
        return None
    if not arrived.all():
        shifted = new_t + TIME_SHIFT * np.diff(new_t, append=new_t[-1])
        new_t = np.where(arrived, new_t, shifted)
        waypoints = OnPath(formulation.follows, new_t, *limits)
        new_q, arrived = _projected(waypoints, t, q, new_t)
        if not arrived.all():
            return None
    bodies = with_clearance_margin(envelope.bodies)
    bounds = SearchBounds(*limits, formulation.coordinates.is_revolute, bodies)
    largest_step = np.minimum(_SPEED_SHARE * envelope.speed * np.diff(new_t)[:, None], np.pi)
    new_q = Shortest(waypoints, bounds, largest_step, weights).near(new_q, smoothings)
    return (new_t, new_q) if bounds.is_admissible(new_q).all() else None


def _projected(waypoints: OnPath, t: Array, q: Array, new_t: Array) -> tuple[Array, Flags]:
    """Return the projection onto the path of q (W, n) at t, interpolated linearly at new times.

    (K, n), and whether each of them converged, (K,).
    """
    interpolated = np.column_stack([np.interp(new_t, t, joint) for joint in q.T])
    return waypoints.project_each(interpolated, np.arange(len(new_t)))
