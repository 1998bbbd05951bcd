"""What numba compiles of Newton's method onto a path whose rows are relaxed: joints and deviation.

The deviation δ (6,) of the first tip's path, x, y, z [m] and the rotation vector [rad], is unknown
along with q: with the path's pose (p, R) and Q = I or R, the target is p + Q δ_v, R exp(δ_ω), and a
step solves J dq - E dδ = e with the least |dq|² + |dδ|², E = [Q, R Jl(δ_ω)]. A δ that leaves its
band is put back onto the border, and stays there: it may move along it.
"""

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, kernel
from selfmotion.basics.layout import Layout
from selfmotion.kernels import cholesky, errors_and_rows, gram, rows_of, solve_cholesky
from selfmotion.robot import place_tips
from selfmotion.search.projection import CONVERGED, correct, stopped
from selfmotion.search.settings import LITTLE_GAIN, LITTLE_GAINS

# Below this angle [rad] the closed forms of a rotation lose digits and their series serve.
_SMALL = 1e-3
# What a solution may miss by [m, rad].
NOTHING_LEFT = 1e-12


@kernel
def project_relaxed(
    q: Array,
    deviation: Array,
    target: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    groups: Ints,
    bands: Array,
    in_tool_axes: bool,
    longest: float,
    steps: int,
    arrived: Flags,
) -> None:
    """Put each of q (K, n) and its deviation (K, 6) onto a relaxed target (12 F,), in place.

    Row i is relaxed with others of the same number in `groups` (6,), whose band is that of `bands`
    (6,); -1 for rows that are not. Joints stop at their limits as in `project_all`. `arrived` (K,)
    says of which it was possible within so many steps.
    """
    n, tips = q.shape[1], layout.shape[0]
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, wide = np.zeros((tips, 6, n)), np.zeros((tips, 6, n + 6))
    held, bound = np.zeros(n, dtype=np.bool_), np.zeros(6, dtype=np.bool_)
    both, unused, moved = np.empty(n + 6), np.empty(n + 6), target.copy()
    for k in range(len(q)):
        arrived[k], held[:], bound[:] = False, False, False
        length, delta = np.inf, deviation[k]
        for _ in range(steps):
            inside = stopped(q[k], lower, upper, held)
            inside = put_back(delta, groups, bands, bound) and inside
            if inside and length < CONVERGED:
                arrived[k] = True
                break
            place_tips(q[k], chains, r, p, rotations, positions, jacobians)
            for j in range(n):
                both[j] = q[k, j]
                for f in range(tips):
                    for i in range(6):
                        wide[f, i, j] = 0.0 if held[j] else jacobians[f, i, j]
            both[n:] = delta
            unused[:] = 1.0
            displace(target, delta, in_tool_axes, moved, wide[0, :, n:])
            along_border(delta, groups, bound, wide[0, :, n:])
            length = correct(both, wide, rotations, positions, moved, layout, unused, longest)
            # Singular, or not a number.
            if not length >= 0.0:
                break
            q[k], delta[:] = both[:n], both[n:]


@kernel
def approach_all(
    q: Array,
    deviation: Array,
    target: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    groups: Ints,
    bands: Array,
    in_tool_axes: bool,
    iterations: int,
    misses: Array,
) -> None:
    """Bring each of q (K, n) and its deviation (K, 6) as near to a target as limits let it.

    Levenberg-Marquardt with steps that are cut off at the limits and bands, which arrives also
    where Newton's method does not, and at the nearest place where nothing arrives. `misses` (K, m)
    are what is left in the rows [m, rad]; infinite where that is no number from the beginning.
    """
    n, tips, m = q.shape[1], layout.shape[0], rows_of(layout)
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, wide = np.zeros((tips, 6, n)), np.zeros((tips, 6, n + 6))
    error, step, moved = np.empty(m), np.empty(m), target.copy()
    jacobian, factor, steep = np.empty((m, n + 6)), np.empty((m, m)), np.empty((m, n + 6))
    trial, delta, bound = np.empty(n), np.empty(6), np.zeros(6, dtype=np.bool_)
    for k in range(len(q)):
        damping, best, idle = 1e-3, np.inf, 0
        trial[:], delta[:], error[:] = q[k], deviation[k], np.inf
        for _ in range(iterations):
            for j in range(n):
                trial[j] = min(max(trial[j], lower[j]), upper[j])
            bound[:] = False
            put_back(delta, groups, bands, bound)
            place_tips(trial, chains, r, p, rotations, positions, jacobians)
            wide[:, :, :n] = jacobians
            displace(target, delta, in_tool_axes, moved, wide[0, :, n:])
            along_border(delta, groups, bound, wide[0, :, n:])
            errors_and_rows(layout, moved, wide, rotations, positions, step, steep)
            size = 0.0
            for i in range(m):
                size += step[i] ** 2
            if size < best:
                idle = idle + 1 if size > (1.0 - LITTLE_GAIN) * best else 0
                best, damping = size, max(0.1 * damping, 1e-14)
                error[:], jacobian[:], q[k], deviation[k] = step, steep, trial, delta
                hold(q[k], lower, upper, error, jacobian)
            else:
                damping *= 10.0
                # Before anything is known it is not a number: there is no way on from there.
                if damping > 1e6 or best == np.inf:
                    break
            if best < NOTHING_LEFT**2 or idle == LITTLE_GAINS:
                break
            gram(jacobian, factor)
            for i in range(m):
                factor[i, i] += damping
                step[i] = error[i]
            if not cholesky(factor):
                break
            solve_cholesky(factor, step)
            for j in range(n + 6):
                along = 0.0
                for i in range(m):
                    along += jacobian[i, j] * step[i]
                if j < n:
                    trial[j] = q[k, j] + along
                else:
                    delta[j - n] = deviation[k, j - n] + along
        misses[k] = error


