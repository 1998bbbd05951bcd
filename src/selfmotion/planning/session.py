"""One start of one problem, optimised on a grid that becomes finer."""

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array
from selfmotion.constraints import Binding
from selfmotion.engine import (
    MOST_HALVINGS,
    Counts,
    Evaluation,
    Guide,
    Objective,
    Remaining,
    StillMotion,
    finest,
    rough_still_motion,
    settled_still_motion,
)
from selfmotion.motion import Grid, NodeNullMotion, NullMotion, Trajectory
from selfmotion.optimise import Iteration, Minimum, Status
from selfmotion.planning.along_chain import along_chain
from selfmotion.planning.closing import closed
from selfmotion.planning.descent import Descent, breaks
from selfmotion.planning.effort import Effort
from selfmotion.planning.nodes import NodeDescent, takes
from selfmotion.planning.settings import (
    ALIKE,
    COST_AGREEMENT,
    LEAST_SAVING,
    MOST_ESTIMATED,
    RISE,
    RISES,
    ROUGH_AGREEMENT,
    THINNER,
)
from selfmotion.planning.standing import Standing
from selfmotion.planning.warm_start import coefficients_of, slower
from selfmotion.problem import Problem
from selfmotion.result import Plan
from selfmotion.search import SequenceGuide

# After these there is nothing to go on from.
_ADRIFT = (Status.UNBOUNDED, Status.GRADIENT)
# After these the user has no more time to give.
_CUT_SHORT = (Status.INTERRUPTED, Status.DEADLINE, Status.STOPPED, Status.MAX_EVALUATIONS)


