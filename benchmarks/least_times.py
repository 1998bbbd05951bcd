"""The least time of a joint path within limits, on a fine grid: programmes that HiGHS solves.

Nothing here is shared with the paces that it judges: b = (ds/dt)² has values at the nodes of a grid
over a parameter s of the joint path, closer towards both ends; accelerations are those of a b that
is linear between two nodes, jerks by differences over three. Limits of the jerk make a sequence of
programmes: 1/√b in |q''' b + 3/2 q'' b' + ½ q' b''| ≤ J/√b is replaced by its tangent at the b
before, which lies below it (F. Debrouwere et al., IEEE Trans. Automatic Control 58(12), 2013).
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import linprog
from scipy.sparse import coo_array, csr_array, vstack

from selfmotion.basics import Array
from selfmotion.model.motion import Trajectory

# HiGHS gives up on a programme after so many seconds.
PATIENCE = 60.0
# Samples of the joint path, equally far apart, through which its spline goes.
SAMPLES = 12_000
# Where a path turns by more than so many times the median, nodes are no closer.
TURN = 30.0
# How many times as large b may become in each programme, and as small; the last ones are careful.
TRUST = (30.0, 30.0, 9.0, 9.0, 9.0, 4.0, 4.0, 4.0, 2.0, 2.0, 2.0, 1.5, 1.5)
# A programme that gains less than this share is the last but those that are careful.
GAIN = 2e-4
# From rest at its largest jerk J a joint goes on by s = J t³/6, so that b = this J^(2/3) s^(4/3).
FROM_REST = 6.0 ** (4.0 / 3.0) / 4.0


def gridded(motion: Trajectory, count: int, power: float) -> tuple[Array, Array, Array, Array]:
    """Return a grid s (count + 1,) of a joint path, and q' to q''' on it.

    Half of the nodes are shared out by the length, half by how much the path turns. Towards both
    ends they are as near to each other as those of x^power near 0 are.
    """
    t = np.linspace(motion.t[0], motion.t[-1], 50_001)
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(motion(t), axis=0), axis=1)))
    q = motion(np.interp(np.linspace(0.0, length[-1], SAMPLES + 1), length, t))
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    path = CubicSpline(way, q)
    x = np.linspace(-1.0, 1.0, count + 1)
    near = 1.0 - np.abs(x)
    graded = 0.5 * np.minimum(near, 0.1 * (near / 0.1) ** power)
    grid = np.where(x < 0.0, graded, 1.0 - graded)
    share = (grid - grid[0]) / (grid[-1] - grid[0])
    turn = np.linalg.norm(path(way, 2), axis=1)
    # At a rest a spline's second derivatives are rounding.
    turn = np.minimum(turn, TURN * np.median(turn))
    turned = np.append(0.0, np.cumsum(0.5 * (turn[1:] + turn[:-1]) * np.diff(way)))
    s = np.interp(share, 0.5 * (way / way[-1] + turned / turned[-1]), way)
    return s, path(s, 1), path(s, 2), path(s, 3)


def rows_at(weights: list[Array], columns: list[Array], count: int) -> csr_array:
    """Return rows (K n) with weights (K, n) in columns (K,), of a table with so many columns."""
    rows = np.arange(weights[0].size)
    n = weights[0].shape[1]
    return coo_array(
        (
            np.concatenate([w.ravel() for w in weights]),
            (np.tile(rows, len(weights)), np.concatenate([np.repeat(c, n) for c in columns])),
        ),
        shape=(len(rows), count),
    ).tocsr()


def acceleration_rows(s: Array, first: Array, second: Array, limit: Array) -> csr_array:
    """Return (q'' b + ½ q' b') / A at both ends of each interval, b linear in between."""
    k, h = np.arange(len(s) - 1), np.diff(s)[:, None]
    blocks = []
    for at in (k, k + 1):
        slope = first[at] / (2.0 * h) / limit
        parts = [-slope, slope, second[at] / limit]
        blocks.append(rows_at(parts, [k, k + 1, at], len(s)))
    return vstack(blocks, format="csr")


def jerk_rows(s: Array, orders: tuple[Array, Array, Array], limit: Array) -> csr_array:
    """Return (q''' b + 3/2 q'' b' + ½ q' b'') / J at the inner nodes, by differences over three."""
    first, second, third = (order[1:-1] / limit for order in orders)
    before, after = np.diff(s)[:-1, None], np.diff(s)[1:, None]
    both = before + after
    slopes = -after / (before * both), (after - before) / (before * after), before / (after * both)
    bends = 2.0 / (before * both), -2.0 / (before * after), 2.0 / (after * both)
    parts = [1.5 * second * d + 0.5 * first * dd for d, dd in zip(slopes, bends, strict=True)]
    parts[1] = parts[1] + third
    k = np.arange(1, len(s) - 1)
    return rows_at(parts, [k - 1, k, k + 1], len(s))


def time_of(s: Array, b: Array) -> float:
    """Return the time of a way at squared rates that are linear in between."""
    rate = np.sqrt(np.maximum(b, 0.0))
    return float((2.0 * np.diff(s) / (rate[1:] + rate[:-1])).sum())


def largest(gradient: Array, rows: csr_array, right: Array, least: Array, most: Array) -> Array:
    """Return the b that maximises a gradient's product within rows and bounds."""
    found = linprog(
        -gradient,
        A_ub=rows,
        b_ub=right,
        bounds=np.column_stack([least, most]),
        method="highs-ds",
        options={"time_limit": PATIENCE},
    )
    if found.status != 0:
        raise RuntimeError(f"HiGHS: {found.message}")
    return np.asarray(found.x)


def least_time(motion: Trajectory, velocity: Array, acceleration: Array, count: int) -> float:
    """Return the least time by limits of velocity and acceleration on a grid."""
    s, first, second, _ = gridded(motion, count, 1.0)
    return time_of(s, _without_jerk(s, first, second, velocity, acceleration))


def _without_jerk(
    s: Array, first: Array, second: Array, velocity: Array, acceleration: Array
) -> Array:
    rows = acceleration_rows(s, first, second, acceleration)
    most = _most(first, velocity)
    both, right = vstack([rows, -rows], format="csr"), np.ones(2 * rows.shape[0])
    return largest(np.ones(len(s)), both, right, np.zeros(len(s)), most)


def _most(first: Array, velocity: Array) -> Array:
    most: Array = (velocity / np.maximum(np.abs(first), 1e-12)).min(axis=1) ** 2
    most[[0, -1]] = 0.0
    return most


def least_time_with_jerk(
    motion: Trajectory, velocity: Array, acceleration: Array, jerk: Array, count: int
) -> float:
    """Return the least time found by a sequence of programmes, limits of the jerk among them."""
    s, *orders = gridded(motion, count, 3.0)
    most = _most(orders[0], velocity)
    for node, inner, h in ((0, 1, s[1]), (-1, -2, s[-1] - s[-2])):
        least = (jerk / np.maximum(np.abs(orders[0][node]), 1e-12)).min()
        most[inner] = min(most[inner], FROM_REST * least ** (2.0 / 3.0) * h ** (4.0 / 3.0))
    bent = acceleration_rows(s, orders[0], orders[1], acceleration)
    surge = jerk_rows(s, (orders[0], orders[1], orders[2]), jerk)
    b = np.minimum(_without_jerk(s, orders[0], orders[1], velocity, acceleration), most)
    inner = np.arange(1, len(s) - 1)
    n, times = orders[0].shape[1], []
    weights = np.append(np.diff(s), 0.0) + np.append(0.0, np.diff(s))
    for trust in TRUST:
        near = np.maximum(b, 1e-9 * b.max())
        # J/√b ≥ (J/√b₀) (3 - b/b₀)/2, times √b₀.
        root = np.repeat(np.sqrt(near[inner]), n)[:, None]
        own = rows_at([np.repeat(0.5 / near[inner, None], n, axis=1)], [inner], len(s))
        scaled = surge.multiply(root).tocsr()
        found = largest(
            weights * near**-1.5 / (weights * near**-1.5).mean(),
            vstack([bent, -bent, scaled + own, own - scaled], format="csr"),
            np.concatenate([np.ones(2 * bent.shape[0]), np.full(2 * surge.shape[0], 1.5)]),
            np.zeros(len(s)),
            np.minimum(most, trust * near),
        )
        b = np.maximum(found, near / trust) * (most > 0.0)
        times.append(time_of(s, found) if (found[1:-1] > 0.0).all() else np.inf)
        if len(times) > 4 and abs(times[-1] / times[-2] - 1.0) < GAIN:
            break
    return min(times[1:])
