"""One control cycle, compiled: a command near the reference from which the arm can be stopped."""

from math import floor, inf, sqrt

import numpy as np

from selfmotion.basics import Array, inlined, kernel
from selfmotion.basics.layout import KIND, Layout
from selfmotion.model.kernels import (
    at_tip,
    factor_damped,
    pose_error,
    rows_of,
    select,
    solve_cholesky,
    task_rows,
)
from selfmotion.realtime.settings import FOLLOWED, PIVOT

# Commands from which a stop within all limits is possible, for any reference.
#
# The commanded motion is a uniform cubic B-spline. Its control points c follow a double
# integrator,
#
#     w⁺ = w + h a,   c⁺ = c + h w⁺,
#
# with h the control cycle [s]: q is a mean of neighbouring c, q̇ of neighbouring w, and q̈ of
# neighbouring a, with positive weights, so that limits which c, w and a keep at every cycle are
# kept by the motion at all times, between cycles as well. Its acceleration is continuous: it goes
# from one a to the next along a straight line.
#
# A joint that brakes by A in every cycle comes to rest D(w) = h Σ_j max(0, w - j h A) further on
# (j = 1, 2, …). The states with c + D(w) ≤ upper, c - D(-w) ≥ lower and |w| ≤ V are exactly those
# from which it can stop in time, and a = -A (or what brings w to 0) leads from each to another
# one: there is always a next command.
#
# Limits of speed may depend on the position, by e(q, q̇) = max(0, q̇ + o)²/(2a) + q - upper ≤ 0
# and its mirror image (`certificate.BrakingCurves`). Between knots (q, q̇) is a mean, with the
# weights of q̇, of states (c - s h w, w) with 0 ≤ s ≤ 1 (de Boor's recursion for q, once), and e is
# convex: what keeps e ≤ 0 at (c, w) of each cycle, and c within what is kept at w ≤ 0, keeps it at
# all times. A joint that brakes by A ≥ a gets below the curve. By A < a it does as long as w is
# below w° = A o/(a - A), where both have the same slope; from above, it has to stay below the
# parabola c + w²/(2A) that touches the curve at w°.

# Rows of an array of limits, (9, n): lower, upper, speed, acceleration; then of the curves the
# deceleration a, the offset o and where they end, ±inf for none; last, how far the arm is from its
# command.
DECELERATION, OFFSET, CURVE_LOWER, CURVE_UPPER, DEVIATION = 4, 5, 6, 7, 8

# Allowance for rounding of limits: the set is smaller by this, relative to each limit.
_ROUNDING = 1e-9


@inlined
def braking_distance(w: float, most: float, h: float) -> float:
    """Return D(w) for w ≥ 0, deceleration `most` A and cycle `h`."""
    cycles = floor(w / (most * h))
    return h * cycles * (w - 0.5 * most * h * (cycles + 1.0))


@inlined
def fastest(room: float, most: float, h: float) -> float:
    """Return the largest w⁺ after which a joint can stop within `room`.

    It moves by h w⁺ at once, so that D(w⁺ + h A) = room; D is a polygon, inverted in closed form.
    """
    if room == inf:
        return inf
    room = max(room, 0.0)
    cycles = floor(0.5 * (1.0 + sqrt(1.0 + 8.0 * room / (most * h * h))))
    return room / (h * cycles) + 0.5 * most * h * (cycles + 1.0) - most * h


@inlined
def fastest_on_curve(room: float, most: float, hard: float, offset: float, h: float) -> float:
    """Return the largest w⁺ after which a joint stays below its curve as it brakes.

    Parameters
    ----------
    room : float
        Distance of c from the end of the curve [rad or m].
    most : float
        Deceleration A of the joint [rad/s² or m/s²].
    hard, offset : float
        Deceleration a and offset o of the curve.
    h : float
        Cycle [s].
    """
    if room == inf:
        return inf
    # h w + (w + o)²/(2a) = room
    way = max(room + h * offset, 0.0)
    bound = hard * (sqrt(h * h + 2.0 * way / hard) - h) - offset
    if most >= hard:
        return bound
    touching = most * offset / (hard - most)
    if bound <= touching:
        return bound
    # h w + w²/(2A) = the room up to the parabola's end
    square = (touching + offset) * (touching + offset)
    left = room - 0.5 * square / hard + 0.5 * touching * touching / most
    below = most * (sqrt(h * h + 2.0 * max(left, 0.0) / most) - h)
    return min(bound, max(touching, below))