class Session:
    """The optimisation from one start; made by `Session.begin`.

    Parameters
    ----------
    effort : Effort
    still : StillMotion
        The motion at x = 0.
    objective : Objective
    free : bool
        Whether the start may move along its self-motion.

    Attributes
    ----------
    violations : tuple of str
        What is wrong for each constraint that the last minimisation could not meet.
    active : tuple of Binding
        What kept it from a lower cost.
    remaining : float or None
        What any other one could still save, as far as is known [cost].
    of_chain : bool
        Whether what stands is a chain of the search, at its optimum.
    """

    def __init__(
        self, effort: Effort, still: StillMotion, objective: Objective, *, free: bool
    ) -> None:
        self._effort, self._still, self._free = effort, still, free
        self._objective = objective
        self._descent = Descent(effort)
        self._minimum: Minimum | None = None
        self._ended: Status | None = None
        self._x = np.zeros(objective.size)
        self._null_motion: NullMotion = still.problem.null_motion
        self.remaining: float | None = None
        self._evaluations: int | None = None
        self._tried: NullMotion | None = None
        self._standing: Standing | None = None
        self._tried_nodes = False
        self.of_chain = False
        self._warm: Plan | None = None
        self.violations: tuple[str, ...] = ()
        self.active: tuple[Binding, ...] = ()

    @classmethod
    def begin(
        cls,
        problem: Problem,
        effort: Effort,
        configuration: Array,
        *,
        free: bool,
        guide: Guide | None = None,
        deviation: Array | None = None,
        grid: Grid | None = None,
    ) -> "Session":
        """Integrate the motion at x = 0 from a start, and return the session around it.

        Parameters
        ----------
        problem : Problem
        effort : Effort
        configuration : (n,)
            The start.
        free : bool
            Whether the start may move along its self-motion.
        guide : Guide, optional
            The null motion that stands for x = 0: where the search found one worth starting from.
        deviation : (size,), optional
            That of the tool from its path at x = 0, as `Deviation` has it, likewise.
        grid : Grid, optional
            Where a rough motion will do; by default one on which it stays near the path.

        Raises
        ------
        BreakdownError
            The motion at x = 0 runs into a singular pose.
        """
        if grid is None:
            still, jacobians = settled_still_motion(problem, configuration, guide, deviation)
        else:
            still, jacobians = rough_still_motion(problem, configuration, grid)
        effort.counts.jacobians += jacobians
        bound = problem.bind_constraints(configuration, still.end, apart=effort.apart)
        objective = Objective.of(
            problem,
            still,
            free=free,
            constraints=bound,
            counts=effort.counts,
            rollout=still.rollout,
        )
        return cls(effort, still, objective, free=free)

    @property
    def counts(self) -> Counts:
        """Work done by all sessions of the plan."""
        return self._effort.counts

    @property
    def history(self) -> list[Iteration]:
        """All iterations so far."""
        return self._descent.history

    @property
    def null_motion(self) -> NullMotion:
        """The parameterisation that the motion has by now."""
        return self._null_motion if self._standing is None else self._standing.null_motion

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended the session."""
        if self._ended is not None:
            return self._ended
        if self._standing is not None:
            return self._standing.status
        return Status.STOPPED if self._minimum is None else self._minimum.status

    @property
    def cut_short(self) -> bool:
        """Whether the user wants no more."""
        return self.status in (Status.INTERRUPTED, Status.STOPPED)

    def end(self, status: Status) -> None:
        """Take the motion as it is; there is no time for another one."""
        self._ended = status
        if self._standing is None:
            self.violations = self._objective.violations(self._x)

    @property
    def coefficients(self) -> Array:
        """The null motion's coefficients."""
        if self._standing is not None:
            return self._standing.coefficients
        return self._objective.parts(self._x)[1].copy()

    @property
    def steps(self) -> int:
        """Steps of the present grid."""
        if self._standing is not None:
            return self._standing.steps
        return self._objective.grid.steps

    @property
    def most_steps(self) -> int:
        """Steps beyond which a grid is not refined any more."""
        return int(self._still.grid.steps * 2**MOST_HALVINGS)

    @property
    def nodes(self) -> Array:
        """The motion as it is now, at the nodes of the grid, (N + 1, n)."""
        if self._standing is not None:
            return np.array(self._standing.motion.trajectory(self._objective.grid.nodes))
        samples = self._objective.samples(self._x)
        return np.array(samples.q[self._objective.grid.node_stages])

    def motion(self) -> Evaluation:
        """Return the motion as it is now."""
        if self._standing is not None:
            return self._standing.evaluation()
        return self._objective.at(self._x)

    def still_motion(self) -> Evaluation:
        """Return the motion at x = 0 on the present grid."""
        return self._objective.at(np.zeros_like(self._x))

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        if self._standing is not None:
            return self._standing.cost
        objective, x = self._objective, self._x
        cost = objective.value(x)
        if not np.isfinite(cost):
            return cost
        return cost + max(abs(cost), 1e-3) * objective.constraints.penalty(objective.samples(x))

    def score(self) -> tuple[bool, float]:
        """Return whether constraints are violated, then the cost: the smaller, the better.

        Of two that violate constraints, the one that does so less is nearer to a motion.
        """
        return bool(self.violations), self.merit() if self.violations else self._cost()

    def take_chain(self, guide: SequenceGuide) -> None:
        """Let the shortest chain near a sequence stand, if it will do: nothing is left to gain."""
        constraints = self._objective.constraints.constraints
        self._standing = along_chain(self._still.problem, self._effort, guide, constraints)
        self.of_chain = self._standing is not None

    def adopt(self, plan: Plan) -> None:
        """Begin at a plan's motion instead of x = 0, unless that would be worse."""
        self._warm = plan

    def _begin_at(self, plan: Plan) -> None:
        """Begin at a plan's null motion instead of x = 0, unless that would be worse."""
        motion = self._null_motion
        known = plan.report.null_motion
        if plan.problem.null_motion == motion and not isinstance(known, NodeNullMotion | None):
            motion = known
        grid = self._objective.grid.with_steps(max(motion.fewest_steps, plan.report.steps))
        self._begin_along(plan.trajectory, self._pace(plan), self._on(grid, motion), motion)

    def _pace(self, plan: Plan) -> float:
        return plan.path.duration / self._still.problem.path.duration

    def resume(self, trajectory: Trajectory) -> None:
        """Begin at the null motion of a motion along this path, unless that would be worse."""
        self._begin_along(trajectory, 1.0, self._objective, self._null_motion)

    def _begin_along(
        self, trajectory: Trajectory, pace: float, objective: Objective, motion: NullMotion
    ) -> None:
        problem, t, still = self._still.problem, objective.grid.stage_times, self.merit()
        x = coefficients_of(trajectory, pace, problem, t, objective.null_motion)
        z, _, c = objective.parts(np.zeros(objective.size))
        before = self._x, self._objective, self._null_motion
        self._x, self._objective = np.concatenate([z, x, c]), objective
        self._null_motion = motion
        if not self.merit() <= still:
            self._x, self._objective, self._null_motion = before

    def minimize(self, evaluations: int | None = None) -> None:
        """Optimise on the present grid, from the motion that there is.

        Parameters
        ----------
        evaluations : int, optional
            So many of the cost, for a rough optimum; by default what `Effort` allows.
        """
        self._evaluations = evaluations
        if self.of_chain or (evaluations is None and self._take_nodes()):
            return
        if self._warm is not None:
            warm, self._warm = self._warm, None
            self._begin_at(warm)
        objective, wanted = self._objective, self._null_motion
        if not np.isfinite(objective.value(self._x)):
            objective.require_finite(self._x)
        if self._approached():
            status = self.status
            self._change(wanted)
            if status in _CUT_SHORT:
                self.end(status)
        if self._ended is None:
            self._descend()
        self._close()
        self.violations = self._objective.violations(self._x)

    def _take_nodes(self) -> bool:
        """Go to the optimum on nodes near the motion; return whether that is what stands now."""
        objective, problem = self._objective, self._still.problem
        constraints = objective.constraints.constraints
        led_nowhere = self._tried_nodes and self._standing is None
        if self._ended is not None or led_nowhere or not takes(problem, self._effort, constraints):
            return False
        before = self._standing
        # What led nowhere once would do so again.
        self._tried_nodes = True

        def optimum(descent: NodeDescent) -> Standing | None:
            if before is not None:
                return descent.again(before)
            if not np.isfinite(objective.value(self._x)):
                return None
            here, t = self.motion().trajectory, objective.grid.nodes
            warm = self._warm
            if warm is None or warm.trajectory.t[-1] != warm.path.duration:
                return descent.near([here], t)
            return descent.near([slower(warm.trajectory, self._pace(warm)), here], t)

        self._by_nodes(optimum)
        return self._standing is not None

    @property
    def has_nodes(self) -> bool:
        """Whether what stands was found by Newton's method on nodes."""
        return self._standing is not None

    def leave_nodes(self) -> None:
        """Go on without nodes, from the motion that they began with."""
        self._standing, self._tried_nodes, self.of_chain = None, True, False
        self.minimize()

    def _settle_nodes(self) -> None:
        """Go on until more nodes change the cost no more."""
        standing = self._standing
        if standing is not None and self._ended is None and not self.of_chain:
            self._by_nodes(lambda descent: descent.settled(standing))

    def _by_nodes(self, search: Callable[[NodeDescent], Standing | None]) -> None:
        """Let what is found on nodes be what stands, if something is."""
        constraints = self._objective.constraints.constraints
        descent = NodeDescent(self._still.problem, self._effort, constraints, free=self._free)
        try:
            found = search(descent)
        except KeyboardInterrupt:
            if descent.latest is None and self._standing is None:
                raise
            found = descent.latest or self._standing
            self._ended = Status.INTERRUPTED
        self._descent.history += descent.history
        if found is not None:
            self._standing, self.active, self.violations = found, found.active, ()
            self.remaining = found.remaining

    def _descend(self) -> None:
        """Minimise from where the motion is; by a finer null motion where this one gets stuck."""
        wanted, before = self._still.problem.null_motion, (self._x, self._objective)
        # Where more freedom is taken anyway if it pays, it is a shorter way than restoration.
        refines = wanted.gain < np.inf and self._null_motion == wanted
        refines &= self._minimum is None and self._evaluations is None
        self._take_minimum(restores=not refines)
        if not refines or self.status is not Status.INFEASIBLE:
            return
        stuck = self._x, self._objective, self._minimum, wanted
        self._x, self._objective = before
        self._tried = wanted.detours(self._objective.null_motion.rows)[0]
        self._change(self._tried)
        self._take_minimum()
        if not breaks(self._objective, self._x):
            return
        status = self.status
        self._x, self._objective, self._minimum, self._null_motion = stuck
        if status in _CUT_SHORT:
            self.end(status)
        else:
            self._take_minimum()

    def _approached(self) -> bool:
        """Whether this is now the optimum of a rougher null motion, which leads to that wanted.

        That is sought where conditions are violated at x = 0: with many coefficients, steps would
        be small, and each would cost much.
        """
        wanted, objective = self._null_motion, self._objective
        z, x, c = objective.parts(self._x)
        first = self._minimum is None and self._evaluations is None and not x.any()
        if wanted.rough == wanted or not first or not breaks(objective, self._x):
            return False
        before, cost = (self._x, objective), objective.value(self._x)
        grid = Grid.aligned(self._still.problem.knots, wanted.rough.fewest_steps)
        rough = self._on(grid, wanted.rough)
        # Written so that NaN asks for more steps, too.
        while not _relative_change(cost, rough.value(np.zeros(rough.size))) <= ALIKE:
            if rough.grid.steps >= objective.grid.steps:
                return False
            rough = self._on(rough.grid.halved(), wanted.rough)
        self._x = np.concatenate([z, np.zeros(rough.null_motion.size), c])
        self._objective, self._null_motion = rough, wanted.rough
        self._take_minimum()
        if self.status is Status.INFEASIBLE:
            self._x, self._objective, self._null_motion, self._minimum = *before, wanted, None
            return False
        return True

    def _take_minimum(self, *, restores: bool = True) -> None:
        """Go to the minimum from where the motion is, and know what binds there."""
        objective, before = self._objective, self._minimum
        minimum = self._descent.minimum(
            objective,
            self._x,
            None if before is None else before.inverse_hessian,
            evaluations=self._evaluations,
            restores=restores,
        )
        self._minimum, self._x, self.active = minimum, np.array(minimum.x), ()
        if minimum.status is Status.INTERRUPTED:
            # For good, whatever is minimised later.
            self.end(Status.INTERRUPTED)
        if self._descent.bound and minimum.status is Status.CONVERGED:
            least = LEAST_SAVING * abs(minimum.cost)
            samples = objective.samples(minimum.x)
            self.active = objective.constraints.active(samples, minimum.multipliers, least)

    def detours(self) -> Iterator["Session"]:
        """Yield sessions around the same motion at x = 0 whose null motions may meet conditions.

        Where that of the problem is to be had in the end: with it.
        """
        wanted = self._still.problem.null_motion
        for motion in wanted.detours(self._objective.null_motion.rows):
            if motion == self._tried:
                continue
            grid = self._still.grid.with_steps(motion.fewest_steps)
            session = Session(self._effort, self._still, self._on(grid, motion), free=self._free)
            session._null_motion = motion
            session._descent.before, session._descent.history = self._descent.before, self.history
            session.minimize()
            if wanted.gain == np.inf and not (session.violations or session.cut_short):
                session._change(wanted)
                session.minimize()
            yield session

    def settle(self) -> None:
        """Optimise until finer grids and more freedom of the null motion save nothing.

        What freedom is wanted is found on a coarse grid, where it costs little.
        """
        if self._standing is not None or self._take_nodes():
            self._settle_nodes()
            return
        error = self._refine_until(ROUGH_AGREEMENT)
        coarse = self._cost()
        enriched = self._enriched()
        if enriched or error > COST_AGREEMENT:
            self._refine_until(COST_AGREEMENT)
        if enriched or abs(self._cost() - coarse) > ROUGH_AGREEMENT * abs(coarse):
            while self._enriched():
                self._refine_until(COST_AGREEMENT)

    def _refine_until(self, agreement: float) -> float:
        """Optimise on halved grids until the cost agrees with that of the one before.

        Return how well it does, as a share of the cost; 0 where no finer grid would help.
        """
        rises, error = 0, 0.0
        while self.steps < self.most_steps:
            if self.status in (*_CUT_SHORT, *_ADRIFT):
                return 0.0
            unmet, before = bool(self.violations), self._cost()
            self.refine()
            after = self._cost()
            error = _relative_change(before, after)
            # A cost that grows and grows, and what two grids in turn could not meet: the path runs
            # past the edge of the workspace between their nodes, or limits are too tight.
            rises = rises + 1 if after > RISE * abs(before) else 0
            if rises == RISES:
                return 0.0
            self.minimize()
            if unmet and self.violations:
                return 0.0
            # The optimum agrees, too: a motion that a coarse grid praises may be none on this one.
            error = max(error, _relative_change(before, self._cost()))
            if error <= agreement:
                break
        return error

    def refine(self, where: npt.NDArray[np.bool_] | None = None) -> None:
        """Go on with half the step length, everywhere or for some of the steps (N,)."""
        if self._standing is not None:
            self._standing = self._standing.refined(where)
            return
        self._objective = self._on(self._objective.grid.halved(where))
        self._close()

    def _enriched(self) -> bool:
        """Give the null motion more freedom if that pays, and know what is left; return whether."""
        if self.violations or self.status in (*_CUT_SHORT, *_ADRIFT):
            return False
        wanted = self._still.problem.null_motion
        left = self._left()
        self.remaining = left.most
        enough = wanted.gain * abs(self._cost())
        if self.remaining <= enough:
            return False
        rows = self._objective.null_motion.rows
        rests = any(self._still.problem.rests)
        finer = wanted.finer(left.intervals(0.5 * enough), rows, rests)
        if finer in (wanted, self._null_motion):
            return False
        self._change(finer)
        self.minimize()
        return True

    def _left(self) -> Remaining:
        """Return what is left to save around the present motion."""
        problem = self._still.problem
        spline = finest(problem.follows.redundancy)
        # More than a step for each interval makes no better estimate.
        grid = self._objective.grid.with_steps(spline.intervals)
        if grid.steps > MOST_ESTIMATED:
            # It is in memory for each number of the spline.
            grid = Grid.aligned(problem.knots, MOST_ESTIMATED)
        same = grid is self._objective.grid
        objective = self._objective if same else self._on(grid)
        z, x, c = objective.parts(self._x)
        around = objective.null_motion.epsilon(x)
        fine = self._on(grid, spline, around)
        none = np.zeros(fine.null_motion.size)
        return Remaining(fine, np.concatenate([z, none, c]), bound=self._descent.bound)

    def _change(self, motion: NullMotion) -> None:
        """Go on with another null motion that can be what the present one is."""
        before = self._objective
        z, x, c = before.parts(self._x)
        grid = before.grid.with_steps(motion.fewest_steps // THINNER)
        t, duration = grid.stage_times, self._still.problem.path.duration
        own, new = (kind.functions(t, duration) for kind in (self._null_motion, motion))
        same = np.linalg.lstsq(new, own)[0]
        rows = x.reshape(before.null_motion.rows, own.shape[1]) @ same.T
        moved = np.concatenate([z, rows.ravel(), c]), self._on(grid, motion)
        # At once: an interruption finds what belongs together.
        self._x, self._objective, self._null_motion, self._minimum = *moved, motion, None

    def _on(
        self, grid: Grid, motion: NullMotion | None = None, around: Array | None = None
    ) -> Objective:
        """Return the objective on a grid, with another null motion around a given one."""
        return Objective.of(
            self._still.problem,
            self._still,
            grid=grid,
            free=self._free,
            constraints=self._objective.constraints.constraints,
            counts=self._effort.counts,
            null_motion=motion or self._null_motion,
            around=around,
        )

    def _cost(self) -> float:
        if self._standing is not None:
            return self._standing.cost
        return sum(self._objective.terms(self._x).values())

    def _close(self) -> None:
        if self._objective.constraints.has_equalities and self._minimum is not None:
            self._x = closed(self._objective, self._x, self._minimum.inverse_hessian)


def _relative_change(before: float, after: float) -> float:
    """Return the change of a cost as a share of what it was."""
    return abs(after - before) / max(abs(before), np.finfo(float).tiny)
