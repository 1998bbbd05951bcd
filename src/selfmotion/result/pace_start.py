"""Paces that the search for the fastest one begins with."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.motion import Trajectory
from selfmotion.path import Pace
from selfmotion.result.pace_rows import length_speed

# A pace of constant joint speed has so many knots at least and about so many at most.
_FEWEST, _ENOUGH = 600, 3000
# Its first and last intervals have so many parts.
_GRADED = 12
# A smooth pace has so many intervals at least; so many at most, or for each sample of the motion,
# with this time between two [s], more with less: slow limits make a motion long, not more winding.
_INTERVALS, _MANY, _PER_SAMPLE, _COARSE = 250, 4000, 4, 4e-3
# Where jerks are limited it has this many, unless these are nearer than this [s]: from a pace that
# is coarse around corners the programmes come to slower ones, from which no near one is faster.
_FINE, _FINEST = 2000, 1e-3
# It is as smooth as the mean, so often, over so many knots.
_MEANS, _WINDOW = 4, 3
# Accelerations build up over so many knots where the arm begins at rest and jerks are limited.
_EASED = 8
# Rates below this share of the largest are none.
_NONE = 1e-9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def of_constant_speed(motion: Trajectory) -> Pace:
    """Return the pace at which the joints together are always about as fast."""
    knots = motion.t
    if len(knots) - 1 < _FEWEST:
        parts = -(-_FEWEST // (len(knots) - 1))
        places = np.arange(parts * (len(knots) - 1) + 1) / parts
        knots = np.interp(places, np.arange(len(knots)), knots)
    elif len(knots) > 2 * _ENOUGH:
        knots = np.append(knots[: -1 : len(knots) // _ENOUGH], knots[-1])
    # From rest a fast motion needs as long for the first of these as for the others.
    graded = np.square(np.arange(1, _GRADED) / _GRADED)
    first, last = knots[1] - knots[0], knots[-1] - knots[-2]
    knots = np.concatenate(
        [
            knots[:1],
            knots[0] + first * graded,
            knots[1:-1],
            knots[-1] - last * graded[::-1],
            knots[-1:],
        ]
    )
    qd, qdd = motion(knots, 1), motion(knots, 2)
    speed = length_speed(qd)
    gain = np.einsum("kn,kn->k", qd, qdd) / speed
    h = np.diff(knots)
    # The trapezoidal rule with its correction at the ends.
    parts = 0.5 * h * (speed[:-1] + speed[1:]) + h**2 / 12.0 * (gain[:-1] - gain[1:])
    # Where accelerations are large for the steps, the correction is none.
    parts = np.maximum(parts, 0.25 * h * (speed[:-1] + speed[1:]))
    length = np.append(0.0, np.cumsum(parts))
    return Pace(length, knots - knots[0], 1.0 / speed, -gain / speed**3)


def smooth(pace: Pace, step: float, jerk: bool, samples: int) -> Pace:
    """Return a pace all of whose derivatives are smooth, on knots about so far apart in time [s].

    Farther where a motion of so many samples is that slow.
    The mean over some knots, several times; beyond a rest it goes back, beyond others on. Where
    jerks are limited, accelerations begin at 0.
    """
    from scipy.interpolate import make_interp_spline

    if jerk:
        step = min(step, max(pace.t[-1] / _FINE, _FINEST))
    most = int(np.ceil(max(_MANY, _PER_SAMPLE * samples) * _COARSE / step))
    count = min(max(int(np.ceil(pace.t[-1] / step)), _INTERVALS), most)
    t = np.linspace(0.0, pace.t[-1], count + 1)
    sigma = np.maximum.accumulate(pace(t))
    beyond = _WINDOW // 2 * _MEANS
    before, after = sigma[beyond:0:-1], sigma[-2 : -beyond - 2 : -1]
    rates = pace(t[[0, -1]], 1)
    still = _NONE * float(pace.rate.max())
    before = before if rates[0] <= still else 2.0 * sigma[0] - before
    after = after if rates[1] <= still else 2.0 * sigma[-1] - after
    mean = np.concatenate([before, sigma, after])
    for _ in range(_MEANS):
        mean = np.convolve(mean, np.full(_WINDOW, 1.0 / _WINDOW), mode="valid")
    # By as much as the ends have moved.
    mean = sigma[0] + (mean - mean[0]) * (sigma[-1] - sigma[0]) / (mean[-1] - mean[0])
    spline = make_interp_spline(t, mean, 5)
    start, end = (_EASED * t[1] if jerk and rate <= still else 0.0 for rate in rates)
    w, dw, ddw, new = _eased(pace.t[-1], start, end, count)
    rate, bend = spline(w, 1), spline(w, 2)
    for at in (0, -1):
        if rates[at] <= still:
            rate[at] = 0.0
    rate = np.maximum(rate, 0.0)
    bend = bend * dw**2 + rate * ddw
    sigma = np.maximum.accumulate(np.clip(spline(w), sigma[0], sigma[-1]))
    return Pace(new, sigma, rate * dw, bend)


def _eased(
    duration: float, start: float, end: float, count: int
) -> tuple[Array, Array, Array, Array]:
    """Return a time w that begins as τ^(3/2), its two derivatives, and τ, (count + 1,) each.

    What begins as w² begins as τ³, so that accelerations begin at 0. That takes times `start` and
    `end` at the ends, where it takes some: there w' = √(1 - (1 - τ/start)⁴).
    """
    lost = start * (1.0 - _eased_way(np.ones(1))[0]), end * (1.0 - _eased_way(np.ones(1))[0])
    t = np.linspace(0.0, duration + sum(lost), count + 1)
    w, dw, ddw = t - lost[0], np.ones(count + 1), np.zeros(count + 1)
    for span, where, sign, origin in ((start, t, 1.0, 0.0), (end, t[-1] - t, -1.0, duration)):
        if not span:
            continue
        inside = where < span
        x = where[inside] / span
        w[inside] = origin + sign * span * _eased_way(x)
        dw[inside] = np.sqrt(1.0 - (1.0 - x) ** 4)
        # Where τ = 0 the rate that this multiplies is 0.
        ddw[inside] = sign * 2.0 * (1.0 - x) ** 3 / np.where(x > 0.0, span * dw[inside], np.inf)
    return w, dw, ddw, t


def _eased_way(x: Array) -> Array:
    """Return the integral of √(1 - (1 - x)⁴) from 0 to x (K,), smooth in the root of x."""
    roots = np.sqrt(x)[:, None] * 0.5 * (_NODES + 1.0)
    values = 2.0 * roots * np.sqrt(1.0 - (1.0 - roots**2) ** 4)
    return np.asarray(0.5 * np.sqrt(x) * (values @ _WEIGHTS))
