"""A motion cut into stretches from rest to rest, as controllers pass it.

A motion is cut where the arm rests, be it for an instant: controllers stop there, and what happens
there happens on time. Which targets there are in between says `selfmotion.controllers.thinning`.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from selfmotion.basics import Flags, ProblemError, Progress, silent
from selfmotion.certificate import Tolerance
from selfmotion.controllers.pieces import Piece
from selfmotion.controllers.pose_thinning import NotByPosesError
from selfmotion.controllers.stretches import NO_MISS, Miss, Misses, Stretch
from selfmotion.controllers.thinning import Span, rests
from selfmotion.motion import Trajectory

# Makes a span of tool poses of a piece, which joints slide, and when it begins and ends.
PosedSpans = Callable[[Piece, Flags, float, float], Span]
# The arm rests where it is as slow as this [rad or m/s] for at least so long [s].
_REST, _WHILE = 1e-7, 0.02
# Programs go from rest to rest: this is rest [rad or m/s], and so is such a share of the fastest.
_SLOW, _SHARE = 1e-4, 1e-3


def stretches_of(
    pieces: Sequence[Piece],
    slides: Flags,
    allowed: Tolerance,
    of_moves: Tolerance | None = None,
    progress: Progress = silent,
    posed: PosedSpans | None = None,
) -> tuple[list[Stretch], Misses]:
    """Return the targets of a motion, as its file has them, and how far they are off it.

    Moves through the air may be off by `of_moves`; by default as far as they keep apart. With
    `posed` they are tool poses; those of moves that poses do not keep are joint targets.

    Raises
    ------
    NotByPosesError
        Poses do not keep a seam.
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
            for stretch, miss in _thinned(piece, slides, first, last, within, posed):
                both = Misses(NO_MISS, miss) if piece.is_move else Misses(miss, NO_MISS)
                worst = worst.worse(both)
                found.append(stretch)
    return found, worst


def _thinned(
    piece: Piece,
    slides: Flags,
    first: float,
    last: float,
    within: Tolerance,
    posed: PosedSpans | None,
) -> list[tuple[Stretch, Miss]]:
    if posed is not None:
        try:
            return posed(piece, slides, first, last).stretches(within)
        except NotByPosesError:
            # A free move goes through singular configurations where it likes.
            if not piece.is_move:
                raise
    return Span.of(piece, slides, first, last).stretches(within)


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
    return rests(motion, first, last)


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
