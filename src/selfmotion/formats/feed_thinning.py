"""As few tool poses as keep a seam at its feed: straight and circular steps as long as can be.

From each target the next is as far ahead as one step keeps near the motion, where the tool has
gone as far. Where the tool is, is kept as the settings say. How it turns where that is free, and
the arm's self-motion, may be off by more: by as much as still keeps all that the seam has to, which
its certificate judges.
"""

from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.certificate import Tolerance
from selfmotion.formats.circular import MOST_TURN, arc_through, put_on_arcs, step_lengths
from selfmotion.formats.feed_stretches import FeedStretch, times_at
from selfmotion.formats.passed_lengths import PassedLength
from selfmotion.formats.pieces import Piece
from selfmotion.formats.pose_numbers import Rounding
from selfmotion.formats.pose_stretches import on_one_side, straight
from selfmotion.formats.pose_thinning import NotByPosesError, PoseSpan, largest
from selfmotion.formats.stretches import SURE, Event, Miss, Stretch
from selfmotion.formats.tool_frames import WORLD, ToolFrames
from selfmotion.motion import Trajectory

# What turning and self-motion may be off, from the most that is tried on [rad or m], the last as
# all else is; and how much of what is allowed of places: where corners are cut the feed suffers.
_FREE, _OF_PLACES = (0.2, 0.02, 0.0), (1.0, 0.3)
# Places along a stretch that are looked at, at least and at most.
_FEWEST, _MOST = 400, 2000
# Stretches shorter than this have no feed [m]; steps at least [m]; of what is allowed, steps take
# this much before corners and digits; tries to halve those that take more.
_SHORT, _STEP, _OF_ALLOWED, _TRIES = 1e-3, 1e-5, 0.9, 12
# Events have to be as near to their times [s]; half-turns have two axes [rad].
_PROMPT, _NEARLY_HALF = 5e-4, 3.0


class _Steps(NamedTuple):
    """Targets by their places among those that are looked at, and which steps go round."""

    ends: list[int]
    round: list[bool]


