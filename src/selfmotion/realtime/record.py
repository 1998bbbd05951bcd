"""What a closed loop with an arm did, as arrays and as a plan."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.certificate import Tolerance
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.path import Waypoints
from selfmotion.model.task import SE3
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan, Report
from selfmotion.problem.constraints import NO_OVERLAP, Constraint, separate_clearances
from selfmotion.problem.costs import Cost, JointVelocity, Samples
from selfmotion.problem.problem import Problem
from selfmotion.realtime.replanner import Replanner

# Error of a measured arm within which it counts as on the path [m, rad].
_TOLERANCE = Tolerance(1e-3, 1e-2)


@dataclass(frozen=True, eq=False)
class Record:
    """History of a closed loop, a sample for each period.

    Attributes
    ----------
    t : (K,)
        Times [s].
    q : (K, n)
        Configurations of the arm [rad or m].
    targets : tuple of SE3
        Poses of the path at these times.
    error : (K, 2)
        Error of the tool from the targets, in the rows of the task [m, rad].
    seconds : (K,)
        Duration of each step of the replanner, by the clock [s].
    flags : Counter
        Number of segments by flag.
    reasons : Counter
        Number of segments by reason, without its details.
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

        Its path goes through the targets, straight between two samples where they jump.

        Parameters
        ----------
        replanner : Replanner
            Its arm and task.
        costs : sequence of Cost
            Costs that the report states.
        constraints : sequence of Constraint
            Constraints that the motion is judged by.
        """
        robot, task = replanner.robot, replanner.task
        path = Waypoints.from_poses(self.t, list(self.targets))
        others, apart = separate_clearances(constraints, NO_OVERLAP)
        problem = Problem(
            robot, path, task, costs=tuple(costs), constraints=others, clearance=apart
        )
        qd = np.gradient(self.q, self.t, axis=0)
        motion = Trajectory(self.t, self.q, qd, robot.joint_names)
        samples = Samples.along(problem.follows, Sampling.trapezoidal(self.t), self.q, qd)
        terms = {cost.name: float(samples.weights @ cost.value(samples)) for cost in costs}
        certificate = problem.certify(motion, _TOLERANCE)
        return Plan(problem, motion, motion, read_only([]), self._report(terms), certificate)

    def _report(self, terms: Mapping[str, float]) -> Report:
        """Return a report with the costs of the motion, which was not optimised as a whole."""
        steps = len(self.t)
        return Report(
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
