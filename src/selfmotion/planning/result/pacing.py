"""Optimal time scaling: the fastest pace of a joint path within limits of its rates."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, Flags, PlanError, obey_interruption
from selfmotion.model.motion import Trajectory, slowdown_of
from selfmotion.model.path import Pace, times_when
from selfmotion.planning.optimise import banded_optimum
from selfmotion.planning.result.pace_rows import (
    MIN_SQUARED_RATE,
    PaceLimits,
    Squares,
    States,
    length_speed,
    rows_of,
)

# Smallest number of knots of a pace of constant joint speed …
_MIN_KNOTS = 600
# … and about the largest.
_ENOUGH = 3000
# Parts of its first and last intervals.
_GRADED = 12
# Smallest number of intervals of a smooth pace …
_INTERVALS = 250
# … and the largest …
_MANY = 4000
# … or per sample of the motion …
_PER_SAMPLE = 4
# … with this time between two [s], or more: slow limits make a motion long, not more winding.
_COARSE = 4e-3
# Number of intervals with limits of the jerk: programmes from a coarse pace end at slower ones …
_FINE = 2000
# … unless they become shorter than this [s].
_FINEST = 1e-3
# Moving means that smooth a pace: their number …
_MEANS = 4
# … and width in knots.
_WINDOW = 3
# Knots over which accelerations build up from rest, with limits of the jerk.
_EASED = 8
# Rates below this share of the largest are 0.
_REST = 1e-9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def of_constant_speed(motion: Trajectory) -> Pace:
    """Return the pace at which the joints together are always about as fast."""
    knots = motion.t
    if len(knots) - 1 < _MIN_KNOTS:
        parts = -(-_MIN_KNOTS // (len(knots) - 1))
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
    # Without a correction where accelerations are large for the steps.
    parts = np.maximum(parts, 0.25 * h * (speed[:-1] + speed[1:]))
    length = np.append(0.0, np.cumsum(parts))
    return Pace(length, knots - knots[0], 1.0 / speed, -gain / speed**3)


def smooth(pace: Pace, step: float, jerk: bool, samples: int) -> Pace:
    """Return a pace with smooth derivatives, on knots about `step` apart [s].

    Farther apart for slow motions of `samples` samples. The mean over some knots, several times; it
    is reflected at rests, and extended at other ends. With limits of the jerk, accelerations start
    at
    0.
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
    rest_rate = _REST * float(pace.rate.max())
    before = before if rates[0] <= rest_rate else 2.0 * sigma[0] - before
    after = after if rates[1] <= rest_rate else 2.0 * sigma[-1] - after
    mean = np.concatenate([before, sigma, after])
    for _ in range(_MEANS):
        mean = np.convolve(mean, np.full(_WINDOW, 1.0 / _WINDOW), mode="valid")
    # By as much as the ends have moved.
    mean = sigma[0] + (mean - mean[0]) * (sigma[-1] - sigma[0]) / (mean[-1] - mean[0])
    spline = make_interp_spline(t, mean, 5)
    start, end = (_EASED * t[1] if jerk and rate <= rest_rate else 0.0 for rate in rates)
    w, dw, ddw, new = _eased(pace.t[-1], start, end, count)
    rate, bend = spline(w, 1), spline(w, 2)
    for at in (0, -1):
        if rates[at] <= rest_rate:
            rate[at] = 0.0
    rate = np.maximum(rate, 0.0)
    bend = bend * dw**2 + rate * ddw
    sigma = np.maximum.accumulate(np.clip(spline(w), sigma[0], sigma[-1]))
    return Pace(new, sigma, rate * dw, bend)