class _Along(NamedTuple):
    """The motion at places along a stretch: how far the tool is [m], q (K, n) and rows of poses."""

    lengths: PassedLength
    gone: Array
    q: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class FeedSpan(PoseSpan):
    """What of a seam at a feed lies between two rests, to be written as poses with speeds."""

    @classmethod
    def by(
        cls,
        frames: ToolFrames,
        rounding: Rounding,
        piece: Piece,
        slides: Flags,
        first: float,
        last: float,
    ) -> PoseSpan:
        """Return that of a piece with a feed; of others, what is written with times."""
        given = frames, rounding, piece, slides, first, last
        has_feed = len(piece.feeds) == 1 and bool(piece.feeds[0])
        if not has_feed or piece.keeps is None or not _rides_along(frames):
            return PoseSpan.by(*given)
        return super().by(*given)

    def thinned(self, allowed: Tolerance) -> tuple[Stretch, Miss]:
        """See `Span.thinned`: with times where speeds do not do, and the stretch says why."""
        motion = self.piece.motion
        gone = PassedLength.of_motion(self.frames, motion, self.first, self.last)
        if gone.whole < _SHORT:
            return super().thinned(allowed)
        why = "no poses keep it where the tool has gone as far"
        for free, share in product(_FREE, _OF_PLACES):
            nearer = replace(allowed, position=share * allowed.position)
            stretch = self._fewest(gone, nearer, max(free, allowed.rotation))
            if stretch is None:
                continue
            if not self._is_prompt(stretch):
                why = "an event is where the tool is slower than its feed"
            elif self._keeps(stretch, gone, allowed):
                return stretch, self._miss(stretch)
        timed, miss = super().thinned(allowed)
        return replace(timed, remark=f"with times: {why}"), miss

    def _keeps(self, stretch: FeedStretch, gone: PassedLength, allowed: Tolerance) -> bool:
        """Whether the seam keeps all that it has to with a stretch in place of its motion."""
        motion = self.piece.motion
        t, q, qd = stretch.at_pace(gone)
        if not np.isfinite(q).all():
            return False
        before, after = motion.t < self.first - _PROMPT, motion.t > self.last + _PROMPT
        whole = Trajectory(
            np.concatenate([motion.t[before], self.first + t, motion.t[after]]),
            np.vstack([motion.q[before], q, motion.q[after]]),
            np.vstack([motion.qd[before], qd, motion.qd[after]]),
            motion.joint_names,
        )
        return self.piece.keeps is not None and self.piece.keeps(whole, allowed)

    def _is_prompt(self, stretch: FeedStretch) -> bool:
        """Whether events are on time, ramps being even."""
        own = stretch.ramps.times(stretch.t)
        return all(
            abs(own[event.target] - (at - self.first)) < _PROMPT
            for event, (at, _) in zip(stretch.events, self.events, strict=True)
        )

    def _fewest(self, gone: PassedLength, allowed: Tolerance, free: float) -> FeedStretch | None:
        """Return the fewest targets; None where none keep what is allowed."""
        fixed = self._fixed(gone)
        along = self._along(gone, fixed)
        marks = [int(np.abs(along.gone - each).argmin()) for each in fixed]
        limits = allowed.position, free
        steps = _Steps([0], [])
        for first, last in pairwise(marks):
            part = self._joined(along, first, last, limits)
            if part is None:
                return None
            part = self._even(along, part, limits)
            steps = _Steps(steps.ends + part.ends[1:], steps.round + part.round)
        for _ in range(_TRIES):
            stretch = self._stretch(gone, along, steps)
            far = self._off(stretch, allowed, free) > 1.0
            if not far.any():
                return stretch
            finer = _halved(steps, far)
            if len(finer.ends) == len(steps.ends):
                return None
            steps = finer
        return None

    def _fixed(self, gone: PassedLength) -> Array:
        """Return how far the tool is at ends, events, and where feeds change [m]."""
        start = float(self.piece.motion.t[0])
        changes = [start + item.during.ravel() for item in self.piece.feeds[0]]
        times = np.concatenate([[at for at, _ in self.events], *changes])
        inside = np.unique(gone.at(times[(times > self.first) & (times < self.last)]))
        inside = inside[(inside > _STEP) & (inside < gone.whole - _STEP)]
        inside = inside[np.append(True, np.diff(inside) > _STEP)[: len(inside)]]
        return np.concatenate([[0.0], inside, [gone.whole]])

    def _along(self, gone: PassedLength, fixed: Array) -> _Along:
        motion = self.piece.motion
        inside = motion.t[(motion.t > self.first) & (motion.t < self.last)]
        inside = inside[:: max(1, len(inside) // (_MOST - _FEWEST))]
        even = np.linspace(0.0, gone.whole, _FEWEST + 1)
        far = np.unique(np.concatenate([fixed, even, gone.at(inside)]))
        kept = np.append(True, np.diff(far) > _STEP) | np.isin(far, fixed)
        far = far[kept]
        q = self._at(gone, far)
        places, turns = self.frames.places(q)
        rows = np.hstack([places, on_one_side(turns), q[:, self.frames.external]])
        return _Along(gone, far, q, rows)

    def _joined(
        self, along: _Along, first: int, last: int, limits: tuple[float, float]
    ) -> _Steps | None:
        """Return steps as long as they can be, one after the other."""
        steps, at = _Steps([first], []), first
        while at < last:
            line = self._farthest(along, at, last, limits, is_round=False)
            arc = at if line == last else self._farthest(along, at, last, limits, is_round=True)
            if max(line, arc) <= at:
                return None
            steps.round.append(arc > line + 1)
            at = max(line, arc)
            steps.ends.append(at)
        return steps

    def _farthest(
        self, along: _Along, at: int, last: int, limits: tuple[float, float], *, is_round: bool
    ) -> int:
        """Return how far ahead one step may go; where it begins for nowhere."""
        # The shortest arc has a place in between.
        near, beyond, ahead = at, last + 1, 2 if is_round else 1
        while beyond - near > 1:
            there = min(at + ahead, last) if beyond > last else (near + beyond) // 2
            if there <= near:
                break
            if self._is_near(along, at, there, limits, is_round=is_round):
                near, ahead = there, 2 * ahead
                if near == last:
                    break
            else:
                beyond = there
        return near

    def _even(self, along: _Along, steps: _Steps, limits: tuple[float, float]) -> _Steps:
        """Return as many steps of one kind as long as each other, where these do as well."""
        count = len(steps.round)
        if count < 2 or len(set(steps.round)) > 1:
            return steps
        wanted = np.linspace(along.gone[steps.ends[0]], along.gone[steps.ends[-1]], count + 1)
        ends = [int(np.abs(along.gone - each).argmin()) for each in wanted]
        even = all(
            self._is_near(along, *pair, limits, is_round=steps.round[0]) for pair in pairwise(ends)
        )
        return _Steps(ends, steps.round) if even else steps

    def _is_near(
        self, along: _Along, first: int, last: int, limits: tuple[float, float], *, is_round: bool
    ) -> bool:
        """Whether one step from a place to another keeps near the motion."""
        part = slice(first, last + 1)
        gone, exact = along.gone[part], along.rows[part]
        place, free = (_OF_ALLOWED * limit for limit in limits)
        if 2.0 * np.arccos(min(1.0, abs(float(exact[0, 3:7] @ exact[-1, 3:7])))) > _NEARLY_HALF:
            return False
        rows = straight(gone, gone[[0, -1]], exact[[0, -1]])
        if is_round:
            via = self._middle(along, first, last)
            arc = arc_through(exact[0, :3], via, exact[-1, :3])
            if arc is None or arc.angle > MOST_TURN:
                return False
            put_on_arcs(rows, gone, gone[[0, -1]], exact[[0, -1], :3], via[None])
        if np.linalg.norm(rows[:, :3] - exact[:, :3], axis=1).max() > place:
            return False
        if rows.shape[1] > 7 and np.abs(rows[:, 7:] - exact[:, 7:]).max() > free:
            return False
        if np.linalg.norm(self.frames.turned(rows[:, 3:7], exact[:, 3:7]), axis=1).max() > free:
            return False
        near = np.array(along.q[part])
        near[:, self.frames.external] = rows[:, 7:]
        q, arrived = self.frames.solved(rows[:, :3], rows[:, 3:7], near)
        return bool(arrived.all() and np.abs(q - along.q[part]).max() <= free)

    def _middle(self, along: _Along, first: int, last: int) -> Array:
        """Return where the tool is halfway from one place to another, (3,)."""
        half = 0.5 * (along.gone[[first]] + along.gone[[last]])
        return np.asarray(self.frames.places(self._at(along.lengths, half))[0][0])

    def _at(self, gone: PassedLength, far: Array) -> Array:
        """Return the motion where the tool has gone so far, (K, n)."""
        return self.piece.motion(np.minimum(gone.when(far), self.last))

    def _stretch(self, gone: PassedLength, along: _Along, steps: _Steps) -> FeedStretch:
        """Return targets, as the file has them."""
        motion, ends = self.piece.motion, steps.ends
        q = self._in_digits(along.q[ends])
        places, turns = self.rounding(along.rows[ends, :3], along.rows[ends, 3:7])
        vias = np.full((len(ends) - 1, 3), np.nan)
        for k in np.flatnonzero(steps.round):
            via = self._middle(along, ends[k], ends[k + 1])
            vias[k] = self.rounding(via[None], along.rows[ends[k] : ends[k] + 1, 3:7])[0][0]
        found, arrived = self.frames.solved(places, turns, self._mixed(along.q[ends], q))
        if not arrived.all():
            at = gone.when(along.gone[[ends[int(np.argmin(arrived))]]])[0] - motion.t[0]
            raise NotByPosesError(f"'{self.piece.name}': the arm is singular at t = {at:.4g} s")
        speeds = self._speeds(gone, along.gone[ends])
        times = times_at(places, vias, speeds)
        far = np.append(0.0, np.cumsum(step_lengths(places, vias)))

        def near(own: Array) -> Array:
            share = np.interp(own, times, far) / far[-1]
            return self._at(gone, share * gone.whole)

        events = [
            Event(int(np.abs(along.gone[ends] - gone.at(np.array([at]))).argmin()), name)
            for at, name in self.events
        ]
        return FeedStretch(
            self.piece.name,
            times,
            found,
            tuple(events),
            places=places,
            turns=on_one_side(turns),
            frames=self.frames,
            near=near,
            order=np.arange(q.shape[1]),
            speeds=speeds,
            vias=vias,
            seconds=round(self.last - self.first, 5),
        )

    def _speeds(self, gone: PassedLength, ends: Array) -> Array:
        """Return the feed of each step; beside a feed, as fast as it is on average [m/s]."""
        middles = gone.when(0.5 * (ends[1:] + ends[:-1])) - self.piece.motion.t[0]
        found = np.full(len(middles), gone.whole / (self.last - self.first))
        for item in self.piece.feeds[0]:
            for begin, end in item.during:
                found[(middles >= begin) & (middles <= end)] = item.asked
        return found

    def _off(self, stretch: FeedStretch, allowed: Tolerance, free: float) -> Array:
        """Return how much of what is allowed each step takes, corners included, (K,)."""
        times, count = stretch.looked_at(), len(stretch.t) - 1
        exact = stretch.matched(self.piece.motion, self.first)
        at, facing = self.frames.places(exact)
        worst = np.zeros(count)
        for line in stretch.ways(times):
            if not np.isfinite(line).all():
                return np.full(count, np.inf)
            places, turns = self.frames.places(line)
            taken = np.linalg.norm(places - at, axis=1) / allowed.position
            taken = np.maximum(taken, np.abs(line - exact).max(axis=1) / free)
            turned = np.linalg.norm(self.frames.turned(turns, facing), axis=1)
            worst = np.maximum(worst, largest(np.maximum(taken, turned / free), count))
        return SURE * worst


def _rides_along(frames: ToolFrames) -> bool:
    """Whether the path is given in a frame that the work object stands still in."""
    robot = frames.robot
    carrier = robot.urdf.root if frames.carrier == WORLD else frames.carrier
    return len(robot.chain_to(carrier, robot.reference).joints) == 0


def _halved(steps: _Steps, far: Flags) -> _Steps:
    """Return steps with those halved that are too far off, and their neighbours."""
    near = np.convolve(far, np.ones(3), mode="same") > 0.0
    found = _Steps(steps.ends[:1], [])
    for k, is_round in enumerate(steps.round):
        first, last = steps.ends[k], steps.ends[k + 1]
        # An arc has a place in between.
        if near[k] and last - first >= (4 if is_round else 2):
            found.ends.append((first + last) // 2)
            found.round.append(is_round)
        found.ends.append(last)
        found.round.append(is_round)
    return found
