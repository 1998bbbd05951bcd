"""A chain of samples moved along its self-motion curves to where it is shorter."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.search.chains import shortest_chains
from selfmotion.search.curves import SelfMotion
from selfmotion.search.nodes import Admissible

# Distances of neighbouring samples [rad or m], each a third of the last, from half of that of the
# search on. A chain's excess length is about in proportion to the finest: 3 to 6 % at 0.01, 1 % at
# 0.003, and at 0.001 less than what smoothing the motion changes.
ROUGHLY, FINELY = (0.03, 0.01), (0.003, 0.001)
# So many samples to each side are looked at in one round.
_SIDE, _ROUNDS = 6, 40
# A round that shortens the chain by less than this share is the last one of its spacing.
_WORTHWHILE = 2e-4


def tighten(
    motion: SelfMotion,
    x: Array,
    q: Array,
    bounds: Admissible,
    largest_step: Array,
    spacings: tuple[float, ...] = ROUGHLY + FINELY,
) -> Array:
    """Return a shorter chain of configurations near q (W, n).

    Samples as coarse as those of the global search cannot follow small drifts along the curves.
    Dynamic programming over a few finer samples to both sides of each configuration, repeated
    about the outcome until that gains no more, then with finer ones. Never longer than q.

    Parameters
    ----------
    motion : SelfMotion
    x : (W, 12)
        The tool at the waypoints.
    q : (W, n)
        On the path, within `bounds` and `largest_step`, angles without jumps.
    bounds : Admissible
    largest_step : (n,) or (W - 1, n)
    spacings : tuple of float
        Of the samples [rad or m], one after the other.
    """
    fixed = np.zeros(q.shape[1], dtype=bool)
    length = float(np.abs(np.diff(q, axis=0)).sum())
    for spacing in spacings:
        strips = [
            _Strip(motion, target, here, bounds, spacing) for target, here in zip(x, q, strict=True)
        ]
        for _ in range(_ROUNDS):
            layers = [strip.layer() for strip in strips]
            chains = shortest_chains(layers, largest_step, fixed)
            chain = chains.back(len(q) - 1, int(np.argmin(chains.cost[-1])))
            before, length = length, float(chains.cost[-1].min())
            for strip, node in zip(strips, chain, strict=True):
                strip.choose(node)
            if length > (1.0 - _WORTHWHILE) * before:
                break
        q = np.array([strip.chosen for strip in strips])
    return q


class _Strip:
    """Samples of one waypoint's curve about a configuration, made when asked for and kept."""

    def __init__(
        self, motion: SelfMotion, target: Array, q: Array, bounds: Admissible, spacing: float
    ) -> None:
        self._motion, self._target, self._bounds = motion, target, bounds
        self._spacing = spacing
        # By the number of spacings from the first configuration; None beyond the curve's end.
        self._samples: dict[int, Array | None] = {0: q}
        self._free = {0: True}
        self._tangent = motion.tangent(q, target)
        self._centre = 0
        self._indices = [0]

    @property
    def chosen(self) -> Array:
        """The configuration chosen last."""
        q = self._samples[self._centre]
        assert q is not None, "only samples that exist are in a layer"
        return q

    def choose(self, node: int) -> None:
        """Make a node of the last layer the centre of the next one."""
        self._centre = self._indices[node]

    def layer(self) -> Array:
        """Return the free samples about the centre, (K, n), sorted by the first joint."""
        nodes = []
        for index in range(self._centre - _SIDE, self._centre + _SIDE + 1):
            q = self._sample(index)
            if q is not None and self._free[index]:
                nodes.append((q[0], index, q))
        nodes.sort(key=lambda node: node[:2])
        self._indices = [index for _, index, _ in nodes]
        return np.array([q for _, _, q in nodes])

    def _sample(self, index: int) -> Array | None:
        if index not in self._samples:
            toward = 1 if index > 0 else -1
            # The neighbour comes first; it exists, for layers grow outwards from the centre.
            previous = self._sample(index - toward)
            self._samples[index] = q = self._next(index, toward, previous)
            self._free[index] = q is not None and self._bounds.keeps(q)
        return self._samples[index]

    def _next(self, index: int, toward: int, previous: Array | None) -> Array | None:
        if previous is None or self._tangent is None:
            return None
        if index == toward:
            guess = previous + toward * self._spacing * self._tangent
        else:
            earlier = self._samples[index - 2 * toward]
            assert earlier is not None, "its neighbour was made from it"
            guess = 2.0 * previous - earlier
        q = self._motion.project(guess, self._target)
        # Far corrections lead to another part of the curve, or another curve.
        if q is None or np.linalg.norm(q - guess) > 0.5 * self._spacing:
            return None
        return q