def _eased(
    duration: float, start: float, end: float, count: int
) -> tuple[Array, Array, Array, Array]:
    """Return a time w that starts as τ^(3/2), its two derivatives, and τ, (count + 1,) each.

    A function of w² then starts as τ³, so that accelerations start at 0. Over the times `start` and
    `end` at the ends, if positive: there w' = √(1 - (1 - τ/start)⁴).
    """
    lost = start * (1.0 - _eased_time(np.ones(1))[0]), end * (1.0 - _eased_time(np.ones(1))[0])
    t = np.linspace(0.0, duration + sum(lost), count + 1)
    w, dw, ddw = t - lost[0], np.ones(count + 1), np.zeros(count + 1)
    for ease, where, sign, origin in ((start, t, 1.0, 0.0), (end, t[-1] - t, -1.0, duration)):
        if not ease:
            continue
        inside = where < ease
        x = where[inside] / ease
        w[inside] = origin + sign * ease * _eased_time(x)
        dw[inside] = np.sqrt(1.0 - (1.0 - x) ** 4)
        # Where τ = 0 the rate that this multiplies is 0.
        ddw[inside] = sign * 2.0 * (1.0 - x) ** 3 / np.where(x > 0.0, ease * dw[inside], np.inf)
    return w, dw, ddw, t


def _eased_time(x: Array) -> Array:
    """Return the integral of √(1 - (1 - x)⁴) from 0 to x (K,), smooth in the root of x."""
    roots = np.sqrt(x)[:, None] * 0.5 * (_NODES + 1.0)
    values = 2.0 * roots * np.sqrt(1.0 - (1.0 - roots**2) ** 4)
    return np.asarray(0.5 * np.sqrt(x) * (values @ _WEIGHTS))


# The fastest pace of a joint path within limits of its rates.
#
# A pace is improved by linear programmes in b(τ), the square of how much faster it becomes at its
# own time τ. Velocity, acceleration and torque limits are linear in b, so that one programme finds
# their optimum (D. Verscheure et al., IEEE Trans. Automatic Control 54(10), 2009); limits of the
# jerk and of the tool's acceleration are linearised, anew in each programme. Where the motion
# between two knots exceeds a limit, a knot is added between them, or these two get less room: the
# whole motion is not slowed for one of its samples.

# Largest growth of b in the first steps …
_FIRST = (50.0, 50.0, 9.0)
# … and in others.
_OTHERS = 9.0
# Largest b: little else bounds it at rest.
_MAX_SQUARED_RATE = 500.0
# With limits of the jerk, linearisations are valid nearby: restarts at the pace before …
_BASES = 3
# … each with this largest change of b …
_BY_JERKS = 4.0
# … and this one in later steps.
_BY_JERKS_LATER = 2.0
# Largest number of steps from there …
_MAX_STEPS = 12
# … of which the first ones add knots …
_ADDING = 7
# … until the relative gain is below this.
_GAIN = 5e-4
# Target share of limits …
_AIM = 0.999
# … a share that is left as it is …
_KEPT = 0.9998
# … and one that is near enough.
_NEAR = 1.0003
# Smallest factor of the room between two knots in one step.
_MIN_ROOM = 0.8
# Excess of a limit for which a knot is added …
_ROUGH = 1.002
# … unless knots are nearer than this [s] …
_NEAREST = 2e-4
# … or become this many times as many: an excess all along is not due to knots.
_MORE = 4
# Programmes without solution in turn that end the iteration.
_UNSOLVED = 2
# With limits of the jerk, a knot is also added where the use of all limits falls below this share:
# within an interval the jerk cannot follow the path.
_IDLE = 0.8
# Share of the largest step that counts as all of it.
_ALL = 0.9
# Excess of a pace from a programme without solution: it is rejected.
_WILD = 10.0
# A jump of this share of a limit has a knot of its own.
_JUMP = 0.02
# Relative duality gap of the programmes at a rough pace …
_ROUGH_GAP = 1e-3
# … and at a fine one.
_GAP = 1e-6
# Relative increase of times: rounding of third differences of samples.
_ROUNDING = 1e-6
# Derivatives below this share of the largest are 0: then those next to the ends count.
_NONE = 1e-5
# Initial point of programmes, as a share of a feasible one: there is room on all sides.
_INSIDE = 0.9


@dataclass(frozen=True)
class Ends:
    """Rates at the start and end of a motion: the original ones, or rest."""

    start_kept: bool = False
    end_kept: bool = False


