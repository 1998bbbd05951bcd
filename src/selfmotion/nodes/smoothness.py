"""What keeps a motion of nodes smooth: at its ends where the arm rests, and at its nodes."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array
from selfmotion.costs import JointVelocity
from selfmotion.nodes.hermite import HermiteSamples
from selfmotion.nodes.spline import Hermite, weighted
from selfmotion.problem import Problem

# An arm that rests takes about this share of the duration to start and to stop its self-motion;
# that is asked for over so many times as long.
_STARTING, _NEAR_REST = 0.02, 4.0
# w is this many times the cube of an interval's length: so strong that little is left of jumps,
# and so weak that Newton's method takes no more steps.
_STRENGTH = 10.0


@dataclass(frozen=True, eq=False)
class Smoothing:
    """What keeps a motion from starting and stopping at once: ½ ∫ b(t) q̈ᵀWq̈ dt.

    Attributes
    ----------
    shares : (N, 4)
        b at the samples [s²].
    weight : (n, n)
        W.
    """

    shares: Array
    weight: Array


def smoothing_at_rest(problem: Problem, spline: Hermite) -> Smoothing | None:
    """Return what makes the self-motion start and stop as the arm does where it rests.

    And what makes joints do so that are held for a while.
    """
    orders = [order for cost in problem.all_costs for order in cost.curvature(problem.robot.dof)]
    edges = problem.follows.edges
    if not (any(problem.rests) or len(edges)) or max(orders, default=0) > 1:
        return None
    duration, t = problem.path.duration, spline.sampling.t[:-1].reshape(-1, 4)
    starting = _STARTING * duration
    ends = [end for rest, end in zip(problem.rests, (0.0, duration), strict=True) if rest]
    shares = np.zeros_like(t)
    for end in (*ends, *edges):
        # Fading out: where it ended at once, velocities would jump.
        far = np.abs(t - end) / (_NEAR_REST * starting)
        shares = np.maximum(shares, np.maximum(1.0 - far**2, 0.0) ** 3)
    return Smoothing(starting**2 * shares, np.diag(_weights(problem)))


def _weights(problem: Problem) -> Array:
    """Return what the squares of rates weigh, (n,): of virtual joints nothing, as in costs."""
    arm, found = problem.asked.robot, np.zeros(problem.robot.dof)
    found[: arm.dof] = np.asarray(JointVelocity.usual(arm).weight)
    return found


class Continuity:
    """The jumps of q̈ at the nodes, weighed so that half their squares add up to what they cost.

    A cubic Hermite spline's q̈ may jump at its nodes. Where limits of acceleration bind, the best
    motion makes use of that, and an arm's, whose q̈ cannot jump, goes beyond the limits there:
    ½ Σ w_k jump_kᵀ W jump_k keeps it from that. So it does where joints begin and end to be held.

    Parameters
    ----------
    problem : Problem
        At its knots accelerations may jump; where its arm rests, they begin and end at 0.
    spline : Hermite
    everywhere : bool
        Whether at all nodes, or only where joints begin and end to be held.
    """

    def __init__(self, problem: Problem, spline: Hermite, *, everywhere: bool) -> None:
        self._spline = spline
        weights = np.zeros(len(spline.t))
        if everywhere:
            shorter = np.minimum(spline.steps[1:], spline.steps[:-1])
            weights[1:-1] = _STRENGTH * shorter**3
            weights[np.isin(spline.t, problem.knots)] = 0.0
            for node, order in zip((0, -1), problem.rest_orders, strict=True):
                if order > 1:
                    weights[node] = _STRENGTH * spline.steps[node] ** 3
        for edge in problem.follows.edges:
            node = int(np.argmin(np.abs(spline.t - edge)))
            weights[node] = _STRENGTH * (_STARTING * problem.path.duration) ** 3
        root = np.diag(np.sqrt(_weights(problem)))
        self._scales = np.sqrt(weights)[:, None, None] * root

    def jumps(self, samples: HermiteSamples) -> Array:
        """Return the weighed jumps, (N + 1, n)."""
        before, after = self._spline.accelerations(samples.ends)
        before[0] = after[-1] = 0.0
        return np.asarray((self._scales @ (before - after)[:, :, None])[:, :, 0])

    def slopes(self, samples: HermiteSamples) -> Array:
        """Return the derivatives of half their squares by q, q̇ of intervals' ends, (N, 4, n)."""
        by = (np.swapaxes(self._scales, 1, 2) @ self.jumps(samples)[:, :, None])[:, None, :, 0]
        before, after = self._spline.at_ends(2)
        return np.asarray(before[:, :, None] * by[1:] - after[:, :, None] * by[:-1])

    def tangents(self, changes: Array) -> Array:
        """Return their derivatives by w of each node's neighbours and its own, (N + 1, n, 6r).

        `changes` (N + 1, 2, n, 2r) is ∂(q, q̇)/∂w of the nodes.
        """
        count, _, n, size = changes.shape
        near = np.zeros((count, n, 3 * size))
        before, after = self._spline.at_ends(2)
        near[1:, :, :size] = weighted(before[:, :2], changes[:-1])
        near[1:, :, size : 2 * size] = weighted(before[:, 2:], changes[1:])
        near[:-1, :, size : 2 * size] -= weighted(after[:, :2], changes[:-1])
        near[:-1, :, 2 * size :] = weighted(-after[:, 2:], changes[1:])
        return np.asarray(self._scales @ near)
