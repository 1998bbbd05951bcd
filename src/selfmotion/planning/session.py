"""One start of one problem, optimised: what stands, and how it becomes better."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Counts, Flags
from selfmotion.constraints import BoundConstraint
from selfmotion.motion import Evaluation, Trajectory
from selfmotion.optimise import Iteration, Status
from selfmotion.planning.along_chain import along_chain
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.for_nodes import first_nodes, is_on_nodes, is_published, most_nodes
from selfmotion.planning.nodes import NodeDescent
from selfmotion.planning.on_nodes import MotionOnNodes
from selfmotion.planning.standing import PaperMotion, Standing, score
from selfmotion.planning.warm_start import coefficients_of, moved_to, pace_of, slower
from selfmotion.result import Plan
from selfmotion.search import SequenceGuide


class Session:
    """The optimisation from one start; from its motion at x = 0.

    What stands is replaced as a whole, so that an interruption finds what belongs together.

    Parameters
    ----------
    beginning : Beginning

    Attributes
    ----------
    still : PaperMotion
        The motion at x = 0.
    is_hopeless : bool
        Whether it ended because another motion is known that costs less.
    """

    def __init__(self, beginning: Beginning) -> None:
        self.still = PaperMotion(beginning, beginning.solution())
        self.history: list[Iteration] = []
        self.is_hopeless = False
        self._found: Standing | None = None
        self._ended: Status | None = None
        self._warm: Plan | None = None
        self._known: Trajectory | None = None

    @property
    def beginning(self) -> Beginning:
        """What all motions of this start have in common."""
        return self.still.beginning

    @property
    def standing(self) -> Standing:
        """The motion that stands."""
        return self._found or self.still

    @property
    def counts(self) -> Counts:
        """Work done by all sessions of the plan."""
        return self.beginning.effort.counts

    @property
    def status(self) -> Status:
        """How the last minimisation ended, or what ended the session."""
        return self.standing.status if self._ended is None else self._ended

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
        """What is wrong for each constraint that what stands does not meet."""
        return self.standing.violations

    def end(self, status: Status) -> None:
        """Take the motion as it is; there is no time for another one."""
        self._ended = status

    def motion(self) -> Evaluation:
        """Return the motion as it is now."""
        return self.standing.evaluation()

    def still_evaluation(self) -> Evaluation:
        """Return the motion at x = 0, on the grid of what stands where it has one."""
        found = self._found
        known = found if isinstance(found, PaperMotion) else self.still
        return known.solution.still_evaluation()

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        return self.standing.merit()

    def score(self) -> tuple[bool, bool, float]:
        """Return what ranks it among others: the smaller, the better; see `score`."""
        return score(self.standing)

    def take_chain(self, guide: SequenceGuide) -> None:
        """Let the shortest chain near a sequence stand, if it will do: nothing is left to gain."""
        start = self.beginning
        self._found = along_chain(start.problem, start.effort, guide, start.constraints)

    def stand_on(self, found: MotionOnNodes, history: list[Iteration]) -> None:
        """Let what was found on nodes elsewhere be what stands, with the way to it."""
        self._found = found
        self.history += history

    @property
    def of_chain(self) -> bool:
        """Whether what stands is a chain of the search, at its optimum."""
        return isinstance(self._found, MotionOnNodes) and self._found.is_chain

    def adopt(self, plan: Plan) -> None:
        """Begin at a plan's motion instead of x = 0, unless that would be worse."""
        self._warm = plan

    def resume(self, trajectory: Trajectory) -> None:
        """Begin at a motion that is known."""
        self._known = trajectory

    def minimize(self, dearest: float = np.inf) -> None:
        """Optimise from the motion that there is.

        Where a motion is known that costs `dearest`: it ends where it becomes clear that this one
        will cost more.
        """
        start = self.beginning
        if self._ended is not None or self.of_chain:
            return
        if not np.isfinite(self.still.cost):
            self.still.solution.objective.require_finite(self.still.solution.x)
        if is_published(start.problem, start.effort):
            self._take_published()
        elif is_on_nodes(start.problem, start.effort):
            self._take_nodes(dearest)

    def settle(self) -> None:
        """Go on until more nodes save nothing; the published method has done so on its grids."""
        found = self._found
        if self._ended is None and isinstance(found, MotionOnNodes) and not found.is_chain:
            self._by_nodes(lambda descent: descent.settled(found), self.beginning.constraints)

    def refine(self, where: Flags | None = None) -> None:
        """Go on with half the step length, everywhere or for some of the steps (N,)."""
        if self._found is None:
            self.still = self.still.refined(where)
        else:
            self._found = self._found.refined(where)

    def _take_published(self) -> None:
        """Go to the optimum of the published method."""
        effort, before = self.beginning.effort, self._found
        if isinstance(before, PaperMotion):
            solution = before.solution.again()
        else:
            begun, most = self.still.solution, effort.max_evaluations
            limit = None if most is None else effort.counts.evaluations + most
            method = replace(begun.method, limit=limit, callback=effort.callback)
            solution = replace(begun, method=method, x=self._first_coefficients()).settled()
        self._found = PaperMotion(self.beginning, solution)
        self.history = list(solution.history)
        if solution.status is Status.INTERRUPTED:
            self.end(Status.INTERRUPTED)

    def _first_coefficients(self) -> Array:
        """Return the decision vector that is nearest to a known plan, if no worse than x = 0."""
        plan, problem = self._warm, self.beginning.problem
        objective, none = self.still.solution.objective, self.still.solution.x
        if plan is None:
            return none
        t, pace = objective.grid.stage_times, pace_of(plan, problem)
        near = coefficients_of(plan.trajectory, pace, problem, t, objective.null_motion)
        z, _ = objective.parts(none)
        x = np.concatenate([z, near])
        return x if objective.value(x) <= self.still.cost else none

    def _take_nodes(self, dearest: float) -> None:
        """Go to the optimum on nodes near the motion."""
        start, before = self.beginning, self._found

        def optimum(descent: NodeDescent) -> MotionOnNodes | None:
            if isinstance(before, MotionOnNodes):
                return descent.again(before)
            warm, t = self._warm, first_nodes(start.problem)
            known = self._known or self.still.evaluation().trajectory
            motions = [known]
            if warm is not None and warm.trajectory.t[-1] == warm.path.duration:
                own = slower(warm.trajectory, pace_of(warm, start.problem))
                if not start.free:
                    own = moved_to(own, start.still.start)
                motions = [own, known]
                if len(own.t) <= most_nodes(start.problem):
                    # Its nodes are where such a motion needs them.
                    t = np.unique(np.append(own.t, start.problem.knots))
            return descent.near(motions, t, dearest)

        self._by_nodes(optimum, start.constraints)
        found = self._found
        # One that costs more already is none to take either way.
        if found is not None and found.cost < dearest and not found.keeps_off_itself:
            self.keep_off_itself()
        if self.status is Status.GRADIENT:
            # A gradient that is not finite is named with its time.
            self.still.solution.objective.gradient(self.still.solution.x)

    def keep_off_itself(self) -> bool:
        """Ask that of an optimum that takes the arm into itself; return whether there is a new one.

        Few do, so that the others need not wait for distances.
        """
        found, start = self._found, self.beginning
        if not isinstance(found, MotionOnNodes) or found.violations:
            return False
        # Of a given start in which it meets itself, nothing else begins.
        kept = start.free or start.problem.keeps_off_itself(found.motion.place.q[:1])
        if self._ended is not None or start.effort.apart or found.is_chain or not kept:
            return False
        self.still = replace(self.still, beginning=start.kept_apart())

        def optimum(descent: NodeDescent) -> MotionOnNodes | None:
            first = self._known or self.still.evaluation().trajectory
            return descent.with_more(found) or descent.near([first], found.motion.grid.t)

        self._by_nodes(optimum, self.beginning.constraints)
        return self._found is not found

    def _by_nodes(
        self,
        search: Callable[[NodeDescent], MotionOnNodes | None],
        constraints: Sequence[BoundConstraint],
    ) -> None:
        """Let what is found on nodes be what stands, if something is."""
        start = self.beginning
        descent = NodeDescent(start.problem, start.effort, constraints, free=start.free)
        try:
            found = search(descent)
        except KeyboardInterrupt:
            if descent.latest is None and self._found is None:
                raise
            found = descent.latest
            self._ended = Status.INTERRUPTED
        if descent.is_stopped:
            # A motion that was better before it stands as it was, and does not say so.
            self._ended = Status.STOPPED
        self.history += descent.history
        self.is_hopeless = descent.is_hopeless
        self._found = found or self._found
