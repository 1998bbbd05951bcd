"""Self-motion curves: all configurations with the tool in a given pose, for redundancy 1."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags, Ints, Progress, inlined, kernel, read_only, silent
from selfmotion.basics.layout import Layout
from selfmotion.model.follow import Follows, kinematics_of
from selfmotion.model.kernels import rows_of
from selfmotion.model.robot import place_tips
from selfmotion.planning.search.layer_steps import wrapped
from selfmotion.planning.search.manifold import (
    CONVERGED,
    LONGEST_CORRECTION,
    Manifold,
    correct,
    correction_space,
)

# Largest distance of samples along a curve [rad or m], configuration norm.
SPACING = 0.1
# Corrections of a sample before its step is halved.
_CORRECTIONS = 6
# Smallest step as a share of the largest: a curve ends there.
_SMALLEST_STEP = 1.0 / 64.0
# Neighbours with tangents at more than acos of this may be on different branches.
_ALIGNED = 0.93
# A configuration this near [rad or m] to a curve's polyline is on the curve.
ON_CURVE = 0.02
# Largest number of samples of a curve.
_MAX_SAMPLES = 5000
# One in this many samples of a curve is a seed at the next waypoint.
_CARRIED = 6


# States of the continuation of a curve: it goes on …
GOING = 0
# … is back at its start …
CLOSED = 1
# … or ends.
ENDED = 2


@kernel
def walk(
    start: Array,
    tangent: Array,
    target: Array,
    chains: Array,
    revolute: Flags,
    layout: Layout,
    spacing: float,
    samples: Array,
) -> tuple[int, bool]:
    """Follow a self-motion curve from `start` (n,) along `tangent`.

    Sets `samples` (K, n); returns their number, and whether they lead back to the start.
    """
    n, tips = len(start), layout.shape[0]
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    tangents, q = np.empty((3, n)), np.empty(n)
    for k in range(n):
        samples[0, k], q[k] = start[k], start[k] + spacing * tangent[k]
        for i in range(3):
            tangents[i, k] = tangent[k]
    state, code = np.array([spacing, 0.0, 1.0, spacing]), GOING
    space = np.empty(correction_space(n, rows_of(layout)))
    while code == GOING:
        place_tips(q, chains, r, p, rotations, positions, jacobians)
        code = _advance(
            q,
            jacobians,
            rotations,
            positions,
            target,
            layout,
            revolute,
            samples,
            tangents,
            state,
            space,
        )
    return int(state[2]), code == CLOSED


@inlined
def _advance(
    q: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    target: Array,
    layout: Layout,
    revolute: Flags,
    samples: Array,
    tangents: Array,
    state: Array,
    space: Array,
) -> int:
    """Advance the continuation of a self-motion curve by one evaluation of the Jacobian.

    q is the iterate at which the Jacobian was taken, and on return the one to take it at next.
    `samples` (K, n) receives the curve. `tangents` (3, n): at the last sample, at the iterate, at
    the start. `state`: step, corrections and samples so far, largest step. `space` is to
    work in.
    """
    n, count = q.shape[0], int(state[2])
    last = samples[count - 1]
    length = correct(
        q, jacobians, rotations, translations, target, layout, tangents[1], state[3], space
    )
    state[1] += 1
    if length > CONVERGED and state[1] < _CORRECTIONS:
        return GOING
    moved, cosine = 0.0, 0.0
    for k in range(n):
        moved += (q[k] - last[k]) ** 2
        cosine += tangents[0, k] * tangents[1, k]
    moved = np.sqrt(moved)
    # NaN fails these comparisons, too.
    sound = 0.0 <= length <= CONVERGED and cosine > _ALIGNED
    if sound and 0.3 * state[0] < moved < 1.2 * state[0]:
        for k in range(n):
            samples[count, k] = q[k]
        state[2] = count + 1
        if count >= 3 and _passes_start(samples, count, revolute, tangents):
            return CLOSED
        if count + 1 == samples.shape[0]:
            return ENDED
        for k in range(n):
            tangents[0, k] = tangents[1, k]
        state[0] = min(state[3], 1.5 * state[0])
        last = samples[count]
    else:
        state[0] *= 0.5
        if state[0] < _SMALLEST_STEP * state[3]:
            return ENDED
        for k in range(n):
            tangents[1, k] = tangents[0, k]
    state[1] = 0
    for k in range(n):
        q[k] = last[k] + state[0] * tangents[0, k]
    return GOING


@inlined
def _passes_start(samples: Array, count: int, revolute: Flags, tangents: Array) -> bool:
    """Whether the last segment passes the start, modulo turns; it is then cut there."""
    n = samples.shape[1]
    square, dot, cosine = 0.0, 0.0, 0.0
    home = np.empty(n)
    for k in range(n):
        home[k] = wrapped(samples[0, k] - samples[count - 1, k], revolute[k])
        segment = samples[count, k] - samples[count - 1, k]
        square += segment**2
        dot += segment * home[k]
        cosine += tangents[1, k] * tangents[2, k]
    share = dot / square
    if cosine < 0.5 or share < -0.05 or share > 1.05:
        return False
    distance = 0.0
    for k in range(n):
        segment = samples[count, k] - samples[count - 1, k]
        distance += (home[k] - share * segment) ** 2
    if distance > 0.0625 * square:
        return False
    for k in range(n):
        samples[count, k] = samples[count - 1, k] + home[k]
    return True


@kernel
def locate(
    q: Array, samples: Array, curve: Ints, revolute: Flags, near: float
) -> tuple[int, float, float]:
    """Return the nearest segment's first sample, the share along it, and the distance to q.

    `samples` (K, n) are polylines one after the other, `curve` (K,) has their numbers. Only
    segments that start within `near` of q in each coordinate count; -1 for none.
    """
    n, count = samples.shape[1], samples.shape[0]
    best, best_share, best_square = -1, 0.0, np.inf
    offset, segment = np.empty(n), np.empty(n)
    for i in range(count - 1):
        if curve[i] != curve[i + 1]:
            continue
        dot, square, total, far = 0.0, 0.0, 0.0, False
        for k in range(n):
            offset[k] = wrapped(q[k] - samples[i, k], revolute[k])
            if abs(offset[k]) > near:
                far = True
                break
            segment[k] = samples[i + 1, k] - samples[i, k]
            dot += offset[k] * segment[k]
            square += segment[k] ** 2
        if far:
            continue
        share = min(1.0, max(0.0, dot / square)) if square > 0.0 else 0.0
        for k in range(n):
            total += (offset[k] - share * segment[k]) ** 2
            if total > best_square:
                break
        if total < best_square:
            best, best_share, best_square = i, share, total
    return best, best_share, np.sqrt(best_square)


@kernel
def locate_all(
    q: Array, samples: Array, curve: Ints, revolute: Flags, near: float
) -> tuple[Ints, Array, Array]:
    """Return the nearest segment to each of q (K, n); see `locate`."""
    segments, shares = np.empty(len(q), dtype=np.int64), np.empty(len(q))
    distances = np.empty(len(q))
    for k in range(len(q)):
        segments[k], shares[k], distances[k] = locate(q[k], samples, curve, revolute, near)
    return segments, shares, distances


@dataclass(frozen=True, eq=False)
class Curve:
    """One self-motion curve as a polyline.

    Attributes
    ----------
    q : (K, n)
        Configurations [rad or m] in order, revolute joints without wrapping, joint limits not
        regarded. Of a closed curve the last one is the first one modulo turns.
    closed : bool
        False where it ends in a singular configuration.
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
        # Segments are at most 1.2 spacings long.
        self._near = 1.5 * spacing + ON_CURVE
        self._samples = np.empty((0, len(revolute)))
        self._arcs = np.empty(0)
        self._curve = np.empty(0, dtype=np.intp)
        self._first: list[int] = []

    def add(self, curve: Curve) -> None:
        """Add a curve."""
        index = np.full(len(curve.q), len(self.curves))
        self._first.append(len(self._samples))
        self.curves.append(curve)
        self._samples = np.vstack([self._samples, curve.q])
        self._arcs = np.concatenate([self._arcs, curve.arc])
        self._curve = np.concatenate([self._curve, index])

    def locate(self, q: Array) -> tuple[Ints, Array]:
        """Return the curves that q (K, n) are on, -1 for none, and the arc lengths there, (K,)."""
        if not self.curves or not len(q):
            return np.full(len(q), -1), np.zeros(len(q))
        i, share, distance = locate_all(q, self._samples, self._curve, self._revolute, self._near)
        found = distance < ON_CURVE
        # Rows without a curve may take any segment.
        i = np.where(found, i, 0)
        arc = self._arcs[i] + share * (self._arcs[i + 1] - self._arcs[i])
        return np.where(found, self._curve[i], -1), arc

    def at(self, curve: Ints, arc: Array) -> Array:
        """Return the points of the polylines of curves (K,) at arc lengths (K,), (K, n)."""
        starts = np.array(self._first)
        # Arc lengths of all curves, one after the other.
        ends = np.cumsum([each.length + 1.0 for each in self.curves])
        before = np.concatenate([[0.0], ends[:-1]])
        along = self._arcs + before[self._curve]
        last = np.append(starts[1:], len(self._arcs)) - 1
        i = np.searchsorted(along, arc + before[curve])
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
        samples, on = np.empty((_MAX_SAMPLES, self.coordinates.dof)), self._manifold
        count, closed = walk(
            start, tangent, target, on.chains, on.revolute, on.layout, self.spacing, samples
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
    found: list[CurveSet] = []
    for i, x in enumerate(target):
        progress("search: self-motions at waypoint", i + 1, len(target))
        here = CurveSet(motion.revolute, motion.spacing)
        if i > 0:
            motion.complete(here, x, found[-1].seeds())
        if i % every == 0 or i == len(target) - 1:
            motion.complete(here, x, seeds, far=True)
        found.append(here)
    for i in range(len(target) - 2, -1, -1):
        motion.complete(found[i], target[i], found[i + 1].seeds())
    return found