def fastest_pace(motion: Trajectory, limits: PaceLimits, ends: Ends, step: float) -> Pace:
    """Return the fastest pace of a motion within limits.

    Parameters
    ----------
    motion : Trajectory
        Its joint path is followed.
    limits : PaceLimits
    ends : Ends
    step : float
        Approximate time between two knots of the pace [s]; more for slow motions.

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
        # Linearisations are valid nearby: the next one starts there.
        pace = _scaled(smooth(pace, step, limits.has_jerk, len(motion.t)), motion, limits)
        pace = _stepped(pace, motion, limits, ends, _BY_JERKS)
    pace = _scaled(smooth(pace, step, limits.has_jerk, len(motion.t)), motion, limits)
    return _converged(pace, motion, limits, ends)


def along(pace: Pace, motion: Trajectory) -> Trajectory:
    """Return a motion at a pace of its own time."""
    at = np.minimum(pace.sigma + motion.t[0], motion.t[-1])
    q, qd, rate = motion(at), motion(at, 1), pace.rate[:, None]
    bend = pace(pace.t, 2) if pace.bend is None else pace.bend
    return Trajectory(
        pace.t, q, qd * rate, motion.joint_names, motion(at, 2) * rate**2 + qd * bend[:, None]
    )


def _converged(base: Pace, motion: Trajectory, limits: PaceLimits, ends: Ends) -> Pace:
    """Return a pace after steps until none gains any more, within limits between knots too."""
    best, before = ((np.inf, np.inf), base), base.t[-1]
    near = Squares.constant(_knots(base, motion, limits), 1.0)
    room = _all_room(len(near.knots) - 1, limits)
    most, count, unsolved = _BY_JERKS_LATER if limits.has_jerk else _OTHERS, len(near.knots), 0
    for number in range(_MAX_STEPS):
        known = near
        near, reached = _improved(base, motion, limits, room, known, ends, most, _GAP)
        unsolved = 0 if reached else unsolved + 1
        if np.isfinite(best[0][1]) and not near.is_positive:
            break
        pace = _changed(base, near)
        used, least = limits.shares(along(pace, motion))
        selected = _scaled(pace, motion, limits, least=1.0)
        over = np.max([table.max(axis=1) for table in used], axis=0)
        # A motion that violates limits which no slower pace satisfies for sure is rejected.
        passed = max((float(table.max()) for table in used[3:]), default=0.0)
        rank = max(passed, _KEPT), float(selected.t[-1])
        if rank < best[0]:
            best = rank, selected
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
        # Where the step was the limit, knots are not.
        held = near.inside(0.5) < _ALL * most * known.inside(0.5)
        idle = (least < _IDLE) & held & limits.has_jerk
        cut = _to_cut(over, idle, pace)
        if number >= _ADDING or len(near.knots) + np.count_nonzero(cut) > _MORE * count:
            cut[:] = False
        # A limit exceeded where a knot is added is checked again before the room is reduced.
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
    less = np.maximum(_AIM / np.maximum(used, _AIM), _MIN_ROOM)
    return np.where(cut[:, None] | (used <= _KEPT), 1.0, less)


def _to_cut(over: Array, idle: Flags, pace: Pace) -> Flags:
    """Return the mask of intervals that are too long for the motion in or next to them."""
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
    """Return a pace after one rough step with full room."""
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
    for selected, end in ((ends.start_kept, 0), (ends.end_kept, -1)):
        if selected:
            _keep(start, fixed, end, base, knots)
        elif _starts(states, end, limits.has_jerk):
            start[end], fixed[end] = 0.0, True
    rows = rows_of(states, limits, room, near)
    # To first order the time falls with half the integral of b by b^(3/2).
    widths = np.diff(np.concatenate([[knots[0]] * 2, knots, [knots[-1]] * 2]))
    weights = np.convolve(widths, np.ones(3), mode="full")[2:-2] / 3.0
    gradient = weights * np.maximum(near.c, 1e-4) ** -1.5
    upper = np.minimum(most * near.c, _MAX_SQUARED_RATE) + 2.0 * MIN_SQUARED_RATE
    upper = np.where(fixed, start, upper)
    # If a pace may not be much slower either, the remaining room has none.
    for lower in ([near.c / most] if limits.has_jerk else []) + [0.0 * near.c]:
        least = np.where(fixed, start, np.maximum(lower, MIN_SQUARED_RATE))
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
    """Return whether the pace has to start from rest at an end, as the arm does.

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
        # From rest b grows from 0: as a function of the root of the path length time is smooth.
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
