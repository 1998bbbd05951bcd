"""What numba compiles for self-motion curves: Newton's corrector, continuation, nearest point."""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.robot import place_tips
from selfmotion.search.edges import wrapped
from selfmotion.search.projection import CONVERGED, correct
from selfmotion.search.settings import ALIGNED, CORRECTIONS, SMALLEST_STEP

# What is known of a curve on the way.
GOING, CLOSED, ENDED = 0, 1, 2


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

    Sets `samples` (K, n); returns how many there are, and whether they lead back to the start.
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
) -> int:
    """Advance the continuation of a self-motion curve by one evaluation of the Jacobian.

    q is the iterate at which the Jacobian was taken, and on return the one to take it at next.
    `samples` (K, n) receives the curve. `tangents` (3, n): at the last sample, at the iterate, at
    the start. `state`: step, corrections so far, samples so far, largest step.
    """
    n, count = q.shape[0], int(state[2])
    last = samples[count - 1]
    length = correct(q, jacobians, rotations, translations, target, layout, tangents[1], state[3])
    state[1] += 1
    if length > CONVERGED and state[1] < CORRECTIONS:
        return GOING
    moved, cosine = 0.0, 0.0
    for k in range(n):
        moved += (q[k] - last[k]) ** 2
        cosine += tangents[0, k] * tangents[1, k]
    moved = np.sqrt(moved)
    # NaN fails these comparisons, too.
    sound = 0.0 <= length <= CONVERGED and cosine > ALIGNED
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
        if state[0] < SMALLEST_STEP * state[3]:
            return ENDED
        for k in range(n):
            tangents[1, k] = tangents[0, k]
    state[1] = 0
    for k in range(n):
        q[k] = last[k] + state[0] * tangents[0, k]
    return GOING


@inlined
def _passes_start(samples: Array, count: int, revolute: Flags, tangents: Array) -> bool:
    """Whether the last segment passes the start, modulo turns; then it is made to end there."""
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

    `samples` (K, n) are polylines one after the other, `curve` (K,) says which one each is of.
    Only segments that start within `near` of q in each coordinate count; -1 when there is none.
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
