"""Proof that pairs of bodies keep a distance along a motion, by bisection of its time."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.collision import ClearanceModel
from selfmotion.realtime.settings import (
    FAR_MESHES,
    FIRST_CHECKS,
    FIRST_OF_MESHES,
    MAX_CHECKS,
    NEARER,
)


class Undecided(NamedTuple):
    """A place where bounds do not decide whether a pair of bodies keeps its distance.

    Attributes
    ----------
    cycle, pair : int
    distance : float
        Of the pair at that cycle, or at the other end of the interval, the smaller [m].
    """

    cycle: int
    pair: int
    distance: float


def distance_proofs(model: ClearanceModel, min_distance: float) -> Iterator["DistanceProof"]:
    """Yield the proof for pairs of hulls, and for those that are left out there, by their meshes.

    Parameters
    ----------
    model : ClearanceModel
    min_distance : float
        The distance to keep [m].
    """

    def of_hulls(q: Array, selected: Flags) -> Array:
        return model.clearances(q).values

    yield DistanceProof(
        of_hulls, model.pairs, min_distance, model.pair_levers, FIRST_CHECKS, reuses=False
    )
    if not model.left_out:
        return
    meshes, near = model.of_left_out(), min_distance + FAR_MESHES

    def of_meshes(q: Array, selected: Flags) -> Array:
        limits = np.broadcast_to(np.where(selected, near, -np.inf), (len(q), len(selected)))
        return meshes.distances(q, limits, limits)

    yield DistanceProof(
        of_meshes, meshes.pairs, min_distance, meshes.pair_levers, FIRST_OF_MESHES, reuses=True
    )


class DistanceProof:
    """Pairs of bodies, and the distance that each has to keep from segment to segment.

    A pair has to keep `min_distance`, or, where it is nearer than that, the largest distance that
    it has had so far, less `NEARER`: what one segment gives away, the next cannot give away again.

    Parameters
    ----------
    measure : callable
        Configurations (K, n), and which pairs are needed (P,) → lower bounds of distances (K, P)
        [m], exact where they are small; any values for the other pairs.
    pairs : tuple of (str, str)
    min_distance : float
        The distance to keep [m].
    levers : (P, n)
        See `CollisionModel.pair_levers`.
    intervals : int
        Intervals to begin with.
    reuses : bool
        Whether distances measured for an earlier segment may decide as well: the bodies of these
        pairs move with the joints alone.
    """

    def __init__(
        self,
        measure: Callable[[Array, Flags], Array],
        pairs: tuple[tuple[str, str], ...],
        min_distance: float,
        levers: Array,
        intervals: int,
        reuses: bool,
    ) -> None:
        self.pairs, self.min_distance, self.levers = pairs, min_distance, levers
        self.reuses = reuses
        self._measure, self._intervals = measure, intervals
        # The last distance of each pair that was measured, and at which configuration.
        self._last_distance = np.full(len(pairs), -np.inf)
        self._last_q = np.zeros_like(levers)
        # The largest distance that each pair has had, at most `min_distance`.
        self._floor = np.full(len(pairs), -np.inf)

    def forget(self) -> None:
        """Forget how near pairs have been."""
        self._floor[:] = -np.inf

    def distances(self, q: Array) -> Array:
        """Return the distances of pairs at a configuration (n,), (P,) [m]."""
        return np.asarray(self._measure(q[None], np.ones(len(self.pairs), dtype=np.bool_))[0])

    def shift_floor(self, change: Array) -> None:
        """Change what pairs keep by how much bodies that move have changed distances, (P,) [m]."""
        self._floor = np.minimum(self._floor + change, self.min_distance)

    def raise_floor(self, distances: Array) -> None:
        """Raise what pairs have to keep to their present distances (P,), at most `min_distance`.

        A pair that is much nearer than it has to be, as when the arm was pushed, begins anew.
        """
        is_pushed = distances < self._floor - 2.0 * NEARER
        floor = np.where(is_pushed, -np.inf, self._floor)
        self._floor = np.maximum(floor, np.minimum(self.min_distance, distances))

    def required(self, distances: Array) -> Array:
        """Return the distances that pairs have to keep, for their present ones, (P,) each [m].

        Bounds need some room to prove that a pair right at its distance leaves it. A pair that is
        nearer than that room allows comes no nearer.
        """
        has_room = distances >= self.min_distance + NEARER
        required = np.where(has_room, self.min_distance, self._floor - NEARER)
        return np.asarray(np.minimum(required, distances))

    def first_undecided(self, levers: Array, q: Array, travelled: Array) -> Undecided | None:
        """Return where no bound decides whether pairs keep their distances; None if all do.

        Parameters
        ----------
        levers : (P, n)
            Of the bodies where they are now.
        q : (K, n)
            At cycles [rad or m].
        travelled : (K, n)
            Upper bounds of the path lengths of joints since the first cycle.
        """
        way = (levers * (np.abs(q[0] - self._last_q) + travelled[-1])).sum(axis=1)
        # Written so that NaN decides nothing.
        open_pairs = ~(self._last_distance - way >= self.min_distance)
        if not open_pairs.any():
            return None

        def measure(cycles: Ints) -> Array:
            return np.where(open_pairs, self._measure(q[cycles], open_pairs), np.inf)

        edges = np.linspace(0, len(q) - 1, self._intervals + 1).round().astype(np.intp)
        edges = np.unique(edges)
        distances = measure(edges)
        bounded = open_pairs
        if self.reuses:
            self._last_distance[open_pairs] = distances[0, open_pairs]
            self._last_q[open_pairs] = q[0]
            # Meshes that are nearer all the time would take a hundred measurements: these are only
            # measured at the ends.
            bounded = open_pairs & (distances[0] >= self.min_distance)
        self.raise_floor(distances[0])
        required = self.required(distances[0])
        bounding_levers = np.where(bounded[:, None], levers, 0.0)
        return _bisect(measure, edges, distances, required, travelled, bounding_levers)


def _bisect(
    measure: Callable[[Ints], Array],
    edges: Ints,
    distances: Array,
    required: Array,
    travelled: Array,
    levers: Array,
) -> Undecided | None:
    """Return where bounds between cycles do not decide whether pairs keep what is required (P,).

    Between cycles a and b the distance of a pair is at least ½ (d(a) + d(b) - Σ_j l_j V_j), with
    V_j the path length of joint j in between, and l_j the pair's lever.
    """
    first, last, at_first, at_last = edges[:-1], edges[1:], distances[:-1], distances[1:]
    count = len(edges)
    while True:
        way = (travelled[last] - travelled[first]) @ levers.T
        # Written so that NaN decides nothing.
        ends_keep = (at_first >= required) & (at_last >= required)
        keeps = ends_keep & (0.5 * (at_first + at_last - way) >= required)
        open_ = np.flatnonzero(~keeps.all(axis=1))
        if not open_.size:
            return None
        middle = (first[open_] + last[open_]) // 2
        is_violated = ~ends_keep.all(axis=1)
        count += len(middle)
        if is_violated.any() or count > MAX_CHECKS or (middle == first[open_]).any():
            row = int(np.argmax(is_violated)) if is_violated.any() else int(open_[0])
            pair = int(np.argmin(np.minimum(at_first, at_last)[row] - required))
            distance = float(min(at_first[row, pair], at_last[row, pair]))
            return Undecided(int(last[row]), pair, distance)
        at_middle = measure(middle)
        first, last = np.append(first[open_], middle), np.append(middle, last[open_])
        at_first = np.vstack([at_first[open_], at_middle])
        at_last = np.vstack([at_middle, at_last[open_]])
