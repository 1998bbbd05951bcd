"""The loop around a replanner: states in, segments out; simulated, and recorded."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, as_number, read_only
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.path import Line, Path, Waypoints
from selfmotion.model.task import SE3
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan, Report
from selfmotion.problem.constraints import NO_OVERLAP, Constraint, separate_clearances
from selfmotion.problem.costs import Cost, JointVelocity, Samples
from selfmotion.problem.problem import Problem
from selfmotion.realtime.commands import Segment
from selfmotion.realtime.replanner import Replanner


@dataclass(frozen=True, eq=False)
class State:
    """Measurements at a step.

    Attributes
    ----------
    t : float
        When it was measured [s].
    q, qd : (n,)
        Measured positions and velocities [rad or m, and per s].
    path : Path, optional
        The tool's motion, as it is known by now.
    obstacles : mapping
        Where obstacles are by now: name → pose.
    target, twist, seen : optional
        In place of a path; see `Replanner.step`.
    chunk, times : optional
        In place of both.
    """

    t: float
    q: npt.ArrayLike
    qd: npt.ArrayLike
    path: Path | None = None
    obstacles: Mapping[str, SE3] = field(default_factory=dict)
    target: SE3 | npt.ArrayLike | None = None
    twist: npt.ArrayLike | None = None
    seen: float | None = None
    chunk: Sequence[SE3] | npt.ArrayLike | None = None
    times: npt.ArrayLike | None = None


def follow(
    replanner: Replanner,
    read: Callable[[], State | None],
    write: Callable[[Segment], None],
    *,
    lead: float = 0.0,
) -> int:
    """Plan a segment for each state that is read, and write it, until there is none.

    Parameters
    ----------
    replanner : Replanner
        With ``latency`` no less than `lead`.
    read : callable
        Waits for the next state, about a period later, and returns it; None ends the loop.
    write : callable
        Sends a segment to the controller: its samples are commanded one per cycle, from its first
        time on, until another segment replaces it. Each ends at rest.
    lead : float
        Time from its state to the start of a segment [s]: for planning and communication, in whole
        cycles.

    Returns
    -------
    Number of segments.
        How many segments were written.

    Raises
    ------
    ProblemError
        `read` returns something else.
    """
    count = 0
    while (state := read()) is not None:
        if not isinstance(state, State):
            raise ProblemError(f"read() returned {type(state).__name__}, expected State or None")
        segment = replanner.step(
            state.t + lead,
            state.q,
            state.qd,
            state.path,
            state.obstacles,
            target=state.target,
            twist=state.twist,
            # A target without a time was seen when the state was.
            seen=state.t if state.seen is None and state.target is not None else state.seen,
            chunk=state.chunk,
            times=state.times,
        )
        write(segment)
        count += 1
    return count


# A simulated arm to close the loop with: it follows its command late, and is measured badly.


@dataclass(frozen=True)
class Plant:
    """Dynamics of a simulated arm.

    Attributes
    ----------
    lag : float
        Time constant with which each joint goes to its command [s].
    delay : float
        Time from a command to its effect [s].
    noise : float
        Standard deviation of measured positions [rad or m].
    """

    lag: float = 0.01
    delay: float = 2e-3
    noise: float = 5e-5

    def __post_init__(self) -> None:
        for name in ("lag", "delay", "noise"):
            as_number(getattr(self, name), f"plant: {name}", least=0.0)


class SimulatedArm:
    """Plays segments, cycle by cycle, as a controller would: the last one it was given.

    Parameters
    ----------
    q : (n,)
        Where it stands at first.
    cycle : float
        Time between commands [s].
    plant : Plant
    rng : Generator or int
        Source of the noise.

    Attributes
    ----------
    t : float
        Time [s].
    q : (n,)
        Where the arm is.
    pushed : (n,)
        External displacement from its command [rad or m]; to be set.
    commanded : list of (q, qd, qdd)
        All commands so far.
    """

    def __init__(
        self,
        q: Array,
        cycle: float,
        plant: Plant | None = None,
        rng: np.random.Generator | int = 0,
    ) -> None:
        self.t, self.q, self.cycle = 0.0, np.array(q, dtype=np.float64), cycle
        self._plant = plant or Plant()
        self._rng = np.random.default_rng(rng)
        self.pushed = np.zeros_like(self.q)
        self._moved = self.q.copy()
        self._waiting = [self.q.copy()] * (round(self._plant.delay / cycle) + 1)
        self._segment: Segment | None = None
        self.commanded: list[tuple[Array, Array, Array]] = []

    def write(self, segment: Segment) -> None:
        """Play this segment from now on."""
        self._segment = segment

    def measure(self) -> tuple[Array, Array]:
        """Return measured positions and velocities, (n,) each."""
        noise = self._plant.noise * self._rng.standard_normal(len(self.q))
        rate = np.zeros(len(self.q)) if not self.commanded else self.commanded[-1][1]
        return self.q + noise, np.array(rate)

    def run(self, seconds: float) -> None:
        """Let time pass.

        Raises
        ------
        ProblemError
            There is no segment to play.
        """
        if self._segment is None:
            raise ProblemError("the simulated arm has no segment to play; write one first")
        share = 1.0 if self._plant.lag == 0.0 else 1.0 - np.exp(-self.cycle / self._plant.lag)
        for _ in range(round(seconds / self.cycle)):
            self.t += self.cycle
            segment = self._segment
            k = segment.index(self.t)
            self.commanded.append((segment.q[k], segment.qd[k], segment.qdd[k]))
            self._waiting = [*self._waiting[1:], segment.q[k]]
            self._moved += share * (self._waiting[0] - self._moved)
            self.q = self._moved + self.pushed


# A closed loop with a simulated arm, recorded.

# Errors of a measured arm that count as on the path [m, rad].
_BACK = 1e-3, 1e-2


class Scene(Protocol):
    """Events around the arm; all times [s]."""

    def path(self, t: float) -> Path:
        """Return the tool's motion, as it is known at a time."""

    def obstacles(self, t: float) -> Mapping[str, SE3]:
        """Return the poses of obstacles at a time."""

    def pushed(self, t: float) -> Array:
        """Return the external displacement of the arm from its command, (n,) [rad or m]."""


