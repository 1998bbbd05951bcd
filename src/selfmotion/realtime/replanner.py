"""Plans the next seconds again and again while the arm moves."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, ProblemError, as_number, as_whole, one_blas_thread
from selfmotion.constraints import Constraint
from selfmotion.costs import Cost, JointVelocity
from selfmotion.follow import Follows
from selfmotion.motion import NullMotion, PolynomialNullMotion
from selfmotion.path import Dwell, Path, PathSamples
from selfmotion.realtime import law
from selfmotion.realtime.arguments import as_asked, as_begun, as_measured, check_kinds
from selfmotion.realtime.clear import Surroundings
from selfmotion.realtime.horizon import Horizon, in_null_space
from selfmotion.realtime.limits import joint_limits, planned_limits, stoppable
from selfmotion.realtime.reference import Approach, Reference, resting
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.viable import tightened
from selfmotion.robot import RobotModel, march
from selfmotion.task import Task

# The pose feedback between two steps [1/s]. A motion that breaks down within this time [s] is not
# followed: the arm can stop in less; nor within the second, where limits already hold it up. A
# command so far from the arm [rad or m] is not what it does.
_GAIN, _SOON, _AHEAD, _FARTHEST = 20.0, 0.5, 2.0, 0.5


class Replanner:
    """Plans the motion of the next seconds, from where the arm is, once a period.

    Each `step` makes one step of the optimisation over the horizon, warm-started from the last
    coefficients, shifted in time, and commands the beginning of it. The command goes on from the
    command: position, velocity and acceleration are continuous. What the arm is measured to be off
    its command is filtered, and the tool is planned for where the arm is, so that the command makes
    up for it.

    Limits of position, velocity and acceleration hold for every command, at all times and whatever
    happens (`selfmotion.realtime.viable`): where they are in the way of the path, the path gives.

    Parameters
    ----------
    robot : RobotModel
    task : Task or str
        The rows of the path that are prescribed; ``"pose"`` by default.
    costs : sequence of Cost
        By default ∫ ½ q̇ᵀq̇ dt.
    constraints : sequence of Constraint
        `JointPositionLimits`, `JointVelocityLimits` and `JointAccelerationLimits`, by default those
        of the arm and its maker, and `Clearance`, whose obstacles may move.
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
        How old the measured state is when its segment begins [s].
    settling : float
        Time constant [s] of the filter of what the arm is off its command: no shorter than its
        own time constant and delay.
    patience : float
        Without a path or a measured state for this long [s], or with a singular pose right ahead,
        the arm is brought to rest.
    approach : Approach
        How the tool comes back to the path.

    Raises
    ------
    ProblemError
        The arm cannot move in all rows; a limit of acceleration is missing; a constraint is of a
        kind that is not kept while moving; a number is out of range.
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
        self._settling = as_number(settling, "settling", above=0.0)
        latency = as_number(latency, "latency", least=0.0)
        as_number(reserve, "reserve", least=0.0, most=self.horizon)
        somewhere = Dwell(robot.pose(robot.dexterous_configuration()), self.horizon)
        follows = Follows.of(robot, somewhere, self.task)
        costs, constraints = as_asked(follows, costs, constraints)
        limits = joint_limits(robot, constraints)
        self.limits = limits
        self._inner = np.vstack([tightened(limits), np.zeros(robot.dof)])
        null_motion = in_null_space(null_motion or PolynomialNullMotion())
        steps = as_whole(steps, "steps", null_motion.fewest_steps, 1000)
        bodies = [pair for item in constraints for pair in item.envelope(robot).bodies]
        self._around = Surroundings(robot, bodies) if bodies else None
        self._horizon = Horizon(
            follows,
            costs,
            planned_limits(limits),
            null_motion,
            self.horizon,
            steps,
            self._around,
        )
        self._kinematics = follows.only.chain.kinematics()
        self._layout = follows.layout
        self._delay = round(latency / self.cycle)
        self._prepare(round(self.period / self.cycle) + round(reserve / self.cycle))
        self._reference = Reference(follows, approach or Approach(), self._times)
        self._begun = False

    def _prepare(self, cycles: int) -> None:
        """Make all tables of a step, for so many cycles that follow the path."""
        n, h, grid = self.robot.dof, self.cycle, self._horizon.grid
        # In so many cycles every joint comes to rest from its highest speed.
        stopping = int(np.ceil((self.limits[2] / (self.limits[3] * h)).max())) + 3
        self._cycles = cycles
        self._states = np.zeros((cycles + stopping + 1, 3, n))
        self._table = np.zeros((cycles, 2 * n + law.REFERENCE))
        ahead = h * np.arange(1.5, cycles + 1.0)
        halves = np.interp(np.arange(2 * grid.steps + 1), 2 * np.arange(grid.steps + 1), grid.nodes)
        self._ahead, self._times = ahead, np.concatenate([halves, ahead])
        self._functions = self._horizon.functions(ahead)
        four = np.tile([0, 1, 1, 2], (grid.steps, 1)) + 2 * np.arange(grid.steps)[:, None]
        self._stages = np.append(four.ravel(), 2 * grid.steps)
        self._sent = np.zeros((self._delay + 1, n))

    def reset(self) -> None:
        """Forget all: the next step begins at its measured state."""
        self._begun = False

    @property
    def deviation(self) -> Array:
        """What the arm is off its command, filtered, (n,) [rad or m]."""
        return np.array(self._inner[4])

    def step(
        self,
        t: float,
        q: npt.ArrayLike,
        qd: npt.ArrayLike,
        path: Path,
        obstacles: Mapping[str, pin.SE3] | None = None,
    ) -> Segment:
        """Return the motion to command from `t` on.

        Parameters
        ----------
        t : float
            When the segment begins to be commanded [s]: a period after the last one, or later
            where that was missed. It is taken to the nearest cycle.
        q, qd : (n,)
            Measured state [rad or m, per s]: at the first step, where the command begins. Later
            ones tell where the arm is at ``t - latency``; numbers that are not finite are left out.
        path : Path
            The tool's motion, at the time of `t`; another one at each step, if need be. Before it
            begins and after it ends, it rests.
        obstacles : mapping, optional
            Where obstacles of the `Clearance` are by now: name → pose.

        Returns
        -------
        Segment
            Always, also where something failed: `Segment.flag` and `Segment.reasons` tell.

        Raises
        ------
        StartError
            The first state is not one from which the arm can stop within its limits.
        ProblemError
            `t` lies before the last step, or an obstacle is not known.
        """
        with one_blas_thread():
            return self._step(as_number(t, "t"), q, qd, path, obstacles or {})

    def _step(
        self,
        t: float,
        q: npt.ArrayLike,
        qd: npt.ArrayLike,
        path: Path,
        obstacles: Mapping[str, pin.SE3],
    ) -> Segment:
        dof = self.robot.dof
        if not self._begun:
            self._begin(t, as_begun(q, "q", dof), as_begun(qd, "qd", dof))
        q, qd = as_measured(q, dof), as_measured(qd, dof)
        t, passed = self._go_on(t)
        reasons: list[str] = []
        if self._around is not None:
            self._around.move(obstacles)
        moving = self._measure(q, passed, reasons)
        target = self._target(t, path, passed, reasons)
        error, flag, follows = np.zeros(2), Flag.STOPPING, False
        first = 0
        if target is not None:
            rate = self._states[0, 1] - 0.5 * self.cycle * self._states[0, 2]
            place = self._positions(self._states[:1])[0] + self._inner[4]
            error = self._reference.begin(place, rate, target, self._held_up(passed))
            flag = self._plan(passed, rate, place, reasons)
            if moving and flag is not Flag.STOPPING:
                follows = self._follow()
                first = self._cycles
            else:
                flag = Flag.STOPPING
        self._follows = follows or flag is Flag.STOPPING
        end = law.brake(self._states, first, self._inner, self.cycle)
        return self._segment(t, end, flag, reasons, follows, error)

    def _begin(self, t: float, q: Array, qd: Array) -> None:
        c = stoppable(self.robot, self._inner, q, qd, self.cycle)
        self._states[:] = 0.0
        self._states[:, 0], self._states[0, 1] = c, qd
        law.brake(self._states, 0, self._inner, self.cycle)
        self._time, self._inner[4], self._sent[:] = t, 0.0, q
        self._path: Path | None = None
        self._without_path = self._without_state = self._without_way = 0.0
        self._horizon.forget()
        self._follows = self._begun = True

    def _go_on(self, t: float) -> tuple[float, float]:
        """Make the state that is commanded at `t` the first one; return its time, what passed."""
        passed = round((t - self._time) / self.cycle) if np.isfinite(t) else -1
        if passed < 0:
            raise ProblemError(f"t is {t} s, expected no less than the last step's {self._time} s")
        end = len(self._states) - 1
        here = min(passed, end)
        sent = self._positions(self._states[: here + 1])
        if passed > end:
            sent = np.vstack([sent, np.repeat(sent[-1:], min(passed - end, len(self._sent)), 0)])
        self._sent = np.vstack([self._sent, sent[1:]])[-len(self._sent) :]
        self._states[0] = self._states[here]
        self._time += passed * self.cycle
        return self._time, passed * self.cycle

    def _held_up(self, passed: float) -> Array | None:
        """Return the twist that the reference had come to, where limits kept the tool from it.

        Begun anew with the tool's own, it would never get faster than in one period: too little to
        leave a singular pose by.
        """
        cycle = round(passed / self.cycle)
        if self._follows or not 2 <= cycle <= self._cycles:
            return None
        rows = self._table[cycle - 2 : cycle, -6:]
        return np.asarray(0.5 * (rows[0] + rows[1]))

    def _positions(self, states: Array) -> Array:
        """Return q of states: the spline at its knots, (c⁻ + 4 c + c⁺)/6."""
        h = self.cycle
        return np.asarray(states[:, 0] - h * states[:, 1] + h * h / 6.0 * states[:, 2])

    def _measure(self, q: Array, passed: float, reasons: list[str]) -> bool:
        """Take in a measured position; return whether the arm may go on moving."""
        if q.shape != self._inner[4].shape or not np.all(np.isfinite(q)):
            self._without_state += max(passed, self.cycle)
            reasons.append("the measured state is missing, or not finite")
            return self._without_state <= self._patience
        self._without_state = 0.0
        off = q - self._sent[0]
        worst = int(np.argmax(np.abs(off)))
        if abs(off[worst]) > _FARTHEST:
            reasons.append(
                f"joint '{self.robot.joint_names[worst]}' is {off[worst]:.3g} from its command"
            )
            return False
        share = 1.0 - np.exp(-passed / self._settling)
        self._inner[4] += share * (off - self._inner[4])
        return True

    def _target(
        self, t: float, path: Path, passed: float, reasons: list[str]
    ) -> PathSamples | None:
        """Return the path at the times of the horizon and the cycles; the last one where it fails.

        None after too long.
        """
        try:
            target = resting(path, t + self._times)
            self._path, self._without_path = path, 0.0
            return target
        # A path is the user's code: whatever it raises must not leave the arm without a command.
        except Exception as error:
            reasons.append(f"the path failed: {type(error).__name__}: {error}")
        self._without_path += max(passed, self.cycle)
        if self._path is None or self._without_path > self._patience:
            return None
        return resting(self._path, t + self._times)

    def _plan(self, passed: float, rate: Array, place: Array, reasons: list[str]) -> Flag:
        """Improve the plan; write ε of the cycles into the table."""
        n, horizon, stages = self.robot.dof, self._horizon, self._stages
        horizon.shift(passed)
        kept = horizon.epsilon(self._ahead, self._functions)
        table = self._reference.table
        reference = PathSamples(
            horizon.grid.stage_times,
            table[stages, :3],
            table[stages, 3:12].reshape(-1, 3, 3),
            table[stages, 12:],
        )
        flag = Flag.PLANNED
        if self._improved(place, rate, reference, reasons):
            kept = horizon.epsilon(self._ahead, self._functions)
            if horizon.relaxed:
                reasons.append("no self-motion keeps all limits over the horizon")
            if self._around is not None and self._around.blocked:
                reasons.append(self._around.message)
                flag = Flag.STOPPING
        else:
            flag = Flag.KEPT if np.any(kept) else Flag.TRACKING
        # On the way into a singular pose an arm may end up on its other side.
        soon = horizon.breakdown < _SOON
        self._without_way = self._without_way + max(passed, self.cycle) if soon else 0.0
        held_up = horizon.breakdown < _AHEAD and not self._follows
        if held_up or self._without_way > self._patience:
            flag = Flag.STOPPING
        self._table[:, n : 2 * n] = kept
        self._table[:, 2 * n :] = table[-self._cycles :]
        return flag

    def _improved(
        self, place: Array, rate: Array, reference: PathSamples, reasons: list[str]
    ) -> bool:
        try:
            if self._horizon.improve(place, rate, self._reference.jacobian, reference):
                return True
            reasons.append(self._horizon.failure)
        # Costs are the user's code: whatever they raise must not leave the arm without a command.
        except Exception as error:
            reasons.append(f"planning failed: {type(error).__name__}: {error}")
            self._horizon.forget()
        return False

    def _follow(self) -> bool:
        """Command the cycles one after the other; return whether the tool moves as asked."""
        states, table, limits = self._states, self._table, self._inner
        h, n = self.cycle, self.robot.dof
        table[0, :n] = states[0, 0] + 0.5 * h * states[0, 1] + limits[4]
        places = table[: self._cycles, :n]
        follows = True

        def step(
            cycle: int, tip: int, jacobian: Array, rotation: Array, translation: Array
        ) -> bool:
            nonlocal follows
            follows &= law.command(
                cycle, jacobian, rotation, translation, table, states, limits, layout, _GAIN, h
            )
            return True

        layout = self._layout
        march([self._kinematics], places, step)
        return follows

    def _segment(
        self, t: float, end: int, flag: Flag, reasons: list[str], follows: bool, error: Array
    ) -> Segment:
        h = self.cycle
        # What comes after the end is rest, too.
        self._states[end + 1 :] = self._states[end]
        end = max(end, 1)
        states = self._states[: end + 1]
        return Segment(
            t=np.asarray(t + h * np.arange(end + 1), dtype=np.float64),
            q=self._positions(states),
            qd=states[:, 1] - 0.5 * h * states[:, 2],
            qdd=states[:, 2],
            flag=flag,
            reasons=tuple(reasons),
            follows=follows,
            tool_error=error,
        )
