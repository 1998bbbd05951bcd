"""Replanner: plans the next seconds repeatedly while the arm moves (receding horizon)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics import (
    Array,
    as_number,
    as_whole,
    one_blas_thread,
)
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
from selfmotion.realtime.chunks import Chunk, blend
from selfmotion.realtime.commands import (
    Commands,
    cycles_of_mean,
    joint_limits,
    kept_envelope,
    planned_limits,
)
from selfmotion.realtime.horizon import Horizon, is_damped
from selfmotion.realtime.moving_clearance import MovingClearance
from selfmotion.realtime.pace import LastPath, Sampled, Times
from selfmotion.realtime.quantities import Quantities, is_quantity
from selfmotion.realtime.reference import Approach, Reference
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.settings import (
    AHEAD,
    CATCH_UP,
    GENTLER,
    GENTLEST,
    HARDER,
    JUMPED,
    LARGEST,
    LONGEST_STOP,
    REACHED,
    REACHING,
    RETREATS,
    RIGHT_AHEAD,
    SOON,
    STANDING,
    UNNOTICED,
)


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
        self._dexterous = robot.dexterous_configuration()
        somewhere = Dwell(robot.pose(self._dexterous), self.horizon)
        follows = Follows.of(robot, somewhere, self.task)
        costs, constraints = checked_terms(follows, costs, constraints)
        envelope = kept_envelope(robot, constraints)
        limits = joint_limits(robot, envelope)
        self.limits, self.jerk_limit = limits[:4], envelope.jerk
        null_motion = check_null_space(null_motion or PolynomialNullMotion())
        steps = as_whole(steps, "steps", null_motion.fewest_steps, 1000)
        self._clearance = MovingClearance(robot, envelope.bodies) if envelope.bodies else None
        mean = cycles_of_mean(robot, envelope, self.cycle)
        others, jerk = (
            [item for item in constraints if is_quantity(item)],
            2.0 / (mean * self.cycle),
        )
        fastest = np.stack([limits[2], limits[3], jerk * limits[3]])
        self._quantities = Quantities(robot, others, fastest, self.cycle) if others else None
        self._cycles = round(self.period / self.cycle) + round(reserve / self.cycle)
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
        self._kinematics, self._layout = single_tip(follows).chain.kinematics(), follows.layout
        gentler = self._quantities is not None and self._quantities.by_acceleration
        self._commands = Commands(
            robot,
            limits,
            self.cycle,
            self._cycles,
            latency,
            settling,
            mean,
            LONGEST_STOP if gentler else 0.0,
        )
        self._gentlest, self._share = GENTLEST if gentler else 1.0, 1.0
        self._prepare()
        self._approach = approach or Approach()
        for item in constraints:
            if isinstance(item, ToolLimits):
                self._approach = self._approach.within(item.limit)
        self._reference = Reference(follows, self._approach, self._times)
        self._started = False

    def _prepare(self) -> None:
        """Make all tables of a step, for the cycles that follow the path."""
        n, grid, cycles = self.robot.dof, self._horizon.grid, self._cycles
        self._table = np.zeros((cycles, 2 * n + law.REFERENCE))
        halves = np.interp(np.arange(2 * grid.steps + 1), 2 * np.arange(grid.steps + 1), grid.nodes)
        self._times = np.concatenate([halves, self._ahead])
        self._pace, self._paced = self._horizon.pace, self._horizon.pace.weights(self._times)
        # Stages of the Runge-Kutta method among nodes and middles.
        stages = np.tile([0, 1, 1, 2], (grid.steps, 1)) + 2 * np.arange(grid.steps)[:, None]
        self._stages = np.append(stages.ravel(), 2 * grid.steps)

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
        dof = self.robot.dof
        if not self._started:
            self._start(t, checked_state(q, "q", dof), checked_state(qd, "qd", dof))
        if isinstance(path, Chunk):
            path = self._joined(path, t, reasons)
        q, qd = measured_state(q, dof), measured_state(qd, dof)
        commands = self._commands
        passed = commands.go_on(t)
        moving = self._measure(q, passed, reasons)
        if self._clearance is not None:
            self._clearance.move(obstacles, commands.place)
        waited = max(passed, self.cycle)
        self._pace.shift(passed)
        target = self._target(path, waited, age, reasons)
        error, flag, follows = np.zeros(2), Flag.STOPPING, False
        first = 0
        if target is not None:
            flag, error = self._plan(target, passed, reasons)
            if moving and flag is not Flag.STOPPING:
                follows = commands.follow(self._kinematics, self._layout, self._table)
                first = self._cycles
            else:
                flag = Flag.STOPPING
        # The command is behind the motion that follows the path.
        delay = self._pace.delay - commands.lead * (1.0 - float(self._pace.rates[0]))
        said = tuple(reasons)
        issued, unproved = self._braked(
            lambda cycle, share: commands.segment(cycle, flag, said, follows, error, delay, share),
            first,
        )
        if not unproved and self._clearance is not None:
            unproved = self._clearance.proof_failure(*self._expected(issued))
        if unproved:
            # The segment before, which is proved, runs to its stop.
            reasons.append(unproved)
            if target is not None and target.along.any():
                self._refused += 1
                self._pace.slow_down(self._refused)
            flag, follows = Flag.STOPPING, False
            issued = commands.segment(None, flag, tuple(reasons), follows, error, delay)
        self._refused *= bool(unproved)
        self._follows = follows or flag is Flag.STOPPING
        self._held = not follows
        return issued

    def _joined(self, chunk: Chunk, t: float, reasons: list[str]) -> Path:
        """Return a chunk joined to what is followed; alone where that fails, with the reason.

        Both may be anything: their exceptions must not leave the arm without a command.
        """
        try:
            return blend(self._path.followed, chunk, t, self._approach)
        except Exception as error:
            reasons.append(f"the chunk is not joined: {type(error).__name__}: {error}")
            return chunk

    def _braked(self, made: Callable[[int, float], Segment], first: int) -> tuple[Segment, str]:
        """Return a segment that brakes from a cycle on, and why it is not proved.

        "" where all quantities are. Where it is the braking that is not, it is tried more gently,
        and harder again at the next steps; where it is the path, it is followed for a period only.
        """
        share, shortest = self._share, min(first, round(self.period / self.cycle))
        issued = made(first, share)
        if self._quantities is None:
            return issued, ""
        while found := self._quantities.unproved(issued, self._commands.deviation):
            if np.isfinite(found.time) and found.time >= first * self.cycle:
                if share <= self._gentlest:
                    return issued, found.reason
                share = max(GENTLER * share, self._gentlest)
            elif shortest * self.cycle <= found.time < np.inf and first > shortest:
                first = shortest
            else:
                # A stop that takes too long was too gentle.
                self._share = self._share if np.isfinite(found.time) else min(share / GENTLER, 1.0)
                return issued, found.reason
            issued = made(first, share)
        self._share = min(HARDER * share, 1.0)
        return issued, ""

    def _expected(self, segment: Segment) -> tuple[Array, Array, Array]:
        """Return where the arm is expected, path lengths and times of a segment.

        At the expected position: the command plus the present deviation.
        """
        place = segment.q + self._commands.deviation
        return place, segment.travelled, segment.t - segment.t[0]

    def _start(self, t: float, q: Array, qd: Array) -> None:
        self._commands.begin(t, q, qd)
        self._path = LastPath(self._patience)
        self._without_state = self._without_motion = 0.0
        self._horizon.forget()
        self._share = 1.0
        for kept in (self._clearance, self._quantities):
            if kept is not None:
                kept.forget()
        self._pace.reset()
        self._refused, self._leaves, self._clear = 0, False, q
        self._follows = self._held = self._started = True

    def _last_reference_twist(self, passed: float) -> Array | None:
        """Return the last twist of the reference, if limits stopped the tool; else None.

        From the tool's own, nearly zero, it would never be fast enough to leave a singular pose.
        """
        cycle = round(passed / self.cycle)
        if self._follows or not 2 <= cycle <= self._cycles:
            return None
        rows = self._table[cycle - 2 : cycle, -6:]
        return np.asarray(0.5 * (rows[0] + rows[1]))

    def _measure(self, q: Array, passed: float, reasons: list[str]) -> bool:
        """Take in a measured position; return whether the arm may go on moving."""
        if q.shape != (self.robot.dof,) or not np.all(np.isfinite(q)):
            self._without_state += max(passed, self.cycle)
            reasons.append("the measured state is missing, or not finite")
            return self._without_state <= self._patience
        self._without_state = 0.0
        off = self._commands.measure(q, passed)
        reasons += [off] if off else []
        return not off

    def _target(
        self, path: Path | None, waited: float, age: float, reasons: list[str]
    ) -> Sampled | None:
        """Return the path at the times of a step, at its pace; None where there is none."""
        pace = self._pace
        if not pace.is_on_time and self._path.jumps(path, self._when()):
            pace.reset()
        found = self._path.samples(path, self._when(), waited, age, reasons)
        if found is None or not found.along.any():
            pace.reset()
            return found
        if self._held and found.along[0].any():
            self._anchor(found, waited)
            found = self._path.again(self._when())
        if self._is_met_again():
            pace.reset()
            found = self._path.again(self._when())
        return found

    def _when(self) -> Times:
        """Return the times of a step, and those of the path then."""
        commands = self._commands
        t = commands.time + commands.lead + self._times
        return self._pace.times(t, self._times, self._paced)

    def _anchor(self, target: Sampled, passed: float) -> None:
        """Let the path go on where the tool is, which was stopped or held back meanwhile."""
        commands, task = self._commands, self.task
        jacobian = self._kinematics.at(commands.place)
        here = SE3(self._kinematics.rotation, self._kinematics.translation)
        goal = SE3(target.path.rotation[0], target.path.translation[0])
        each = target.along[0], -task.twist_error(goal, here), jacobian @ commands.rate
        along, ahead, rate = (task.select(one[:, None], here.rotation)[:, 0] for one in each)
        size, off = float(along @ along), np.abs(ahead).max()
        differs = max(off, np.abs(rate - self._pace.rates[0] * along).max()) > UNNOTICED
        # Far from its path the tool approaches it, and a path that begins at rest is left to that.
        if size > 0.0 and differs and off < JUMPED:
            most = (1.0 + CATCH_UP) * passed
            early = min(max(float(along @ ahead) / size, -most), most)
            self._pace.anchor(early, float(along @ rate) / size)

    def _ends(self, target: Sampled, when: float) -> bool:
        """Return whether a path that has a pace is out of reach right after a time from now."""
        if not target.along.any():
            return False
        s = np.interp(when, self._times[: -self._cycles], self._when().s[: -self._cycles])
        self._leaves = not all(map(self._reaches, self._poses(s + RIGHT_AHEAD)))
        return self._leaves

    def _is_met_again(self) -> bool:
        """Return whether the tool waits where its path leaves reach, and the path is back there."""
        if self._pace.rates[0] >= STANDING or self._pace.delay < RIGHT_AHEAD:
            return False
        return self._leaves and all(map(self._reaches, self._poses(self._commands.time)))

    def _poses(self, *s: float) -> list[SE3]:
        """Return poses of the last path at times of its own; none where it fails."""
        found = self._path.again(Times(np.array(s), np.array(s), np.ones(len(s))))
        if found is None:
            return []
        each = zip(found.path.rotation, found.path.translation, strict=True)
        return [SE3(*pose) for pose in each]

    def _reaches(self, pose: SE3) -> bool:
        """Return whether Newton's method comes to a pose of the tool.

        From where the arm was on time, or from a dexterous configuration: where it waits, stretched
        out, it is ill-conditioned. Nor is the arm so near a singular pose there that commands are
        damped.
        """
        kinematics, task = self._kinematics, self.task
        for q in (self._clear, self._dexterous):
            for _ in range(REACHING):
                jacobian = kinematics.at(q)
                here = SE3(kinematics.rotation, kinematics.translation)
                rows = task.select(jacobian, here.rotation)
                error = task.select(task.twist_error(pose, here)[:, None], here.rotation)[:, 0]
                gram = rows @ rows.T
                if np.abs(error).max() < REACHED:
                    if is_damped(gram):
                        break
                    return True
                step = rows.T @ np.linalg.solve(gram + REACHED * np.eye(len(rows)), error)
                step *= min(1.0, LARGEST / float(np.abs(step).max()))
                q = np.clip(q + step, self.limits[0], self.limits[1])
        return False

    def _plan(self, target: Sampled, passed: float, reasons: list[str]) -> tuple[Flag, Array]:
        """Improve the plan; write reference and ε of the cycles into the table.

        Returns also how far the tool is off the path. Where a motion breaks down on the way, the
        path is followed until shortly before that.
        """
        n, horizon, commands = self.robot.dof, self._horizon, self._commands
        rate, place = commands.rate, commands.place
        twist = None if target.along.any() else self._last_reference_twist(passed)
        horizon.shift(passed)
        before = horizon.plan
        for retreats in range(RETREATS + 1):
            self._pace.command()
            error = self._reference.begin(place, rate, target.path, twist)
            failure = self._improved(place, rate, target)
            when = min(horizon.breakdown, horizon.damped)
            if when == np.inf or retreats == RETREATS or not self._ends(target, when):
                break
            self._pace.retreat(when)
            if not failure:
                break
            target = self._path.again(self._when()) or target
        if self._pace.is_on_time and not (failure or horizon.damped < np.inf):
            self._clear = place
        flag, epsilon = Flag.PLANNED, horizon.epsilon(before if failure else horizon.plan)
        if not failure:
            if self._pace.rates[0] < STANDING and self._pace.delay > RIGHT_AHEAD:
                reasons.append("the tool waits on its path")
            if horizon.elastic:
                reasons.append("no self-motion keeps all limits over the horizon")
            if self._clearance is not None and self._clearance.blocked:
                reasons.append(self._clearance.message)
                flag = Flag.STOPPING
        else:
            reasons.append(failure)
            horizon.start_anew()
            flag = Flag.KEPT if np.any(epsilon) else Flag.TRACKING
        # Through a singular pose an arm may continue on its other side.
        soon = horizon.breakdown < SOON
        self._without_motion = self._without_motion + max(passed, self.cycle) if soon else 0.0
        is_stuck = horizon.breakdown < AHEAD and not self._follows
        if is_stuck or self._without_motion > self._patience:
            flag = Flag.STOPPING
        self._table[:, n : 2 * n] = epsilon
        self._table[:, 2 * n :] = self._reference.table[-self._cycles :]
        return flag, error

    def _improved(self, place: Array, rate: Array, target: Sampled) -> str:
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
            done = horizon.improve(place, rate, jacobian, reference, along)
            return "" if done else horizon.failure
        # Costs are the user's code: their exceptions must not leave the arm without a command.
        except Exception as error:
            return f"planning failed: {type(error).__name__}: {error}"
