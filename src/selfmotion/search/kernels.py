"""What numba compiles for self-motion curves: Newton's corrector, continuation, nearest segment."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, inlined, kernel
from selfmotion.kernels import (
    KIND,
    Layout,
    Rows,
    cholesky,
    gram,
    part,
    pose_error,
    rows_of,
    select,
    solve_cholesky,
    task_rows,
)
from selfmotion.robot import ChainArrays, TreeArrays, compose, placements

Mask = npt.NDArray[np.bool_]

# What is known of a curve on the way.
GOING, CLOSED, ENDED = 0, 1, 2

# A Newton correction of this size [rad or m] leaves an error of its square.
CONVERGED = 1e-6
_CORRECTIONS = 6
# Neighbours whose tangents differ by more than acos of this are too far apart to be trusted to
# lie on the same branch.
_ALIGNED = 0.93
# Steps are halved no further than this share of the largest.
_SMALLEST_STEP = 1.0 / 64.0


@kernel
def wrapped(difference: float, revolute: bool) -> float:
    """Return the difference of two coordinates, modulo a turn where the joint is revolute."""
    if revolute:
        turns = np.floor(difference / (2.0 * np.pi) + 0.5)
        return float(difference - 2.0 * np.pi * turns)
    return difference


@kernel
def correct(
    q: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    target: Array,
    layout: Layout,
    tangent: Array,
    longest: float,
) -> float:
    """Add J⁺e to q, no longer than `longest`, and project `tangent` onto the null space of J.

    Of all tips, (F, 6, n), (F, 3, 3) and (F, 3); `target` (12 F,) is as `Follows.targets` has it.
    Returns the norm of the correction
    before it was shortened; -1 where J has no full rank.
    """
    n, m = jacobians.shape[2], rows_of(layout)
    error, z, along = np.zeros(6), np.empty(m), np.zeros(m)
    jacobian, factor = np.empty((m, n)), np.empty((m, m))
    for f in range(layout.shape[0]):
        place, turn = part(target, 12 * f, (3,)), part(target, 12 * f + 3, (3, 3))
        pose_error(layout[f, KIND], place, turn, translations[f], rotations[f], error)
        select(layout, f, rotations[f], error, z)
        task_rows(layout, f, rotations[f], jacobians[f], jacobian)
    for i in range(m):
        for k in range(n):
            along[i] += jacobian[i, k] * tangent[k]
    gram(jacobian, factor)
    if not cholesky(factor):
        return -1.0
    solve_cholesky(factor, z)
    solve_cholesky(factor, along)
    length, norm = 0.0, 0.0
    step = np.zeros(n)
    for k in range(n):
        for i in range(m):
            step[k] += jacobian[i, k] * z[i]
            tangent[k] -= jacobian[i, k] * along[i]
        length += step[k] ** 2
        norm += tangent[k] ** 2
    length, norm = np.sqrt(length), np.sqrt(norm)
    scale = longest / length if length > longest else 1.0
    for k in range(n):
        q[k] += scale * step[k]
        tangent[k] /= norm
    return float(length)


@kernel
def walk(
    start: Array,
    tangent: Array,
    target: Array,
    chains: tuple[ChainArrays, ...],
    revolute: Mask,
    layout: Layout,
    spacing: float,
    samples: Array,
) -> tuple[int, bool]:
    """Follow a self-motion curve from `start` (n,) along `tangent`.

    Sets `samples` (K, n); returns how many there are, and whether they lead back to the start.
    """
    n, tips = len(start), layout.shape[0]
    r, p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians = np.zeros((tips, 6, n))
    tangents, q = np.empty((3, n)), np.empty(n)
    for k in range(n):
        samples[0, k], q[k] = start[k], start[k] + spacing * tangent[k]
        for i in range(3):
            tangents[i, k] = tangent[k]
    state, code = np.array([spacing, 0.0, 1.0, spacing]), GOING
    while code == GOING:
        _place(q, chains, r, p, rotations, positions, jacobians)
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
    revolute: Mask,
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
def _passes_start(samples: Array, count: int, revolute: Mask, tangents: Array) -> bool:
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
    q: Array, samples: Array, curve: Rows, revolute: Mask, near: float
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
def extend(
    before: Array,
    cost: Array,
    after: Array,
    largest_step: Array,
    turning: Mask,
    weights: Array,
    reach: Array,
    parent: Rows,
) -> None:
    """Set `reach` (M,), the least cost at `after` (M, n) over steps from `before` (N, n).

    The cost of a step is Σ w|Δq| with `weights` (n,); `turning` joints count modulo turns. `before`
    is sorted by its first joint unless that one turns. `parent` is -1 where no step is short
    enough.
    """
    n, many = after.shape[1], before.shape[0]
    for j in range(after.shape[0]):
        reach[j], parent[j] = np.inf, -1
        first = 0
        if not turning[0]:
            first = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(first, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            total = cost[i]
            for k in range(n):
                step = abs(wrapped(after[j, k] - before[i, k], turning[k]))
                total += weights[k] * step
                if step > largest_step[k] or total >= reach[j]:
                    total = np.inf
                    break
            if total < reach[j]:
                reach[j], parent[j] = total, i


@kernel
def near_pairs(
    before: Array, after: Array, largest_step: Array, turning: Mask
) -> tuple[Rows, Rows]:
    """Return the pairs of nodes (P,), (P,) from `before` (N, n) to `after` (M, n) that are near.

    No joint may move by more than `largest_step`; otherwise as `extend`.
    """
    n, many = after.shape[1], before.shape[0]
    room = 4 * (many + after.shape[0])
    first, second = np.empty(room, dtype=np.intp), np.empty(room, dtype=np.intp)
    count = 0
    for j in range(after.shape[0]):
        begin = 0
        if not turning[0]:
            begin = int(np.searchsorted(before[:, 0], after[j, 0] - largest_step[0]))
        for i in range(begin, many):
            if not turning[0] and before[i, 0] > after[j, 0] + largest_step[0]:
                break
            near = True
            for k in range(n):
                if abs(wrapped(after[j, k] - before[i, k], turning[k])) > largest_step[k]:
                    near = False
                    break
            if near:
                if count == room:
                    room *= 2
                    longer = np.empty((2, room), dtype=np.intp)
                    longer[0, :count], longer[1, :count] = first, second
                    first, second = longer[0], longer[1]
                first[count], second[count] = i, j
                count += 1
    return first[:count].copy(), second[:count].copy()


@kernel
def spread_out(q: Array, apart: Array, most: int) -> Rows:
    """Return the rows of q (K, n) to keep, at most so many: the earlier ones of near ones.

    First those farther from all kept ones in some coordinate than apart[0], then apart[1], ….
    """
    n, many = q.shape[1], len(q)
    kept, count = np.empty(min(most, many), dtype=np.intp), 0
    taken = np.zeros(many, dtype=np.bool_)
    for distance in apart:
        for k in range(many):
            if taken[k] or count == len(kept):
                continue
            alone = True
            for other in range(count):
                far = False
                for i in range(n):
                    if abs(q[k, i] - q[kept[other], i]) > distance:
                        far = True
                        break
                if not far:
                    alone = False
                    break
            if alone:
                taken[k], kept[count] = True, k
                count += 1
    return kept[:count]


@kernel
def cheapest(
    first: Rows, second: Rows, price: Array, cost: Array, reach: Array, parent: Rows
) -> None:
    """Lower `reach` (M,) to the least cost over steps with prices (P,), and set `parent`."""
    for k in range(len(first)):
        total = cost[first[k]] + price[k]
        if total < reach[second[k]]:
            reach[second[k]], parent[second[k]] = total, first[k]


@kernel
def project_all(
    q: Array,
    targets: Array,
    chains: tuple[ChainArrays, ...],
    layout: Layout,
    lower: Array,
    upper: Array,
    longest: float,
    steps: int,
    arrived: Mask,
) -> None:
    """Put each of q (K, n) onto its target (K, 12 F) by Newton's method, in place.

    A joint that would leave its limits stays at the limit, and the others do the rest. `arrived`
    (K,) says of which that was possible within so many steps.
    """
    n, tips = q.shape[1], layout.shape[0]
    r, p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, unused = np.zeros((tips, 6, n)), np.empty(n)
    held = np.zeros(n, dtype=np.bool_)
    for k in range(len(q)):
        arrived[k] = False
        for j in range(n):
            held[j] = False
        length = np.inf
        for _ in range(steps):
            inside = True
            for j in range(n):
                if q[k, j] < lower[j] or q[k, j] > upper[j]:
                    q[k, j] = min(max(q[k, j], lower[j]), upper[j])
                    held[j], inside = True, False
            if inside and length < CONVERGED:
                arrived[k] = True
                break
            _place(q[k], chains, r, p, rotations, positions, jacobians)
            for j in range(n):
                unused[j] = 1.0
                if held[j]:
                    for f in range(tips):
                        for i in range(6):
                            jacobians[f, i, j] = 0.0
            length = correct(
                q[k], jacobians, rotations, positions, targets[k], layout, unused, longest
            )
            # Singular, or not a number.
            if not length >= 0.0:
                break


@inlined
def _place(
    q: Array,
    chains: tuple[ChainArrays, ...],
    r: Array,
    p: Array,
    rotations: Array,
    positions: Array,
    jacobians: Array,
) -> None:
    """Set the tips' places, and their Jacobians (F, 6, n), at q (n,)."""
    for f in range(len(chains)):
        tree, tip_rotation, tip_position = chains[f]
        placements(
            q,
            tree.joints,
            tree.parents,
            tree.rotations,
            tree.positions,
            tree.axes,
            tree.is_revolute,
            r,
            p,
        )
        last = len(tree.joints)
        compose(r[last], p[last], tip_rotation, tip_position, rotations[f], positions[f])
        _jacobian(r, p, tree, positions[f], jacobians[f])


@inlined
def _jacobian(r: Array, p: Array, tree: TreeArrays, tip: Array, jacobian: Array) -> None:
    """Write the columns of a tip's Jacobian [v, ω] (6, n) at its origin, in the base's axes."""
    axis = np.empty(3)
    for j in range(len(tree.joints)):
        column = tree.joints[j]
        for a in range(3):
            axis[a] = 0.0
            for b in range(3):
                axis[a] += r[j + 1, a, b] * tree.axes[j, b]
        if tree.is_revolute[j]:
            x, y, z = tip[0] - p[j + 1, 0], tip[1] - p[j + 1, 1], tip[2] - p[j + 1, 2]
            jacobian[0, column] = axis[1] * z - axis[2] * y
            jacobian[1, column] = axis[2] * x - axis[0] * z
            jacobian[2, column] = axis[0] * y - axis[1] * x
            for a in range(3):
                jacobian[3 + a, column] = axis[a]
        else:
            for a in range(3):
                jacobian[a, column], jacobian[3 + a, column] = axis[a], 0.0
