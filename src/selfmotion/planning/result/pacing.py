"""The fastest pace of a joint path within limits of its rates."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, PlanError, obey_interruption
from selfmotion.model.motion import Trajectory, slowdown_of
from selfmotion.model.path import Pace, times_when
from selfmotion.planning.optimise import banded_optimum
from selfmotion.planning.result.pace_rows import (
    LEAST,
    PaceLimits,
    Squares,
    States,
    length_speed,
    rows_of,
)

# Paces that the search for the fastest one begins with.

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
_STILL = 1e-9
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
    still = _STILL * float(pace.rate.max())
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


# The fastest pace of a joint path within limits of its rates.
#
# A pace is improved by linear programmes in b(τ), the square of how much faster it becomes at its
# own time τ. Velocity, acceleration and torque limits are linear in b, so that one programme
# finds their optimum (D. Verscheure et al., IEEE Trans. Automatic Control 54(10), 2009); limits
# of the jerk and of the tool's acceleration are kept by tangents, anew in each programme. Where
# the motion between two knots uses more than it may, a knot is put between them, or these two get
# less room: the whole motion is not slowed for one of its samples.

# How much faster a pace may become in each of the first steps, and in the others: squared.
_FIRST, _OTHERS = (50.0, 50.0, 9.0), 9.0
# Nor more than by this, squared: at rest little else bounds it.
_MOST = 500.0
# With limits of the jerk tangents hold near a pace only: so many begin anew with the one before,
# which becomes so much faster or slower at most, squared; and so much in the steps after them.
_BASES, _BY_JERKS, _BY_JERKS_LATER = 3, 4.0, 2.0
# Steps from there, until one gains less than this share; knots are added in the first ones.
_MOST_STEPS, _ADDING, _GAIN = 12, 7, 5e-4
# What of limits is aimed at, what is left as it is, and what is near enough.
_AIM, _KEPT, _NEAR = 0.999, 0.9998, 1.0003
# A step takes at most this share of the room that there is.
_LEAST_ROOM = 0.8
# A knot is added where a limit is passed by this share, unless knots are so near [s], or become so
# many times as many: what is passed all along is no matter of knots.
_ROUGH, _NEAREST, _MORE = 1.002, 2e-4, 4
# So many programmes in turn that are not solved are the last ones: others would not be either.
_UNSOLVED = 2
# With limits of the jerk likewise where at some time no limit is used by this share: within an
# interval the jerk cannot follow what the path asks for.
_IDLE = 0.8
# This share of what a step may do is all of it.
_ALL = 0.9
# A pace that passes limits manyfold is of a programme that was not solved: what is known stays.
_WILD = 10.0
# A jump of this share of a limit has a knot of its own.
_JUMP = 0.02
# Gaps of the linear programmes, as shares: while the pace is rough, and then.
_ROUGH_GAP, _GAP = 1e-3, 1e-6
# Times are this share longer than limits ask: third differences of samples round so much.
_ROUNDING = 1e-6
# Derivatives below this share of the largest are none: they are looked at beside the ends.
_NONE = 1e-5
# Programmes begin with so much of what is known to keep the limits: there is room to all sides.
_INSIDE = 0.9


@dataclass(frozen=True)
class Ends:
    """How a motion begins and ends: whether its original rate is kept there, or it rests."""

    start_kept: bool = False
    end_kept: bool = False


def fastest_pace(motion: Trajectory, limits: PaceLimits, ends: Ends, step: float) -> Pace:
    """Return the fastest pace of a motion within limits.

    Parameters
    ----------
    motion : Trajectory
        Whose joint path is kept.
    limits : PaceLimits
    ends : Ends
    step : float
        Time between two knots of the pace [s], about; more of a motion that is slow all along.

    Raises
    ------
    PlanError
        No pace keeps the limits.
    """
    rough = limits.without_jerk()
    pace = _scaled(of_constant_speed(motion), motion, rough)
    for most in _FIRST:
        pace = _stepped(pace, motion, rough, ends, most)
    for _ in range(_BASES if limits.has_jerk else 0):
        # Tangents hold near a pace, so that the next one begins anew from there.
        pace = _scaled(smooth(pace, step, limits.has_jerk, len(motion.t)), motion, limits)
        pace = _stepped(pace, motion, limits, ends, _BY_JERKS)
    pace = _scaled(smooth(pace, step, limits.has_jerk, len(motion.t)), motion, limits)
    return _settled(pace, motion, limits, ends)


def along(pace: Pace, motion: Trajectory) -> Trajectory:
    """Return a motion at a pace of its own time."""
    at = np.minimum(pace.sigma + motion.t[0], motion.t[-1])
    q, qd, rate = motion(at), motion(at, 1), pace.rate[:, None]
    bend = pace(pace.t, 2) if pace.bend is None else pace.bend
    return Trajectory(
        pace.t, q, qd * rate, motion.joint_names, motion(at, 2) * rate**2 + qd * bend[:, None]
    )


def _settled(base: Pace, motion: Trajectory, limits: PaceLimits, ends: Ends) -> Pace:
    """Return a pace after steps until none gains any more, within limits between knots too."""
    best, before = ((np.inf, np.inf), base), base.t[-1]
    near = Squares.constant(_knots(base, motion, limits), 1.0)
    room = _all_room(len(near.knots) - 1, limits)
    most, count, unsolved = _BY_JERKS_LATER if limits.has_jerk else _OTHERS, len(near.knots), 0
    for number in range(_MOST_STEPS):
        known = near
        near, reached = _improved(base, motion, limits, room, known, ends, most, _GAP)
        unsolved = 0 if reached else unsolved + 1
        if np.isfinite(best[0][1]) and not near.is_positive:
            break
        pace = _changed(base, near)
        used, least = limits.shares(along(pace, motion))
        kept = _scaled(pace, motion, limits, least=1.0)
        over = np.max([table.max(axis=1) for table in used], axis=0)
        # A motion that passes what no slower pace surely keeps stands back.
        passed = max((float(table.max()) for table in used[3:]), default=0.0)
        rank = max(passed, _KEPT), float(kept.t[-1])
        if rank < best[0]:
            best = rank, kept
        if unsolved == _UNSOLVED:
            break
        if over.max() > _WILD and np.isfinite(best[0][1]):
            # Near the best that is known programmes are solved again: b is 1 there.
            base = best[1]
            near = Squares.constant(base.t, 1.0)
            room = _all_room(len(base.t) - 1, limits)
            continue
        if over.max() < _NEAR and passed <= _KEPT and abs(before / pace.t[-1] - 1.0) < _GAIN:
            break
        before = pace.t[-1]
        # Where it became as fast as a step may make it, knots are not what holds it.
        held = near.inside(0.5) < _ALL * most * known.inside(0.5)
        idle = (least < _IDLE) & held & limits.has_jerk
        cut = _to_cut(over, idle, pace)
        if number >= _ADDING or len(near.knots) + np.count_nonzero(cut) > _MORE * count:
            cut[:] = False
        # A limit that is passed where a knot is added is looked at again before there is less room.
        room = [
            np.repeat(own * _less(table, cut), 1 + cut, axis=0)
            for own, table in zip(room, used, strict=True)
        ]
        knots, middles = near.knots, 0.5 * (near.knots[1:] + near.knots[:-1])
        near = near.on(np.sort(np.append(knots, middles[cut])))
    return best[1]


def _knots(base: Pace, motion: Trajectory, limits: PaceLimits) -> Array:
    """Return the knots of a pace, and when a motion's accelerations or jerks jump."""
    inner = motion.t[1:-1]
    reached = times_when(
        base, inner - motion.t[0], np.zeros(len(inner)), np.full(len(inner), base.t[-1])
    )
    before, jumps = np.nextafter(inner, -np.inf), np.zeros(len(inner), dtype=bool)
    rates = base(reached, 1)[:, None]
    for order, limit in ((2, limits.acceleration), (3, limits.jerk)):
        jump = np.abs(motion(inner, order) - motion(before, order)) * rates**order
        jumps |= (jump > _JUMP * limit).any(axis=1)
    jumps &= (reached > 0.0) & (reached < base.t[-1])
    wanted = reached[jumps]
    if not len(wanted):
        return base.t
    # A knot near a jump is in its place.
    after = np.searchsorted(wanted, base.t)
    ends = np.concatenate([[-np.inf], wanted, [np.inf]])
    beside = np.minimum(base.t - ends[after], ends[after + 1] - base.t)
    far = beside > 0.3 * (base.t[1] - base.t[0])
    far[[0, -1]] = True
    knots = np.union1d(base.t[far], wanted)
    return knots


