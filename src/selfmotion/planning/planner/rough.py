"""Rough motions on few nodes: what two have in common, and how they are ranked."""

from collections.abc import Callable, Sequence

import numpy as np

from selfmotion.basics import Array, Ints
from selfmotion.model.follow import Coordinates
from selfmotion.planning.formulation import BoundConditions, Formulation, keeps_off_itself
from selfmotion.planning.nodes import Batch, NodeGrid, NodeMotion, minimise
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import NOTHING, UNKEPT, rough_grid

# Newton iterations of rough motions.
ROUGH_ROUNDS = 30
# Relative difference of the costs of mirror images; also rounding of limits, as a share of a turn.
_SAME_TO_DIGITS = 1e-9
# Distance of rough optima that are the same.
SAME_OPTIMUM = 0.1
# A whole turn [rad].
_TURN = 2.0 * np.pi


def far_from_usual(coordinates: Coordinates, motions: Array) -> Array:
    """Return the mean distances of motions (K, N, n) from the usual posture, (K,) [rad]."""
    away = np.abs(motions - coordinates.usual()) @ coordinates.weights
    return np.asarray(away.mean(axis=1))


def wound_back(coordinates: Coordinates, motion: Array) -> Array:
    """Return a motion (N, n) with joints turned by whole turns, as near to usual as limits allow.

    The tool's motion is the same. Joints outside of their limits at any turn are put in the middle.
    """
    lowest, highest = motion.min(axis=0), motion.max(axis=0)
    middle, shift = 0.5 * (lowest + highest), np.zeros(coordinates.dof)
    usual = coordinates.usual()
    for joint in np.flatnonzero(coordinates.is_revolute):
        lower, upper = coordinates.lower[joint], coordinates.upper[joint]
        wanted = round((usual[joint] - middle[joint]) / _TURN)
        # Rounding must not take a joint that stands on its limit round to the other side.
        least = np.ceil((lower - lowest[joint]) / _TURN - _SAME_TO_DIGITS)
        most = np.floor((upper - highest[joint]) / _TURN + _SAME_TO_DIGITS)
        if least <= most:
            shift[joint] = np.clip(wanted, least, most)
        elif np.isfinite(lower) and np.isfinite(upper):
            shift[joint] = round((0.5 * (lower + upper) - middle[joint]) / _TURN)
    return np.asarray(motion + _TURN * shift)


Distance = Callable[[Array, Array], Array]
"""How far a motion (N, n) is from each of others (K, N, n), (K,) [rad or m]."""


