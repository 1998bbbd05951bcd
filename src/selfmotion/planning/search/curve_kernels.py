"""Continuation of self-motion curves, and the nearest points on them, compiled."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.model.kernels import rows_of
from selfmotion.model.robot import place_tips
from selfmotion.planning.search.layer_steps import wrapped
from selfmotion.planning.search.manifold import CONVERGED, correct, correction_space

# Corrections of a sample before its step is halved.
_CORRECTIONS = 6
# Smallest step as a share of the largest: a curve ends there.
_SMALLEST_STEP = 1.0 / 64.0
# Factor from a step that was taken to the next one.
_GROWTH = 1.5
# Smallest distance of a sample from the last one, as a share of the step: a nearer one turned back.
_NEAREST = 0.3
# Largest such distance: corrections that lead farther may end on another branch.
_FARTHEST = 1.2
# Smallest cosine between tangents of neighbours: below it they may be on different branches.
_ALIGNED = 0.93
# Smallest cosine between the tangents at the start and where the curve is back at it.
_CLOSING_COSINE = 0.5
# Share of a segment by which the start may be beyond its ends, and still be passed by it.
_OVERSHOOT = 0.05
# Largest distance of the start from a segment that passes it, as a share of the segment's length.
_CLOSING = 0.25
# Columns of a continuation: step, corrections of the iterate, samples so far, largest step.
_STEP, _CORRECTED, _COUNT, _LONGEST = range(4)
# States of a continuation: it goes on …
_GOING = 0
# … is back at its start …
_CLOSED = 1
# … or ends.
_ENDED = 2


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
    state, code = np.array([spacing, 0.0, 1.0, spacing]), _GOING
    space = np.empty(correction_space(n, rows_of(layout)))
    while code == _GOING:
        place_tips(q, chains, r, p, rotations, positions, jacobians)
        code = _correct_or_predict(
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
    return int(state[_COUNT]), code == _CLOSED


@inlined
def _correct_or_predict(
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
    """Make one Newton correction of the iterate; return the state of the continuation.

    Once it has converged it is the next sample, and the next iterate is predicted along the
    tangent; where it does not converge, or strays, the step is halved.

    Parameters
    ----------
    q : (n,)
        The iterate, at which the tips were placed; becomes the next one.
    jacobians, rotations, translations : (F, 6, n), (F, 3, 3), (F, 3)
        Of the tips at q.
    target : (12,)
    layout : Layout
    revolute : (n,)
    samples : (K, n)
        Receives the curve.
    tangents : (3, n)
        At the last sample, at the iterate, at the start.
    state : (4,)
        Its columns are `_STEP`, `_CORRECTED`, `_COUNT` and `_LONGEST`.
    space : array
        To work in; see `correction_space`.
    """
    n, count = q.shape[0], int(state[_COUNT])
    last = samples[count - 1]
    length = correct(
        q, jacobians, rotations, translations, target, layout, tangents[1], state[_LONGEST], space
    )
    state[_CORRECTED] += 1
    if length > CONVERGED and state[_CORRECTED] < _CORRECTIONS:
        return _GOING
    moved, cosine = 0.0, 0.0
    for k in range(n):
        moved += (q[k] - last[k]) ** 2
        cosine += tangents[0, k] * tangents[1, k]
    moved = np.sqrt(moved)
    # NaN fails these comparisons, too.
    sound = 0.0 <= length <= CONVERGED and cosine > _ALIGNED
    if sound and _NEAREST * state[_STEP] < moved < _FARTHEST * state[_STEP]:
        for k in range(n):
            samples[count, k] = q[k]
        state[_COUNT] = count + 1
        if count >= 3 and _passes_start(samples, count, revolute, tangents):
            return _CLOSED
        if count + 1 == samples.shape[0]:
            return _ENDED
        for k in range(n):
            tangents[0, k] = tangents[1, k]
        state[_STEP] = min(state[_LONGEST], _GROWTH * state[_STEP])
        last = samples[count]
    else:
        state[_STEP] *= 0.5
        if state[_STEP] < _SMALLEST_STEP * state[_LONGEST]:
            return _ENDED
        for k in range(n):
            tangents[1, k] = tangents[0, k]
    state[_CORRECTED] = 0
    for k in range(n):
        q[k] = last[k] + state[_STEP] * tangents[0, k]
    return _GOING


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
    if cosine < _CLOSING_COSINE or share < -_OVERSHOOT or share > 1.0 + _OVERSHOOT:
        return False
    distance = 0.0
    for k in range(n):
        segment = samples[count, k] - samples[count - 1, k]
        distance += (home[k] - share * segment) ** 2
    if distance > _CLOSING**2 * square:
        return False
    for k in range(n):
        samples[count, k] = samples[count - 1, k] + home[k]
    return True


@kernel
def nearest_segment(
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
def nearest_segments(
    q: Array, samples: Array, curve: Ints, revolute: Flags, near: float
) -> tuple[Ints, Array, Array]:
    """Return the nearest segment to each of q (K, n); see `nearest_segment`."""
    segments, shares = np.empty(len(q), dtype=np.int64), np.empty(len(q))
    distances = np.empty(len(q))
    for k in range(len(q)):
        segments[k], shares[k], distances[k] = nearest_segment(q[k], samples, curve, revolute, near)
    return segments, shares, distances
