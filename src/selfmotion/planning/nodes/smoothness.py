"""Penalty on q̈ where the costs have none: the motion of nodes stays smooth."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.follow import window_edges
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.nodes.spline import Quintic
from selfmotion.problem.costs import Samples

# Time in which the self-motion of a resting arm starts and stops, as a share of the duration.
_STARTING = 0.02
# The penalty covers this many times that.
_NEAR_REST = 4.0
# Time constant of the penalty everywhere, as a share of the duration. Costs of joint speed leave
# accelerations free: on few nodes these oscillate, and under limits they jump between them. This
# value removes most of both, and adds at most some 1e-5 of F.
_EVERYWHERE = 0.004
# Largest penalty everywhere, as a share of F: a larger one has a cause, such as a singular pose
# nearby.
_LITTLE = 0.02
# Where starting and stopping adds more than this share of F …
_TOO_MUCH = 2e-3
# … it is made faster until it adds this share …
_STARTS_COST = 1e-3
# … by this factor at most.
_QUICKEST = 1e-3


@dataclass(frozen=True, eq=False)
class Smoothing:
    """Penalty on starting and stopping at once: ½ ∫ Σ_o b_o(t) xᵀWx dt.

    Of x = q̈ (2) and the jerk (3).

    Attributes
    ----------
    shares : dict of (N, 5)
        b_o at the samples, by order [s²], [s⁴].
    weight : (n, n)
        W.
    """

    shares: dict[int, Array]
    weight: Array


def smoothing_of(
    formulation: Formulation, spline: Quintic, *, smoothed: bool, quick: float = 1.0
) -> Smoothing | None:
    """Return the penalty that makes the self-motion start and stop smoothly where the arm rests.

    Also where joints are held for a while; and everywhere a little if `smoothed`. Starting and
    stopping takes the share `quick` of the usual time. None without any of that, or where the costs
    penalise q̈ themselves.
    """
    if _is_smooth(formulation):
        return None
    t = spline.sampling.t.reshape(spline.count, -1)
    shares, of_jerks = _of_held(formulation, t)
    shares = np.maximum(shares, _of_rest(formulation, t, quick))
    if smoothed:
        # No more than at the ends, which it would slow down.
        little = min(_EVERYWHERE, quick * _STARTING) * formulation.path.duration
        shares = np.maximum(shares, little**2)
    if not shares.any():
        return None
    each = {order: b for order, b in ((2, shares), (3, of_jerks)) if b.any()}
    return Smoothing(each, np.diag(formulation.speed_weights))


def rest_times(formulation: Formulation) -> Array:
    """Return the ends at which the arm rests, (k,) [s]."""
    both = zip(formulation.problem.rest_orders, (0.0, formulation.path.duration), strict=True)
    return np.array([end for rest, end in both if rest])


def quickness(formulation: Formulation, samples: Samples, cost: float, quick: float) -> float:
    """Return the share of the usual time in which a motion of this cost should start and stop.

    The present share `quick`, unless its penalty is too large.
    """
    if _is_smooth(formulation) or not any(formulation.problem.rest_orders):
        return quick
    shares = _of_rest(formulation, samples.sampling.t, quick)
    squares = shares * (samples.qdd**2 @ formulation.speed_weights)
    added = 0.5 * float(np.sum(samples.weights * squares))
    if added <= _TOO_MUCH * abs(cost):
        return quick
    return max(quick * _STARTS_COST * abs(cost) / added, _QUICKEST)


def _is_smooth(formulation: Formulation) -> bool:
    """Whether the costs penalise q̈ or the jerk themselves."""
    return highest_order(formulation) > 1


def _of_rest(formulation: Formulation, t: Array, quick: float) -> Array:
    """Return b of q̈ at times, of the shape of t, of starting and stopping."""
    starting = quick * _STARTING * formulation.path.duration
    found = np.zeros_like(t)
    for end in rest_times(formulation):
        found = np.maximum(found, starting**2 * _faded(t - end, starting))
    return found


def _of_held(formulation: Formulation, t: Array) -> tuple[Array, Array]:
    """Return b of q̈ and of the jerk at times where joints start or end to be held.

    Accelerations do not jump there, as at rests.
    """
    starting = _STARTING * formulation.path.duration
    faded = np.zeros_like(t)
    for edge in window_edges(formulation.follows):
        faded = np.maximum(faded, _faded(t - edge, starting))
    return starting**2 * faded, starting**4 * faded


def _faded(away: Array, starting: float) -> Array:
    """Return 1 that fades out: where b ended abruptly, accelerations would jump."""
    return np.asarray(np.maximum(1.0 - (away / (_NEAR_REST * starting)) ** 2, 0.0) ** 3)


def highest_order(formulation: Formulation) -> int:
    """Return the order of the highest derivative of q that costs are quadratic forms of, or 0."""
    dof = formulation.robot.dof
    return max((order for cost in formulation.costs for order in cost.curvature(dof)), default=0)


def can_be_smoothed(formulation: Formulation, samples: Samples, cost: float) -> bool:
    """Return whether q̈ may be penalised everywhere at this cost, see `smoothing_of`."""
    squares = samples.qdd**2 @ formulation.speed_weights
    share = (_EVERYWHERE * formulation.path.duration) ** 2
    return bool(0.5 * share * float(samples.weights @ squares) <= _LITTLE * abs(cost))
