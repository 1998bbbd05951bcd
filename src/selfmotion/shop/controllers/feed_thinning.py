"""As few tool poses as keep a seam at its feed: straight and circular steps as long as can be.

From each target the next is as far ahead as one step keeps near the motion, where the tool has
gone as far. Where the tool is, is kept as the settings say. How it turns where that is free, and
the arm's self-motion, may be off by more: by as much as still keeps all that the seam has to, which
its certificate judges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Trajectory
from selfmotion.shop.controllers.feed_stretches import FeedStretch, PassedLength, times_at
from selfmotion.shop.controllers.program_texts import TIMED
from selfmotion.shop.controllers.steps import (
    Allowed,
    Places,
    Steps,
    StepSearch,
    arc_through,
    step_lengths,
)
from selfmotion.shop.controllers.stretches import (
    SURE,
    Event,
    Knots,
    Miss,
    Stretch,
    by_each_way,
    on_one_side,
)
from selfmotion.shop.controllers.targets import NotByPosesError, PoseSpan, largest
from selfmotion.shop.controllers.thinning import Piece, events_within, rests
from selfmotion.shop.controllers.tool_frames import Rounding, ToolFrames, carrier_in_reference

# What turning and self-motion may be off, from the most that is tried on [rad or m], the last as
# all else is; and how much of what is allowed of places: where corners are cut the feed suffers.
_FREE, _OF_PLACES = (0.2, 0.02, 0.0), (1.0, 0.3)
# Places along a stretch that are looked at, at least and at most.
_FEWEST, _MOST = 400, 2000
# Stretches shorter than this have no feed [m]; steps at least [m]; tries to halve those that take
# more than they may.
_SHORT, _STEP, _TRIES = 1e-3, 1e-5, 12
# Speeds have so many digits [m/s]. Leads have no feed: each ramp takes this share of their time.
_SPEED_DIGITS, _RAMP = 8, 0.25
# What joints are off may change by this share of what they may be off, from look to look, and by
# so much at corners in any case [rad or m].
_SWING, _LEAST_SWING = 0.1, 3e-4
# Events have to be as near to their times [s].
_PROMPT = 5e-4


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

    def stretches(self, allowed: Tolerance) -> list[tuple[Stretch, Miss]]:
        """See `Span.stretches`: one from rest to rest of the tool, the arm's self-motion aside.

        With times where speeds do not do, and the stretch says why.
        """
        if rests(self.piece.motion, self.first, self.last):
            return super().stretches(allowed)
        self.check_regular(allowed)
        parts = [self._part(*ends) for ends in pairwise(self._stops)]
        gone = [part._gone for part in parts]
        why, stuck = "there is no feed where the tool hardly moves", None
        for free, share in product(_FREE, _OF_PLACES):
            if min(each.whole for each in gone) < _SHORT:
                break
            nearer = replace(allowed, position=share * allowed.position)
            turning = max(free, allowed.rotation)
            made = [
                part._fewest(each, nearer, turning) for part, each in zip(parts, gone, strict=True)
            ]
            found = [stretch for stretch in made if isinstance(stretch, FeedStretch)]
            if len(found) < len(parts):
                # Where it is with the most that may be off.
                stuck = stuck or next(at for at in made if not isinstance(at, FeedStretch))
                why = self._lost(stuck, allowed)
                continue
            why = (
                "with poses at its feed it does not keep all that it has to (limits, clearances, "
                "the feed itself): leave more room, or take a lower feed"
            )
            if not all(part._is_prompt(own) for part, own in zip(parts, found, strict=True)):
                why = "an event is where the tool is slower than its feed, or it is at no feed"
            elif self._keeps(found, gone, allowed):
                pairs = zip(parts, found, strict=True)
                return [(stretch, part._miss(stretch)) for part, stretch in pairs]
        ((timed, miss),) = super().stretches(allowed)
        return [(replace(timed, remark=f"{TIMED}{why}"), miss)]

    def _lost(self, at: float, allowed: Tolerance) -> str:
        """Return in words where no poses at a feed keep the motion, and what would help."""
        motion = self.piece.motion
        tool = self.piece.chains[0].place(motion(at)).translation
        place = ", ".join(f"{value:.3f}" for value in tool)
        return (
            f"near t = {at - motion.t[0]:.4g} s, at ({place}) m, no poses at its feed keep it "
            f"within {1e3 * allowed.position:.3g} mm and {np.degrees(allowed.rotation):.3g}°: in "
            f"corners round them more (tolerance = 0.002), or stop there (corners = 'stop'); else "
            f"allow more (deviation), or keep away from singular poses"
        )

    @property
    def _stops(self) -> list[float]:
        """When the tool rests, from the first to the last."""
        at = self.piece.motion.t[0] + np.array(self.piece.tool_rests)
        inside = at[(at > self.first + _PROMPT) & (at < self.last - _PROMPT)]
        return [self.first, *inside.tolist(), self.last]

    def _part(self, first: float, last: float) -> "FeedSpan":
        events = events_within(self.piece, first, last)
        return replace(self, first=first, last=last, events=events)

    @property
    def _gone(self) -> PassedLength:
        return PassedLength.of_motion(self.frames, self.piece.motion, self.first, self.last)

    def _keeps(
        self, stretches: Sequence[FeedStretch], gone: Sequence[PassedLength], allowed: Tolerance
    ) -> bool:
        """Whether the seam keeps all that it has to with stretches in place of its motion.

        By each way in which a controller may join their targets.
        """
        ways = (stretch.at_pace(each) for stretch, each in zip(stretches, gone, strict=True))
        return all(self._keeps_by(parts, allowed) for parts in by_each_way(ways))

    def _keeps_by(self, parts: Sequence[Knots], allowed: Tolerance) -> bool:
        motion, begin = self.piece.motion, self.first
        rows: list[tuple[Array, Array, Array]] = []
        for t, q, qd in parts:
            if not np.isfinite(q).all():
                return False
            kept = slice(1 if rows else 0, None)
            rows.append((begin + t[kept], q[kept], qd[kept]))
            begin += float(t[-1])
        before, after = motion.t < self.first - _PROMPT, motion.t > self.last + _PROMPT
        given = motion.t, motion.q, motion.qd
        whole = [
            np.concatenate([own[before], *each, own[after]])
            for own, each in zip(given, zip(*rows, strict=True), strict=True)
        ]
        judged = Trajectory(whole[0], whole[1], whole[2], motion.joint_names)
        return self.piece.keeps is not None and self.piece.keeps(judged, allowed)

    def _is_prompt(self, stretch: FeedStretch) -> bool:
        """Whether there is time to run up, and events are on time, ramps being even."""
        if not stretch.ramps.each > 0.0:
            return False
        own = stretch.ramps.times(stretch.t)
        return all(
            abs(own[event.target] - (at - self.first)) < _PROMPT
            for event, (at, _) in zip(stretch.events, self.events, strict=True)
        )

    def _fewest(self, gone: PassedLength, allowed: Tolerance, free: float) -> FeedStretch | float:
        """Return the fewest targets; where none keep what is allowed, near when that is [s]."""
        fixed = self._fixed(gone)
        along = self._along(gone, fixed)
        marks = [int(np.abs(along.gone - each).argmin()) for each in fixed]
        limits = Allowed(allowed.position, allowed.rotation, free)
        steps = StepSearch(self.frames, self.piece.turns, along, limits).between(marks)
        if not isinstance(steps, Steps):
            return self._when(gone, along.gone[steps])
        for _ in range(_TRIES):
            stretch = self._stretch(gone, along, steps)
            taken = self._off(stretch, limits)
            if not isinstance(taken, np.ndarray):
                return taken
            far = taken > 1.0
            if not far.any():
                return stretch
            worst = steps.ends[int(taken.argmax())]
            finer = steps.halved(far)
            if len(finer.ends) == len(steps.ends):
                break
            steps = finer
        return self._when(gone, along.gone[worst])

    def _when(self, gone: PassedLength, far: float) -> float:
        """Return when the tool has gone so far [s]."""
        return float(np.clip(gone.when(np.array([far]))[0], self.first, self.last))

    def _fixed(self, gone: PassedLength) -> Array:
        """Return how far the tool is at ends, events, and where feeds change [m]."""
        start = float(self.piece.motion.t[0])
        changes = [start + item.during.ravel() for item in self.piece.feeds[0]]
        times = np.concatenate([[at for at, _ in self.events], *changes])
        inside = np.unique(gone.at(times[(times > self.first) & (times < self.last)]))
        inside = inside[(inside > _STEP) & (inside < gone.whole - _STEP)]
        inside = inside[np.append(True, np.diff(inside) > _STEP)[: len(inside)]]
        return np.concatenate([[0.0], inside, [gone.whole]])

    def _along(self, gone: PassedLength, fixed: Array) -> Places:
        motion = self.piece.motion
        inside = motion.t[(motion.t > self.first) & (motion.t < self.last)]
        inside = inside[:: max(1, len(inside) // (_MOST - _FEWEST))]
        even = np.linspace(0.0, gone.whole, _FEWEST + 1)
        others = np.unique(np.concatenate([even, gone.at(inside)]))
        others = others[np.append(True, np.diff(others) > _STEP)]
        apart = np.abs(others[:, None] - fixed).min(axis=1) > _STEP
        far = np.sort(np.concatenate([fixed, others[apart]]))
        q = self._at(gone, far)
        places, turns = self.frames.places(q)
        rows = np.hstack([places, on_one_side(turns), q[:, self.frames.external]])
        return Places(far, q, rows, lambda lengths: self.frames.places(self._at(gone, lengths))[0])

    def _at(self, gone: PassedLength, far: Array) -> Array:
        """Return the motion where the tool has gone so far, (K, n)."""
        return self.piece.motion(np.minimum(gone.when(far), self.last))

    def _stretch(self, gone: PassedLength, along: Places, steps: Steps) -> FeedStretch:
        """Return targets, as the file has them."""
        motion, ends = self.piece.motion, steps.ends
        q = self._in_digits(along.q[ends])
        places, turns = self.rounding(along.rows[ends, :3], along.rows[ends, 3:7])
        vias = np.full((len(ends) - 1, 3), np.nan)
        for k in np.flatnonzero(steps.round):
            via = along.middle(ends[k], ends[k + 1])
            via = self.rounding(via[None], turns[[k]])[0][0]
            arc = arc_through(places[k], via, places[k + 1])
            # Halved ones may be too short: they are straight then.
            if arc is not None and arc.is_meant:
                vias[k] = via
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
        """Return the feed of each step; beside a feed, what takes as long with its ramps [m/s]."""
        middles = gone.when(0.5 * (ends[1:] + ends[:-1])) - self.piece.motion.t[0]
        found = np.full(len(middles), gone.whole / ((1.0 - _RAMP) * (self.last - self.first)))
        for item in self.piece.feeds[0]:
            for begin, end in item.during:
                found[(middles >= begin) & (middles <= end)] = item.asked
        return np.round(found, _SPEED_DIGITS)

    def _off(self, stretch: FeedStretch, allowed: Allowed) -> Array | float:
        """Return how much of what is allowed each step takes, corners included, (K,).

        Where joints swing between two looks, as they do near a singular pose, near when [s].
        """
        times, count = stretch.looked_at(), len(stretch.t) - 1
        exact = stretch.matched(self.piece.motion, self.first)
        at, facing = self.frames.places(exact)
        worst = np.zeros(count)
        for line in stretch.ways(times):
            off = line - exact
            swing = np.abs(np.diff(off, axis=0)).max(axis=1)
            # Written so that NaN does.
            swings = ~(swing <= max(_SWING * allowed.free, _LEAST_SWING))
            if swings.any():
                return float(min(self.first + times[int(swings.argmax())], self.last))
            places, turns = self.frames.places(line)
            taken = np.linalg.norm(places - at, axis=1) / allowed.position
            taken = np.maximum(taken, np.abs(off).max(axis=1) / allowed.free)
            turned = allowed.turned(self.frames, self.piece.turns, turns, facing)
            worst = np.maximum(worst, largest(np.maximum(taken, turned), count))
        return SURE * worst


def _rides_along(frames: ToolFrames) -> bool:
    """Whether the path is given in a frame that the work object stands still in."""
    return carrier_in_reference(frames.robot, frames.carrier) is not None
