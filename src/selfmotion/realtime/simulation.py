"""A closed loop with a simulated arm, recorded."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.path import Path, Waypoints
from selfmotion.model.task import SE3
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan, Report
from selfmotion.problem.constraints import NO_OVERLAP, Constraint, separate_clearances
from selfmotion.problem.costs import Cost, JointVelocity, Samples
from selfmotion.problem.problem import Problem
from selfmotion.realtime.loop import State, follow
from selfmotion.realtime.replanner import Replanner
from selfmotion.realtime.segment import Segment
from selfmotion.realtime.simulated_arm import SimulatedArm

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