@inlined
def viable_accelerations(
    c: float, w: float, limits: Array, k: int, h: float
) -> tuple[float, float]:
    """Return the least and the largest a after which joint k can still stop, limits (8 or 9, n).

    Never empty: where rounding, or a state from outside, would make it so, it is the harder
    braking.
    """
    most, speed = limits[3, k], limits[2, k]
    hard, offset = limits[DECELERATION, k], limits[OFFSET, k]
    up = min(
        fastest(limits[1, k] - c, most, h),
        fastest_on_curve(limits[CURVE_UPPER, k] - c, most, hard, offset, h),
    )
    down = min(
        fastest(c - limits[0, k], most, h),
        fastest_on_curve(c - limits[CURVE_LOWER, k], most, hard, offset, h),
    )
    high = min(most, (speed - w) / h, (up - w) / h)
    low = max(-most, (-speed - w) / h, (-down - w) / h)
    high, low = max(high, -most), min(low, most)
    if low > high:
        low = high = low if w < 0.0 else high
    return low, high


def tightened(limits: Array) -> Array:
    """Return limits (8, n) reduced by the allowance for rounding."""
    inner = limits.copy()
    inner[[0, CURVE_LOWER]] += _ROUNDING
    inner[[1, CURVE_UPPER]] -= _ROUNDING
    inner[2:4] *= 1.0 - _ROUNDING
    return inner


# One control cycle, compiled: the rate that keeps the tool on its reference, within limits.
#
# The rates that viable commands allow are a box. As long as eq. 4 stays in it, it is what is
# commanded. Where a joint would leave it, that joint is held at its bound and eq. 4 is solved
# again for the others, one joint after the other: saturation in the null space (F. Flacco, A. De
# Luca, O. Khatib, "Control of redundant robots under hard joint constraints", IEEE Transactions
# on Robotics 31, 2015), with the self-motion as what may give first. Near singular poses the
# inverse is damped, by the smallest pivot of JJᵀ.

# Entries of a cycle's row besides its n-vectors: the reference's position, rotation and twist.
REFERENCE = 18


@kernel
def saturated_rates(
    jacobian: Array, wanted: Array, epsilon: Array, low: Array, high: Array, rates: Array
) -> bool:
    """Set `rates` (n,) within low..high, so that Jq̇ is `wanted` (m,) where that is possible.

    With q̇ = J⁺u + (I - J⁺J) ε where no bound is active. Where the tool would not move as wanted,
    the
    self-motion is replaced by the middle of the bounds. Returns whether the tool moves as wanted.
    """
    if saturate(jacobian, wanted, epsilon, low, high, rates):
        return True
    middle = np.empty(rates.shape[0])
    for k in range(rates.shape[0]):
        middle[k] = 0.5 * (low[k] + high[k])
    return saturate(jacobian, wanted, middle, low, high, rates)


@inlined
def saturate(
    jacobian: Array, wanted: Array, epsilon: Array, low: Array, high: Array, rates: Array
) -> bool:
    """Hold joints at their bounds, the one farthest out first, until the others are within."""
    m, n = jacobian.shape
    moving, factor, y = jacobian.copy(), np.empty((m, m)), np.empty(m)
    held = np.zeros(n, dtype=np.bool_)
    for _ in range(n + 1):
        for i in range(m):
            y[i] = wanted[i]
            for k in range(n):
                y[i] -= jacobian[i, k] * (rates[k] if held[k] else epsilon[k])
        factor_damped(moving, PIVOT, factor)
        solve_cholesky(factor, y)
        worst, most = -1, 0.0
        for k in range(n):
            if held[k]:
                continue
            rates[k] = epsilon[k]
            for i in range(m):
                rates[k] += moving[i, k] * y[i]
            beyond = max(rates[k] - high[k], low[k] - rates[k]) / (high[k] - low[k] + 1e-12)
            # NaN is beyond every bound.
            if not beyond <= most:
                worst, most = k, beyond
                if beyond != beyond:
                    break
        if worst < 0:
            break
        held[worst] = True
        if not rates[worst] >= low[worst]:
            rates[worst] = low[worst]
        elif not rates[worst] <= high[worst]:
            rates[worst] = high[worst]
        for i in range(m):
            moving[i, worst] = 0.0
    for i in range(m):
        residual = wanted[i]
        for k in range(n):
            residual -= jacobian[i, k] * rates[k]
        if not abs(residual) <= FOLLOWED:
            return False
    return True


