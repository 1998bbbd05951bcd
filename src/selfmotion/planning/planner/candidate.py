"""A motion from one start: the minimum-norm motion first, then what polishing makes of it."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from selfmotion.basics import (
    Array,
    BreakdownError,
    Flags,
    InverseKinematicsError,
    ProblemError,
    shown,
)
from selfmotion.model.motion import (
    Evaluation,
    FreeNullMotion,
    Grid,
    NullMotionTable,
    PolynomialNullMotion,
    Trajectory,
)
from selfmotion.model.robot import RobotModel, null_space
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import Iteration, QuasiNewton, Status
from selfmotion.planning.paper import (
    MOST_HALVINGS,
    Guide,
    Method,
    MinimumNormMotion,
    Objective,
    converged_minimum_norm,
)
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import first_nodes, is_on_nodes, is_published, most_nodes
from selfmotion.planning.planner.polish import Polisher
from selfmotion.planning.planner.solutions import (
    MinimumNormSolution,
    NodeSolution,
    PublishedSolution,
    Solution,
    score,
)
from selfmotion.planning.result import Plan
from selfmotion.planning.search import Manifold
from selfmotion.problem.problem import Problem


def check_warm_start(plan: object, problem: Problem) -> None:
    """Raise ProblemError where a plan is none, or one of another arm."""
    if not isinstance(plan, Plan):
        raise ProblemError(f"warm_start is {shown(plan)}, expected a Plan; load_plan reads one")
    check_joints(plan.robot, problem.robot)


def check_joints(theirs: RobotModel, ours: RobotModel) -> None:
    """Raise ProblemError where what is known has another arm's joints."""
    if theirs.joint_names != ours.joint_names:
        raise ProblemError(
            f"warm_start: its joints are {', '.join(theirs.joint_names)}, expected those of "
            f"{ours.name}: {', '.join(ours.joint_names)}"
        )


def on_start(formulation: Formulation, seed: Array) -> Array:
    """Return the configuration (n,) near another one that is on the start of all paths.

    Raises
    ------
    InverseKinematicsError
        There is none.
    """
    follows, robot = formulation.follows, formulation.robot
    own = follows.coordinates
    if not follows.is_plain:
        manifold = Manifold(follows, own.lower, own.upper)
        held = follows.held(np.zeros(1))
        q, arrived = manifold.project(seed[None], follows.targets(np.zeros(1)), far=True, held=held)
        if not arrived[0]:
            misses = np.array([item.miss(item.path.pose(0.0), q[0]) for item in follows.items])
            position, rotation = misses.max(axis=0)
            raise InverseKinematicsError(
                f"{robot.name}: from the configuration that is known none was found in which all "
                f"frames are where their paths begin",
                position_miss=float(position),
                rotation_miss=float(rotation),
            )
        return np.asarray(q[0])
    first, task = formulation.path.pose(0.0), formulation.problem.task
    return formulation.robot.inverse_kinematics(first, task, seed)


def pace_of(plan: Plan, formulation: Formulation) -> float:
    """Return the duration of a plan's path over that of the problem's."""
    return plan.path.duration / formulation.path.duration


def slower(trajectory: Trajectory, pace: float) -> Trajectory:
    """Return the same motion so many times as fast; `pace` is its duration over the new one."""
    qdd = None if trajectory.qdd is None else pace**2 * trajectory.qdd
    t, qd = trajectory.t / pace, pace * trajectory.qd
    return Trajectory(t, trajectory.q, qd, trajectory.joint_names, qdd)


def moved_to(trajectory: Trajectory, start: Array) -> Trajectory:
    """Return the same motion from another start (n,); where it is off the path, it is put there."""
    q = trajectory.q + (start - trajectory.q[0])
    return Trajectory(trajectory.t, q, trajectory.qd, trajectory.joint_names, trajectory.qdd)


