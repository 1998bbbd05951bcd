"""Self-motion curves: all configurations with the tool in a given pose, for redundancy 1."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Ints, Progress, read_only, silent
from selfmotion.model.follow import Follows, kinematics_of
from selfmotion.model.kernels import rows_of
from selfmotion.planning.search.curve_kernels import nearest_segments, walk
from selfmotion.planning.search.manifold import (
    LONGEST_CORRECTION,
    Manifold,
    correct,
    correction_space,
)

# Largest distance of samples along a curve [rad or m], configuration norm.
SPACING = 0.1
# A configuration this near [rad or m] to a curve's polyline is on the curve.
ON_CURVE = 0.02
# Largest number of samples of a curve.
_MAX_SAMPLES = 5000
# One in this many samples of a curve is a seed at the next waypoint.
_CARRIED = 6


@dataclass(frozen=True, eq=False)
class Curve:
    """One self-motion curve as a polyline.

    Attributes
    ----------
    q : (K, n)
        Configurations [rad or m] in order, revolute joints without wrapping, joint limits not
        regarded. Of a closed curve the last one is the first one modulo turns.
    closed : bool
        False where it ends: in a singular configuration, where its steps become too short, or
        after `_MAX_SAMPLES` samples.
    arc : (K,)
        Arc length from the first sample, in the configuration norm.
    """

    q: Array
    closed: bool
    arc: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", read_only(self.q))
        steps = np.linalg.norm(np.diff(self.q, axis=0), axis=1)
        object.__setattr__(self, "arc", read_only(np.concatenate([[0.0], np.cumsum(steps)])))

    @property
    def length(self) -> float:
        """Arc length of the whole curve."""
        return float(self.arc[-1])


class CurveSet:
    """The curves found for one pose of the tool."""

    def __init__(self, revolute: npt.NDArray[np.bool_], spacing: float) -> None:
        self.curves: list[Curve] = []
        self._revolute = revolute
        # Segments are at most 1.2 spacings long (see `curve_kernels`).
        self._near = 1.5 * spacing + ON_CURVE
        self._samples = np.empty((0, len(revolute)))
        self._arcs = np.empty(0)
        self._curve_of_sample = np.empty(0, dtype=np.intp)
        self._first_samples: list[int] = []

    def add(self, curve: Curve) -> None:
        """Add a curve."""
        index = np.full(len(curve.q), len(self.curves))
        self._first_samples.append(len(self._samples))
        self.curves.append(curve)
        self._samples = np.vstack([self._samples, curve.q])
        self._arcs = np.concatenate([self._arcs, curve.arc])
        self._curve_of_sample = np.concatenate([self._curve_of_sample, index])

    def locate(self, q: Array) -> tuple[Ints, Array]:
        """Return the curves that q (K, n) are on, -1 for none, and the arc lengths there, (K,)."""
        if not self.curves or not len(q):
            return np.full(len(q), -1), np.zeros(len(q))
        i, share, distance = nearest_segments(
            q, self._samples, self._curve_of_sample, self._revolute, self._near
        )
        found = distance < ON_CURVE
        # Rows without a curve may take any segment.
        i = np.where(found, i, 0)
        arc = self._arcs[i] + share * (self._arcs[i + 1] - self._arcs[i])
        return np.where(found, self._curve_of_sample[i], -1), arc

    def at(self, curve: Ints, arc: Array) -> Array:
        """Return the points of the polylines of curves (K,) at arc lengths (K,), (K, n)."""
        starts = np.array(self._first_samples)
        # Curves are laid end to end, a gap of 1 between them: one search finds all segments.
        ends = np.cumsum([each.length + 1.0 for each in self.curves])
        offsets = np.concatenate([[0.0], ends[:-1]])
        along = self._arcs + offsets[self._curve_of_sample]
        last = np.append(starts[1:], len(self._arcs)) - 1
        i = np.searchsorted(along, arc + offsets[curve])
        i = np.clip(i, starts[curve] + 1, last[curve])
        share = (arc - self._arcs[i - 1]) / (self._arcs[i] - self._arcs[i - 1])
        first = self._samples[i - 1]
        return np.asarray(first + share[:, None] * (self._samples[i] - first))

    def seeds(self) -> Iterable[Array]:
        """Yield configurations from which to find these curves at a pose nearby."""
        for curve in self.curves:
            yield from curve.q[::_CARRIED]


class SelfMotion:
    """Newton's method and continuation on {q : F(q) = x}.

    Continuation along the null vector of J (predictor) with Newton corrections q ← q + J⁺e, in
    steps of at most `spacing` in the configuration norm, halved where the curve bends or the
    corrections do not converge (E. Allgower, K. Georg, "Numerical Continuation Methods", 1990).
    Joint limits and collisions are not regarded: the curves of revolute arms are closed then.

    Parameters
    ----------
    follows : Follows
        Leaves redundancy 1.
    spacing : float
        Largest distance of neighbouring samples [rad or m].
    """

    def __init__(self, follows: Follows, spacing: float) -> None:
        self.robot, self.coordinates, self.spacing = follows.robot, follows.coordinates, spacing
        self.revolute = follows.coordinates.is_revolute
        self._tips = kinematics_of(follows)
        everywhere = np.full(follows.dof, np.inf)
        self._manifold = Manifold(follows, -everywhere, everywhere)
        # Any direction that is not a row of the Jacobian gives the tangent by projection.
        self._direction = np.random.default_rng(0).normal(size=follows.dof)

    def project_all(
        self, q: Array, target: Array, *, far: bool = False
    ) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return the results of Newton's method from configurations (K, n), and convergence, (K,).

        Parameters
        ----------
        q : (K, n)
        target : (12,) or (K, 12)
            The tool's translation and rotation (see `Follows.targets`).
        far : bool
            Whether q are any configurations instead of ones near solutions.
        """
        return self._manifold.project(q, target, far=far)

    def tangent(self, q: Array, target: Array) -> Array | None:
        """Return a unit null vector of J at q, a solution; None where q is singular."""
        tangent, layout = self._direction.copy(), self._manifold.layout
        space = np.empty(correction_space(len(q), rows_of(layout)))
        tips = self._tips.at(q)
        length = correct(q.copy(), *tips, target, layout, tangent, LONGEST_CORRECTION, space)
        return tangent if length >= 0.0 and np.all(np.isfinite(tangent)) else None

    def trace(self, q: Array, target: Array) -> Curve | None:
        """Return the curve through q, a solution; None where q is singular."""
        tangent = self.tangent(q, target)
        if tangent is None:
            return None
        samples, closed = self._walk(q, tangent, target)
        if not closed:
            back, _ = self._walk(q, -tangent, target)
            samples = np.vstack([back[:0:-1], samples])
        return Curve(samples, closed) if len(samples) > 1 else None

    def curves(self, target: Array, seeds: Iterable[Array]) -> CurveSet:
        """Return the curves that Newton's method reaches from `seeds`, each once."""
        found = CurveSet(self.revolute, self.spacing)
        self.complete(found, target, seeds, far=True)
        return found

    def complete(
        self, found: CurveSet, target: Array, seeds: Iterable[Array], *, far: bool = False
    ) -> bool:
        """Add to `found` the curves it lacks; return whether there was one."""
        before = len(found.curves)
        given = np.array(list(seeds)).reshape(-1, self.coordinates.dof)
        projected, arrived = self.project_all(given, target, far=far)
        left = projected[arrived]
        left = left[found.locate(left)[0] < 0]
        while len(left):
            curve = self.trace(left[0], target)
            left = left[1:]
            if curve is not None:
                found.add(curve)
                left = left[found.locate(left)[0] < 0]
        return len(found.curves) > before

    def _walk(self, start: Array, tangent: Array, target: Array) -> tuple[Array, bool]:
        """Return the samples (K, n) from `start` on, and whether they lead back to it."""
        samples = np.empty((_MAX_SAMPLES, self.coordinates.dof))
        chains, revolute = self._manifold.chains, self._manifold.revolute
        layout = self._manifold.layout
        count, closed = walk(
            start, tangent, target, chains, revolute, layout, self.spacing, samples
        )
        return samples[:count].copy(), closed


def curves_along(
    motion: SelfMotion,
    target: Array,
    seeds: Array,
    every: int,
    progress: Progress = silent,
) -> list[CurveSet]:
    """Return the self-motion curves at all waypoints.

    Curves of one waypoint are continued to the next and then, from the last waypoint back, to the
    previous one; `seeds` are tried at every `every`-th waypoint and at the last one. So a curve is
    missed only when it exists between two such waypoints alone, or no seed leads to it.

    Parameters
    ----------
    motion : SelfMotion
    target : (W, 12)
    seeds : (K, n)
    every : int
    progress : Progress
    """
    curve_sets: list[CurveSet] = []
    for i, x in enumerate(target):
        progress("search: self-motions at waypoint", i + 1, len(target))
        curves = CurveSet(motion.revolute, motion.spacing)
        if i > 0:
            motion.complete(curves, x, curve_sets[-1].seeds())
        if i % every == 0 or i == len(target) - 1:
            motion.complete(curves, x, seeds, far=True)
        curve_sets.append(curves)
    for i in range(len(target) - 2, -1, -1):
        motion.complete(curve_sets[i], target[i], curve_sets[i + 1].seeds())
    return curve_sets