class RoughMotions:
    """Rough motions of one formulation, all on the same few nodes.

    Parameters
    ----------
    formulation : Formulation
    effort : Effort

    Attributes
    ----------
    t : (N + 1,)
        Times of the nodes [s].
    free : bool
        Whether the start is free.
    coordinates : Coordinates
        With the required limits: whole turns depend on these, not on the arm's own.
    apart : callable
        Distance of motions.
    """

    def __init__(self, formulation: Formulation, effort: Effort) -> None:
        self._formulation, self._effort = formulation, effort
        self.free = formulation.given_start is None
        allowed = formulation.envelope
        self.coordinates = formulation.coordinates.within(allowed.lower, allowed.upper)
        self.apart = distance_of(formulation.coordinates)
        self.t = rough_grid(formulation).nodes

    def roughly(self, started: NodeMotion) -> NodeMotion:
        """Return the rough optimum near a motion, or that itself where it keeps more."""
        found = minimise(started, lambda _: False, roughly=True, max_iterations=ROUGH_ROUNDS).motion
        return min(found, started, key=self.rank)

    def grid(self, formulation: Formulation) -> NodeGrid:
        """Return the nodes of rough motions, without conditions."""
        counts = self._effort.counts
        none = BoundConditions()
        return NodeGrid(formulation, self.t, none, free=self.free, counts=counts, smoothed=True)

    def different(self, motions: Sequence[NodeMotion]) -> list[NodeMotion]:
        """Return motions without those that are near one before them."""
        q = np.array([motion.place.q for motion in motions])
        alone, _ = unlike(q, np.arange(len(q)), self.apart, SAME_OPTIMUM)
        return [motions[k] for k in alone]

    def rank(self, motion: NodeMotion) -> tuple[bool, float]:
        """Return the sort key of motions, the best first: violations have a penalty."""
        cost = motion.cost
        return not self.is_clear(motion), cost + UNKEPT * abs(cost) * motion.violation

    def motion(self, found: Batch, k: int) -> NodeMotion | None:
        """Return one of the motions, with its constraints.

        Its joints are turned by whole turns towards the usual posture. Without limits they may have
        gone far beyond them, and the tool's motion is the same.
        """
        q = found.q[k]
        motion = self.near(wound_back(self.coordinates, q), found.qd[k], found.qdd[k])
        # Costs may depend on whole turns.
        if motion is not None and motion.cost <= (1.0 + _SAME_TO_DIGITS) * found.costs[k]:
            return motion
        return self.near(self._turned_inside(q), found.qd[k], found.qdd[k])

    def expected(self, found: Batch) -> Ints:
        """Return the numbers of motions, the cheapest first; of about as cheap ones the usual."""
        order = cheapest(found)
        if not order.size:
            return order
        own, costs = self.coordinates, found.costs[order]
        # Each motion belongs to the cheapest one of about the same cost.
        group, first = np.zeros(len(order), dtype=np.int64), 0
        for k in range(1, len(order)):
            if costs[k] - costs[first] > NOTHING * abs(costs[first]):
                first = k
            group[k] = first
        far = far_from_usual(own, np.array([wound_back(own, found.q[k]) for k in order]))
        return np.asarray(order[np.lexsort((far, group))])

    def _turned_inside(self, q: Array) -> Array:
        """Return a motion (N + 1, n) with joints beyond their limits turned back by whole turns."""
        own = self.coordinates
        beyond = ((q > own.upper) | (q < own.lower)).any(axis=0)
        return np.where(beyond, wound_back(own, q), q)

    def near(
        self, q: Array, qd: Array | None = None, qdd: Array | None = None
    ) -> NodeMotion | None:
        """Return the motion nearest to one, with the conditions; by default without self-motion."""
        formulation, minimum_norm = self._formulation, np.zeros_like(q)
        bound = formulation.conditions(q[0], q[-1], apart=self._effort.apart)
        counts = self._effort.counts
        grid = NodeGrid(formulation, self.t, bound, free=self.free, counts=counts, smoothed=True)
        return grid.near(
            q, minimum_norm if qd is None else qd, minimum_norm if qdd is None else qdd
        )

    def is_clear(self, motion: NodeMotion) -> bool:
        """Return whether a motion keeps the arm off itself."""
        return keeps_off_itself(self._formulation, motion.place.q)


def cheapest(found: Batch) -> Ints:
    """Return the numbers of motions, the cheapest first, without those of infinite cost."""
    order = np.argsort(found.costs, kind="stable")
    return np.asarray(order[np.isfinite(found.costs[order])])


def same(a: float, b: float | None) -> bool:
    """Return whether two costs are equal to the last digits."""
    return b is not None and abs(a - b) <= _SAME_TO_DIGITS * abs(a)


def distance_of(coordinates: Coordinates) -> Distance:
    """Return the largest distance of motions, modulo whole turns, as a function."""
    turning, sizes = coordinates.is_revolute, coordinates.sizes

    def apart(motion: Array, others: Array) -> Array:
        difference = others - motion
        turns = np.round(difference / (2.0 * np.pi))
        away = sizes * np.abs(difference - 2.0 * np.pi * turns * turning)
        return np.asarray(away.max(axis=(1, 2)))

    return apart


def unlike(
    motions: Array, order: Ints, apart: Distance, least: float
) -> tuple[list[int], list[int]]:
    """Return those of motions (K, N, n) that are not near one earlier in an order, and the others.

    Numbers of motions, in that order; farther apart than `least` is not near.
    """
    alone: list[int] = []
    near: list[int] = []
    for k in order.tolist():
        is_alone = bool((apart(motions[k], motions[alone]) > least).all())
        (alone if is_alone else near).append(k)
    return alone, near
