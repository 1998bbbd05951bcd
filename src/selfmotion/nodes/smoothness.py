"""What keeps a motion of nodes smooth where its costs do not ask for it."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import JointVelocity, Samples
from selfmotion.nodes.spline import Quintic
from selfmotion.problem import Problem

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


def smoothing_of(problem: Problem, spline: Quintic, *, calm: bool) -> Smoothing | None:
    """Return what makes the self-motion start and stop as the arm does where it rests.

    And joints that are held for a while; and everywhere a little where the motion is to be `calm`.
    None where there is nothing of that, or the costs ask for smoothness themselves.
    """
    orders = [order for cost in problem.all_costs for order in cost.curvature(problem.robot.dof)]
    if max(orders, default=0) > 1:
        return None
    duration, t = problem.path.duration, spline.sampling.t.reshape(spline.count, -1)
    shares = np.full_like(t, (_EVERYWHERE * duration) ** 2 if calm else 0.0)
    of_jerks = np.zeros_like(t)
    starting = _STARTING * duration
    ends = [end for rest, end in zip(problem.rests, (0.0, duration), strict=True) if rest]
    edges = problem.follows.edges
    for end in (*ends, *edges):
        # Fading out: where it ended at once, accelerations would jump.
        far = np.abs(t - end) / (_NEAR_REST * starting)
        faded = np.maximum(1.0 - far**2, 0.0) ** 3
        shares = np.maximum(shares, starting**2 * faded)
        # What is held begins and ends to be so without jumps of accelerations, as rest does.
        if end in edges:
            of_jerks = np.maximum(of_jerks, starting**4 * faded)
    if not shares.any():
        return None
    each = {order: b for order, b in ((2, shares), (3, of_jerks)) if b.any()}
    return Smoothing(each, np.diag(_weights(problem)))


def would_be_calm(problem: Problem, samples: Samples, cost: float) -> bool:
    """Return whether a motion of such a cost may be asked to be calm, see `smoothing_of`."""
    squares = samples.qdd**2 @ _weights(problem)
    share = (_EVERYWHERE * problem.path.duration) ** 2
    return bool(0.5 * share * float(samples.weights @ squares) <= _LITTLE * abs(cost))


def _weights(problem: Problem) -> Array:
    """Return what the squares of rates weigh, (n,): of virtual joints nothing, as in costs."""
    arm, found = problem.asked.robot, np.zeros(problem.robot.dof)
    found[: arm.dof] = np.asarray(JointVelocity.usual(arm).weight)
    return found
