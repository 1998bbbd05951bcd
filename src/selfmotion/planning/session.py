"""One start of one problem, optimised on a grid that becomes finer."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from selfmotion.basics import Array, BreakdownError
from selfmotion.engine import (
    FEEDBACK,
    AugmentedLagrangian,
    Deviation,
    FixedStart,
    FreeStart,
    Objective,
    Rollout,
    Start,
    inverse_metric,
)
from selfmotion.motion import Grid, NullMotionTable, Trajectory, TransportedFrame
from selfmotion.optimise import Callback as IterationCallback
from selfmotion.optimise import Iteration, Minimum, QuasiNewton, Status
from selfmotion.plans import Problem

_Result = TypeVar("_Result")
Guide = Callable[[Array], Array]

# Steps to begin with; halved until the motion at x = 0 drifts off the path by less than this,
# relative to the extent of the path. Costs are then right to about the same.
_FEWEST_STEPS, _DRIFT = 32, 1e-3
# Agreement of the cost on a grid and on the halved one, at which the coarser optimum stands.
_COST_AGREEMENT = 1e-4
# A cost that rises this much on two grids in turn has no limit.
_RISE, _RISES = 1.5, 2
# Trouble that three grids in turn place within this share of the motion, and of which the last has
# at least half as much as the first, is the motion's own.
_SAME_PLACE, _SAME_AMOUNT = 1e-3, 0.5
# The finest grid has 2 to this power times the steps of the first.
MOST_HALVINGS = 8
# The first round of the augmented Lagrangian is minimised this much more coarsely.
_FIRST_SLACK = 1e4
# Rounds of the augmented Lagrangian. What has not fallen to this share in so many of them, while
# penalties grew tenfold in each, does not fall any more.
_ROUNDS, _STUCK_ROUNDS, _STUCK = 12, 4, 0.9
# Equalities are met to this [rad, rad/s], which Newton's method needs a few steps for.
_CLOSED, _CLOSING_STEPS = 1e-11, 12
# After these the user has no more time to give.
_CUT_SHORT = (Status.INTERRUPTED, Status.STOPPED, Status.MAX_EVALUATIONS)


@dataclass
class Counts:
    """Work done, over all starts and grids."""

    evaluations: int = 0
    gradients: int = 0
    jacobians: int = 0


class Session:
    """The optimisation from one start.

    Parameters
    ----------
    problem : Problem
    optimizer : QuasiNewton
    callback : callable or None
        Called with each `Iteration`.
    max_evaluations : int or None
        Limit on evaluations of this session.
    counts : Counts
        Where work is added up, shared by all sessions of a plan.
    configuration : (n,)
        The start.
    free : bool
        Whether the start may move along its self-motion.
    guide : callable, optional
        t (S,) → q̇ (S, n) of a motion whose null motion stands for x = 0: where the search found
        one worth starting from. By default x = 0 has no null motion.

    Raises
    ------
    BreakdownError
        The motion at x = 0 runs into a singular pose.
    """

    def __init__(
        self,
        problem: Problem,
        optimizer: QuasiNewton,
        callback: IterationCallback | None,
        max_evaluations: int | None,
        counts: Counts,
        configuration: Array,
        *,
        free: bool,
        guide: Guide | None = None,
    ) -> None:
        self._problem, self._optimizer, self._callback = problem, optimizer, callback
        self._limit, self._spent = max_evaluations, 0
        self.counts, self._guide = counts, guide
        self.history: list[Iteration] = []
        self.violations: tuple[str, ...] = ()
        robot, task = problem.robot, problem.rows
        self._start: Start = (
            FreeStart(robot, task, configuration) if free else FixedStart(configuration)
        )
        reference = self._reference(configuration)
        self._frame = self._null_space(reference)
        bound = problem.bind_constraints(configuration, reference.samples().q[-1].copy())
        conditions = AugmentedLagrangian(bound, reference.grid)
        self._objective = self._bind(reference.grid, conditions)
        self._minimum: Minimum | None = None
        self._ended: Status | None = None
        # Whether the last motion kept all constraints: so far none is known to be active.
        self._feasible = True
        self._x = np.zeros(self._objective.size)

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended the session."""
        if self._ended is not None:
            return self._ended
        return Status.STOPPED if self._minimum is None else self._minimum.status

    @property
    def cut_short(self) -> bool:
        """Whether the user wants no more."""
        return self.status in (Status.INTERRUPTED, Status.STOPPED)

    def end(self, status: Status) -> None:
        """Take the motion as it is; there is no time for another one."""
        self._ended = status
        self.terms()
        self.violations = self._conditions.violated(self._objective.rollout.samples())

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients."""
        return self._objective.parts(self._x)[1]

    @property
    def initial_score(self) -> float:
        """Return the cost of x = 0, much larger where constraints are violated: for ranking."""
        x = np.zeros(self._objective.size)
        cost = sum(self._objective.terms(x).values())
        conditions = self._conditions
        conditions.start(self._objective.rollout.samples(), cost)
        return float(cost + conditions.value(self._objective.rollout.samples()))

    @property
    def score(self) -> tuple[bool, float]:
        """Whether constraints are violated, then the cost: the smaller, the better."""
        return bool(self.violations), sum(self.terms().values())

    def terms(self) -> dict[str, float]:
        """Return what each cost contributes to the motion's cost."""
        return self._counted(lambda: self._objective.terms(self._x))

    def initial_terms(self) -> dict[str, float]:
        """Return what each cost contributes at x = 0, and leave the rollout there."""
        return self._counted(lambda: self._objective.terms(np.zeros_like(self._x)))

    @property
    def damped(self) -> bool:
        """Whether the motion that was evaluated last was damped anywhere."""
        return self._objective.rollout.damped

    def trajectory(self) -> Trajectory:
        """Return the motion that was evaluated last, its nodes put onto the path unless damped."""
        rollout = self._objective.rollout
        before = rollout.jacobian_evaluations
        trajectory = Trajectory(*rollout.polish(), self._problem.robot.joint_names)
        self.counts.jacobians += rollout.jacobian_evaluations - before
        return trajectory

    def minimize(self, use_metric: bool) -> None:
        """Optimise on the present grid: rounds of the augmented Lagrangian until all is kept."""
        objective, conditions = self._objective, self._conditions
        cost = sum(self.terms().values())
        conditions.start(objective.rollout.samples(), cost)
        h = None if self._minimum is None else self._minimum.inverse_hessian
        worst: list[float] = []
        for round_number in range(_ROUNDS):
            if use_metric and (round_number > 0 or h is None):
                h = inverse_metric(self._counted(lambda: objective.metric(self._x)))
            self._minimum = self._run_optimizer(h, round_number)
            self._x = np.array(self._minimum.x)
            self.terms()
            samples = objective.rollout.samples()
            kept = conditions.update(samples)
            if (kept and self._feasible) or self.status in _CUT_SHORT:
                break
            self._feasible = kept
            worst.append(conditions.worst)
            if round_number >= _STUCK_ROUNDS and worst[-1] > _STUCK * worst[-1 - _STUCK_ROUNDS]:
                break
        self._close()
        self.violations = conditions.violated(objective.rollout.samples())

    def _close(self) -> None:
        """Meet the equalities to rounding by Newton's method.

        The step is the smallest in the metric of H⁻¹ that takes out the residual, so that it
        hardly changes the cost: -H Gᵀ(G H Gᵀ)⁻¹ h with G = ∂h/∂x.
        """
        objective, conditions = self._objective, self._conditions
        if not conditions.has_equalities or self._minimum is None:
            return
        h = self._minimum.inverse_hessian
        best, nearest = self._x, np.inf
        for _ in range(_CLOSING_STEPS):
            if not np.isfinite(sum(self.terms().values())):
                break
            tangents = self._counted(lambda: objective.node_tangents(self._x))
            residual, rows = conditions.equalities(objective.rollout.samples(), tangents)
            miss = float(np.max(np.abs(residual), initial=0.0))
            if miss < _CLOSED:
                return
            # Conditions that contradict each other, or are out of reach, are not met by more steps.
            if not miss < nearest:
                break
            best, nearest = self._x, miss
            spread = h @ rows.T
            # Least squares: conditions may depend on each other.
            self._x = self._x - spread @ np.linalg.lstsq(rows @ spread, residual)[0]
        self._x = best
        self.terms()

    def refine_until_settled(self) -> None:
        """Optimise on halved grids until the cost agrees."""
        rises = 0
        for _ in range(MOST_HALVINGS):
            if self.status in _CUT_SHORT:
                return
            before, unmet = sum(self.terms().values()), bool(self.violations)
            self.refine()
            after = sum(self.terms().values())
            error = abs(after - before)
            # A cost that grows and grows, and what two grids in turn could not meet: the path runs
            # past the edge of the workspace between their nodes, or limits are too tight.
            rises = rises + 1 if after > _RISE * abs(before) else 0
            if rises == _RISES:
                return
            self.minimize(use_metric=True)
            if error <= _COST_AGREEMENT * abs(before) or (unmet and self.violations):
                return

    def refine(self) -> None:
        """Go on with half the step length."""
        grid = self._objective.rollout.grid.halved()
        self._objective = self._bind(grid, self._conditions.refined(grid))
        self._close()

    @property
    def _conditions(self) -> AugmentedLagrangian:
        conditions = self._objective.constraints
        if conditions is None:
            raise RuntimeError("a session's objective always has constraints")
        return conditions

    def _reference(self, configuration: Array) -> Rollout:
        """Return the motion at x = 0, on the coarsest grid on which it stays near the path.

        Damping takes it off the path: there, on the first grid that changes the error no more.
        """
        problem = self._problem
        steps = max(_FEWEST_STEPS, problem.null_motion.fewest_steps)
        grid = Grid.aligned(problem.knots, steps)
        target = problem.path.samples(grid.nodes)
        extent = max(float(np.ptp(target.translation, axis=0).max()), 1e-3)
        rows = problem.rows.rows
        coarse: Array | None = None
        troubles: list[tuple[float, float]] = []
        for _ in range(MOST_HALVINGS):
            rollout = self._rollout(grid)
            offset = self._offset(grid)
            idle = np.zeros((len(grid.stage_times), problem.robot.dof))
            broken = rollout.run(configuration, idle if offset is None else offset)
            self.counts.jacobians += rollout.jacobian_evaluations
            drift = rollout.drift[:, rows] / np.where(rows < 3, extent, 1.0)
            if rollout.damped and coarse is not None:
                off = ~(np.abs(drift[::2] - coarse) <= _DRIFT).all(axis=1)
            else:
                off = ~(np.abs(drift) <= _DRIFT).all(axis=1)
            coarse = drift
            if broken is None and not off.any():
                return rollout
            # Where eq. 4 broke down, or else where it first left the path.
            time = float(grid.nodes[int(np.argmax(off))]) if broken is None else broken
            troubles.append((time, np.inf if broken is not None else float(np.abs(drift).max())))
            if not rollout.damped and _stays(troubles, problem.path.duration):
                break
            grid = grid.halved()
        raise BreakdownError(
            f"{problem.robot.name}: without self-motion the tool reaches a singular pose near "
            f"t = {time:.4g} s; start elsewhere (start=), or keep the path away from the edge "
            f"of the workspace",
            time=time,
        )

    def _null_space(self, reference: Rollout) -> Callable[[Array], Array] | None:
        problem = self._problem
        if problem.null_motion.space == "joint":
            return None
        if problem.robot.redundancy(problem.rows) == 0:
            return lambda t: np.zeros((len(t), problem.robot.dof, 0))
        nodes = reference.grid.node_stages
        return TransportedFrame(reference.grid.nodes, reference.samples().task_jacobian[nodes])

    def _bind(self, grid: Grid, conditions: AugmentedLagrangian) -> Objective:
        problem = self._problem
        t = grid.stage_times
        functions = problem.null_motion.functions(t, problem.path.duration)
        frame = None if self._frame is None else self._frame(t)
        rows = problem.robot.dof if frame is None else frame.shape[2]
        return Objective(
            self._rollout(grid),
            NullMotionTable(functions, frame, rows, self._offset(grid)),
            problem.costs,
            self._start,
            conditions,
            Deviation(problem.path, problem.relaxations, t, problem.pinned)
            if problem.relaxations
            else None,
            self._path_weight(),
        )

    def _rollout(self, grid: Grid) -> Rollout:
        problem = self._problem
        return Rollout(problem.robot, problem.path, problem.rows, grid, damping=problem.damping_law)

    def _path_weight(self) -> float:
        """Return the weight of the path error in the cost, see `Damping`; 0 without damping."""
        damping, law = self._problem.damping, self._problem.damping_law
        if damping is None or law is None:
            return 0.0
        rate = FEEDBACK / self._problem.path.duration
        return float(damping.path_weight * (rate / law.threshold) ** 2)

    def _offset(self, grid: Grid) -> Array | None:
        return None if self._guide is None else self._guide(grid.stage_times)

    def _run_optimizer(self, h: Array | None, round_number: int) -> Minimum:
        # While multipliers are still far off, minimising to the last digit is lost work.
        slack = 1.0 if self._feasible else _FIRST_SLACK * 0.1**round_number
        optimizer = replace(self._optimizer, tolerance=self._optimizer.tolerance * max(slack, 1.0))
        limit = None if self._limit is None else max(self._limit - self._spent, 1)
        minimum = self._counted(
            lambda: optimizer.minimize(
                self._objective,
                self._x,
                h,
                max_evaluations=None if limit is None else limit + self._objective.evaluations,
                callback=self._callback,
            )
        )
        self.history += minimum.history
        return minimum

    def _counted(self, work: Callable[[], _Result]) -> _Result:
        """Do some work with the objective and add up what it took."""
        objective = self._objective
        rollout = objective.rollout
        before = objective.evaluations, objective.gradient_evaluations, rollout.jacobian_evaluations
        try:
            return work()
        finally:
            self.counts.evaluations += objective.evaluations - before[0]
            self._spent += objective.evaluations - before[0]
            self.counts.gradients += objective.gradient_evaluations - before[1]
            self.counts.jacobians += rollout.jacobian_evaluations - before[2]


def _stays(troubles: list[tuple[float, float]], duration: float) -> bool:
    """Return whether trouble (when, how much) does not go away on finer grids."""
    if len(troubles) < 3:
        return False
    times, amounts = zip(*troubles[-3:], strict=True)
    in_place = max(times) - min(times) <= _SAME_PLACE * duration
    return bool(in_place and amounts[-1] >= _SAME_AMOUNT * amounts[0])
