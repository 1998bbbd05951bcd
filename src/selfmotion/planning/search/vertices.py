"""Vertices of the search: samples of self-motion curves inside the limits and free of collision."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.collision import CollisionModel
from selfmotion.planning.search.curves import ON_CURVE, CurveSet, SelfMotion

# Ends of free intervals are found to this share of the spacing.
_BORDER = 0.25
# Distance at which a joint is at its limit [rad or m].
AT_LIMIT = 1e-3
# Samples nearer to each other than this share of the spacing are merged.
_MERGED = 0.4
# A whole turn [rad].
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class Admissible:
    """Conditions on a vertex of a chain: limits, bodies and quantities.

    Attributes
    ----------
    lower, upper : (n,)
        Joint limits [rad or m], ±inf for none.
    revolute : (n,)
        Whether a turn leads to the same pose.
    bodies : tuple of (CollisionModel, float)
        Bodies with a minimum distance [m].
    """

    lower: Array
    upper: Array
    revolute: npt.NDArray[np.bool_]
    bodies: tuple[tuple[CollisionModel, float], ...]

    @property
    def turning(self) -> npt.NDArray[np.bool_]:
        """Joints that turn without end: their angles count modulo turns."""
        free = np.isinf(self.lower) & np.isinf(self.upper)
        return np.asarray(self.revolute & free)

    def without_turns(self) -> "Admissible":
        """Return bounds in which joints with room for a whole turn turn without end.

        The search is much smaller then: six joints of two turns each make 64 vertices of one.
        """
        wide = self.revolute & (self.upper - self.lower >= _TURN)
        return replace(
            self,
            lower=np.where(wide, -np.inf, self.lower),
            upper=np.where(wide, np.inf, self.upper),
        )

    def counting_turns(self, which: Flags, bounds: "Admissible") -> "Admissible":
        """Return it with the limits of `bounds` for some joints (n,), whose turns count again."""
        return replace(
            self,
            lower=np.where(which, bounds.lower, self.lower),
            upper=np.where(which, bounds.upper, self.upper),
        )

    def turned_inside(self, q: Array) -> Array:
        """Return a motion (W, n) with each revolute joint by whole turns nearest to mid-range."""
        bounded = self.revolute & np.isfinite(self.lower) & np.isfinite(self.upper)
        lower, upper = np.where(bounded, self.lower, 0.0), np.where(bounded, self.upper, 0.0)
        off = 0.5 * (lower + upper - q.min(axis=0) - q.max(axis=0))
        return q + _TURN * np.where(bounded, np.round(off / _TURN), 0.0)

    def beyond(self, q: Array) -> npt.NDArray[np.bool_]:
        """Return the mask of joints that leave their limits in a motion (W, n), (n,)."""
        return np.asarray(np.any((q < self.lower) | (q > self.upper), axis=0))

    def layer(self, q: Array) -> Array:
        """Return free samples (K, n) at all their turns, sorted by the first joint, (K', n)."""
        # A turn there and back may round a joint that stands at its limit beyond that.
        vertices = np.clip(self.all_turns(q), self.lower, self.upper)
        return np.ascontiguousarray(vertices[np.argsort(vertices[:, 0], kind="stable")])

    def representative(self, q: Array) -> Array:
        """Return q (…, n) with each revolute joint at or above its lower limit by the least turn.

        Angles without lower limit are brought into [-π, π), or to the first turn below the upper
        limit.
        """
        below = np.where(np.isfinite(self.upper), self.upper - _TURN, -np.pi)
        base = np.where(np.isfinite(self.lower), self.lower, below)
        return np.where(self.revolute, base + np.mod(q - base, _TURN), q)

    def excess(self, q: Array) -> Array:
        """Return the distance of q (…, n) from within the limits, at the nearest turn, (…, n)."""
        first = self.representative(q)
        above = np.maximum(first - self.upper, 0.0)
        below = np.maximum(self.lower - first, 0.0)
        turned = np.where(self.revolute, np.maximum(self.lower - (first - _TURN), 0.0), np.inf)
        return np.maximum(np.minimum(above, turned), below)

    def free(self, q: Array) -> npt.NDArray[np.bool_]:
        """Whether each of q (K, n) is inside the limits at some turn, and clear of collisions."""
        first = self.representative(q)
        free = np.asarray(np.all((first <= self.upper) & (first >= self.lower), axis=-1))
        free[free] = self._clear(first[free])
        return free

    def keep(self, q: Array) -> npt.NDArray[np.bool_]:
        """Whether each of q (K, n) is inside the limits as it is, and clear of collisions."""
        selected = np.asarray(np.all((q <= self.upper) & (q >= self.lower), axis=1))
        selected[selected] = self._clear(q[selected])
        return selected

    def _clear(self, q: Array) -> npt.NDArray[np.bool_]:
        """Whether bodies keep their distances at each of q (K, n)."""
        clear = np.ones(len(q), dtype=bool)
        for model, distance in self.bodies:
            clear[clear] = ~model.colliding(q[clear, : model.robot.dof], distance)
        return clear

    def all_turns(self, q: Array) -> Array:
        """Return q (K, n), inside the limits, at every turn that is inside them, (K', n)."""
        q = self.representative(q)
        for k in np.flatnonzero(self.revolute & np.isfinite(self.lower) & np.isfinite(self.upper)):
            turns = [q]
            for count in range(1, int((self.upper[k] - self.lower[k]) / _TURN) + 1):
                more = q.copy()
                more[:, k] += count * _TURN
                turns.append(more[more[:, k] <= self.upper[k]])
            q = np.concatenate(turns)
        return q


def place_vertices(
    motion: SelfMotion,
    target: Array,
    curves: CurveSet,
    carried: Array,
    bounds: Admissible,
    spacing: float,
) -> Array:
    """Return the free samples of the curves of one waypoint, (K, n), without turns.

    Samples carried from the waypoint before are kept: chains can follow them without a change along
    the curve from sample to sample, which would add to their length. Gaps between them are filled
    to `spacing`, and halved where free samples start or end.

    Parameters
    ----------
    motion : SelfMotion
    target : (12,)
    curves : CurveSet
    carried : (C, n)
        Configurations on the curves.
    bounds : Admissible
    spacing : float
        Largest gap in the configuration norm.
    """
    if not curves.curves:
        return np.empty((0, motion.coordinates.dof))
    sampler = _Sampler(motion, target, curves, bounds, spacing)
    return np.vstack(sampler.vertices(carried))


@dataclass(frozen=True, eq=False)
class _Sampler:
    """Samples the curves of one waypoint between and at carried samples, all at once."""

    motion: SelfMotion
    target: Array
    curves: CurveSet
    bounds: Admissible
    spacing: float

    def vertices(self, carried: Array) -> list[Array]:
        """Return the free samples in pieces (K, n)."""
        on, places = self.curves.locate(carried)
        numbers: list[Ints] = []
        arcs: list[Array] = []
        rows: list[Ints] = []
        for k, curve in enumerate(self.curves.curves):
            here = np.flatnonzero(on == k)
            here = here[np.argsort(places[here], kind="stable")]
            selected = here[_thinned(places[here], _MERGED * self.spacing)]
            gaps = _between(places[selected].tolist(), curve.length, self.spacing)
            arcs += [places[selected], gaps]
            rows += [selected, np.full(len(gaps), -1)]
            numbers.append(np.full(len(selected) + len(gaps), k))
        number, row = np.concatenate(numbers), np.concatenate(rows)
        arc = np.concatenate(arcs)
        fresh = row < 0
        q = np.empty((len(row), self.motion.coordinates.dof))
        q[~fresh], q[fresh] = carried[row[~fresh]], self.curves.at(number[fresh], arc[fresh])
        # Samples farther outside of the limits would stay outside after projection onto their
        # curve.
        near = np.all(self.bounds.excess(q) < ON_CURVE, axis=1)
        new = np.flatnonzero(near & fresh)
        q[new], near[new] = self.motion.project_all(q[new], self.target)
        free = near.copy()
        free[near] = self.bounds.free(q[near])
        return [q[free], *self._borders(number, arc, free)]

    def _borders(self, number: Ints, arc: Array, free: Flags) -> list[Array]:
        """Return free samples (K, n) nearer to the ends of free intervals of curves."""
        on, inside, outside = _changes(number, arc, free, self.curves)
        lengths = np.array([curve.length for curve in self.curves.curves])
        found: list[Array] = []
        while True:
            wide = np.abs(outside - inside) > _BORDER * self.spacing
            on, inside, outside = on[wide], inside[wide], outside[wide]
            if not len(on):
                return found
            middle = 0.5 * (inside + outside)
            guess = self.curves.at(on, middle % lengths[on])
            q, free = self.motion.project_all(guess, self.target)
            free[free] = self.bounds.free(q[free])
            found.append(q[free])
            inside, outside = np.where(free, middle, inside), np.where(free, outside, middle)


def _changes(number: Ints, arc: Array, free: Flags, curves: CurveSet) -> tuple[Ints, Array, Array]:
    """Return the pairs of a free and a blocked neighbour: curve number, and both arc lengths."""
    on: list[Ints] = []
    inside, outside = [], []
    for k, curve in enumerate(curves.curves):
        here = np.flatnonzero(number == k)
        here = here[np.argsort(arc[here], kind="stable")]
        arcs, selected = arc[here], free[here]
        if curve.closed and len(here):
            arcs, selected = (
                np.append(arcs, arcs[0] + curve.length),
                np.append(selected, selected[0]),
            )
        i = np.flatnonzero(selected[1:] != selected[:-1])
        on.append(np.full(len(i), k))
        inside.append(np.where(selected[i], arcs[i], arcs[i + 1]))
        outside.append(np.where(selected[i], arcs[i + 1], arcs[i]))
    return np.concatenate(on), np.concatenate(inside), np.concatenate(outside)


def _thinned(arcs: Array, spacing: float) -> list[int]:
    """Return the sorted arc lengths (K,) to keep: each farther than `spacing` from the last."""
    selected: list[int] = []
    for k, arc in enumerate(arcs.tolist()):
        if not selected or arc - arcs[selected[-1]] > spacing:
            selected.append(k)
    return selected


def _between(arcs: Sequence[float], length: float, spacing: float) -> Array:
    """Return arc lengths that fill the gaps between sorted `arcs`, the start included."""
    fill: list[float] = []
    if not arcs or arcs[0] > _MERGED * spacing:
        fill.append(0.0)
    stops = [0.0, *arcs, length]
    for first, last in itertools.pairwise(stops):
        parts = int(np.ceil((last - first) / spacing))
        fill += [first + (last - first) * k / parts for k in range(1, parts)]
    return np.array(fill)
