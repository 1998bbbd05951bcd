"""Commands: limits of the joints, segments, and a state for each cycle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import and_

import numpy as np

from selfmotion.basics import Array, ProblemError, StartError
from selfmotion.basics.layout import Layout
from selfmotion.model.robot import Kinematics, RobotModel
from selfmotion.problem.constraints import (
    Constraint,
    Ends,
    Envelope,
    JointAccelerationLimits,
    JointJerkLimits,
    JointPositionLimits,
    JointVelocityLimits,
    PositionDependentVelocityLimits,
)
from selfmotion.realtime import law
from selfmotion.realtime.law import braking_distance, tightened
from selfmotion.realtime.quantities import is_quantity
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.settings import (
    ACCELERATION,
    ENDS,
    FARTHEST,
    GAIN,
    LONGEST_MEAN,
    SPEED,
)

# Excess of a number of cycles that counts as rounding, relative to it.
_ROUNDING = 1e-9
_USUAL = (
    JointPositionLimits,
    JointVelocityLimits,
    JointAccelerationLimits,
    JointJerkLimits,
    PositionDependentVelocityLimits,
)


def kept_envelope(robot: RobotModel, constraints: Sequence[Constraint]) -> Envelope:
    """Return what the loop keeps of configurations and velocities.

    The limits of the arm and its maker, and of the constraints.

    Raises
    ------
    ProblemError
        A constraint is of a kind that cannot be kept while moving.
    """
    for item in constraints:
        if not (item.kept_moving or is_quantity(item)):
            about = (
                "is about the ends of a motion, which goes on"
                if item.ends != Ends()
                else "says by neither a quantity nor its envelope what it limits"
            )
            raise ProblemError(
                f"constraint {type(item).__name__} is not kept while moving: it {about}; expected "
                f"limits of joints or of a quantity, or a Clearance"
            )
    kinds = {type(item) for item in constraints}
    # Without given ones, those of the arm and its maker.
    asked = [*constraints, *(kind() for kind in _USUAL if kind not in kinds)]
    return reduce(and_, (item.envelope(robot) for item in asked))


def joint_limits(robot: RobotModel, envelope: Envelope) -> Array:
    """Return limits of an arm, (8, n): see `law.DEVIATION`.

    Lower, upper, speed and acceleration, and curves of speed by position.

    Raises
    ------
    ProblemError
        A joint has no limit of acceleration; several constraints say how its speed depends on the
        position.
    """
    limits = np.array([envelope.lower, envelope.upper, envelope.speed, envelope.acceleration])
    endless = np.flatnonzero(~np.isfinite(limits[2:]).all(axis=0))
    if endless.size:
        raise ProblemError(
            f"{robot.name}: joint '{robot.joint_names[int(endless[0])]}' has no limit of speed or "
            f"acceleration, which a stop in time needs; give JointVelocityLimits(…) and "
            f"JointAccelerationLimits(…)"
        )
    several = [item for item in envelope.curves if item.limited.any()]
    if len(several) > 1:
        raise ProblemError(
            f"{robot.name}: {len(several)} constraints say how limits of speed depend on the "
            f"position, expected one PositionDependentVelocityLimits"
        )
    n = robot.dof
    ends = np.full(n, np.inf)
    curves = np.stack([np.ones(n), np.zeros(n), -ends, ends])
    for one in several:
        curves = np.stack([one.deceleration, one.offset, one.lower, one.upper])
    return np.vstack([limits, curves])


def cycles_of_mean(robot: RobotModel, envelope: Envelope, cycle: float) -> int:
    """Return the number M of cycles over which commands are averaged, so that jerks keep limits.

    Accelerations of a mean over M cycles change by 2A/(M h) per time at most: M ≥ 2A/(J h).

    Raises
    ------
    ProblemError
        A mean over that many cycles would no longer be the motion that was planned.
    """
    needed = np.ceil(2.0 * envelope.acceleration / (envelope.jerk * cycle) * (1.0 - _ROUNDING))
    worst = int(np.argmax(needed))
    if needed[worst] * cycle > LONGEST_MEAN:
        unit = robot.unit_of(robot.joint_names[worst])
        most = 0.5 * envelope.jerk[worst] * LONGEST_MEAN
        raise ProblemError(
            f"{robot.name}: joint '{robot.joint_names[worst]}': a jerk of "
            f"{envelope.jerk[worst]:.4g} {unit}/s³ is not kept while moving beside an acceleration "
            f"of {envelope.acceleration[worst]:.4g} {unit}/s², expected JointAccelerationLimits of "
            f"{most:.4g} {unit}/s² or less, or JointJerkLimits of "
            f"{2.0 * envelope.acceleration[worst] / LONGEST_MEAN:.4g} {unit}/s³ or more"
        )
    return max(int(needed[worst]), 1)


def planned_limits(limits: Array) -> Array:
    """Return the limits of plans, within the limits (8, n) of commands."""
    lower, upper, speed, hardest, hard, offset, first, last = limits
    margin = np.minimum(ENDS, 0.1 * (upper - lower))
    ends = lower + margin, upper - margin
    curve = hard, offset, first + margin, last - margin
    return np.stack([*ends, SPEED * speed, ACCELERATION * hardest, *curve])


def stoppable(robot: RobotModel, limits: Array, q: Array, qd: Array, cycle: float) -> Array:
    """Return the control point c (n,) of a motion that starts at q with q̇.

    See `viable_accelerations`.

    Raises
    ------
    StartError
        A joint cannot stop within the limits (8, n) from there.
    """
    c = q + cycle * qd
    lower, upper, speed, hardest = limits[:4]
    ahead = np.where(qd > 0.0, upper - c, c - lower)
    need = np.array(
        [braking_distance(abs(w), most, cycle) for w, most in zip(qd, hardest, strict=True)]
    )
    curve = np.where(qd > 0.0, limits[law.CURVE_UPPER] - q, q - limits[law.CURVE_LOWER])
    most = np.array(
        [
            law.fastest_on_curve(float(room), float(a), float(hard), float(offset), cycle)
            for room, a, hard, offset in zip(curve, *limits[3:6], strict=True)
        ]
    )
    beyond = (np.abs(qd) > speed) | (need > ahead) | ((qd != 0.0) & (np.abs(qd) > most))
    bad = np.flatnonzero((c < lower) | (c > upper) | beyond)
    if bad.size:
        k = int(bad[0])
        name = robot.joint_names[k]
        unit = robot.unit_of(name)
        is_outside = not lower[k] <= q[k] <= upper[k]
        asks = is_outside and unit == "rad" and abs(q[k]) > 2.0 * np.pi
        raise StartError(
            f"joint '{name}' is at {q[k]:.6g} {unit}, {qd[k]:.6g} {unit}/s, from where it cannot "
            f"stop within {lower[k]:.6g}..{upper[k]:.6g} {unit} at up to "
            f"{min(speed[k], max(most[k], 0.0)):.6g} {unit}/s; "
            f"bring the arm within its limits first"
            f"{'; are its angles in degrees? expected rad' if asks else ''}",
            position_miss=0.0,
            rotation_miss=0.0,
        )
    return np.asarray(c)


class Commands:
    """Commands of a segment, and the deviation of the arm from them.

    What is commanded is the mean of the motion of `law` over the last M cycles. Limits of q, q̇ and
    q̈ that a motion keeps are kept by its means, as are limits of q̇ that depend on q by a convex
    function; and the acceleration of the mean changes by no more than 2A/(M h) per time. The motion
    of `law` is ahead of the command by half of that, `lead`.

    Parameters
    ----------
    robot : RobotModel
    limits : (8, n)
        Lower, upper, speed, acceleration, and the curves: see `law.DEVIATION`.
    cycle : float
        Time between commands [s].
    cycles : int
        Number of cycles of a segment that follow the path; later ones bring the arm to rest.
    latency : float
        How old a measured position is [s].
    settling : float
        Time constant [s] of the filter of the arm's deviation from its command.
    mean : int
        Number M of cycles of the mean.
    longest : float
        Time that a stop may take where it need not be the hardest [s].

    Attributes
    ----------
    time : float
        When the first state is commanded [s].
    lead : float
        By how much the motion of `law` is ahead of the command [s].
    """

    def __init__(
        self,
        robot: RobotModel,
        limits: Array,
        cycle: float,
        cycles: int,
        latency: float,
        settling: float,
        mean: int = 1,
        longest: float = 0.0,
    ) -> None:
        self._robot, self._cycle, self._settling = robot, cycle, settling
        # The last row is the arm's deviation from its command.
        self._limits = np.vstack([tightened(limits), np.zeros(robot.dof)])
        # Number of cycles in which every joint stops from its highest speed.
        stopping = int(np.ceil((limits[2] / (limits[3] * cycle)).max())) + 3
        stopping = max(stopping, round(longest / cycle))
        # c, w and a of each cycle; see `viable_accelerations`.
        self._states = np.zeros((cycles + stopping + mean, 3, robot.dof))
        # Those of the M - 1 cycles before.
        self._past = np.zeros((mean - 1, 3, robot.dof))
        self.lead = 0.5 * (mean - 1) * cycle
        # What is left of the last segment, from the present cycle on.
        self._rest = self._states.copy()
        self._sent = np.zeros((round(latency / cycle) + 1, robot.dof))
        self.time = 0.0

    def begin(self, t: float, q: Array, qd: Array) -> None:
        """Command the arm to stop from its first state."""
        c = stoppable(self._robot, self._limits, q + self.lead * qd, qd, self._cycle)
        self._states[:] = 0.0
        # It came at the same rate.
        since = self._cycle * np.arange(len(self._past), 0, -1)[:, None]
        self._past[:, 0], self._past[:, 1], self._past[:, 2] = c - since * qd, qd, 0.0
        self._states[:, 0], self._states[0, 1] = c, qd
        law.brake(self._states, 0, self._limits, 1.0, self._cycle)
        self.time, self._limits[law.DEVIATION], self._sent[:] = t, 0.0, q

    def go_on(self, t: float) -> float:
        """Make the state that is commanded at `t` the first one; return the time passed [s]."""
        passed = round((t - self.time) / self._cycle) if np.isfinite(t) else -1
        if passed < 0:
            raise ProblemError(f"t is {t} s, expected no less than the last step's {self.time} s")
        end = len(self._states) - 1
        here = min(passed, end)
        sent = self._commanded(here)[:, 0]
        if passed > end:
            sent = np.vstack([sent, np.repeat(sent[-1:], min(passed - end, len(self._sent)), 0)])
        self._sent = np.vstack([self._sent, sent[1:]])[-len(self._sent) :]
        past = np.vstack([self._past, self._states[:here]])[len(self._states[:here]) :]
        # Where it has come to rest, it rested before.
        beyond = min(passed - here, len(past))
        self._past[:] = np.vstack([past[beyond:], np.repeat(self._states[here][None], beyond, 0)])
        left = len(self._states) - here
        self._rest[:left], self._rest[left:] = self._states[here:], self._states[-1]
        self._states[0] = self._states[here]
        self.time += passed * self._cycle
        return passed * self._cycle

    @property
    def deviation(self) -> Array:
        """Filtered deviation of the arm from its command, (n,) [rad or m]."""
        return np.asarray(self._limits[law.DEVIATION])

    @property
    def rate(self) -> Array:
        """The rate that is commanded now, (n,)."""
        return np.asarray(self._states[0, 1] - 0.5 * self._cycle * self._states[0, 2])

    @property
    def place(self) -> Array:
        """Estimated configuration of the arm now, (n,)."""
        return np.asarray(self._positions(self._states[:1])[0] + self.deviation)

    def measure(self, q: Array, passed: float) -> str:
        """Take in a measured position (n,); return why the arm may not go on moving, or ""."""
        off = q - self._sent[0]
        worst = int(np.argmax(np.abs(off)))
        if abs(off[worst]) > FARTHEST:
            return f"joint '{self._robot.joint_names[worst]}' is {off[worst]:.3g} from its command"
        share = 1.0 - np.exp(-passed / self._settling)
        self._limits[law.DEVIATION] += share * (off - self._limits[law.DEVIATION])
        return ""

    def follow(self, kinematics: Kinematics, layout: Layout, table: Array) -> bool:
        """Command the cycles of a `table` one after the other; see `law.command`.

        Returns whether the tool moves as planned.
        """
        states, limits, h, n = self._states, self._limits, self._cycle, self._robot.dof
        table[0, :n] = states[0, 0] + 0.5 * h * states[0, 1] + limits[law.DEVIATION]
        follows = True

        def step(
            cycle: int, tip: int, jacobian: Array, rotation: Array, translation: Array
        ) -> bool:
            nonlocal follows
            follows &= law.command(
                cycle, jacobian, rotation, translation, table, states, limits, layout, GAIN, h
            )
            return True

        kinematics.march(table[:, :n], step)
        return follows

    def segment(
        self,
        first: int | None,
        flag: Flag,
        reasons: tuple[str, ...],
        follows: bool,
        error: Array,
        delay: float,
        share: float = 1.0,
    ) -> Segment:
        """Return the commands: from cycle `first` on, the arm is brought to rest.

        By a share of the limits of acceleration. None for the rest of the last segment.
        """
        h = self._cycle
        if first is None:
            self._states[:] = self._rest
            moves = np.flatnonzero(self._states[:, 1:].any(axis=(1, 2)))
            end = min(int(moves[-1]) + 1, len(self._states) - 1) if moves.size else 0
        else:
            end = law.brake(self._states, first, self._limits, share, h)
        # After the end the arm rests.
        self._states[end + 1 :] = self._states[end]
        end = max(min(end + len(self._past), len(self._states) - 1), 1)
        q, qd, qdd = np.moveaxis(self._commanded(end), 1, 0)
        return Segment(
            t=np.asarray(self.time + h * np.arange(end + 1), dtype=np.float64),
            q=q,
            qd=qd,
            qdd=qdd,
            flag=flag,
            reasons=reasons,
            follows=follows,
            tool_error=error,
            delay=delay,
        )

    def _commanded(self, end: int) -> Array:
        """Return q, q̇ and q̈ of the commands up to cycle `end`, (end + 1, 3, n)."""
        states, h = np.concatenate([self._past, self._states[: end + 1]]), self._cycle
        motion = np.stack(
            [self._positions(states), states[:, 1] - 0.5 * h * states[:, 2], states[:, 2]], axis=1
        )
        mean = len(self._past) + 1
        # Relative to the newest of each, so that an arm at rest is exactly at rest.
        newest = motion[mean - 1 :]
        total = sum(motion[k : k + end + 1] - newest for k in range(mean - 1))
        return np.asarray(newest + total / mean)

    def _positions(self, states: Array) -> Array:
        """Return q of states: the spline at its knots, (c⁻ + 4 c + c⁺)/6."""
        h = self._cycle
        return np.asarray(states[:, 0] - h * states[:, 1] + h * h / 6.0 * states[:, 2])