@called
def hold(q: Array, lower: Array, upper: Array, error: Array, jacobian: Array) -> None:
    """Take the joints at limits that a step would leave out of J (m, n + 6)."""
    for j in range(len(q)):
        slope = 0.0
        for i in range(len(error)):
            slope += jacobian[i, j] * error[i]
        if (q[j] <= lower[j] and slope < 0.0) or (q[j] >= upper[j] and slope > 0.0):
            jacobian[:, j] = 0.0


@called
def put_back(delta: Array, groups: Ints, bands: Array, bound: Flags) -> bool:
    """Put δ (6,) back into its bands; return whether it was inside, up to rounding.

    `bound` (6,) notes, by the group's number, those whose border was reached.
    """
    inside = True
    for g in range(6):
        size = 0.0
        for i in range(6):
            if groups[i] == g:
                size += delta[i] ** 2
        size = np.sqrt(size)
        if size > bands[g]:
            inside = inside and size < bands[g] * (1.0 + 1e-6)
            bound[g] = True
            for i in range(6):
                if groups[i] == g:
                    delta[i] *= bands[g] / size
    return inside


@called
def along_border(delta: Array, groups: Ints, bound: Flags, columns: Array) -> None:
    """Take out of E (6, 6) what is not relaxed, and what leads across borders that δ is on."""
    for i in range(6):
        if groups[i] < 0:
            columns[:, i] = 0.0
    for g in range(6):
        if not bound[g]:
            continue
        square = 0.0
        for i in range(6):
            if groups[i] == g:
                square += delta[i] ** 2
        for row in range(6):
            across = 0.0
            for i in range(6):
                if groups[i] == g:
                    across += columns[row, i] * delta[i]
            for i in range(6):
                if groups[i] == g:
                    columns[row, i] -= across * delta[i] / square


@called
def displace(target: Array, delta: Array, in_tool_axes: bool, moved: Array, columns: Array) -> None:
    """Set `moved` (12 F,) to a target displaced by δ (6,), and `columns` (6, 6) to -E."""
    turn, slope = np.empty((3, 3)), np.empty((3, 3))
    exponential(delta[3:], turn, slope)
    columns[:] = 0.0
    for i in range(3):
        moved[i] = target[i]
        for j in range(3):
            axis = target[3 + 3 * i + j] if in_tool_axes else (1.0 if i == j else 0.0)
            moved[i] += axis * delta[j]
            columns[i, j] = -axis
            turned = 0.0
            for k in range(3):
                turned += target[3 + 3 * i + k] * turn[k, j]
                columns[3 + i, 3 + j] -= target[3 + 3 * i + k] * slope[k, j]
            moved[3 + 3 * i + j] = turned


@called
def exponential(vector: Array, turn: Array, slope: Array) -> None:
    """Set exp([δ]×) and its left Jacobian Jl(δ) = I + b [δ]× + c [δ]×² for δ (3,), (3, 3) each."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if angle < _SMALL:
        a, b, c = 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
        c = (1.0 - a) / angle**2
    for i in range(3):
        for j in range(3):
            # [δ]×² = δ δᵀ - |δ|² I, and [δ]× has one more axis in each entry off the diagonal.
            same = 1.0 if i == j else 0.0
            square = vector[i] * vector[j] - same * angle**2
            sign = 0.0 if i == j else (1.0 if (j - i) % 3 == 2 else -1.0)
            skew = sign * vector[3 - i - j]
            turn[i, j] = same + a * skew + b * square
            slope[i, j] = same + b * skew + c * square
