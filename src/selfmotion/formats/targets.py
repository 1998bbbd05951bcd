"""Joint targets that a controller passes, and how far that takes it off the motion.

A motion is cut where the arm rests, be it for an instant: controllers stop there, and what happens
there happens on time. Of what is left, targets are as far apart as the
error of straight joint lines between them allows, h²|Jq̈|/8 ≤ deviation, spread over the time
evenly in ∫ √(|Jq̈|/8) dt (de Boor, "Good approximation by splines with variable knots", 1973).
What is left of error is then measured by forward kinematics.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from selfmotion.basics import Array, Flags, ProblemError, Progress, silent
from selfmotion.certificate import Tolerance
from selfmotion.formats.pieces import Piece
from selfmotion.formats.stretches import (
    NO_MISS,
    Event,
    Miss,
    Misses,
    Stretch,
    miss_between,
    miss_of,
)
from selfmotion.motion import Trajectory

# Programs count times [s], angles [°] and lengths [mm] in so many digits behind the point.
TIME_DIGITS, ANGLE_DIGITS, LENGTH_DIGITS = 5, 5, 4
# The arm rests where it is as slow as this [rad or m/s] for at least so long [s].
_REST, _WHILE = 1e-7, 0.02
# Programs go from rest to rest: this is rest [rad or m/s], and so is such a share of the fastest.
_SLOW, _SHARE = 1e-4, 1e-3
# Targets are at least so dense [of where they are densest].
_SPARSE = 0.1
# Times at which the motion's curvature is looked at, for each of its samples; targets at least
# between two events or rests, tries, and more targets than this no controller takes.
_FINER, _FEWEST, _TRIES, _MOST = 4, 4, 20, 100_000


def stretches_of(
    pieces: Sequence[Piece],
    slides: Flags,
    allowed: Tolerance,
    of_moves: Tolerance | None = None,
    progress: Progress = silent,
) -> tuple[list[Stretch], Misses]:
    """Return the targets of a motion, as its file has them, and how far they are off it.

    Moves through the air may be off by `of_moves`; by default as far as they keep apart.

    Raises
    ------
    ProblemError
        It does not begin and end at rest, or takes more targets than any controller has.
    """
    found: list[Stretch] = []
    worst = Misses(NO_MISS, NO_MISS)
    for k, piece in enumerate(pieces):
        progress("targets", k + 1, len(pieces))
        motion = piece.motion
        for when in motion.t[[0, -1]]:
            speed = np.abs(motion(when, 1))
            if speed.max() > _SLOW:
                raise ProblemError(
                    f"'{piece.name}' has joint '{motion.joint_names[int(speed.argmax())]}' at "
                    f"{speed.max():.3g} rad/s or m/s at t = {when:.6g} s; programs of controllers "
                    f"go from rest to rest: plan it with a ramp, or rest=True"
                )
        within = _allowed(piece, allowed, of_moves)
        for first, last in _moving(motion, [motion.t[0] + at for at, _ in piece.events]):
            stretch, miss = _thinned(piece, slides, within, first, last)
            both = Misses(NO_MISS, miss) if piece.is_move else Misses(miss, NO_MISS)
            worst = worst.worse(both)
            found.append(stretch)
    return found, worst


def _allowed(piece: Piece, allowed: Tolerance, of_moves: Tolerance | None) -> Tolerance:
    """Return how far a controller may be off a piece."""
    if not piece.is_move:
        return allowed
    if of_moves is not None or piece.room is None:
        return of_moves or allowed
    room = piece.room
    return Tolerance(max(allowed.position, room.position), max(allowed.rotation, room.rotation))


def _moving(motion: Trajectory, events: Sequence[float]) -> list[tuple[float, float]]:
    """Return when motions from rest to rest, and rests, begin and end, in turn [s]."""
    still = np.abs(motion.qd).max(axis=1) < _REST
    still[:-1] &= np.abs(np.diff(motion.q, axis=0)).max(axis=1) < 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still[:-1], [False]]).astype(int)))
    marks = [float(motion.t[0])]
    for begin, end in edges.reshape(-1, 2):
        if motion.t[end] - motion.t[begin] >= _WHILE:
            marks += [float(motion.t[begin]), float(motion.t[end])]
    marks.append(float(motion.t[-1]))
    for stop in _stops(motion, events):
        if np.abs(stop - np.array(marks)).min() >= _WHILE and not _within(stop, marks, motion):
            marks.append(stop)
    marks = sorted(set(marks))
    return list(pairwise(marks))


def _within(stop: float, marks: Sequence[float], motion: Trajectory) -> bool:
    """Whether a time is in one of the rests that last."""
    first, last = max(m for m in marks if m < stop), min(m for m in marks if m > stop)
    return bool(np.abs(motion(last) - motion(first)).max() < 1e-9) and _rests(motion, first, last)


def _stops(motion: Trajectory, events: Sequence[float]) -> list[float]:
    """Return when the arm rests for an instant [s]: where an event is then, at that."""
    speeds = np.abs(motion.qd).max(axis=1)
    slow = min(_SLOW, _SHARE * float(speeds.max()))
    inside = np.clip(events, motion.t[0], motion.t[-1]).tolist()
    found = [at for at in inside if np.abs(motion(at, 1)).max() < slow]
    edges = np.diff(np.concatenate([[False], speeds < slow, [False]]).astype(int))
    for begin, end in np.flatnonzero(edges).reshape(-1, 2):
        found.append(float(motion.t[begin + int(speeds[begin:end].argmin())]))
    return found


def _thinned(
    piece: Piece, slides: Flags, allowed: Tolerance, first: float, last: float
) -> tuple[Stretch, Miss]:
    """Return the targets from one time to another, and how far they are off."""
    motion = piece.motion
    begins, ends = first == motion.t[0], last == motion.t[-1]
    events = [
        (motion.t[0] + at, name)
        for at, name in piece.events
        if (begins or first < motion.t[0] + at) and (ends or motion.t[0] + at <= last)
    ]
    fixed = _apart(first, last, [at for at, _ in events])
    still = bool(np.abs(motion(last) - motion(first)).max() < 1e-9) and _rests(motion, first, last)
    _check_digits(piece, slides, allowed)
    more = 1.0
    for _ in range(_TRIES):
        t = fixed if still else _spread(piece, fixed, allowed, more)
        if len(t) > _MOST:
            raise ProblemError(
                f"'{piece.name}' takes more than {_MOST} targets; allow more than "
                f"{_in_words(piece, allowed)}"
            )
        offset = np.round(t - first, TIME_DIGITS)
        # Where the arm is at the times that the file has.
        q = _in_digits(motion(np.minimum(first + offset, last)), slides)
        if still:
            q[:] = q[0]
        named = tuple(Event(int(np.abs(t - at).argmin()), name) for at, name in events)
        stretch = Stretch(piece.name, offset, q, named)
        miss = miss_of(stretch, motion, piece.chains, first)
        share = miss.share(allowed)
        if still or share <= 1.0:
            return stretch, miss
        more *= max(1.05, 1.02 * float(np.sqrt(share)))
    raise ProblemError(
        f"'{piece.name}' is off by {1e3 * miss.position:.3g} mm and "
        f"{np.degrees(max(miss.rotation, miss.joint)):.3g}° with {len(t)} targets; allow more than "
        f"{_in_words(piece, allowed)}"
    )


def _check_digits(piece: Piece, slides: Flags, allowed: Tolerance) -> None:
    """Refuse what no number of targets keeps, as they have few digits."""
    q = piece.motion.q
    miss = miss_between(_in_digits(q, slides), q, piece.chains)
    if miss.share(allowed) > 1.0:
        raise ProblemError(
            f"'{piece.name}': programs count angles in {10.0**-ANGLE_DIGITS:g}°, which is up to "
            f"{1e3 * miss.position:.2g} mm and {np.degrees(miss.rotation):.2g}° of the tool; allow "
            f"more than {_in_words(piece, allowed)}"
        )


def _in_words(piece: Piece, allowed: Tolerance) -> str:
    """Return what is allowed as the file of settings says it."""
    key = "move_deviation" if piece.is_move else "deviation"
    return (
        f"{key} = {{ position_mm = {1e3 * allowed.position:.3g}, "
        f"rotation_deg = {np.degrees(allowed.rotation):.3g} }}"
    )


def _apart(first: float, last: float, times: Sequence[float]) -> Array:
    """Return first, last and times between them, but for those that are written as the same."""
    least, found = 2.0 * 10.0**-TIME_DIGITS, [first]
    for t in sorted(times):
        if found[-1] + least < t < last - least:
            found.append(t)
    return np.array([*found, last])


def _rests(motion: Trajectory, first: float, last: float) -> bool:
    times = np.linspace(first, last, 33)
    return bool(np.abs(motion(times) - motion(first)).max() < 1e-9)


def _spread(piece: Piece, fixed: Array, allowed: Tolerance, more: float) -> Array:
    """Return times between fixed ones, even in the root of how much the motion bends."""
    found = [fixed[:1]]
    motion = piece.motion
    for begin, end in pairwise(fixed):
        inside = motion.t[(motion.t > begin) & (motion.t < end)]
        marks = np.concatenate([[begin], inside, [end]])
        count = _FINER * (len(marks) - 1) + 1
        t = np.interp(np.linspace(0, len(marks) - 1, count), np.arange(len(marks)), marks)
        bend = _bend(piece, t, allowed)
        rate = np.sqrt(bend / 8.0)
        # A spline swings where long and short steps meet, and it bends nowhere.
        rate = np.maximum(rate, _SPARSE * float(rate.max())) + 1e-3 / max(end - begin, 1e-6)
        way = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
        targets = max(_FEWEST, int(np.ceil(more * way[-1])))
        # Programs count whole digits of time: targets may not fall on each other.
        targets = min(targets, max(1, int((end - begin) * 10**TIME_DIGITS / 2)))
        found.append(np.interp(np.linspace(0.0, way[-1], targets + 1)[1:], way, t))
        found[-1][-1] = end
    return np.concatenate(found)


def _bend(piece: Piece, t: Array, allowed: Tolerance) -> Array:
    """Return the accelerations of tool and joints as shares of what is allowed, (K,) [1/s²]."""
    motion = piece.motion
    q, qdd = motion(t), motion(t, 2)
    found: Array = np.abs(qdd).max(axis=1) / allowed.rotation
    for chain in piece.chains:
        rates = np.einsum("kij,kj->ki", chain.along(q)[0], qdd)
        for rows, limit in ((slice(0, 3), allowed.position), (slice(3, 6), allowed.rotation)):
            found = np.maximum(found, np.linalg.norm(rates[:, rows], axis=1) / limit)
    return found


def _in_digits(q: Array, slides: Flags) -> Array:
    """Return coordinates [rad or m] as they are when their digits in a file are read again."""
    degrees = np.radians(np.round(np.degrees(q), ANGLE_DIGITS))
    return np.where(slides, 1e-3 * np.round(1e3 * q, LENGTH_DIGITS), degrees)
