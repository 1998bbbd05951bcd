"""From a problem to a plan."""

import time
from dataclasses import dataclass

import numpy as np

from selfmotion.arrays import Array, read_only
from selfmotion.certificate import Certificate, Tolerance, certify
from selfmotion.errors import BreakdownError, ProblemError
from selfmotion.grid import Grid
from selfmotion.null_motion import NullMotionTable, TransportedFrame
from selfmotion.objective import Objective, inverse_metric
from selfmotion.plan import Plan, Report
from selfmotion.problem import Problem
from selfmotion.quasi_newton import Callback, Iteration, Minimum, QuasiNewton, Status
from selfmotion.rollout import Rollout
from selfmotion.trajectory import Trajectory

# Steps to begin with; halved until the motion at x = 0 drifts off the path by less than this,
# relative to the extent of the path. Costs are then right to about the same.
_FEWEST_STEPS, _DRIFT = 32, 1e-3
# Agreement of the cost on a grid and on the halved one, at which the coarser optimum stands.
_COST_AGREEMENT = 1e-4
# After these the user has no more time to give.
_CUT_SHORT = (Status.INTERRUPTED, Status.STOPPED, Status.MAX_EVALUATIONS)
# The finest grid has 2 to this power times the steps of the first.
_MOST_HALVINGS = 8


def plan(
    problem: Problem,
    *,
    optimizer: QuasiNewton | None = None,
    initial_metric: str = "gauss-newton",
    max_evaluations: int | None = None,
    callback: Callback | None = None,
    tolerance: Tolerance | None = None,
) -> Plan:
    """Plan the joint motion that follows the path exactly and minimises the costs.

    Parameters
    ----------
    problem : Problem
    optimizer : QuasiNewton, optional
    initial_metric : {"gauss-newton", "identity"}
        H0: the inverse Gauss-Newton matrix of the motion at x = 0, or the paper's identity.
    max_evaluations : int, optional
        Limit on evaluations of the cost while optimising.
    callback : callable, optional
        Called with each `Iteration`; returning True stops, keeping the best so far.
    tolerance : Tolerance, optional
        What the motion may miss the path by, between samples as well. The number of steps
        follows from it.

    Returns
    -------
    Plan
        Also where the search fell short: `Plan.report` and `Plan.certificate` say so, and
        `Plan.require` raises.

    Raises
    ------
    BreakdownError
        The motion at x = 0 runs into a singular pose.
    InverseKinematicsError
        No start was given and none was found.
    """
    if initial_metric not in ("gauss-newton", "identity"):
        raise ProblemError(
            f"initial_metric is '{initial_metric}', expected 'gauss-newton' or 'identity'"
        )
    began = time.perf_counter()
    session = _Session(problem, optimizer or QuasiNewton(), callback, max_evaluations)
    minimum = session.minimize(initial_metric == "gauss-newton")
    return session.finish(minimum, tolerance or Tolerance(), began)


@dataclass
class _Counts:
    """Work done on grids that are no longer in use."""

    evaluations: int = 0
    gradients: int = 0
    jacobians: int = 0


