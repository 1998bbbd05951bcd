"""Replanner: plans the next seconds repeatedly while the arm moves (receding horizon)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, as_number, as_whole, one_blas_thread
from selfmotion.model.follow import Follows, single_tip
from selfmotion.model.motion import NullMotion, PolynomialNullMotion
from selfmotion.model.path import Dwell, Path, PathSamples
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import SE3, Task
from selfmotion.problem.constraints import Constraint, ToolLimits
from selfmotion.problem.costs import Cost, JointVelocity
from selfmotion.realtime import law
from selfmotion.realtime.checks import (
    age_of_target,
    check_kinds,
    check_null_space,
    checked_state,
    checked_terms,
    known_chunk,
    measured_state,
    observed_target,
)
from selfmotion.realtime.chunks import Chunk
from selfmotion.realtime.commands import (
    Commands,
    cycles_of_mean,
    joint_limits,
    kept_envelope,
    planned_limits,
)
from selfmotion.realtime.horizon import Horizon
from selfmotion.realtime.moving_clearance import MovingClearance
from selfmotion.realtime.pace import Sampled
from selfmotion.realtime.paced_path import PacedPath
from selfmotion.realtime.proved_stop import ProvedStop
from selfmotion.realtime.quantities import Quantities, is_quantity
from selfmotion.realtime.reach import Reach
from selfmotion.realtime.reference import Approach, Reference
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.settings import AHEAD, LONGEST_STOP, RETREATS, SOON

# Largest number of Runge-Kutta steps of a horizon.
_MAX_STEPS = 1000


class Replanner:
    """Plans the motion of the next seconds, from where the arm is, once a period.

    Each `step` makes one step of the optimisation over the horizon, warm-started from the last
    coefficients, shifted in time, and commands its first part. Commands are continuous in position,
    velocity and acceleration. The measured deviation of the arm from its command is filtered, and
    the tool is planned for the arm's pose, so that the command compensates for it.

    Limits of position, velocity, acceleration and jerk hold for every command, at all times and in
    all events (`selfmotion.realtime.law`): where they conflict with the path, the path is left.
    Distances and quantities are rows of the plan, and proved of each segment to its rest before it
    is issued: without a proof the segment before, which has one, runs to its rest.

    Parameters
    ----------
    robot : RobotModel
    task : Task or str
        The rows of the path that are prescribed; ``"pose"`` by default.
    costs : sequence of Cost
        By default ∫ ½ q̇ᵀq̇ dt.
    constraints : sequence of Constraint
        `JointPositionLimits`, `JointVelocityLimits`, `JointAccelerationLimits`, `JointJerkLimits`
        and `PositionDependentVelocityLimits`, by default those of the arm and its maker;
        `Clearance`, of which there may be several, and whose obstacles may move; and whatever
        limits a quantity: torques, bands, tilts, the tool's speed and acceleration, or your own.
    horizon : float
        How far ahead is planned [s].
    null_motion : NullMotion
        The self-motion over the horizon; a cubic by default.
    period : float
        Time between steps [s].
    cycle : float
        Time between commands [s].
    reserve : float
        How much longer than a period a segment follows the path before it stops [s].
    steps : int
        Runge-Kutta steps of the horizon.
    latency : float
        Age of the measured state at the start of its segment [s].
    settling : float
        Time constant [s] of the filter of the arm's deviation from its command: no shorter than its
        own time constant and delay.
    patience : float
        Without a path, a target that was seen, or a measured state for this long [s], or with a
        singular pose right ahead, the arm is brought to rest.
    approach : Approach
        How the tool comes back to the path.

    Raises
    ------
    ProblemError
        The arm cannot move in all rows; a limit of acceleration is missing; a constraint is of a
        kind that cannot be kept while moving; a number is out of range.
    """

    def __init__(
        self,
        robot: RobotModel,
        task: Task | str = Task.POSE,
        costs: Sequence[Cost] = (JointVelocity(),),
        constraints: Sequence[Constraint] = (),
        horizon: float = 2.0,
        null_motion: NullMotion | None = None,
        *,
        period: float = 0.01,
        cycle: float = 1e-3,
        reserve: float = 0.03,
        steps: int = 20,
        latency: float = 0.0,
        settling: float = 0.05,
        patience: float = 0.2,
        approach: Approach | None = None,
    ) -> None:
        check_kinds(robot, null_motion, approach)
        self.robot, self.task = robot, Task.of(task)
        self.horizon = as_number(horizon, "horizon", above=0.0)
        self.cycle = as_number(cycle, "cycle", above=0.0)
        self.period = as_number(period, "period", least=self.cycle, most=self.horizon)
        self._patience = as_number(patience, "patience", least=0.0)
        settling = as_number(settling, "settling", above=0.0)
        latency = as_number(latency, "latency", least=0.0)
        as_number(reserve, "reserve", least=0.0, most=self.horizon)
        dexterous = robot.dexterous_configuration()
        somewhere = Dwell(robot.pose(dexterous), self.horizon)
        follows = Follows.of(robot, somewhere, self.task)
        costs, constraints = checked_terms(follows, costs, constraints)
        envelope = kept_envelope(robot, constraints)
        limits = joint_limits(robot, envelope)
        self.limits, self.jerk_limit = limits[:4], envelope.jerk
        null_motion = check_null_space(null_motion or PolynomialNullMotion())
        steps = as_whole(steps, "steps", null_motion.fewest_steps, _MAX_STEPS)
        mean = cycles_of_mean(robot, envelope, self.cycle)
        self._clearance = MovingClearance(robot, envelope.bodies) if envelope.bodies else None
        jerk = 2.0 / (mean * self.cycle) * limits[3]
        fastest = np.stack([limits[2], limits[3], jerk])
        quantities = [item for item in constraints if is_quantity(item)]
        self._quantities = (
            Quantities(robot, quantities, fastest, self.cycle) if quantities else None
        )
        # Number of cycles of a segment that follow the path, and their times from now on.
        period_cycles = round(self.period / self.cycle)
        self._cycles = period_cycles + round(reserve / self.cycle)
        self._ahead = self.cycle * np.arange(1.5, self._cycles + 1.0)
        self._horizon = Horizon(
            follows,
            costs,
            planned_limits(limits),
            null_motion,
            self.horizon,
            steps,
            self._ahead,
            self._clearance,
            self._quantities,
        )
        by_acceleration = self._quantities is not None and self._quantities.by_acceleration
        self._commands = Commands(
            robot,
            limits,
            self.cycle,
            self._cycles,
            latency,
            settling,
            mean,
            LONGEST_STOP if by_acceleration else 0.0,
        )
        self._stop = ProvedStop(
            self._commands, self._clearance, self._quantities, period_cycles, self.cycle
        )
        self._kinematics, self._layout = single_tip(follows).chain.kinematics(), follows.layout
        self._reach = Reach(self._kinematics, self.task, limits[0], limits[1], dexterous)
        approach = _approach_within(approach or Approach(), constraints)
        times, self._stages = self._step_times()
        self._reference = Reference(follows, approach, times)
        self._path = PacedPath(
            self.task,
            self._kinematics,
            self._commands,
            self._horizon.pace,
            self._reach,
            approach,
            times,
            len(times) - self._cycles,
            self._patience,
        )
        # Reference and ε of each cycle; see `law.command`.
        self._table = np.zeros((self._cycles, 2 * robot.dof + law.REFERENCE))
        self._started = False

    def reset(self) -> None:
        """Reset: the next step starts at its measured state."""
        self._started = False

    @property
    def deviation(self) -> Array:
        """Filtered deviation of the arm from its command, (n,) [rad or m]."""
        return np.array(self._commands.deviation)

    def step(
        self,
        t: float,
        q: npt.ArrayLike,
        qd: npt.ArrayLike,
        path: Path | None = None,
        obstacles: Mapping[str, SE3] | None = None,
        *,
        target: SE3 | npt.ArrayLike | None = None,
        twist: npt.ArrayLike | None = None,
        seen: float | None = None,
        chunk: Sequence[SE3] | npt.ArrayLike | None = None,
        times: npt.ArrayLike | None = None,
    ) -> Segment:
        """Return the motion to command from `t` on.

        The task is a `path`, a `target` as a camera sees it, or a `chunk` of poses for the next
        seconds, as a learned policy gives them. Targets and chunks may have their own rate: without
        any, the last one continues: a target within the replanner's `patience`, a chunk up to its
        last pose; then the arm is brought to rest.

        Parameters
        ----------
        t : float
            Start time of the segment's command [s]: a period after the last one, or later if that
            was missed. It is rounded to the nearest cycle.
        q, qd : (n,)
            Measured state [rad or m, per s]: the initial command at the first step. Later the state
            at ``t - latency``; NaN is ignored.
        path : Path, optional
            The tool's motion, at the time of `t`; it may change at each step. Outside of its
            duration, it rests.
        obstacles : mapping, optional
            Where obstacles of the `Clearance` are by now: name → pose in the world, or in the
            frame of the link that carries it.
        target : SE3 or (4, 4), optional
            Where the tool is to be [m], world axes; it moves on by `twist`.
        twist : (6,), optional
            How the target moves: velocity of its origin [m/s] and angular velocity [rad/s], world
            axes. By default it rests.
        seen : float, optional
            When the target was seen, on the clock of `t` [s]; by default at `t`. One older than
            `patience` is ignored, however often it is sent.
        chunk : sequence of SE3, or (K, 4, 4), optional
            Where the tool is to be at `times` [m], world axes. What was followed before holds until
            the first of these, or `t`, and is then left for the chunk without a jump in
            acceleration. One that has ended, or has a number that is not finite, is
            ignored, and `Segment.reasons` says why; `Chunk.of` raises the same as an error.
        times : (K,), optional
            Of the chunk, on the clock of `t` [s], increasing.

        Returns
        -------
        Segment
            Also after a failure: see `Segment.flag` and `Segment.reasons`.

        Raises
        ------
        StartError
            The first state is not one from which the arm can stop within its limits.
        ProblemError
            `t` lies before the last step, an obstacle is not known, there are two of path, target
            and chunk, or a chunk without times.
        """
        t, reasons = as_number(t, "t"), list[str]()
        if target is not None or twist is not None or seen is not None:
            path = observed_target(path, target, twist, t if seen is None else seen, reasons)
        poses = None
        if chunk is not None or times is not None:
            poses = known_chunk(path, target, times, chunk, t, reasons)
        age = age_of_target(path, t)
        if abs(age) > self._patience:
            when = f"{age:.3g} s ago" if age > 0.0 else f"in {-age:.3g} s: on another clock?"
            reasons.append(
                f"the target is left out: it was seen {when} (patience: {self._patience:.3g} s)"
            )
            path, age = None, 0.0
        with one_blas_thread():
            return self._step(t, q, qd, poses or path, max(age, 0.0), obstacles or {}, reasons)

    def _step_times(self) -> tuple[Array, Array]:
        """Return the times of a step from now on (K,) [s], and which are Runge-Kutta stages.

        The times are nodes of the horizon and the middles between them, then the cycles that are
        commanded; four stages of each Runge-Kutta step are among the first.
        """
        grid = self._horizon.grid
        half_steps = np.arange(2 * grid.steps + 1)
        nodes_and_middles = np.interp(half_steps, 2 * np.arange(grid.steps + 1), grid.nodes)
        stages = np.tile([0, 1, 1, 2], (grid.steps, 1)) + 2 * np.arange(grid.steps)[:, None]
        times = np.concatenate([nodes_and_middles, self._ahead])
        return times, np.append(stages.ravel(), 2 * grid.steps)

    def _step(
        self,
        t: float,
        q: npt.ArrayLike,
        qd: npt.ArrayLike,
        path: Path | None,
        age: float,
        obstacles: Mapping[str, SE3],
        reasons: list[str],
    ) -> Segment:
        """Return the next segment: measure, plan, command, and prove what is commanded."""
        dof = self.robot.dof
        if not self._started:
            self._start(t, checked_state(q, "q", dof), checked_state(qd, "qd", dof))
        if isinstance(path, Chunk):
            path = self._path.joined(path, t, reasons)
        passed = self._commands.go_on(t)
        may_move = self._measure(measured_state(q, dof), passed, reasons)
        if self._clearance is not None:
            self._clearance.move(obstacles, self._commands.place)
        self._path.go_on(passed)
        target = self._path.target(path, max(passed, self.cycle), age, reasons)
        error, flag = np.zeros(2), Flag.STOPPING
        if target is not None:
            flag, error = self._plan(target, passed, reasons)
        if not may_move:
            flag = Flag.STOPPING
        return self._issue(target, flag, error, reasons)

    def _start(self, t: float, q: Array, qd: Array) -> None:
        """Begin at a state of the arm, and forget all that was before."""
        self._commands.begin(t, q, qd)
        # Times without a measured state, and with a singular pose right ahead [s].
        self._without_state = self._without_motion = 0.0
        self._horizon.forget()
        self._stop.reset()
        self._path.reset()
        self._reach.last_regular = q
        # Whether the last segment was as planned: it followed its path, or stopped by its flag.
        self._as_planned = self._started = True

    def _measure(self, q: Array, passed: float, reasons: list[str]) -> bool:
        """Take in a measured position; return whether the arm may go on moving."""
        if q.shape != (self.robot.dof,) or not np.all(np.isfinite(q)):
            self._without_state += max(passed, self.cycle)
            reasons.append("the measured state is missing, or not finite")
            return self._without_state <= self._patience
        self._without_state = 0.0
        failure = self._commands.measure(q, passed)
        reasons += [failure] if failure else []
        return not failure

    def _plan(self, target: Sampled, passed: float, reasons: list[str]) -> tuple[Flag, Array]:
        """Improve the plan; return its flag, and how far the tool is off its path [m, rad].

        Writes reference and ε of the cycles into the table.
        """
        n, horizon = self.robot.dof, self._horizon
        twist = None if target.along.any() else self._last_reference_twist(passed)
        horizon.shift(passed)
        last_plan = horizon.plan
        error, failure = self._improve_at_pace(target, twist)
        if self._path.is_on_time and not (failure or horizon.damped < np.inf):
            self._reach.last_regular = self._commands.place
        epsilon = horizon.epsilon(last_plan if failure else horizon.plan)
        if failure:
            reasons.append(failure)
            horizon.start_anew()
            flag = Flag.KEPT if np.any(epsilon) else Flag.TRACKING
        else:
            flag = self._flag_of_plan(reasons)
        if self._is_stuck(passed):
            flag = Flag.STOPPING
        self._table[:, n : 2 * n] = epsilon
        self._table[:, 2 * n :] = self._reference.table[-self._cycles :]
        return flag, error

    def _last_reference_twist(self, passed: float) -> Array | None:
        """Return the last twist of the reference, if limits stopped the tool; else None.

        From the tool's own, nearly zero, it would never be fast enough to leave a singular pose.
        """
        cycle = round(passed / self.cycle)
        if self._as_planned or not 2 <= cycle <= self._cycles:
            return None
        rows = self._table[cycle - 2 : cycle, -6:]
        return np.asarray(0.5 * (rows[0] + rows[1]))

    def _improve_at_pace(self, target: Sampled, twist: Array | None) -> tuple[Array, str]:
        """Improve the plan; return the tool's error, and why that failed, or "".

        Where the motion breaks down because the path leaves reach, the path is followed until
        shortly before.
        """
        commands, horizon = self._commands, self._horizon
        rate, place = commands.rate, commands.place
        for retreats in range(RETREATS + 1):
            self._path.hold_rates()
            error = self._reference.begin(place, rate, target.path, twist)
            failure = self._improve(place, rate, target)
            breakdown = min(horizon.breakdown, horizon.damped)
            is_slower = self._path.retreat(target, breakdown, retreats)
            # A plan that did not fail is kept; the next step begins slower.
            if not (is_slower and failure):
                break
            target = self._path.again() or target
        return error, failure

    def _improve(self, place: Array, rate: Array, target: Sampled) -> str:
        """Improve the plan along the reference; return why that failed, or ""."""
        horizon, stages, table = self._horizon, self._stages, self._reference.table
        reference = PathSamples(
            horizon.grid.stage_times,
            table[stages, :3],
            table[stages, 3:12].reshape(-1, 3, 3),
            table[stages, 12:],
        )
        jacobian, along = self._reference.jacobian, target.along[stages]
        try:
            is_improved = horizon.improve(place, rate, jacobian, reference, along)
            return "" if is_improved else horizon.failure
        # Costs are the user's code: their exceptions must not leave the arm without a command.
        except Exception as error:
            return f"planning failed: {type(error).__name__}: {error}"

    def _flag_of_plan(self, reasons: list[str]) -> Flag:
        """Return the flag of a plan that was improved, and add what is noticed of it."""
        if self._path.is_waiting:
            reasons.append("the tool waits on its path")
        if self._horizon.elastic:
            reasons.append("no self-motion keeps all limits over the horizon")
        if self._clearance is not None and self._clearance.blocked:
            reasons.append(self._clearance.message)
            return Flag.STOPPING
        return Flag.PLANNED

    def _is_stuck(self, passed: float) -> bool:
        """Return whether the motion breaks down so soon, and for so long, that the arm has to stop.

        Not at once: through a singular pose an arm may continue on its other side.
        """
        breakdown = self._horizon.breakdown
        waited = self._without_motion + max(passed, self.cycle)
        self._without_motion = waited if breakdown < SOON else 0.0
        is_delayed = breakdown < AHEAD and not self._as_planned
        return is_delayed or self._without_motion > self._patience

    def _issue(
        self, target: Sampled | None, flag: Flag, error: Array, reasons: list[str]
    ) -> Segment:
        """Command what is planned, unless its flag is to stop; return the segment, proved.

        Where it is not, the segment before, which is proved, runs to its stop.
        """
        commands = self._commands
        follows, first = False, 0
        if flag is not Flag.STOPPING:
            follows = commands.follow(self._kinematics, self._layout, self._table)
            first = self._cycles
        delay, notes = self._path.delay, tuple(reasons)

        def braked(cycle: int, share: float) -> Segment:
            return commands.segment(cycle, flag, notes, follows, error, delay, share)

        segment, failure = self._stop.proved(braked, first)
        if failure:
            reasons.append(failure)
            self._path.refuse(target)
            flag, follows = Flag.STOPPING, False
            segment = commands.segment(None, flag, tuple(reasons), follows, error, delay)
        else:
            self._path.accept()
        self._as_planned = follows or flag is Flag.STOPPING
        self._path.is_held = not follows
        return segment


def _approach_within(approach: Approach, constraints: Sequence[Constraint]) -> Approach:
    """Return an approach that is no faster than limits of the tool allow."""
    for item in constraints:
        if isinstance(item, ToolLimits):
            approach = approach.within(item.limit)
    return approach