@kernel
def command(
    cycle: int,
    world_jacobian: Array,
    rotation: Array,
    translation: Array,
    table: Array,
    states: Array,
    limits: Array,
    layout: Layout,
    gain: float,
    h: float,
) -> bool:
    """Choose the acceleration of a cycle, and set the states of its end.

    Parameters
    ----------
    world_jacobian, rotation, translation : (6, n), (3, 3), (3,)
        Pinocchio's Jacobian at the world's origin and the tool's pose, at the middle of the rate's
        interval: where `table` says.
    table : (M, 2n + 18)
        Per cycle: where the arm is expected then (n), ε (n), position, rotation and twist of the
        reference. The next row's first entries are set.
    states : (M + 1, 3, n)
        c, w and a; those of `cycle` are given.
    limits : (9, n)
        Of the joints, of their curves, and how far the arm is from its command: see `DEVIATION`.

    Returns whether the tool moves as the reference does.
    """
    n, m, row = world_jacobian.shape[1], rows_of(layout), table[cycle]
    jacobian, task, error = np.empty((6, n)), np.empty((m, n)), np.zeros(6)
    at_tip(world_jacobian, translation, jacobian)
    target = row[2 * n + 3 : 2 * n + 12].copy().reshape(3, 3)
    pose_error(layout[0, KIND], row[2 * n : 2 * n + 3], target, translation, rotation, error)
    twist, wanted = np.empty(6), np.empty(m)
    for i in range(6):
        twist[i] = row[2 * n + 12 + i] + gain * error[i]
    task_rows(layout, 0, rotation, jacobian, task)
    select(layout, 0, rotation, twist, wanted)
    w = states[cycle, 1]
    low, high, rates = np.empty(n), np.empty(n), np.empty(n)
    viable_rates(states[cycle], limits, h, low, high)
    follows = saturated_rates(task, wanted, row[n : 2 * n], low, high, rates)
    for k in range(n):
        rate = min(max(rates[k], low[k]), high[k])
        move(states, cycle, k, (rate - w[k]) / h, h)
        if cycle + 1 < table.shape[0]:
            ahead = states[cycle + 1, 0, k] + 0.5 * h * states[cycle + 1, 1, k]
            table[cycle + 1, k] = ahead + limits[DEVIATION, k]
    return follows


@inlined
def viable_rates(state: Array, limits: Array, h: float, low: Array, high: Array) -> None:
    """Set the bounds of the rates (n,) of the next cycle, by c, w and a now (3, n)."""
    for k in range(state.shape[1]):
        c, w = state[0, k], state[1, k]
        low[k], high[k] = viable_accelerations(c, w, limits, k, h)
        low[k], high[k] = w + h * low[k], w + h * high[k]


@inlined
def move(states: Array, cycle: int, k: int, acceleration: float, h: float) -> None:
    """Set joint k's state at the end of a cycle."""
    rate = states[cycle, 1, k] + h * acceleration
    states[cycle + 1, 2, k] = acceleration
    states[cycle + 1, 1, k] = rate
    states[cycle + 1, 0, k] = states[cycle, 0, k] + h * rate


@kernel
def brake(states: Array, first: int, limits: Array, share: float, h: float) -> int:
    """Bring all joints to rest from cycle `first` on; return the cycle at which they rest.

    Together, so that the arm stays on the line that it is on, as far as viable commands allow, by
    a share of the limits of acceleration.
    Where `states` (M + 1, 3, n) end before that: the last cycle.
    """
    n = states.shape[2]
    for cycle in range(first, states.shape[0] - 1):
        longest, moves = 0.0, False
        for k in range(n):
            w = states[cycle, 1, k]
            longest = max(longest, abs(w) / (share * limits[3, k] * h))
            moves = moves or w != 0.0 or states[cycle, 2, k] != 0.0
        if not moves:
            return cycle
        # In this number of cycles the slowest to brake can rest.
        part = 1.0 / max(1.0, longest)
        for k in range(n):
            c, w = states[cycle, 0, k], states[cycle, 1, k]
            low, high = viable_accelerations(c, w, limits, k, h)
            wish = -w * part / h
            move(states, cycle, k, min(max(wish, low), high), h)
            if longest <= 1.0 and low <= wish <= high:
                # To rest, not to rounding.
                states[cycle + 1, 1, k], states[cycle + 1, 0, k] = 0.0, c
    return int(states.shape[0] - 1)


