"""Motions by tool poses and the speed between them, in place of times: what a shop touches up.

A controller goes along each straight or circular step at its speed, rounds corners within its
zone, and runs up and down by its own acceleration. So a segment is compared with a motion at equal
arc lengths, not at equal times. Where times are needed, even ramps (`Ramps`) stand for those of the
controller: as long as the planned duration leaves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import ceil

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, FileFormatError
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.shop.controllers.arc_length import ArcLength
from selfmotion.shop.controllers.arcs import put_on_arcs, step_lengths
from selfmotion.shop.controllers.pose_segments import PoseSegment, linear_poses
from selfmotion.shop.controllers.ramps import Ramps
from selfmotion.shop.controllers.segments import Curve, Knots, subdivided

# Largest distance from a target at which its corner is rounded [m]: ABB's z0, and as much in the
# others.
ZONE = 3e-4
# Evaluation times of each ramp.
_RAMP_SAMPLES = 24
# Smallest number of evaluation times of a segment …
_MIN_SAMPLES = 3200
# … and of a step between two targets.
_MIN_STEP_SAMPLES = 16
# Length of path below which the tool rests [m].
_MIN_LENGTH = 1e-6
# Relative difference of speeds that counts as rounding of digits.
_SPEED_ROUNDING = 1e-4
# Smallest time between two evaluations [s].
_MIN_INTERVAL = 1e-9
# Share of a step within which its speed need not be the feed beside it.
_CHANGE_SHARE = 0.4


@dataclass(frozen=True, eq=False, kw_only=True)
class FeedSegment(PoseSegment):
    """A motion from rest to rest by tool poses and speeds.

    `t` are nominal times: those at which targets would be reached without ramps.

    Attributes
    ----------
    speeds : (K,)
        Speed of each step [m/s].
    vias : (K, 3)
        Point that a circular step passes [m]; NaN where a step is straight.
    seconds : float
        Planned duration, with ramps [s].
    is_spline : bool
        Whether a program says that it goes smoothly through its targets, not straight between them.
    """

    speeds: Array
    vias: Array
    seconds: float
    is_spline: bool = False

    @property
    @override
    def duration(self) -> float:
        return self.seconds

    @property
    def ramps(self) -> Ramps:
        """Ramps of the segment at its planned duration."""
        return Ramps(float(self.t[-1]), self.seconds)

    @cached_property
    def middles(self) -> PoseSegment:
        """The middles of its K steps as targets: the via poses of circular ones."""
        t = 0.5 * (self.t[1:] + self.t[:-1])
        rows = self._exact_rows(t)
        q = self.joints(rows, t)
        positions = np.where(np.isfinite(self.vias), self.vias, rows[:, :3])
        return PoseSegment(
            self.name,
            t,
            q,
            positions=positions,
            quaternions=rows[:, 3:7],
            frames=self.frames,
            near=self.near,
            order=self.order,
        )

    def is_circular(self, target: int) -> bool:
        """Whether the step to a target, from 1 on, is circular."""
        return bool(np.isfinite(self.vias[target - 1, 0]))

    @cached_property
    def lengths(self) -> Array:
        """Arc length at each target, (K + 1,) [m]."""
        return np.append(0.0, np.cumsum(step_lengths(self.positions, self.vias)))

    @override
    def evaluation_times(self) -> Array:
        # Steps may be as long as the segment.
        count = max(_MIN_STEP_SAMPLES, ceil(_MIN_SAMPLES / (len(self.t) - 1)))
        return subdivided(self.t, np.linspace(0.0, 1.0, count, endpoint=False))

    @property
    @override
    def curves(self) -> list[Curve]:
        """Interpolations: exact steps, steps with rounded corners, a smooth curve.

        The one that the program states is the first.
        """
        curves: list[Curve] = [self._exact_rows]
        if len(self.t) > 2:
            curves.append(self._rounded_rows)
            if not np.isfinite(self.vias).any():
                curves.append(self.spline)
        return curves[::-1] if self.is_spline else curves

    @override
    def motions(self) -> Iterator[Knots]:
        """With ramps, one motion for each interpolation."""
        times = self.ramps.times(self.evaluation_times())
        run_up = np.linspace(0.0, self.ramps.each, _RAMP_SAMPLES)
        times = np.unique(np.concatenate([times, run_up, self.seconds - run_up]))
        times = times[np.append(np.diff(times) > _MIN_INTERVAL, True)]
        times[-1] = self.seconds
        return self._motions_at(times, self.ramps.nominal_times(times))

    @override
    def reference(self, motion: Trajectory, first: float) -> Array:
        """At equal shares of the arc length."""
        travel = ArcLength.of_motion(self.frames, motion, first, first + self.seconds)
        shares = self._lengths_at(self.evaluation_times()) / self.lengths[-1]
        times = travel.times_at(shares * travel.total)
        return motion(np.clip(times, motion.t[0], motion.t[-1]))

    def at_pace(self, travel: ArcLength) -> Iterator[Knots]:
        """Return a motion for each interpolation, with the arc length over time of another."""
        lengths = travel.lengths_at(travel.t) * (self.lengths[-1] / travel.total)
        nominal_times = np.interp(lengths, self.lengths, self.t)
        return self._motions_at(travel.t - travel.t[0], nominal_times)

    def along(self, path: Path, first: float) -> Iterator[Knots]:
        """Return a motion for each interpolation, at the pace of a path from time `first` on [s].

        Raises
        ------
        FileFormatError
            A speed is not that of the path.
        """
        travel = ArcLength.of_path(path, first, first + self.seconds)
        if travel.total < _MIN_LENGTH:
            raise FileFormatError(
                f"'{self.name}' moves where the path rests: the program is of another one"
            )
        target_times = travel.times_at(self.lengths * (travel.total / self.lengths[-1]))
        steps = pairwise(target_times.tolist())
        for speed, (begin, end) in zip(self.speeds.tolist(), steps, strict=True):
            self._check_speed(path, travel, speed, (begin, end))
        return self.at_pace(travel)

    def _check_speed(
        self, path: Path, travel: ArcLength, speed: float, step: tuple[float, float]
    ) -> None:
        """Refuse the speed of a step, from one time to another, that the path does not have there.

        It has to be within the feeds that the path asks for; without any, no faster than the path.
        """
        is_inside = (travel.t >= step[0]) & (travel.t <= step[1])
        fastest, slowest = float(travel.speed[is_inside].max(initial=0.0)), 0.0
        middle = 0.5 * sum(step)
        # A feed over a shorter length than this is within the zone of a target.
        least = min(ZONE, _CHANGE_SHARE * float(np.ptp(travel.lengths_at(np.array(step)))))
        feeds = [
            (feed, *np.clip(window, *step))
            for feed in path.feeds
            for window in feed.during
            if np.ptp(travel.lengths_at(np.clip(window, *step))) > least
        ]
        for feed, first, last in feeds:
            fastest, slowest = feed.asked, (1.0 - feed.within) * feed.asked
            if not slowest <= speed <= (1.0 + _SPEED_ROUNDING) * fastest:
                middle = 0.5 * (first + last)
                break
        if not slowest <= speed <= (1.0 + _SPEED_ROUNDING) * fastest:
            raise FileFormatError(
                f"'{self.name}' is at {1e3 * speed:.5g} mm/s near t = {middle:.4g} s, its path at "
                f"{1e3 * fastest:.5g} mm/s: nothing has judged that speed; plan anew with it as "
                f"the feed"
            )

    def _motions_at(self, times: Array, nominal_times: Array) -> Iterator[Knots]:
        """Yield the motion of each interpolation that reaches nominal times at `times`."""
        for curve in self.curves:
            yield Knots.smooth(times, self.joints(curve(nominal_times), nominal_times))

    def _exact_rows(self, times: Array) -> Array:
        """Return rows at nominal times on the straight and circular steps themselves."""
        rows = linear_poses(times, self.t, self.rows)
        put_on_arcs(rows, times, self.t, self.positions, self.vias)
        return rows

    def _rounded_rows(self, times: Array) -> Array:
        """Return rows at nominal times with corners cut as far from their targets as zones reach.

        Within the zone of a target the tool goes straight, else along its steps.
        """
        reach = np.minimum(0.5 * np.diff(self.lengths), ZONE)
        ends = [self.lengths[1:-1] - reach[:-1], self.lengths[1:-1] + reach[1:]]
        zone_ends, lengths = np.sort(np.concatenate(ends)), self._lengths_at(times)
        rows = self._exact_rows(times)
        in_zone = np.searchsorted(zone_ends, lengths) % 2 == 1
        if in_zone.any():
            rows_at_ends = self._exact_rows(np.interp(zone_ends, self.lengths, self.t))
            rows[in_zone] = linear_poses(lengths[in_zone], zone_ends, rows_at_ends)
        return rows

    def _lengths_at(self, times: Array) -> Array:
        """Return the arc length at nominal times [m]: the path is the same at all speeds."""
        return np.interp(times, self.t, self.lengths)

    @override
    def spline(self, times: Array) -> Array:
        """Over the arc length."""
        from scipy.interpolate import CubicSpline

        rows: Array = CubicSpline(self.lengths, self.rows)(self._lengths_at(times))
        rows[:, 3:7] /= np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)
        return rows


def nominal_target_times(positions: Array, vias: Array, speeds: Array | Sequence[float]) -> Array:
    """Return when targets are reached at speeds (K,) without ramps, (K + 1,) [s].

    Steps are circular where `vias` (K, 3) are numbers.
    """
    return np.append(0.0, np.cumsum(step_lengths(positions, vias) / np.asarray(speeds)))
