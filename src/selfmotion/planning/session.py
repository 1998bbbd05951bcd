"""One start of one problem, optimised: what stands, and how it becomes better."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Flags
from selfmotion.engine import Counts, Evaluation
from selfmotion.motion import NullMotion, Trajectory
from selfmotion.optimise import Iteration, Status
from selfmotion.planning.along_chain import along_chain
from selfmotion.planning.beginning import Beginning
from selfmotion.planning.descent import Descent, breaks
from selfmotion.planning.for_nodes import first_nodes, most_nodes, takes
from selfmotion.planning.nodes import NodeDescent
from selfmotion.planning.on_nodes import MotionOnNodes
from selfmotion.planning.standing import RolledMotion, Standing, score
from selfmotion.planning.warm_start import pace_of, slower
from selfmotion.result import Plan
from selfmotion.search import SequenceGuide


class Session:
    """The optimisation from one start; from its motion at x = 0.

    What stands is replaced as a whole, so that an interruption finds what belongs together.

    Parameters
    ----------
    beginning : Beginning
    motion : NullMotion, optional
        Another null motion than that of the problem.

    Attributes
    ----------
    rolled : RolledMotion
        What was rolled out last.
    on_nodes : MotionOnNodes or None
        What was found on nodes, which then stands.
    is_hopeless : bool
        Whether it ended because another motion is known that costs less.
    """

    def __init__(self, beginning: Beginning, motion: NullMotion | None = None) -> None:
        self.rolled = RolledMotion.still(beginning, motion)
        self.on_nodes: MotionOnNodes | None = None
        self._descent = Descent(beginning.effort)
        self._ended: Status | None = None
        self._tried_nodes = self.is_hopeless = False
        # A finer null motion than asked for that led nowhere.
        self._tried: NullMotion | None = None
        self._warm: Plan | None = None
        self._known: Trajectory | None = None

    @property
    def beginning(self) -> Beginning:
        """What all motions of this start have in common."""
        return self.rolled.beginning

    @property
    def standing(self) -> Standing:
        """The motion that stands."""
        return self.rolled if self.on_nodes is None else self.on_nodes

    @property
    def counts(self) -> Counts:
        """Work done by all sessions of the plan."""
        return self.beginning.effort.counts

    @property
    def history(self) -> list[Iteration]:
        """All iterations so far."""
        return self._descent.history

    @property
    def bound(self) -> bool:
        """Whether conditions count: until then none was met on the way."""
        return self._descent.bound

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
        if self.on_nodes is None:
            self.rolled = self.rolled.judged()

    def motion(self) -> Evaluation:
        """Return the motion as it is now."""
        return self.standing.evaluation()

    def merit(self) -> float:
        """Return the cost, much larger where constraints are violated: for ranking."""
        return self.standing.merit()

    def score(self) -> tuple[bool, bool, float]:
        """Return what ranks it among others: the smaller, the better; see `score`."""
        return score(self.standing)

    def take_chain(self, guide: SequenceGuide) -> None:
        """Let the shortest chain near a sequence stand, if it will do: nothing is left to gain."""
        start = self.beginning
        self.on_nodes = along_chain(start.problem, start.effort, guide, start.constraints)

    def stand_on(self, found: MotionOnNodes, history: list[Iteration]) -> None:
        """Let what was found on nodes elsewhere be what stands, with the way to it."""
        self.on_nodes, self._tried_nodes = found, True
        self._descent.history += history

    @property
    def of_chain(self) -> bool:
        """Whether what stands is a chain of the search, at its optimum."""
        return self.on_nodes is not None and self.on_nodes.is_chain

    def adopt(self, plan: Plan) -> None:
        """Begin at a plan's motion instead of x = 0, unless that would be worse."""
        self._warm = plan

    def resume(self, trajectory: Trajectory, *, is_optimum: bool = False) -> None:
        """Begin at the null motion of a motion, if no worse; nodes at an optimum as it is."""
        self.rolled = self.rolled.resumed(trajectory)
        self._known = trajectory if is_optimum else None

    def minimize(self, evaluations: int | None = None, *, dearest: float = np.inf) -> None:
        """Optimise on the present grid, from the motion that there is.

        Parameters
        ----------
        evaluations : int, optional
            So many of the cost, for a rough optimum; by default what `Effort` allows.
        dearest : float
            Of a motion that is known: it ends where it becomes clear that this one will cost more.
        """
        on_nodes = self.of_chain or (evaluations is None and self.take_nodes(dearest))
        if on_nodes or self.is_hopeless:
            return
        if self._warm is not None:
            warm, self._warm = self._warm, None
            self.rolled = self.rolled.begun_at(warm)
        objective, wanted = self.rolled.objective, self.rolled.null_motion
        if not np.isfinite(objective.value(self.rolled.x)):
            objective.require_finite(self.rolled.x)
        # It is a long way from far outside the constraints, which another motion spares.
        restores = dearest == np.inf
        if evaluations is None and self._take_rough_minimum(restores=restores):
            spent, status = self.is_spent, self.status
            self.rolled = self.rolled.with_null_motion(wanted)
            if spent:
                self.end(status)
        if self._ended is None:
            self._descend(evaluations, restores=restores)
        self.rolled = self.rolled.closed().judged()

    def take_nodes(self, dearest: float = np.inf) -> bool:
        """Go to the optimum on nodes near the motion; return whether that is what stands now."""
        start, before = self.beginning, self.on_nodes
        over = self._ended is not None or (self._tried_nodes and before is None)
        if over or not takes(start.problem, start.effort, start.constraints):
            return False
        # What led nowhere once would do so again.
        self._tried_nodes = True

        def optimum(descent: NodeDescent) -> MotionOnNodes | None:
            if before is not None:
                return descent.again(before)
            objective, warm = self.rolled.objective, self._warm
            if not np.isfinite(objective.value(self.rolled.x)):
                return None
            t = first_nodes(start.problem)
            known = self._known or objective.at(self.rolled.x).trajectory
            motions = [known]
            if warm is not None and warm.trajectory.t[-1] == warm.path.duration:
                own = slower(warm.trajectory, pace_of(warm, start.problem))
                motions = [own, known]
                if len(own.t) <= most_nodes(start.problem):
                    # Its nodes are where such a motion needs them.
                    t = np.unique(np.append(own.t, start.problem.knots))
            return descent.near(motions, t, dearest)

        self._by_nodes(optimum)
        return self.on_nodes is not None

    def leave_nodes(self) -> None:
        """Go on without nodes, from the motion that they began with."""
        self.on_nodes, self._tried_nodes = None, True
        self.minimize()

    def settle_nodes(self) -> None:
        """Go on until more nodes change the cost no more."""
        standing = self.on_nodes
        if standing is not None and self._ended is None and not standing.is_chain:
            self._by_nodes(lambda descent: descent.settled(standing))

    def _by_nodes(self, search: Callable[[NodeDescent], MotionOnNodes | None]) -> None:
        """Let what is found on nodes be what stands, if something is."""
        start = self.beginning
        descent = NodeDescent(start.problem, start.effort, start.constraints, free=start.free)
        try:
            found = search(descent)
        except KeyboardInterrupt:
            if descent.latest is None and self.on_nodes is None:
                raise
            found = descent.latest or self.on_nodes
            self._ended = Status.INTERRUPTED
        self._descent.history += descent.history
        self.is_hopeless = descent.is_hopeless
        self.on_nodes = found or self.on_nodes

    def _descend(self, evaluations: int | None, *, restores: bool) -> None:
        """Minimise from where the motion is; by a finer null motion where this one gets stuck."""
        wanted, before = self.beginning.problem.null_motion, self.rolled
        # Where more freedom is taken anyway if it pays, it is a shorter way than restoration.
        refines = wanted.gain < np.inf and before.null_motion == wanted
        refines &= before.minimum is None and evaluations is None
        self._take_minimum(evaluations, restores=restores and not refines)
        if not (restores and refines) or self.status is not Status.INFEASIBLE:
            return
        stuck = self.rolled
        self._tried = wanted.detours(before.objective.null_motion.rows)[0]
        self.rolled = before.with_null_motion(self._tried)
        self._take_minimum()
        if not breaks(self.rolled.objective, self.rolled.x):
            return
        spent, status, self.rolled = self.is_spent, self.status, stuck
        if spent:
            self.end(status)
        else:
            self._take_minimum()

    def _take_rough_minimum(self, *, restores: bool) -> bool:
        """Go to the optimum of a rougher null motion, which leads to that wanted; return whether.

        That is sought where conditions are violated at x = 0: with many coefficients, steps would
        be small, and each would cost much.
        """
        before = self.rolled
        first = before.minimum is None and not before.coefficients.any()
        can = first and before.null_motion.rough != before.null_motion
        rough = before.rougher() if can and breaks(before.objective, before.x) else None
        if rough is None:
            return False
        self.rolled = rough
        self._take_minimum(restores=restores)
        if self.status is Status.INFEASIBLE:
            self.rolled = before
            return False
        return True

    def _take_minimum(self, evaluations: int | None = None, *, restores: bool = True) -> None:
        """Go to the minimum from where the motion is, and know what binds there."""
        self.rolled = self._descent.descended(
            self.rolled, evaluations=evaluations, restores=restores
        )
        if self.rolled.status is Status.INTERRUPTED:
            # For good, whatever is minimised later.
            self.end(Status.INTERRUPTED)
        self.rolled = self._descent.priced(self.rolled)

    def others(self) -> list[NullMotion]:
        """Return null motions by which conditions may be met that this one does not meet."""
        wanted = self.beginning.problem.null_motion
        motions = wanted.detours(self.rolled.objective.null_motion.rows)
        return [motion for motion in motions if motion != self._tried]

    def by(self, motion: NullMotion) -> "Session":
        """Return the session around the same motion at x = 0 of another null motion, optimised.

        Where that of the problem is to be had in the end: with it.
        """
        wanted, session = self.beginning.problem.null_motion, Session(self.beginning, motion)
        session._descent.before, session._descent.history = self._descent.before, self.history
        session.minimize()
        if wanted.gain == np.inf and not (session.violations or session.cut_short):
            session.rolled = session.rolled.with_null_motion(wanted)
            session.minimize()
        return session

    def refine(self, where: Flags | None = None) -> None:
        """Go on with half the step length, everywhere or for some of the steps (N,)."""
        if self.on_nodes is not None:
            self.on_nodes = self.on_nodes.refined(where)
        else:
            self.rolled = self.rolled.refined(where)