def coefficients_of(
    trajectory: Trajectory, pace: float, formulation: Formulation, t: Array, table: NullMotionTable
) -> Array:
    """Return the coefficients x whose null motion is nearest to that of another motion, (size,).

    By least squares over the times. Of a null motion only Nᵀε acts, with N (n, r) a basis of the
    null space of the task: it is fitted to Nᵀq̇, with N and q̇ those of the other motion at the same
    share of its path.

    Parameters
    ----------
    trajectory : Trajectory
    pace : float
        The duration of its path over that of the problem's.
    formulation : Formulation
    t : (S,)
        Times on its path [s].
    table : NullMotionTable
        Its null motion at these times.
    """
    # A plan of a part of its path ends earlier.
    theirs = np.minimum(t * pace, trajectory.t[-1])
    q, qd = trajectory(theirs), pace * trajectory(theirs, 1)
    null = np.swapaxes(null_space(formulation.follows.jacobians(q)), 1, 2)
    acting = null @ table.matrix()
    wanted = np.einsum("srn,sn->sr", null, qd)
    if not wanted.size:
        return np.zeros(table.size)
    return np.asarray(np.linalg.lstsq(acting.reshape(-1, table.size), wanted.ravel())[0])


class Candidate:
    """A start, its minimum-norm motion, and the best motion that was found near that.

    What is found is replaced as a whole, so that an interruption finds what belongs together.

    Parameters
    ----------
    formulation : Formulation
    effort : Effort
    start : (n,)
    free : bool
        Whether the start may move along its self-motion.
    guide : Guide, optional
        The null motion that stands for x = 0 in eq. 4: where the search found one worth starting
        from.
    grid : Grid, optional
        To begin with; it is refined until the motion stays near the path.

    Attributes
    ----------
    conditions : BoundConditions
        Those that count, bound to the ends.
    minimum_norm : MinimumNormSolution
        The minimum-norm motion: eq. 4 at x = 0.
    history : list of Iteration
    is_hopeless : bool
        Whether it ended because another motion is known that costs less.

    Raises
    ------
    BreakdownError
        The minimum-norm motion runs into a singular pose.
    ProblemError
        A constraint asks for an equality elsewhere than at the ends.
    """

    def __init__(
        self,
        formulation: Formulation,
        effort: Effort,
        start: Array,
        *,
        free: bool,
        guide: Guide | None = None,
        grid: Grid | None = None,
    ) -> None:
        begun, jacobians = _begun(formulation, start, guide, grid)
        effort.counts.jacobians += jacobians
        self.formulation, self.effort, self.free = formulation, effort, free
        self.conditions = formulation.conditions(
            start, begun.end, apart=effort.apart, decomposed=effort.decomposed
        )
        self._ends = begun.start, begun.end
        # Beyond so many steps a grid is not refined any more.
        self.most_steps = int(begun.grid.steps * 2**MOST_HALVINGS)
        self.minimum_norm = MinimumNormSolution(formulation, begun, self.conditions, effort.counts)
        self.history: list[Iteration] = []
        self.is_hopeless = False
        self._found: Solution | None = None
        self._ended: Status | None = None
        self._warm: Plan | None = None
        self._known: Trajectory | None = None

    @property
    def solution(self) -> Solution:
        """The best motion so far."""
        return self._found or self.minimum_norm

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended all of them."""
        return self.solution.status if self._ended is None else self._ended

    @property
    def cut_short(self) -> bool:
        """Whether the user wants no more."""
        return self.status.is_cut_short

    @property
    def is_spent(self) -> bool:
        """Whether nothing more is to be evaluated."""
        return self.cut_short or self.status is Status.MAX_EVALUATIONS

    @property
    def violations(self) -> tuple[str, ...]:
        """What is wrong, for each constraint that the best motion violates."""
        return self.solution.violations

    @property
    def breaks_at(self) -> float | None:
        """When [s] the best motion violates constraints most; None where it does not."""
        return self._found.breaks_at if isinstance(self._found, NodeSolution) else None

    @property
    def will_do(self) -> bool:
        """Whether the best motion keeps all constraints, and keeps the arm off itself."""
        return not self.violations and self.solution.keeps_off_itself

    @property
    def is_of_chain(self) -> bool:
        """Whether the best motion is a chain of the search, at its optimum."""
        return isinstance(self._found, NodeSolution) and self._found.is_chain

    def end(self, status: Status) -> None:
        """Take the motion as it is; there is no time for another one."""
        self._ended = status

    def evaluation(self) -> Evaluation:
        """Return the motion as it is now."""
        return self.solution.evaluation()

    def minimum_norm_evaluation(self) -> Evaluation:
        """Return the minimum-norm motion, on the grid of the best one where that has one."""
        found = self._found
        if isinstance(found, PublishedSolution):
            return found.minimum_norm_evaluation()
        return self.minimum_norm.evaluation()

    def score(self) -> tuple[bool, bool, float]:
        """Return what ranks it among others: the smaller, the better; see `score`."""
        return score(self.solution)

    def take(self, found: NodeSolution, history: Sequence[Iteration] = ()) -> None:
        """Let what was found elsewhere be the best motion, with the way to it."""
        self._found = found
        self.history += history

    def adopt(self, plan: Plan) -> None:
        """Begin at a plan's motion instead of x = 0, unless that would be worse."""
        self._warm = plan

    def resume(self, trajectory: Trajectory) -> None:
        """Begin at a motion that is known."""
        self._known = trajectory

    def polish(self, cost_to_beat: float = np.inf) -> None:
        """Optimise from the motion that there is.

        Where a motion is known that costs `cost_to_beat`, it ends as soon as it is clear that this
        one will cost more.
        """
        if self._ended is not None or self.is_of_chain:
            return
        if not np.isfinite(self.minimum_norm.cost):
            self.minimum_norm.require_finite()
        if is_published(self.formulation, self.effort):
            self._polish_as_published()
        elif is_on_nodes(self.formulation, self.effort):
            self._polish_on_nodes(cost_to_beat)

    def settle(self) -> None:
        """Go on until more nodes save nothing; the published method has done so on its grids."""
        found = self._found
        if self._ended is None and isinstance(found, NodeSolution) and not found.is_chain:
            self._by_nodes(lambda polisher: polisher.settled(found))

    def as_begun(self) -> "Candidate":
        """Return it as it was before anything was found: the minimum-norm motion."""
        begun = copy(self)
        begun._found = None
        return begun

    def as_adopted(self) -> "Candidate | None":
        """Return it with the motion of the plan that it began with; None where there is none."""
        if self._warm is None or not is_on_nodes(self.formulation, self.effort):
            return None
        motions, t = self._first_motions()
        if len(motions) < 2:
            return None
        polisher = Polisher(self.formulation, self.effort, self.conditions, free=self.free)
        motion = polisher.grid(t).near(*(motions[0](t, order) for order in range(3)))
        if motion is None:
            return None
        known = copy(self)
        # Nothing better was found.
        known._found = replace(NodeSolution.on_the_way(motion), status=Status.PRECISION)
        return known

    def refine(self, where: Flags | None = None) -> None:
        """Go on with half the step length, everywhere or for some of the steps (N,)."""
        if self._found is None:
            self.minimum_norm = self.minimum_norm.refined(where)
        else:
            self._found = self._found.refined(where)

    def keep_off_itself(self) -> bool:
        """Ask that of an optimum that takes the arm into itself; return whether there is a new one.

        Few do, so that the others need not wait for distances.
        """
        found = self._found
        if not isinstance(found, NodeSolution) or found.violations:
            return False
        # Of a given start in which it meets itself, nothing else begins.
        can = self.free or self.formulation.keeps_off_itself(found.motion.place.q[:1])
        if self._ended is not None or self.effort.apart or found.is_chain or not can:
            return False
        self.effort = replace(self.effort, apart=True)
        self.conditions = self.formulation.conditions(
            *self._ends, decomposed=self.effort.decomposed
        )
        self.minimum_norm = replace(self.minimum_norm, conditions=self.conditions)

        def optimum(polisher: Polisher) -> NodeSolution | None:
            first = self._known or self.minimum_norm.evaluation().trajectory
            return polisher.with_more(found) or polisher.near([first], found.motion.grid.t)

        self._by_nodes(optimum)
        return self._found is not found

    def _polish_as_published(self) -> None:
        """Go to the optimum of the published method."""
        before = self._found
        if isinstance(before, PublishedSolution):
            found = before.again()
        else:
            begun = self._as_published()
            found = replace(begun, x=self._first_coefficients(begun)).settled()
        self._found = found
        self.history = list(found.history)
        if found.status is Status.INTERRUPTED:
            self.end(Status.INTERRUPTED)

    def _as_published(self) -> PublishedSolution:
        """Return the minimum-norm motion as the start of the published method."""
        effort, formulation, begun = self.effort, self.formulation, self.minimum_norm.motion
        if isinstance(formulation.null_motion, FreeNullMotion):
            formulation = formulation.changed(null_motion=PolynomialNullMotion())
        ends, most = self.conditions.ends, effort.max_evaluations
        limit = None if most is None else effort.counts.evaluations + most
        own = QuasiNewton() if effort.optimizer is None else effort.optimizer
        method = Method(
            formulation, begun, self.free, ends, own, effort.counts, limit, effort.callback
        )
        objective = Objective.of(
            formulation,
            begun,
            free=self.free,
            ends=ends,
            counts=effort.counts,
            rollout=begun.rollout,
        )
        none = np.zeros(objective.size)
        return PublishedSolution(method, objective, none, conditions=self.conditions)

    def _first_coefficients(self, begun: PublishedSolution) -> Array:
        """Return the decision vector that is nearest to a known plan, if no worse than x = 0."""
        plan, formulation, objective = self._warm, self.formulation, begun.objective
        if plan is None:
            return begun.x
        t, pace = objective.grid.stage_times, pace_of(plan, formulation)
        near = coefficients_of(plan.trajectory, pace, formulation, t, objective.null_motion)
        z, _ = objective.parts(begun.x)
        x = np.concatenate([z, near])
        return x if objective.value(x) <= self.minimum_norm.cost else begun.x

    def _polish_on_nodes(self, cost_to_beat: float) -> None:
        """Go to the optimum on nodes near the motion."""
        before = self._found

        def optimum(polisher: Polisher) -> NodeSolution | None:
            if isinstance(before, NodeSolution):
                return polisher.again(before)
            motions, t = self._first_motions()
            return polisher.near(motions, t, cost_to_beat)

        self._by_nodes(optimum)
        found = self._found
        # One that costs more already is none to take either way.
        if found is not None and found.cost < cost_to_beat and not found.keeps_off_itself:
            self.keep_off_itself()
        if self.status is Status.GRADIENT:
            # A gradient that is not finite is named with its time.
            self.minimum_norm.require_finite_gradients()

    def _first_motions(self) -> tuple[list[Trajectory], Array]:
        """Return motions to begin near, and the times of the first nodes (N + 1,)."""
        formulation, warm, t = self.formulation, self._warm, first_nodes(self.formulation)
        motions = [self._known or self.minimum_norm.evaluation().trajectory]
        if warm is not None and warm.trajectory.t[-1] == warm.path.duration:
            own = slower(warm.trajectory, pace_of(warm, formulation))
            if not self.free:
                own = moved_to(own, self._ends[0])
            motions = [own, *motions]
            if len(own.t) <= most_nodes(formulation):
                # Its nodes are where such a motion needs them.
                t = np.unique(np.append(own.t, formulation.knots))
        return motions, t

    def _by_nodes(self, search: Callable[[Polisher], NodeSolution | None]) -> None:
        """Let what is found on nodes be the best motion, if something is."""
        polisher = Polisher(self.formulation, self.effort, self.conditions, free=self.free)
        try:
            found = search(polisher)
        except KeyboardInterrupt:
            if polisher.latest is None and self._found is None:
                raise
            found = polisher.latest
            self._ended = Status.INTERRUPTED
        if polisher.is_stopped:
            # A motion that was better before it is left as it was, and does not say so.
            self._ended = Status.STOPPED
            if found is not None and found.violations:
                found = polisher.latest or found
        self.history += polisher.history
        self.is_hopeless = polisher.is_hopeless
        self._found = found or self._found


def _begun(
    formulation: Formulation, start: Array, guide: Guide | None, grid: Grid | None
) -> tuple[MinimumNormMotion, int]:
    """Return the motion at x = 0, see `converged_minimum_norm`.

    It keeps out of tolerances in windows, so that it is one that may be followed. Where the path
    cannot be followed like that, it makes use of them, at any time: to begin with, that will do.
    """
    shut = formulation.with_windows_shut
    try:
        return converged_minimum_norm(shut, start, guide, grid)
    except BreakdownError:
        if shut is formulation:
            raise
        return converged_minimum_norm(formulation, start, guide, grid)