def _less(used: Array, cut: Flags) -> Array:
    less = np.maximum(_AIM / np.maximum(used, _AIM), _LEAST_ROOM)
    return np.where(cut[:, None] | (used <= _KEPT), 1.0, less)


def _to_cut(over: Array, idle: Flags, pace: Pace) -> Flags:
    """Return which intervals are too long for what happens in them or beside them."""
    passed = np.concatenate([[False], (over > _ROUGH) | idle, [False]])
    near = passed[:-2] | passed[1:-1] | passed[2:]
    return np.asarray(near & (np.diff(pace.t) > _NEAREST))


def _all_room(count: int, limits: PaceLimits) -> list[Array]:
    widths = [len(limits.speed)] * 3 + [len(item.columns) for item in limits.quantities]
    return [np.full((count, width), _AIM) for width in widths]


def _scaled(pace: Pace, motion: Trajectory, limits: PaceLimits, least: float = 0.0) -> Pace:
    """Return a pace slower as a whole, at least by a factor, so that joints keep their limits."""
    needed = slowdown_of(along(pace, motion), limits.of_orders)
    return pace.slower(max(needed, least) * (1.0 + _ROUNDING))


def _stepped(pace: Pace, motion: Trajectory, limits: PaceLimits, ends: Ends, most: float) -> Pace:
    """Return a pace after one rough step with all the room there is."""
    near, room = Squares.constant(pace.t, 1.0), _all_room(len(pace.t) - 1, limits)
    return _changed(pace, _improved(pace, motion, limits, room, near, ends, most, _ROUGH_GAP)[0])


