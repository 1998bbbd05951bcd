"""Vertices of the search: admissible samples of self-motion curves."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.planning.search.curves import ON_CURVE, CurveSet, SelfMotion
from selfmotion.planning.search.search_bounds import SearchBounds

# Accuracy of the ends of admissible intervals, as a share of the spacing.
_END_RESOLUTION = 0.25
# Samples nearer to each other than this share of the spacing are merged.
_MERGED = 0.4


def place_vertices(
    motion: SelfMotion,
    target: Array,
    curves: CurveSet,
    carried: Array,
    bounds: SearchBounds,
    spacing: float,
) -> Array:
    """Return the admissible samples of one waypoint's self-motion curves, (K, n), modulo turns.

    Samples carried over from the previous waypoint are kept, so that chains can follow them without
    extra length. Gaps are filled to `spacing`; where admissible intervals end, they are bisected.

    Parameters
    ----------
    motion : SelfMotion
    target : (12,)
        The tool at the waypoint.
    curves : CurveSet
        All configurations there.
    carried : (C, n)
        Configurations on the curves.
    bounds : SearchBounds
    spacing : float
        Largest gap in the configuration norm.
    """
    if not curves.curves:
        return np.empty((0, motion.coordinates.dof))
    sampler = _Sampler(motion, target, curves, bounds, spacing)
    samples = sampler.choose(carried)
    q, admissible = sampler.evaluate(samples, carried)
    return np.vstack([q[admissible], *sampler.interval_ends(samples, admissible)])


class _CurveSamples(NamedTuple):
    """Samples on curves: curve number, arc length, and row among the carried ones, -1 for new."""

    curve: Ints
    arc: Array
    carried_row: Ints


@dataclass(frozen=True, eq=False)
class _Sampler:
    """Samples the curves of one waypoint, all at once; see `place_vertices`."""

    motion: SelfMotion
    target: Array
    curves: CurveSet
    bounds: SearchBounds
    spacing: float

    def choose(self, carried: Array) -> _CurveSamples:
        """Return the carried samples that are apart, and those that fill the gaps between them."""
        carried_curve, carried_arc = self.curves.locate(carried)
        parts: list[_CurveSamples] = []
        for k, curve in enumerate(self.curves.curves):
            row = _on_curve(carried_curve, carried_arc, k)
            row = row[_spaced(carried_arc[row], _MERGED * self.spacing)]
            gaps = _gap_fillers(carried_arc[row].tolist(), curve.length, self.spacing)
            arc = np.concatenate([carried_arc[row], gaps])
            new = np.full(len(gaps), -1)
            parts.append(_CurveSamples(np.full(len(arc), k), arc, np.concatenate([row, new])))
        return _CurveSamples(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def evaluate(self, samples: _CurveSamples, carried: Array) -> tuple[Array, Flags]:
        """Return the configurations (K, n) of samples, and which are admissible, (K,)."""
        curve, arc, row = samples
        is_new = row < 0
        q = np.empty((len(row), self.motion.coordinates.dof))
        q[~is_new], q[is_new] = carried[row[~is_new]], self.curves.at(curve[is_new], arc[is_new])
        # Samples farther outside of the limits would stay outside after projection onto their
        # curve.
        admissible = np.all(self.bounds.excess(q) < ON_CURVE, axis=1)
        projected = np.flatnonzero(admissible & is_new)
        q[projected], admissible[projected] = self.motion.project_all(q[projected], self.target)
        admissible[admissible] = self.bounds.is_admissible_modulo_turns(q[admissible])
        return q, admissible

    def interval_ends(self, samples: _CurveSamples, admissible: Flags) -> list[Array]:
        """Return admissible samples (K, n) nearer to the ends of admissible intervals."""
        curve, inside, outside = _interval_brackets(samples, admissible, self.curves)
        lengths = np.array([each.length for each in self.curves.curves])
        ends: list[Array] = []
        while True:
            wide = np.abs(outside - inside) > _END_RESOLUTION * self.spacing
            curve, inside, outside = curve[wide], inside[wide], outside[wide]
            if not len(curve):
                return ends
            middle = 0.5 * (inside + outside)
            guess = self.curves.at(curve, middle % lengths[curve])
            q, accepted = self.motion.project_all(guess, self.target)
            accepted[accepted] = self.bounds.is_admissible_modulo_turns(q[accepted])
            ends.append(q[accepted])
            inside = np.where(accepted, middle, inside)
            outside = np.where(accepted, outside, middle)


def _on_curve(numbers: Ints, arcs: Array, k: int) -> Ints:
    """Return the indices of the samples on curve k, sorted by arc length."""
    indices = np.flatnonzero(numbers == k)
    return np.asarray(indices[np.argsort(arcs[indices], kind="stable")])


def _interval_brackets(
    samples: _CurveSamples, admissible: Flags, curves: CurveSet
) -> tuple[Ints, Array, Array]:
    """Return the neighbours of which one is admissible: curve number, and both arc lengths.

    The arc length of the admissible one comes first.
    """
    numbers: list[Ints] = []
    inside, outside = [], []
    for k, curve in enumerate(curves.curves):
        indices = _on_curve(samples.curve, samples.arc, k)
        arcs, selected = samples.arc[indices], admissible[indices]
        if curve.closed and len(indices):
            arcs = np.append(arcs, arcs[0] + curve.length)
            selected = np.append(selected, selected[0])
        i = np.flatnonzero(selected[1:] != selected[:-1])
        numbers.append(np.full(len(i), k))
        inside.append(np.where(selected[i], arcs[i], arcs[i + 1]))
        outside.append(np.where(selected[i], arcs[i + 1], arcs[i]))
    return np.concatenate(numbers), np.concatenate(inside), np.concatenate(outside)


def _spaced(arcs: Array, spacing: float) -> list[int]:
    """Return the sorted arc lengths (K,) to keep: each farther than `spacing` from the last."""
    selected: list[int] = []
    for k, arc in enumerate(arcs.tolist()):
        if not selected or arc - arcs[selected[-1]] > spacing:
            selected.append(k)
    return selected


def _gap_fillers(arcs: Sequence[float], length: float, spacing: float) -> Array:
    """Return arc lengths that fill the gaps between sorted `arcs` on a curve.

    Also 0 where no sample is near the curve's start.
    """
    fill: list[float] = []
    if not arcs or arcs[0] > _MERGED * spacing:
        fill.append(0.0)
    stops = [0.0, *arcs, length]
    for first, last in itertools.pairwise(stops):
        parts = int(np.ceil((last - first) / spacing))
        fill += [first + (last - first) * k / parts for k in range(1, parts)]
    return np.array(fill)
