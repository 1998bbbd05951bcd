"""Joint torques at all times: bounds, not only samples.

Between the trajectory's samples torques are smooth in time. Its intervals are halved until no joint
turns far in one: torques are trigonometric in q, and points whole turns apart look alike. On each
they are computed at five points; the polynomial through every other of them predicts the rest, and
the largest miss of these predictions is added to what the polynomial through all points reaches.
Intervals on which this does not decide are halved.
"""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.certificate.findings import Finding
from selfmotion.certificate.interpolation import stencil
from selfmotion.certificate.requirement import FinishedMotion, Requirement
from selfmotion.motion import Trajectory
from selfmotion.robot import Dynamics

# Points per interval, and how often one is halved before it counts as undecided.
_POINTS, _DEPTH = 5, 12
# The farthest that a joint goes in an interval [rad or m]; its sines and cosines are then nearly
# parabolas. How often intervals are halved for that, and how many of them are looked at.
_FAR, _FINEST, _MOST = 0.2, 40, 200_000
# At a sample a trajectory belongs to the interval after it: ends are looked at this share before.
_BEFORE = 1e-9


@dataclass(frozen=True, eq=False)
class JointTorques(Requirement):
    """|τ| stays below the limit of each joint, at all times.

    Attributes
    ----------
    dynamics : Dynamics
    limit : (n,)
        [Nm, or N]; inf where there is none.
    """

    dynamics: Dynamics
    limit: Array
    name: str = "joint torque limits"

    def __post_init__(self) -> None:
        object.__setattr__(self, "limit", read_only(self.limit))

    @property
    def covers(self) -> tuple[str, ...]:
        """See `Requirement.covers`."""
        return ("torques",)

    def judge(self, motion: FinishedMotion) -> Finding:
        """See `Requirement.judge`: the largest share of a limit."""
        pending = _short_intervals(motion.trajectory)
        if pending is None:
            return self._too_far(motion)
        worst, when, joint = 0.0, float(pending[0, 0]), 0
        for depth in range(_DEPTH + 1):
            bounds, measured, times = self._bounds(motion.trajectory, pending)
            # Written so that NaN settles nothing.
            settled = (bounds.max(axis=1) <= 1.0) | (measured.max(axis=1) > 1.0)
            if depth == _DEPTH:
                settled[:] = True
            if settled.any():
                rows = np.flatnonzero(settled)
                row, column = np.unravel_index(int(np.argmax(bounds[rows])), bounds[rows].shape)
                if not bounds[rows][row, column] <= worst:
                    worst = float(bounds[rows][row, column])
                    when, joint = float(times[rows][row, column]), int(column)
            if settled.all():
                break
            pending = _halves(pending[~settled])
        name = motion.robot.joint_names[joint]
        text = (
            f"joint '{name}' needs {worst * self.limit[joint]:.4g} Nm or N at t = {when:.3f} s, "
            f"{worst:.5g} times its limit of {self.limit[joint]:.4g}"
        )
        return Finding(self.name, name, when, worst, 1.0, bool(worst <= 1.0), text)

    def _too_far(self, motion: FinishedMotion) -> Finding:
        """Return what is said of a motion that is too long to be looked at."""
        trajectory = motion.trajectory
        way = trajectory.travelled(trajectory.t[-1:])[0]
        joint = int(np.argmax(way))
        name = motion.robot.joint_names[joint]
        text = (
            f"joint '{name}' travels {way[joint]:.3g} rad or m: too far to follow its torque; "
            f"check the motion in parts"
        )
        at = float(trajectory.t[0])
        return Finding(self.name, name, at, np.inf, 1.0, False, text)

    def _bounds(self, motion: Trajectory, intervals: Array) -> tuple[Array, Array, Array]:
        """Return bounds of |τ| / limit, what was measured, and about when, (I, n) each."""
        shares, predict, between, dense = stencil(_POINTS)
        starts, lengths = intervals[:, :1], np.diff(intervals, axis=1)
        t = (starts + lengths * np.minimum(shares, 1.0 - _BEFORE)).ravel()
        torques = self.dynamics.torques(motion(t), motion(t, 1), motion(t, 2))
        used = (torques / self.limit).reshape(len(intervals), _POINTS, -1)
        missed = np.abs(used[:, 1::2] - np.einsum("ab,ibn->ian", predict, used[:, ::2]))
        inside = np.einsum("ab,ibn->ian", dense, used)
        # The peak of a parabola is higher than the points beside it by at most this.
        missed_peaks = 0.125 * np.abs(np.diff(inside, 2, axis=1)).max(axis=1)
        size = np.abs(inside)
        times = starts + lengths * between[np.argmax(size, axis=1)]
        bounds = size.max(axis=1) + missed.max(axis=1) + missed_peaks
        return bounds, np.abs(used).max(axis=1), times


def _short_intervals(motion: Trajectory) -> Array | None:
    """Return intervals (I, 2) in which no joint goes far, or None if they are too many."""
    pending, done, count = np.stack([motion.t[:-1], motion.t[1:]], axis=1), [], 0
    for _ in range(_FINEST):
        way = motion.travelled(pending[:, 1]) - motion.travelled(pending[:, 0])
        # Written so that NaN is far.
        far = ~(way.max(axis=1) <= _FAR)
        done.append(pending[~far])
        count += len(done[-1])
        pending = _halves(pending[far])
        if not len(pending):
            return np.concatenate(done)
        if count + len(pending) > _MOST:
            break
    return None


def _halves(intervals: Array) -> Array:
    """Return both halves of each interval, (2 I, 2)."""
    middle = intervals.mean(axis=1)
    halves = np.stack([intervals[:, 0], middle, middle, intervals[:, 1]], axis=1)
    return halves.reshape(-1, 2)
