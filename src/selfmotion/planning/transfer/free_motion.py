"""Free joint motions between configurations, within limits and around bodies."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    TURN,
    Array,
    InverseKinematicsError,
    PlanError,
    Progress,
    read_only,
    silent,
)
from selfmotion.certificate import Quantity
from selfmotion.model.collision import how_near
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Trajectory, slowdown_of
from selfmotion.model.path import Dwell
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Task
from selfmotion.planning.result import (
    Ends,
    Move,
    PaceLimits,
    along,
    fastest_pace,
    quantities_of_pace,
)
from selfmotion.planning.search import start_candidates
from selfmotion.planning.transfer.rrt_connect import (
    MOVE_MARGIN,
    PATH_SAMPLES,
    ROUNDING,
    Room,
    find_path,
    rounded,
    shortened,
    straight_legs,
)
from selfmotion.problem.constraints import Constraint, Envelope
from selfmotion.problem.problem import at_all_times, envelope_of

# Default time of the processor for a move [s].
MOVE_SECONDS = 10.0
# Share of the limits that is used.
_USED = 0.95
# Without a limit of acceleration: time to full speed [s] …
_UP_TO_SPEED = 0.25
# … which without a limit of speed is this [rad/s or m/s].
_USUAL_SPEED = 1.0
# Without a limit of jerk: time to full acceleration [s], and shortest duration of a move;
# controllers need accelerations without jumps.
_SOFT = 0.02
# Interval between knots of a pace [s].
_STEP_OF_PACE = 4e-3
# Factor by which a move is slowed for requirements that depend on the pace …
_SLOWER_FACTOR = 1.2
# … at most this number of times.
_SLOWER_TRIES = 12
# Factor of the margin and of the density of collision checks after a violation between them.
_WIDER = 2.0
# Searches with ever denser checks.
_TRIES_OF_MOVE = 4
# Retreats along the tool's axis from which trees start as well, if the straight leg is blocked [m].
_RETREATS = (0.01, 0.03, 0.08)
# A move shorter than this [rad or m] has one smooth time law.
_SHORTEST_PACED = 2e-3
# Largest number of configurations for an end that is a pose of the tool.
_END_CONFIGURATIONS = 16


# Accumulated rounding of a motion, in units of the last place.
_ROUNDINGS = 16.0


def constraints_of_moves(
    robot: RobotModel, constraints: Sequence[Constraint]
) -> tuple[Constraint, ...]:
    """Return what a move of an arm keeps: conditions at all times, of those that apply to it."""
    return tuple(item for item in at_all_times(constraints) if item.applies(robot))


class FreeMotions:
    """Finds motions of an arm between configurations.

    Parameters
    ----------
    robot : RobotModel
    constraints : sequence of Constraint
        Those at all times apply; those on ends are left out.
    rng : Generator
    progress : Progress
    """

    def __init__(
        self,
        robot: RobotModel,
        constraints: Sequence[Constraint],
        rng: np.random.Generator,
        progress: Progress = silent,
    ) -> None:
        self.robot, self.constraints = robot, constraints_of_moves(robot, constraints)
        self._rng, self._progress = rng, progress
        self.envelope: Envelope = envelope_of(robot, self.constraints)

    def configurations(self, end: npt.ArrayLike | SE3, task: Task) -> Array:
        """Return the configurations (k, n) that an end stands for; see `move`."""
        if not is_pose(end):
            return self.robot.configuration(end)[None]
        arm = self.envelope.arm(self.robot)
        follows = Follows.of(arm, Dwell(end, 1.0), task)
        room = Room(self.envelope, self.robot)
        found = np.array(start_candidates(follows, _END_CONFIGURATIONS, self._rng, room.free))
        free = found[room.free(found)]
        if not len(free):
            raise InverseKinematicsError(
                f"{self.robot.name}: all {len(found)} configurations that were found for the pose "
                f"of an end are beyond limits or meet something; give a configuration or fewer "
                f"rows (task=)",
                position_miss=0.0,
                rotation_miss=0.0,
            )
        return free

    def between(
        self,
        first: Array,
        last: Array,
        seconds: float = MOVE_SECONDS,
        known: Array | None = None,
    ) -> Move:
        """Return the move between configurations (n,), or the cause why there is none.

        A `known` polyline (m, n) between them is used if it is free and not straight.
        """
        return self.through([first[None], last[None]], seconds, known)

    def time_of(self, first: Array, last: Array) -> Array:
        """Return lower bounds of the times of straight moves (K, n) → (K, n) by the limits [s]."""
        limits = self._limits
        far = np.abs(last - first)
        # From rest to rest: full acceleration, full speed, full brake.
        ramp = limits.speed / limits.acceleration
        short = 2.0 * np.sqrt(far / limits.acceleration)
        times = np.where(far > limits.speed * ramp, far / limits.speed + ramp, short)
        return np.asarray(times.max(axis=-1))

    def through(self, ends: Sequence[Array], seconds: float, known: Array | None = None) -> Move:
        """Return the move through one of several configurations (k, n) each, in this order.

        A polyline from the first to the last one may be `known`; see `between`.
        """
        self._progress("move", 1, 1)
        blocked = _blocked(self, ends)
        if blocked:
            return _missing(self, blocked)
        # Processor time: the result is independent of other processes.
        began = time.thread_time()
        ends = [_inside(self, several) for several in ends]
        worst, margin, finer = "", MOVE_MARGIN, 1.0
        for _ in range(_TRIES_OF_MOVE):
            room = Room(self.envelope, self.robot, margin, finer)
            polyline = _known_polyline(self, room, ends, known) or self._polyline(
                room, ends, began + seconds
            )
            if polyline is None:
                break
            path = rounded(room, *polyline)
            if path is not None:
                try:
                    move = self.at_its_pace(path)
                except PlanError as error:
                    return _missing(self, str(error))
                if move.verified:
                    return move
                worst = worst or f", where {move.trouble}"
            margin, finer = _WIDER * margin, _WIDER * finer
        waited = time.thread_time() - began
        return _missing(
            self, f"no way was found between the configurations in {waited:.1f} s{worst}"
        )

    def refusal(self, q: Array) -> str:
        """Return the cause why no motion starts or ends at a configuration (n,), "" for none."""
        return "" if Room(self.envelope, self.robot, 0.0).free(q[None])[0] else _wrong_with(self, q)

    def _polyline(
        self, room: Room, ends: Sequence[Array], end: float
    ) -> tuple[Array, list[int]] | None:
        """Return a polyline (m, n) through all ends, and the indices of the inner ones."""
        legs: list[Array] = []
        starts = _allowed(room, ends[0])
        for goals in ends[1:]:
            leg = _leg(self, room, starts, _allowed(room, goals), end)
            if leg is None:
                return None
            legs.append(leg)
            starts = leg[-1:]
        passed = np.cumsum([len(leg) - 1 for leg in legs]).tolist()[:-1]
        return np.concatenate([legs[0], *(leg[1:] for leg in legs[1:])]), passed

    @property
    def _limits(self) -> Envelope:
        """The limits of the pace: all of speed and acceleration are finite."""
        envelope = self.envelope
        speed = np.where(np.isfinite(envelope.speed), envelope.speed, _USUAL_SPEED)
        usual = speed / _UP_TO_SPEED
        faster = np.where(np.isfinite(envelope.acceleration), envelope.acceleration, usual)
        return replace(
            envelope,
            speed=read_only(_USED * speed),
            acceleration=read_only(_USED * faster),
            jerk=read_only(_USED * envelope.jerk),
        )

    @cached_property
    def _quantities(self) -> tuple[Quantity, ...]:
        """Quantities that depend on the pace."""
        return quantities_of_pace([item.requirement(self.robot) for item in self.constraints])

    def _fast(self, path: Trajectory) -> Trajectory:
        """Return a joint path at the fastest pace that the limits allow, from rest to rest."""
        limits = self._limits
        jerk = np.where(np.isfinite(limits.jerk), limits.jerk, limits.acceleration / _SOFT)
        retained = PaceLimits(limits.speed, limits.acceleration, jerk, self._quantities)
        return along(fastest_pace(path, retained, Ends(), _STEP_OF_PACE), path)

    def at_its_pace(self, path: Trajectory) -> Move:
        """Return the move along a joint path, as fast as it may be."""
        # Of the shortest ones a search for the fastest pace sees rounding only.
        short = path.travelled(path.t[-1:]).max() < _SHORTEST_PACED
        motion = self._unhurried(path) if short else self._fast(path)
        q, qd = motion.q.copy(), motion.qd.copy()
        # Exactly at the given ends.
        q[0], q[-1], qd[0], qd[-1] = path.q[0], path.q[-1], 0.0, 0.0
        faster = motion(motion.t, 2)
        for slower in _SLOWER_FACTOR ** np.arange(_SLOWER_TRIES):
            t, names = slower * motion.t, self.robot.joint_names
            whole = Trajectory(t, q, qd / slower, names, faster / slower**2)
            found = Move(self.robot, self.constraints, whole)
            if not any(not item.satisfied and item.of_pace for item in found.findings):
                break
        return found

    def _unhurried(self, path: Trajectory) -> Trajectory:
        """Return a joint path over 0 to 1 from rest to rest by one smooth law of time.

        σ = 10τ³ - 15τ⁴ + 6τ⁵, as fast as the limits allow.
        """
        tau = np.linspace(0.0, 1.0, PATH_SAMPLES + 1)
        sigma = np.clip(tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2), 0.0, 1.0)
        rate = 30.0 * tau**2 * (1.0 - tau) ** 2
        bend = 60.0 * tau * (1.0 - 3.0 * tau + 2.0 * tau**2)
        q, qd = path(sigma), path(sigma, 1)
        qdd = path(sigma, 2) * rate[:, None] ** 2 + qd * bend[:, None]
        unit = Trajectory(tau, q, qd * rate[:, None], self.robot.joint_names, qdd)
        limits = self._limits
        needed = slowdown_of(unit, (limits.speed, limits.acceleration, limits.jerk))
        longest = max(needed, _SOFT)
        faster = qdd / longest**2
        return Trajectory(longest * tau, q, unit.qd / longest, unit.joint_names, faster)


def _inside(motions: FreeMotions, q: Array) -> Array:
    """Return configurations on a limit as far inside it as rounding may lead beyond."""
    lower, upper = motions.envelope.lower, motions.envelope.upper
    return np.clip(q, lower + _ulps(lower), upper - _ulps(upper))


def _missing(motions: FreeMotions, trouble: str) -> Move:
    return Move(motions.robot, motions.constraints, None, trouble)


def _blocked(motions: FreeMotions, ends: Sequence[Array]) -> str:
    """Return the cause why an end is not allowed, "" for none."""
    room = Room(motions.envelope, motions.robot, 0.0)
    for number, several in enumerate(ends):
        if room.free(several).any():
            continue
        where = "first" if number == 0 else "last" if number == len(ends) - 1 else "via"
        return f"the {where} configuration is not allowed: {_wrong_with(motions, several[0])}"
    return ""


def _wrong_with(motions: FreeMotions, q: Array) -> str:
    """Return the violated condition of a configuration (n,), in words."""
    envelope, beyond = motions.envelope, []
    for joint, name in enumerate(motions.robot.joint_names):
        low, high = envelope.lower[joint], envelope.upper[joint]
        if max(low - q[joint], q[joint] - high) > ROUNDING:
            beyond.append(
                f"joint '{name}' is at {q[joint]:.5g} {motions.robot.unit_of(name)} "
                f"({low:.5g} to {high:.5g} allowed)"
            )
    if beyond:
        turns = [k for k, name in enumerate(motions.robot.joint_names)
                 if not motions.robot.is_prismatic(name)]  # fmt: skip
        in_degrees = bool(turns) and np.abs(q[turns]).max() > TURN
        asked_for = "; are these degrees? Angles are in rad" if in_degrees else ""
        return f"{'; '.join(beyond)}; give one within the limits{asked_for}"
    for model, far in envelope.bodies:
        near = model.distance(q)
        if near.value < far:
            apart = f"{how_near(near.value)} (wanted: {far * 1e3:.2f} mm)"
            return f"{near.first} and {near.second} {apart}"
    names = ", ".join(item.name for item in envelope.quantities)
    return f"it leaves what is asked of {names}"


def _known_polyline(
    motions: FreeMotions, room: Room, ends: Sequence[Array], known: Array | None
) -> tuple[Array, list[int]] | None:
    """Return a known polyline (m, n), if it is free and not straight."""
    if known is None or straight_legs(room, ends[0], ends[-1]) is not None:
        return None
    # On limits, the ends are put inside them.
    known = np.concatenate([ends[0], known[1:-1], ends[-1]])
    if not all(room.is_open(*leg) for leg in pairwise(known)):
        return None
    return shortened(room, known, motions._rng), []


def _leg(motions: FreeMotions, room: Room, starts: Array, goals: Array, end: float) -> Array | None:
    """Return a polyline from one of starts (a, n) to one of goals (b, n), also after a retreat.

    In a workpiece the only way out is narrow, and along the tool's axis.
    """
    direct = straight_legs(room, starts, goals)
    if direct is not None:
        return direct
    out = [_retreats(motions, room, several) for several in (starts, goals)]
    first, last = (np.concatenate([q, out[k][0]]) for k, q in enumerate((starts, goals)))
    polyline = find_path(room, first, last, end, motions._rng)
    if polyline is None:
        return None
    before, after = (
        [origin for place, origin in zip(*each, strict=True) if np.array_equal(place, tip)]
        for each, tip in zip(out, (polyline[0], polyline[-1]), strict=True)
    )
    if not (before or after):
        return polyline
    whole = np.concatenate(
        [*(q[None] for q in before[:1]), polyline, *(q[None] for q in after[:1])]
    )
    return shortened(room, whole, motions._rng)


def _retreats(motions: FreeMotions, room: Room, several: Array) -> tuple[Array, Array]:
    """Return configurations of retreats, and those from which a free leg leads there."""
    robot, found, origins = motions.robot, list[Array](), list[Array]()
    for q in several:
        for length in _RETREATS:
            away = robot.pose(q) * SE3(np.eye(3), np.array([0.0, 0.0, -length]))
            try:
                there = robot.inverse_kinematics(away, seed=q, attempts=1)
            except InverseKinematicsError:
                continue
            if room.is_open(q, there):
                found.append(there)
                origins.append(q)
    return np.reshape(found, (-1, robot.dof)), np.reshape(origins, (-1, robot.dof))


def is_pose(end: npt.ArrayLike | SE3) -> bool:
    """Whether an end of a move is a pose of the tool, not a configuration."""
    return hasattr(end, "homogeneous") or np.shape(end) == (4, 4)


def _ulps(limit: Array) -> Array:
    """Return the rounding of sums of a few numbers of this size."""
    finite = np.where(np.isfinite(limit), limit, 0.0)
    return np.asarray(_ROUNDINGS * np.spacing(1.0 + np.abs(finite)))


def _allowed(room: Room, several: Array) -> Array:
    """Return those of configurations that are free; all where none is with its margin."""
    free = several[room.free(several)]
    return free if len(free) else several