@kernel
def approach(offset: Array, rate: Array, law: Array, step: float, table: Array) -> None:
    """Set `table` (G, 12) to how an offset (6,) [m, rad] and its rate fade away, every `step`.

    Of second order, separately for position and rotation: the rate approaches the offset's speed
    min(K d, √(A d), V) towards zero, with time constant 1/(4K), by at most A. `law` (5,) are K, V
    and A of positions, V and A of rotations.
    """
    now, speed = offset.copy(), rate.copy()
    for g in range(table.shape[0]):
        for i in range(6):
            table[g, i], table[g, 6 + i] = now[i], speed[i]
        for part in range(2):
            most, hardest, distance, change = law[1 + 2 * part], law[2 + 2 * part], 0.0, 0.0
            for i in range(3 * part, 3 * part + 3):
                distance += now[i] * now[i]
            distance = sqrt(distance)
            pace = min(law[0], min(most, sqrt(hardest * distance)) / max(distance, 1e-12))
            for i in range(3 * part, 3 * part + 3):
                change += (-pace * now[i] - speed[i]) ** 2
            change = sqrt(change) * 4.0 * law[0]
            share = 4.0 * law[0] * step * min(1.0, hardest / max(change, 1e-12))
            for i in range(3 * part, 3 * part + 3):
                before = speed[i]
                speed[i] += share * (-pace * now[i] - speed[i])
                now[i] += 0.5 * step * (before + speed[i])


@inlined
def _turning(angle: float) -> tuple[float, float, float]:
    """Return a, b and c of exp(φ) = I + a [φ] + b [φ]² and Jl(φ) = I + b [φ] + c [φ]²."""
    if not angle > 1e-4:
        return 1.0, 0.5, 1.0 / 6.0
    first = np.sin(angle) / angle
    return first, (1.0 - np.cos(angle)) / (angle * angle), (1.0 - first) / (angle * angle)


@kernel
def shift_reference(
    times: Array,
    translation: Array,
    rotation: Array,
    twist: Array,
    table: Array,
    step: float,
    out: Array,
) -> None:
    """Set `out` (M, 18) to position, rotation and twist of a target moved by a fading offset.

    `times` (M,) count from the first row of `table`, see `approach`. The target is turned by
    exp(φ) and moved by δ: ω = Jl(φ) φ̇ + exp(φ) ω_target.
    """
    turn = np.empty((3, 3))
    for k in range(times.shape[0]):
        place = times[k] / step
        g = min(int(place), table.shape[0] - 2)
        share = min(place - g, 1.0)
        phi, slope = np.empty(3), np.empty(3)
        for i in range(3):
            out[k, i] = translation[k, i] + (1.0 - share) * table[g, i] + share * table[g + 1, i]
            out[k, 12 + i] = (
                twist[k, i] + (1.0 - share) * table[g, 6 + i] + share * table[g + 1, 6 + i]
            )
            phi[i] = (1.0 - share) * table[g, 3 + i] + share * table[g + 1, 3 + i]
            slope[i] = (1.0 - share) * table[g, 9 + i] + share * table[g + 1, 9 + i]
        angle = sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
        first, second, third = _turning(angle)
        square = np.empty((3, 3))
        skew = np.zeros((3, 3))
        skew[0, 1], skew[0, 2], skew[1, 2] = -phi[2], phi[1], -phi[0]
        skew[1, 0], skew[2, 0], skew[2, 1] = phi[2], -phi[1], phi[0]
        for i in range(3):
            for j in range(3):
                square[i, j] = phi[i] * phi[j] - (angle * angle if i == j else 0.0)
        for i in range(3):
            for j in range(3):
                turn[i, j] = (1.0 if i == j else 0.0) + first * skew[i, j] + second * square[i, j]
        for i in range(3):
            rate = slope[i]
            for j in range(3):
                rate += (second * skew[i, j] + third * square[i, j]) * slope[j]
                rate += turn[i, j] * twist[k, 3 + j]
                total = 0.0
                for a in range(3):
                    total += turn[i, a] * rotation[k, a, j]
                out[k, 3 + 3 * i + j] = total
            out[k, 15 + i] = rate