class _Session:
    """One call of `plan`: the problem on a grid that becomes finer."""

    def __init__(
        self,
        problem: Problem,
        optimizer: QuasiNewton,
        callback: Callback | None,
        max_evaluations: int | None,
    ) -> None:
        self._problem, self._optimizer, self._callback = problem, optimizer, callback
        self._limit = max_evaluations
        self._done = _Counts()
        self._history: list[Iteration] = []
        reference = self._reference()
        self._frame = self._null_space(reference)
        self._objective = self._bind(reference.grid)

    def minimize(self, use_metric: bool) -> Minimum:
        """Optimise on the first grid, and on halved ones until the cost agrees."""
        x = np.zeros(self._objective.size)
        h = inverse_metric(self._objective.metric(x)) if use_metric else None
        minimum = self._minimize(x, h)
        for _ in range(_MOST_HALVINGS):
            if minimum.status in _CUT_SHORT:
                break
            self._refine()
            finer = self._minimize(minimum.x, minimum.inverse_hessian)
            error = abs(finer.history[0].cost - minimum.cost)
            minimum = finer
            if error <= _COST_AGREEMENT * abs(finer.cost):
                break
        return minimum

    def finish(self, minimum: Minimum, tolerance: Tolerance, began: float) -> Plan:
        """Refine the motion until it holds the tolerance, and gather everything."""
        for _ in range(_MOST_HALVINGS):
            terms = self._objective.terms(minimum.x)
            trajectory, certificate = self._motion(tolerance)
            errors = certificate.position_error.value, certificate.rotation_error.value
            if errors[0] <= tolerance.position and errors[1] <= tolerance.rotation:
                break
            self._refine()
        initial_terms = self._objective.terms(np.zeros_like(minimum.x))
        initial_trajectory = self._trajectory()
        counts = self._totals()
        report = Report(
            cost=sum(terms.values()),
            initial_cost=sum(initial_terms.values()),
            terms=terms,
            initial_terms=initial_terms,
            evaluations=counts.evaluations,
            gradient_evaluations=counts.gradients,
            jacobian_evaluations=counts.jacobians,
            steps=len(trajectory.t) - 1,
            iterations=sum(iteration.step > 0.0 for iteration in self._history),
            history=tuple(self._history),
            status=minimum.status,
            message=minimum.status.message,
            seconds=time.perf_counter() - began,
        )
        problem = self._problem
        return Plan(
            robot=problem.robot,
            path=problem.path,
            task=problem.rows,
            trajectory=trajectory,
            initial_trajectory=initial_trajectory,
            coefficients=read_only(minimum.x),
            report=report,
            certificate=certificate,
        )

    def _reference(self) -> Rollout:
        """Return the motion at x = 0, on the coarsest grid on which it stays near the path."""
        problem = self._problem
        knots = problem.path.knots
        grid = Grid.aligned(knots, _FEWEST_STEPS)
        target = problem.path.samples(grid.nodes)
        extent = max(float(np.ptp(target.translation, axis=0).max()), 1e-3)
        for _ in range(_MOST_HALVINGS):
            rollout = Rollout(problem.robot, problem.path, problem.rows, grid)
            epsilon = np.zeros((len(grid.stage_times), problem.robot.dof))
            broken = rollout.run(problem.start_configuration, epsilon)
            self._done.jacobians += rollout.jacobian_evaluations
            rows = problem.rows.rows
            drift = np.abs(rollout.drift[:, rows]) / np.where(rows < 3, extent, 1.0)
            off = ~(drift <= _DRIFT).all(axis=1)
            if broken is None and not off.any():
                return rollout
            grid = grid.halved()
        # After the last halving: where eq. 4 broke down, or else where it first left the path.
        time = rollout.grid.nodes[int(np.argmax(off))] if broken is None else broken
        raise BreakdownError(
            f"{problem.robot.name}: without self-motion the tool reaches a singular pose near "
            f"t = {time:.4g} s; start elsewhere (start=), or keep the path away from the edge "
            f"of the workspace",
            time=float(time),
        )

    def _null_space(self, reference: Rollout) -> TransportedFrame | None:
        if self._problem.null_motion.space == "joint":
            return None
        nodes = reference.grid.node_stages
        return TransportedFrame(reference.grid.nodes, reference.samples().task_jacobian[nodes])

    def _bind(self, grid: Grid) -> Objective:
        problem = self._problem
        t = grid.stage_times
        functions = problem.null_motion.functions(t, problem.path.duration)
        frame = None if self._frame is None else self._frame(t)
        rows = problem.robot.dof if frame is None else frame.shape[2]
        return Objective(
            Rollout(problem.robot, problem.path, problem.rows, grid),
            NullMotionTable(functions, frame, rows),
            problem.costs,
            problem.start_configuration,
        )

    def _minimize(self, x: Array, h: Array | None) -> Minimum:
        spent = self._totals().evaluations
        limit = None if self._limit is None else max(self._limit - spent, 1)
        minimum = self._optimizer.minimize(
            self._objective, x, h, max_evaluations=limit, callback=self._callback
        )
        self._history += minimum.history
        return minimum

    def _refine(self) -> None:
        """Go on with half the step length."""
        self._done = self._totals()
        self._objective = self._bind(self._objective.rollout.grid.halved())

    def _totals(self) -> _Counts:
        objective = self._objective
        return _Counts(
            self._done.evaluations + objective.evaluations,
            self._done.gradients + objective.gradient_evaluations,
            self._done.jacobians + objective.rollout.jacobian_evaluations,
        )

    def _trajectory(self) -> Trajectory:
        return Trajectory(*self._objective.rollout.polish(), self._problem.robot.joint_names)

    def _motion(self, tolerance: Tolerance) -> tuple[Trajectory, Certificate]:
        problem, trajectory = self._problem, self._trajectory()
        certificate = certify(problem.robot, problem.path, problem.rows, trajectory, tolerance)
        return trajectory, certificate