def _improved(
    base: Pace,
    motion: Trajectory,
    limits: PaceLimits,
    room: list[Array],
    near: Squares,
    ends: Ends,
    most: float,
    gap: float,
) -> tuple[Squares, bool]:
    """Return the square of how much faster a pace becomes, near one that is known.

    And whether its programme was solved.
    """
    obey_interruption()
    knots = near.knots
    states = States.of(motion, base, knots)
    start, fixed = _INSIDE * near.c, np.zeros(len(near.c), dtype=bool)
    for kept, end in ((ends.start_kept, 0), (ends.end_kept, -1)):
        if kept:
            _keep(start, fixed, end, base, knots)
        elif _starts(states, end, limits.has_jerk):
            start[end], fixed[end] = 0.0, True
    rows = rows_of(states, limits, room, near)
    # To first order the time falls with half the integral of b by b^(3/2).
    widths = np.diff(np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2]))
    weights = np.convolve(widths, np.ones(3), mode="full")[2:-2] / 3.0
    gradient = weights * np.maximum(near.c, 1e-4) ** -1.5
    upper = np.minimum(most * near.c, _MOST) + 2.0 * LEAST
    upper = np.where(fixed, start, upper)
    # Where a pace may not be much slower either, none can be within the room that is left.
    for lower in ([near.c / most] if limits.has_jerk else []) + [0.0 * near.c]:
        least = np.where(fixed, start, np.maximum(lower, LEAST))
        found, reached = banded_optimum(gradient, rows, start, least, upper, gap)
        if reached:
            break
    return Squares(knots, found), reached


def _keep(start: Array, fixed: Flags, end: int, base: Pace, knots: Array) -> None:
    """Fix two coefficients so that dσ/dt = 1 and d²σ/dt² = 0 at an end."""
    rate, bend = (float(base(knots[[end]], order)[0]) for order in (1, 2))
    inner, step = (1, knots[1] - knots[0]) if end == 0 else (-2, knots[-2] - knots[-1])
    start[end] = 1.0 / rate**2
    start[inner] = start[end] * (1.0 - bend / rate * step)
    fixed[[end, inner]] = True


def _starts(states: States, end: int, jerk: bool) -> bool:
    """Return whether the pace has to begin from rest at an end, since else the arm would not.

    With limits of the jerk it rests where accelerations are 0 as well.
    """
    tables = [np.abs(states.at_knots(1))]
    if jerk:
        tables.append(np.abs(states.at_knots(2)[:, :-1]))
    return any(float(table[end].max()) > _NONE * float(table.max()) for table in tables)


def _changed(base: Pace, squares: Squares) -> Pace:
    """Return a pace that is faster by the square roots of b."""
    knots = squares.knots
    h, roots, weights = np.diff(knots), 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
    steps = np.zeros(len(h))
    with np.errstate(divide="ignore", invalid="ignore"):
        for node, weight in zip(roots, weights, strict=True):
            steps += weight * h / np.sqrt(squares.inside(float(node)))
        # From rest b grows from 0: as a function of the root of the way the time is smooth.
        for end, shares in ((0, roots**2), (-1, 1.0 - roots**2)):
            if squares.c[end] == 0.0:
                values = np.array([squares.inside(float(share))[end] for share in shares])
                steps[end] = h[end] * float(_WEIGHTS @ (roots / np.sqrt(values)))
    if not (np.all(np.isfinite(steps)) and np.all(steps > 0.0)):
        raise PlanError("no pace keeps the limits of rates along this joint path")
    value, slope = np.maximum(squares.at_knots(), 0.0), squares.at_knots(1)
    rate = base(knots, 1)
    return Pace(
        np.append(0.0, np.cumsum(steps)),
        np.maximum.accumulate(base(knots)),
        np.maximum(rate, 0.0) * np.sqrt(value),
        base(knots, 2) * value + 0.5 * rate * slope,
    )