@dataclass(frozen=True, eq=False)
class Record:
    """History of a closed loop, a sample per period.

    Attributes
    ----------
    t : (K,)
        Times [s].
    q : (K, n)
        Where the arm was [rad or m].
    targets : tuple of SE3
        Where its tool should have been.
    error : (K, 2)
        How far it was off, in the rows of the task [m, rad].
    seconds : (K,)
        How long each step took, by the clock [s].
    flags : Counter
        Number of segments by flag.
    reasons : Counter
        How often something was noticed.
    commanded : (M, 3, n)
        All commands: positions, velocities, accelerations.
    """

    t: Array
    q: Array
    targets: tuple[SE3, ...]
    error: Array
    seconds: Array
    flags: Counter[str]
    reasons: Counter[str]
    commanded: Array

    def __post_init__(self) -> None:
        for name in ("t", "q", "error", "seconds", "commanded"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    def as_plan(
        self,
        replanner: Replanner,
        costs: Sequence[Cost] = (JointVelocity(),),
        constraints: Sequence[Constraint] = (),
    ) -> Plan:
        """Return the arm's motion as a plan, judged by the certificate, to show and to save.

        Its path is the target's; jumps are linear between two samples.
        """
        robot, task = replanner.robot, replanner.task
        path = Waypoints.from_poses(self.t, list(self.targets))
        others, apart = separate_clearances(constraints, NO_OVERLAP)
        problem = Problem(
            robot, path, task, costs=tuple(costs), constraints=others, clearance=apart
        )
        rates = np.gradient(self.q, self.t, axis=0)
        motion = Trajectory(self.t, self.q, rates, robot.joint_names)
        samples = Samples.along(problem.follows, Sampling.trapezoidal(self.t), self.q, rates)
        terms = {cost.name: float(samples.weights @ cost.value(samples)) for cost in costs}
        steps = len(self.t)
        report = Report(
            cost=sum(terms.values()),
            initial_cost=sum(terms.values()),
            terms=terms,
            initial_terms=terms,
            evaluations=steps,
            gradient_evaluations=steps,
            jacobian_evaluations=0,
            steps=steps - 1,
            iterations=steps,
            history=(),
            status=Status.STOPPED,
            message="tracked in a closed loop, replanned at each step",
            seconds=float(self.seconds.sum()),
        )
        certificate = problem.certify(motion, Tolerance(*_BACK))
        return Plan(problem, motion, motion, read_only([]), report, certificate)


def track(replanner: Replanner, arm: SimulatedArm, scene: Scene, seconds: float) -> Record:
    """Simulate the loop of a replanner and an arm for a duration.

    Time stops during a step: `Record.seconds` has the steps' durations.
    """
    robot, task = replanner.robot, replanner.task
    times: list[float] = []
    places, targets, errors, took = [], [], [], []
    flags: Counter[str] = Counter()
    reasons: Counter[str] = Counter()
    began = 0.0

    def read() -> State | None:
        nonlocal began
        t = arm.t
        if t > seconds - 0.5 * replanner.period:
            return None
        arm.pushed = scene.pushed(t)
        path = scene.path(t)
        target = path.pose(min(t, path.duration))
        times.append(t)
        places.append(arm.q.copy())
        targets.append(target)
        errors.append(task.miss(target, robot.pose(arm.q)))
        state = State(t, *arm.measure(), path, scene.obstacles(t))
        began = time.perf_counter()
        return state

    def write(segment: Segment) -> None:
        took.append(time.perf_counter() - began)
        flags[segment.flag.value] += 1
        reasons.update(reason.split(":")[0] for reason in segment.reasons)
        arm.write(segment)
        arm.run(replanner.period)

    follow(replanner, read, write)
    return Record(
        np.array(times),
        np.array(places),
        tuple(targets),
        np.array(errors),
        np.array(took),
        flags,
        reasons,
        np.array(arm.commanded),
    )


# Everything compiled and allocated before the arm moves.

# Steps until all kernels are compiled: the first ones start a plan, the others shift it.
_STEPS = 5


def warm_up(replanner: Replanner) -> None:
    """Let a replanner do all that it may have to do, and forget it: no step compiles later.

    Kernels are compiled once per machine and loaded once per process, which takes seconds where
    the first step of a moving arm would wait for it.

    Parameters
    ----------
    replanner : Replanner
        The one to be used, before its first step.
    """
    robot = replanner.robot
    q = robot.dexterous_configuration(replanner.task)
    pose = robot.pose(q)
    later = SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 0.01]))
    far = SE3(pose.rotation, pose.translation + 10.0 * robot.reach)
    zero = np.zeros(robot.dof)
    # On the path, then without a state, then towards an unreachable pose.
    for goal, measured in ((later, q), (later, np.full(robot.dof, np.nan)), (far, q)):
        replanner.reset()
        path = Line(pose, goal, 1.0)
        replanner.step(0.0, q, zero, path)
        for k in range(1, _STEPS):
            replanner.step(k * replanner.period, measured, zero, path)
    replanner.reset()
