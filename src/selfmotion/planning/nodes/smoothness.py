"""What keeps a motion of nodes smooth where its costs do not ask for it."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.planning.nodes.spline import Quintic
from selfmotion.problem.costs import JointVelocity, Samples
from selfmotion.problem.problem import Problem

# An arm that rests takes about this share of the duration to start and to stop its self-motion;
# that is asked for over so many times as long.
_STARTING, _NEAR_REST = 0.02, 4.0
# Costs of joint speed say nothing of accelerations: on few nodes these waver, and under limits of
# theirs they jump from one to the other where that costs nothing. This share of the duration takes
# most of both away, and costs some 1e-5 of F at most.
_EVERYWHERE = 0.004
# It is asked for where it is less than this share of F: what accelerates more does so for a reason,
# beside a singular pose.
_LITTLE = 0.02
# What starting and stopping adds is about what it costs: where that is more than the second share
# of F, they are made quicker until it is the first, but no more than so many times.
_STARTS_COST, _TOO_MUCH, _QUICKEST = 1e-3, 2e-3, 1e-3


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What keeps a motion from starting and stopping at once: ½ ∫ Σ_o b_o(t) xᵀWx dt.

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
    problem: Problem, spline: Quintic, *, calm: bool, quick: float = 1.0
) -> Smoothing | None:
    """Return what makes the self-motion start and stop as the arm does where it rests.

    And joints that are held for a while; and everywhere a little where the motion is to be `calm`.
    It starts and stops in the share `quick` of the usual time. None where there is nothing of that,
    or the costs ask for smoothness themselves.
    """
    if _is_smooth(problem):
        return None
    t = spline.sampling.t.reshape(spline.count, -1)
    shares, of_jerks = _of_held(problem, t)
    shares = np.maximum(shares, _of_rest(problem, t, quick))
    if calm:
        # No more than where it starts: there it would make that as slow.
        little = min(_EVERYWHERE, quick * _STARTING) * problem.path.duration
        shares = np.maximum(shares, little**2)
    if not shares.any():
        return None
    each = {order: b for order, b in ((2, shares), (3, of_jerks)) if b.any()}
    return Smoothing(each, np.diag(_weights(problem)))


def rest_times(problem: Problem) -> Array:
    """Return the ends at which the arm rests, (k,) [s]."""
    both = zip(problem.rests, (0.0, problem.path.duration), strict=True)
    return np.array([end for rest, end in both if rest])


def quickness(problem: Problem, samples: Samples, cost: float, quick: float) -> float:
    """Return in what share of the usual time a motion of such a cost should start and stop.

    Where it does so in the share `quick` now: that, unless it costs too much.
    """
    if _is_smooth(problem):
        return quick
    shares = _of_rest(problem, samples.sampling.t, quick)
    squares = shares * (samples.qdd**2 @ _weights(problem))
    added = 0.5 * float(np.sum(samples.weights * squares))
    if added <= _TOO_MUCH * abs(cost):
        return quick
    return max(quick * _STARTS_COST * abs(cost) / added, _QUICKEST)


def _is_smooth(problem: Problem) -> bool:
    """Whether the costs ask for smoothness themselves."""
    orders = [order for cost in problem.all_costs for order in cost.curvature(problem.robot.dof)]
    return max(orders, default=0) > 1


def _of_rest(problem: Problem, t: Array, quick: float) -> Array:
    """Return b of q̈ at times, of the shape of t, that starting and stopping has."""
    starting = quick * _STARTING * problem.path.duration
    found = np.zeros_like(t)
    for end in rest_times(problem):
        found = np.maximum(found, starting**2 * _faded(t - end, starting))
    return found


def _of_held(problem: Problem, t: Array) -> tuple[Array, Array]:
    """Return b of q̈ and of the jerk at times where joints begin or end to be held.

    They do so without jumps of accelerations, as what rests does.
    """
    starting = _STARTING * problem.path.duration
    faded = np.zeros_like(t)
    for edge in problem.follows.edges:
        faded = np.maximum(faded, _faded(t - edge, starting))
    return starting**2 * faded, starting**4 * faded


def _faded(away: Array, starting: float) -> Array:
    """Return 1, fading out: where b ended at once, accelerations would jump."""
    return np.asarray(np.maximum(1.0 - (away / (_NEAR_REST * starting)) ** 2, 0.0) ** 3)


def would_be_calm(problem: Problem, samples: Samples, cost: float) -> bool:
    """Return whether a motion of such a cost may be asked to be calm, see `smoothing_of`."""
    squares = samples.qdd**2 @ _weights(problem)
    share = (_EVERYWHERE * problem.path.duration) ** 2
    return bool(0.5 * share * float(samples.weights @ squares) <= _LITTLE * abs(cost))


def _weights(problem: Problem) -> Array:
    """Return what the squares of rates weigh, (n,): of virtual joints nothing, as in costs.

    As much as where speeds cost what they usually do; where they cost so many times more or less,
    so does this: the best motion is the same whatever the unit of its cost.
    """
    arm, dof = problem.asked.robot, problem.robot.dof
    found = np.zeros(dof)
    found[: arm.dof] = np.asarray(JointVelocity.usual(arm).weight)
    own = [cost.curvature(dof).get(1) for cost in problem.all_costs]
    total = sum(float(np.trace(each)) for each in own if each is not None)
    return found * (total / float(found.sum())) if total > 0.0 else found
