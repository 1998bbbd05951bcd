"""What is commanded: a state for each cycle, from which the arm can always be stopped."""

import numpy as np

from selfmotion.basics import Array, ProblemError
from selfmotion.basics.layout import Layout
from selfmotion.realtime import law
from selfmotion.realtime.limits import stoppable
from selfmotion.realtime.segment import Flag, Segment
from selfmotion.realtime.settings import FARTHEST, GAIN
from selfmotion.realtime.viable import tightened
from selfmotion.robot import Kinematics, RobotModel


class Commands:
    """The commands of a segment, and what the arm is off them.

    Parameters
    ----------
    robot : RobotModel
    limits : (4, n)
        Lower, upper, speed, acceleration.
    cycle : float
        Time between commands [s].
    cycles : int
        So many of a segment follow the path; those after them bring the arm to rest.
    latency : float
        How old a measured position is [s].
    settling : float
        Time constant [s] of the filter of what the arm is off its command.

    Attributes
    ----------
    time : float
        When the first state is commanded [s].
    """

    def __init__(
        self,
        robot: RobotModel,
        limits: Array,
        cycle: float,
        cycles: int,
        latency: float,
        settling: float,
    ) -> None:
        self._robot, self._cycle, self._settling = robot, cycle, settling
        # The last row is what the arm is off its command.
        self._limits = np.vstack([tightened(limits), np.zeros(robot.dof)])
        # In so many cycles every joint comes to rest from its highest speed.
        stopping = int(np.ceil((limits[2] / (limits[3] * cycle)).max())) + 3
        # c, w and a of each cycle; see `viable`.
        self._states = np.zeros((cycles + stopping + 1, 3, robot.dof))
        self._sent = np.zeros((round(latency / cycle) + 1, robot.dof))
        self.time = 0.0

    def begin(self, t: float, q: Array, qd: Array) -> None:
        """Command the arm to stop from its first state."""
        c = stoppable(self._robot, self._limits, q, qd, self._cycle)
        self._states[:] = 0.0
        self._states[:, 0], self._states[0, 1] = c, qd
        law.brake(self._states, 0, self._limits, self._cycle)
        self.time, self._limits[4], self._sent[:] = t, 0.0, q

    def go_on(self, t: float) -> float:
        """Make the state that is commanded at `t` the first one; return the time passed [s]."""
        passed = round((t - self.time) / self._cycle) if np.isfinite(t) else -1
        if passed < 0:
            raise ProblemError(f"t is {t} s, expected no less than the last step's {self.time} s")
        end = len(self._states) - 1
        here = min(passed, end)
        sent = self._positions(self._states[: here + 1])
        if passed > end:
            sent = np.vstack([sent, np.repeat(sent[-1:], min(passed - end, len(self._sent)), 0)])
        self._sent = np.vstack([self._sent, sent[1:]])[-len(self._sent) :]
        self._states[0] = self._states[here]
        self.time += passed * self._cycle
        return passed * self._cycle

    @property
    def deviation(self) -> Array:
        """What the arm is off its command, filtered, (n,) [rad or m]."""
        return np.asarray(self._limits[4])

    @property
    def rate(self) -> Array:
        """The rate that is commanded now, (n,)."""
        return np.asarray(self._states[0, 1] - 0.5 * self._cycle * self._states[0, 2])

    @property
    def place(self) -> Array:
        """Where the arm is now, as far as is known, (n,)."""
        return np.asarray(self._positions(self._states[:1])[0] + self.deviation)

    def measure(self, q: Array, passed: float) -> str:
        """Take in a measured position (n,); return why the arm may not go on moving, or ""."""
        off = q - self._sent[0]
        worst = int(np.argmax(np.abs(off)))
        if abs(off[worst]) > FARTHEST:
            return f"joint '{self._robot.joint_names[worst]}' is {off[worst]:.3g} from its command"
        share = 1.0 - np.exp(-passed / self._settling)
        self._limits[4] += share * (off - self._limits[4])
        return ""

    def follow(self, kinematics: Kinematics, layout: Layout, table: Array) -> bool:
        """Command the cycles of a `table` one after the other; see `law.command`.

        Returns whether the tool moves as asked.
        """
        states, limits, h, n = self._states, self._limits, self._cycle, self._robot.dof
        table[0, :n] = states[0, 0] + 0.5 * h * states[0, 1] + limits[4]
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
        self, first: int, flag: Flag, reasons: tuple[str, ...], follows: bool, error: Array
    ) -> Segment:
        """Return what is commanded: from cycle `first` on, the arm is brought to rest."""
        h = self._cycle
        end = law.brake(self._states, first, self._limits, h)
        # What comes after the end is rest, too.
        self._states[end + 1 :] = self._states[end]
        end = max(end, 1)
        states = self._states[: end + 1]
        return Segment(
            t=np.asarray(self.time + h * np.arange(end + 1), dtype=np.float64),
            q=self._positions(states),
            qd=states[:, 1] - 0.5 * h * states[:, 2],
            qdd=states[:, 2],
            flag=flag,
            reasons=reasons,
            follows=follows,
            tool_error=error,
        )

    def _positions(self, states: Array) -> Array:
        """Return q of states: the spline at its knots, (c⁻ + 4 c + c⁺)/6."""
        h = self._cycle
        return np.asarray(states[:, 0] - h * states[:, 1] + h * h / 6.0 * states[:, 2])
