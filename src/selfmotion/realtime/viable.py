"""Commands from which a stop within all limits stays possible, whatever is asked for.

The commanded motion is a uniform cubic B-spline. Its control points c follow a double integrator,

    w⁺ = w + h a,   c⁺ = c + h w⁺,

with h the control cycle [s]: q is a mean of neighbouring c, q̇ of neighbouring w, and q̈ of
neighbouring a, with positive weights, so that limits which c, w and a keep at every cycle are kept
by the motion at all times, between cycles as well. Its acceleration is continuous: it goes from one
a to the next along a straight line.

A joint that brakes by A in every cycle comes to rest D(w) = h Σ_j max(0, w - j h A) further on
(j = 1, 2, …). The states with c + D(w) ≤ upper, c - D(-w) ≥ lower and |w| ≤ V are exactly those
from which it can stop in time, and a = -A (or what brings w to 0) leads from each to another one:
there is always a next command.
"""

from math import floor, inf, sqrt

from selfmotion.basics import Array, inlined

# What rounding may add to a limit: the set is that much smaller, relative to each limit.
_ROUNDING = 1e-9


@inlined
def braking_distance(w: float, most: float, h: float) -> float:
    """Return D(w) for w ≥ 0, deceleration `most` A and cycle `h`."""
    cycles = floor(w / (most * h))
    return h * cycles * (w - 0.5 * most * h * (cycles + 1.0))


@inlined
def fastest(room: float, most: float, h: float) -> float:
    """Return the largest w⁺ after which a joint with so much room ahead can still stop in it.

    It moves by h w⁺ at once, so that D(w⁺ + h A) = room; D is a polygon, inverted in closed form.
    """
    if room == inf:
        return inf
    room = max(room, 0.0)
    cycles = floor(0.5 * (1.0 + sqrt(1.0 + 8.0 * room / (most * h * h))))
    return room / (h * cycles) + 0.5 * most * h * (cycles + 1.0) - most * h


@inlined
def viable_accelerations(
    c: float, w: float, lower: float, upper: float, speed: float, most: float, h: float
) -> tuple[float, float]:
    """Return the least and the largest a after which a joint's state can still be stopped.

    Never empty: where rounding, or a state from outside, would make it so, it is the harder
    braking.
    """
    high = min(most, (speed - w) / h, (fastest(upper - c, most, h) - w) / h)
    low = max(-most, (-speed - w) / h, (-fastest(c - lower, most, h) - w) / h)
    high, low = max(high, -most), min(low, most)
    if low > high:
        low = high = low if w < 0.0 else high
    return low, high


def tightened(limits: Array) -> Array:
    """Return limits (4, n) smaller by what rounding may add to them."""
    inner = limits.copy()
    inner[0] += _ROUNDING
    inner[1] -= _ROUNDING
    inner[2:] *= 1.0 - _ROUNDING
    return inner
