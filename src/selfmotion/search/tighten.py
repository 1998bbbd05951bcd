"""A chain of samples moved along its self-motion curves to where it is better."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.search.chains import best_chains
from selfmotion.search.curves import SelfMotion
from selfmotion.search.measures import Measure
from selfmotion.search.nodes import Admissible

# Distances of neighbouring samples [rad or m], each a third of the last, from half of that of the
# search on. A chain's excess length is about in proportion to the finest: 3 to 6 % at 0.01, 1 % at
# 0.003, and at 0.001 less than what smoothing the motion changes.
ROUGHLY = (0.03, 0.01)
FINELY = (0.003, 0.001)
# So many samples to each side are looked at in one round, in so many rounds at most; one that
# improves the chain by less than this share is the last one of its spacing.
_SIDE = 6
_TIGHTENING_ROUNDS = 40
_TIGHTENING_GAIN = 2e-4


def tighten(
    motion: SelfMotion,
    x: Array,
    q: Array,
    bounds: Admissible,
    largest_step: Array,
    measure: Measure,
    spacings: tuple[float, ...] = ROUGHLY + FINELY,
) -> Array:
    """Return a cheaper chain of configurations near q (W, n).

    Samples as coarse as those of the global search cannot follow small drifts along the curves.
    Dynamic programming over a few finer samples to both sides of each configuration, repeated
    about the outcome until that gains no more, then with finer ones. Never dearer than q.

    Parameters
    ----------
    motion : SelfMotion
    x : (W, 12)
        The tool at the waypoints.
    q : (W, n)
        On the path, within `bounds` and `largest_step`, angles without jumps.
    bounds : Admissible
    largest_step : (n,) or (W - 1, n)
    measure : Measure
    spacings : tuple of float
        Of the samples [rad or m], one after the other.
    """
    fixed = np.zeros(q.shape[1], dtype=bool)
    cost = measure.of(q)
    for spacing in spacings:
        tangents = [motion.tangent(here, target) for target, here in zip(x, q, strict=True)]
        strips = _Strips(q, tangents, spacing)
        for _ in range(_TIGHTENING_ROUNDS):
            _grow(motion, x, strips, bounds)
            chains = best_chains(strips.layers(), largest_step, fixed, measure)
            strips.choose(chains.back(len(q) - 1, int(np.argmin(chains.cost[-1]))))
            before, cost = cost, float(chains.cost[-1].min())
            if cost > before - _TIGHTENING_GAIN * abs(before):
                break
        q = strips.chosen
    return q


def _grow(motion: SelfMotion, x: Array, strips: "_Strips", bounds: Admissible) -> None:
    """Make the samples that the strips need for their next layers, all waypoints at once."""
    while True:
        waypoints, indices, guesses = strips.wanted()
        if not len(waypoints):
            return
        found, arrived = motion.project_all(guesses, x[waypoints])
        # Far corrections lead to another part of the curve, or another curve.
        arrived &= np.linalg.norm(found - guesses, axis=1) <= 0.5 * strips.spacing
        free = arrived.copy()
        free[arrived] = bounds.keep(found[arrived])
        strips.note(waypoints, indices, found, arrived, free)


class _Strips:
    """Samples of each waypoint's curve about a configuration, made when asked for and kept.

    They are numbered by the spacings from that configuration, to both sides; at a singular one
    there are no others.
    """

    def __init__(self, q: Array, tangents: list[Array | None], spacing: float) -> None:
        self.spacing = spacing
        count, n = q.shape
        # No centre moves farther in all rounds.
        self._middle = _SIDE * (_TIGHTENING_ROUNDS + 1)
        size = 2 * self._middle + 1
        self._samples = np.full((count, size, n), np.nan)
        self._free = np.zeros((count, size), dtype=np.bool_)
        self._samples[:, self._middle], self._free[:, self._middle] = q, True
        none = np.full(n, np.nan)
        self._tangents = np.array([none if one is None else one for one in tangents])
        # How far they go to each side so far, and where the curve goes on.
        self._reach = {side: np.zeros(count, dtype=np.int64) for side in (-1, 1)}
        singular = np.array([one is None for one in tangents], dtype=np.bool_)
        self._goes_on = {side: ~singular for side in (-1, 1)}
        self._centres = np.zeros(count, dtype=np.int64)
        self._indices: list[Ints] = []

    @property
    def chosen(self) -> Array:
        """The configurations chosen last, (W, n)."""
        return self._at(np.arange(len(self._centres)), self._centres)

    def choose(self, nodes: list[int]) -> None:
        """Make nodes of the last layers the centres of the next ones."""
        chosen = [own[node] for own, node in zip(self._indices, nodes, strict=True)]
        self._centres = np.array(chosen, dtype=np.int64)

    def wanted(self) -> tuple[Ints, Ints, Array]:
        """Return the next samples that are needed: their waypoints, numbers, and about where."""
        parts = []
        for side, far in self._reach.items():
            need = self._goes_on[side] & (far < _SIDE + side * self._centres)
            own = np.flatnonzero(need)
            last = self._at(own, side * far[own])
            step = side * self.spacing * self._tangents[own]
            further = far[own] > 0
            earlier = self._at(own[further], side * (far[own] - 1)[further])
            step[further] = last[further] - earlier
            parts.append((own, side * (far[own] + 1), last + step))
        waypoints, indices, guesses = (np.concatenate(each) for each in zip(*parts, strict=True))
        return waypoints, indices, guesses

    def note(self, waypoints: Ints, indices: Ints, q: Array, there: Flags, free: Flags) -> None:
        """Keep samples (K, n), where there are any; and which of them are free."""
        where = waypoints[there], self._middle + indices[there]
        self._samples[where], self._free[where] = q[there], free[there]
        for side, far in self._reach.items():
            own = np.sign(indices) == side
            far[waypoints[own]] += 1
            self._goes_on[side][waypoints[own & ~there]] = False

    def layers(self) -> list[Array]:
        """Return the free samples about the centres, (K, n) each, sorted by the first joint."""
        near = np.arange(-_SIDE, _SIDE + 1)
        self._indices, found = [], []
        for waypoint, centre in enumerate(self._centres):
            indices = centre + near
            indices = indices[self._free[waypoint, self._middle + indices]]
            q = self._samples[waypoint, self._middle + indices]
            order = np.argsort(q[:, 0], kind="stable")
            self._indices.append(indices[order])
            found.append(q[order])
        return found

    def _at(self, waypoints: Ints, indices: Ints) -> Array:
        return np.asarray(self._samples[waypoints, self._middle + indices])
