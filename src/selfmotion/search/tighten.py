"""A chain of samples moved along its self-motion curves to where it is better."""

from collections.abc import Iterator

import numpy as np

from selfmotion.basics import Array
from selfmotion.search.chains import best_chains
from selfmotion.search.curves import SelfMotion
from selfmotion.search.measures import Measure
from selfmotion.search.nodes import Admissible
from selfmotion.search.settings import FINELY, ROUGHLY, SIDE, TIGHTENING_GAIN, TIGHTENING_ROUNDS


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
        tangents = (motion.tangent(here, target) for target, here in zip(x, q, strict=True))
        strips = [_Strip(here, tangent, spacing) for here, tangent in zip(q, tangents, strict=True)]
        for _ in range(TIGHTENING_ROUNDS):
            _grow(motion, x, strips, bounds, spacing)
            layers = [strip.layer() for strip in strips]
            chains = best_chains(layers, largest_step, fixed, measure)
            chain = chains.back(len(q) - 1, int(np.argmin(chains.cost[-1])))
            before, cost = cost, float(chains.cost[-1].min())
            for strip, node in zip(strips, chain, strict=True):
                strip.choose(node)
            if cost > before - TIGHTENING_GAIN * abs(before):
                break
        q = np.array([strip.chosen for strip in strips])
    return q


def _grow(
    motion: SelfMotion, x: Array, strips: list["_Strip"], bounds: Admissible, spacing: float
) -> None:
    """Make the samples that the strips need for their next layers, all waypoints at once."""
    while True:
        wanted = [
            (waypoint, index, guess)
            for waypoint, strip in enumerate(strips)
            for index, guess in strip.wanted()
        ]
        if not wanted:
            return
        guesses = np.array([guess for *_, guess in wanted])
        found, arrived = motion.project_all(guesses, x[[waypoint for waypoint, *_ in wanted]])
        # Far corrections lead to another part of the curve, or another curve.
        arrived &= np.linalg.norm(found - guesses, axis=1) <= 0.5 * spacing
        free = arrived.copy()
        free[arrived] = bounds.keep(found[arrived])
        for (waypoint, index, _), q, is_there, is_free in zip(
            wanted, found, arrived, free, strict=True
        ):
            strips[waypoint].note(index, q if is_there else None, is_free=bool(is_free))


class _Strip:
    """Samples of one waypoint's curve about a configuration, made when asked for and kept."""

    def __init__(self, q: Array, tangent: Array | None, spacing: float) -> None:
        self._spacing = spacing
        # By the number of spacings from the first configuration; None beyond the curve's end.
        self._samples: dict[int, Array | None] = {0: q}
        self._free = {0: True}
        self._tangent = tangent
        # How far they go to each side so far.
        self._reach = {-1: 0, 1: 0}
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

    def wanted(self) -> Iterator[tuple[int, Array]]:
        """Yield the index of the next sample to each side that is needed, and about where it is."""
        for toward, far in self._reach.items():
            last = self._samples[toward * far]
            if last is None or self._tangent is None or far >= SIDE + toward * self._centre:
                continue
            if far == 0:
                yield toward, last + toward * self._spacing * self._tangent
            else:
                earlier = self._samples[toward * (far - 1)]
                assert earlier is not None, "the last one was made from it"
                yield toward * (far + 1), 2.0 * last - earlier

    def note(self, index: int, q: Array | None, *, is_free: bool) -> None:
        """Keep a sample, None where there is none."""
        self._samples[index] = q
        self._reach[1 if index > 0 else -1] = abs(index)
        self._free[index] = is_free

    def layer(self) -> Array:
        """Return the free samples about the centre, (K, n), sorted by the first joint."""
        nodes = []
        for index in range(self._centre - SIDE, self._centre + SIDE + 1):
            q = self._samples.get(index)
            if q is not None and self._free[index]:
                nodes.append((q[0], index, q))
        nodes.sort(key=lambda node: node[:2])
        self._indices = [index for _, index, _ in nodes]
        return np.array([q for _, _, q in nodes])
