"""State of one plan while it is made, and the judgement of its motion."""

import time
from collections import abc
from dataclasses import dataclass, field, replace

import numpy as np

from selfmotion.basics import Array, BreakdownError, Progress, SelfmotionError
from selfmotion.certificate import LIMIT_NAMES, Certificate, Tolerance
from selfmotion.model.motion import Evaluation, Grid, Trajectory
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.optimise import Status
from selfmotion.planning.paper import MOST_HALVINGS, Guide
from selfmotion.planning.planner.candidate import Candidate
from selfmotion.planning.planner.effort import Effort, Search
from selfmotion.planning.planner.grids import is_published
from selfmotion.planning.planner.largest_part import Part, largest_part, shorter_part
from selfmotion.planning.planner.screening import Ranking
from selfmotion.planning.result import Attempt, Plan
from selfmotion.planning.search import Obstruction, Reach, Sequence, reachable

# Path error between nodes, as a share of the tolerance, up to which a grid is fine enough …
_RESOLVED = 0.3
# … and as a share of that on the grid before.
_FALLS = 0.7
# Number of grids on which limits are exceeded between nodes before they count as infeasible.
_ROUGH_GRIDS = 3
# Grids with more steps than this multiple of the first are not optimised again.
_FINER = 4
# Evaluations of the cost on each of several parts of the path.
_PART_EVALUATIONS = 150
# The same with a free start: the start with the largest part is among many.
_FREE_PART_EVALUATIONS = 30
# Largest number of shorter parts where the end of one is too rough.
_SHORTER_PARTS = 3


@dataclass(frozen=True, eq=False)
class Judged:
    """Content of a plan: a motion along all of the path or a part of it, and its certificate.

    Attributes
    ----------
    part : Part
    motion, minimum_norm : Evaluation
        The motion, and the minimum-norm one on the same grid.
    certificate : Certificate
    rival_cost : float or None
        That of the best motion from the chains of the search, where it keeps the constraints.
    """

    part: Part
    motion: Evaluation
    minimum_norm: Evaluation
    certificate: Certificate
    rival_cost: float | None = None

    @property
    def fails_at(self) -> float | None:
        """When [s] the certificate finds something wrong; None where it finds nothing."""
        check = self.certificate
        failed = [item.time for item in check.findings if not item.satisfied]
        if not check.on_path:
            failed.append(check.position_error.time)
        return failed[0] if failed else None


def judge(formulation: Formulation, part: Part, tolerance: Tolerance, progress: Progress) -> Judged:
    """Return the motion on the first grid on which it is within the tolerance, with its check."""
    candidate = part.candidate
    judged: Judged | None = None
    coarse: Trajectory | None = None
    misses: list[float] = []
    roughs, first = 0, candidate.solution.steps
    for _ in range(MOST_HALVINGS):
        try:
            progress("checking", 1, 1)
            judged = _check(formulation, part, tolerance)
            if _meets_itself(formulation, judged.certificate) and candidate.keep_off_itself():
                candidate.settle()
                continue
            rough = _rough(formulation, judged, candidate)
            roughs += rough
            # Where no evaluations are left, finer grids change nothing.
            out = candidate.status is Status.MAX_EVALUATIONS
            spent = out or roughs > _ROUGH_GRIDS or candidate.solution.steps > _FINER * first
            if judged.certificate.on_path and (spent or not rough):
                break
            trajectory = judged.motion.trajectory
            # The path error of damping is the same on any grid: the grid is fine when the tool's
            # motion is.
            if coarse is not None and _same(formulation, coarse, trajectory, tolerance):
                break
            coarse = trajectory if judged.motion.damped else None
            # Poses out of reach are so on any grid.
            check = judged.certificate
            misses.append(check.position_error.value + check.rotation_error.value)
            if coarse is None and len(misses) > 2 and misses[-1] > 0.5 * misses[-3]:
                break
            if candidate.solution.steps >= candidate.most_steps:
                break
            candidate.refine()
            if rough and not candidate.cut_short:
                candidate.polish()
        except KeyboardInterrupt:
            candidate.end(Status.INTERRUPTED)
            break
    # No plan goes without a certificate, interrupted or not.
    return judged or _check(formulation, part, tolerance)


def _resolved(formulation: Formulation, candidate: Candidate, tolerance: Tolerance) -> Evaluation:
    """Return the motion, steps halved between whose nodes the tool was off the path."""
    allowed, before = np.array([tolerance.position, tolerance.rotation]), np.inf
    motion = candidate.evaluation()
    for _ in range(MOST_HALVINGS):
        errors = formulation.errors_between(motion.trajectory) / allowed
        worst = float(errors.max())
        # Written so that NaN is no progress. Damping's error is not that of the steps.
        stuck = not worst < _FALLS * before or len(errors) > candidate.most_steps
        if motion.damped or worst <= _RESOLVED or stuck:
            break
        before = worst
        candidate.refine((errors > _RESOLVED).any(axis=1))
        motion = candidate.evaluation()
    return motion


def _meets_itself(formulation: Formulation, certificate: Certificate) -> bool:
    """Whether self-collision, under the default clearance, is the only violation."""
    is_default = formulation.problem.own_collision is not None and len(certificate.failures) == 1
    return is_default and not certificate.findings[-1].satisfied


def _rough(formulation: Formulation, judged: Judged, candidate: Candidate) -> bool:
    """Whether a required condition holds at the nodes, but not between them."""
    if candidate.violations or not judged.certificate.on_path:
        return False
    is_default = {item.name for item in formulation.problem.requirements}
    # The arm's own limits always apply.
    is_default |= set(LIMIT_NAMES[:2])
    if formulation.problem.own_collision is not None:
        # The default clearance need not have been a constraint of the nodes.
        is_default.discard(formulation.problem.requirements[-1].name)
    nodes = judged.motion.trajectory.t
    # Rates are judged on both sides of a node; anything else that is wrong there stays so.
    return any(
        item.requirement in LIMIT_NAMES or item.time not in nodes
        for item in judged.certificate.findings
        if not item.satisfied and item.requirement in is_default
    )


def _same(
    formulation: Formulation, coarse: Trajectory, fine: Trajectory, tolerance: Tolerance
) -> bool:
    """Whether two motions put all that is followed in the same place in the prescribed rows."""
    pairs = list(zip(coarse(fine.t), fine.q, strict=True))
    misses = np.array(
        [
            item.miss(item.chain.place(first), second)
            for item in formulation.follows.items
            for first, second in pairs
        ]
    )
    position, rotation = misses.max(axis=0)
    return bool(position <= tolerance.position and rotation <= tolerance.rotation)


def _check(formulation: Formulation, part: Part, tolerance: Tolerance) -> Judged:
    motion = _resolved(formulation, part.candidate, tolerance)
    certificate = formulation.certify(motion.trajectory, tolerance, part.ending)
    return Judged(part, motion, part.candidate.minimum_norm_evaluation(), certificate)


@dataclass(eq=False)
class Planner:
    """State of one plan while it is made; the steps of `steps.py` change it.

    Attributes
    ----------
    formulation : Formulation
        The problem, with its tolerances as virtual joints.
    effort : Effort
        Options of all candidates.
    search : Search
    tolerance : Tolerance
    progress : Progress
    warm_start : Plan or None
        Of this problem or of one like it: tried first; where its motion will do, nothing else is.
    guide : Sequence or None
        Likewise a motion that a search over the whole path has found.
    attempts : list of Attempt
        Proposals so far, in order.
    began : float
        When, by the clock `time.perf_counter` [s].
    blocked : Obstruction or None
        A pose that no configuration was found for.
    best : Candidate or None
        The best so far.
    second : Candidate or None
        The best one before it.
    broken : list of Candidate
        Those that were optimised and break something.
    sequences : list of Sequence
        Results of the global search; empty without one, or if it failed.
    rival : Candidate or None
        The best motion from these. It is not chosen where the start is given or the search local,
        and only compared with.
    stops, advice : str
        The obstruction of a motion that is not verified, and remedies, in words; empty if unknown.
    failure : SelfmotionError or None
        The last cause of having no motion, if there is none.
    notes : list of str
        Causes of failed searches, and remedies.
    waiting : sequence of Candidate
        Complete motions that are not optimised yet.
    ranking : Ranking or None
        Rough motions of starts.
    judged : Judged or None
        The judged content of the plan.
    """

    formulation: Formulation
    effort: Effort
    search: Search
    tolerance: Tolerance
    progress: Progress
    warm_start: Plan | None = None
    guide: Sequence | None = None
    attempts: list[Attempt] = field(default_factory=list)
    began: float = field(default_factory=time.perf_counter)
    blocked: Obstruction | None = None
    best: Candidate | None = None
    second: Candidate | None = None
    broken: list[Candidate] = field(default_factory=list)
    sequences: list[Sequence] = field(default_factory=list)
    rival: Candidate | None = None
    failure: SelfmotionError | None = None
    stops: str = ""
    advice: str = ""
    notes: list[str] = field(default_factory=list)
    waiting: abc.Sequence[Candidate] = ()
    ranking: Ranking | None = None
    judged: Judged | None = None

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.search.rng)
        self._reaches: dict[float, Reach] = {}

    @property
    def is_free(self) -> bool:
        """Whether the start is free."""
        return self.formulation.given_start is None

    @property
    def has_motion(self) -> bool:
        """Whether there is an initial motion."""
        return self.warm_start is not None or self.guide is not None

    @property
    def is_searchable(self) -> bool:
        """Whether there is a self-motion to search."""
        return self.formulation.follows.redundancy > 0

    @property
    def chooses_globally(self) -> bool:
        """Whether results of the global search may be chosen, and are not only compared."""
        return self.is_free and self.search.mode != "local"

    @property
    def takes_starts(self) -> bool:
        """Whether starts are drawn."""
        only_global = self.search.mode == "global" and self.is_searchable
        return self.is_free and not only_global

    @property
    def is_sought(self) -> bool:
        """Whether a motion is still sought."""
        return self.judged is None and not self.is_over

    @property
    def is_over(self) -> bool:
        """Whether the user wants no more."""
        return self.best is not None and self.best.cut_short

    @property
    def is_unmet(self) -> bool:
        """Whether no motion so far satisfies all its constraints."""
        return self.best is None or not (self.is_published or self.best.will_do)

    @property
    def is_published(self) -> bool:
        """Whether the published method is requested: its constraints are given ends alone."""
        return is_published(self.formulation, self.effort)

    @property
    def cost_to_beat(self) -> float:
        """Cost of a sufficient motion so far; inf for none."""
        best = self.best
        return best.solution.cost if best is not None and best.will_do else np.inf

    def begin(
        self, start: Array, *, free: bool, guide: Guide | None = None, grid: Grid | None = None
    ) -> Candidate | None:
        """Return the candidate of a start; None where it breaks down at once, which is noted."""
        try:
            return Candidate(
                self.formulation, self.effort, start, free=free, guide=guide, grid=grid
            )
        except BreakdownError as error:
            self.failure = error
            return None

    def taken_up(self, motion: Trajectory) -> Candidate | None:
        """Return the candidate of a rough motion; None if it breaks down at once."""
        candidate = self.begin(motion.q[0], free=self.is_free)
        if candidate is not None:
            candidate.resume(motion)
        return candidate

    def polish(self, candidate: Candidate, *, chosen: bool = True) -> None:
        """Optimise a candidate; keep it if it is the best one and may be chosen."""
        # Comparisons are optimised to the end.
        cost_to_beat = self.cost_to_beat if chosen else np.inf
        try:
            candidate.polish(cost_to_beat)
        except KeyboardInterrupt:
            candidate.end(Status.INTERRUPTED)
        if candidate.is_hopeless:
            return
        if chosen:
            self.consider(candidate)
            self.broken += [candidate] if candidate.violations else []
        if candidate.violations and candidate.effort.apart:
            # Later candidates have self-collision as a constraint at once.
            self.effort = candidate.effort
        if candidate.cut_short and self.best is not None:
            self.best.end(candidate.status)

    def consider(self, candidate: Candidate) -> None:
        """Keep a candidate if it is the best one."""
        if self.best is None or candidate.score() < self.best.score():
            self.best, self.second = candidate, self.best

    def reach(self, suspect: float = 0.0) -> Reach:
        """Return the extent to which single poses are reachable, with more poses about a time [s].

        That is left out where something is known to be beyond.
        """
        for known in self._reaches.values():
            if known.reason:
                return known
        if suspect not in self._reaches:
            self.progress("checking reach", 1, 1)
            rng = np.random.default_rng(self.search.rng)
            self._reaches[suspect] = reachable(self.formulation, self.search.starts, rng, suspect)
        return self._reaches[suspect]

    def is_out_of_reach(self) -> bool:
        """Whether no start led anywhere because the path leaves the workspace."""
        if self.best is not None:
            return bool(self.best.violations) and bool(self.reach().reason)
        failure = self.failure
        return isinstance(failure, BreakdownError) and bool(self.reach(failure.time).reason)

    def judge(self, best: Candidate) -> None:
        """Judge the best motion, on grids that are fine enough."""
        rival_cost = _refine_both(best, self.rival, self.progress)
        self.judged = self._judged(Part(self.formulation, best), rival_cost)
        if self.judged.certificate.verified:
            return
        known = [best.as_adopted()]
        if best.cut_short:
            # An iterate on the way to an optimum may violate more than earlier motions.
            known += [self.second, best.as_begun()]
        for one in filter(None, known):
            if best.cut_short:
                one.end(best.status)
            if self.judge_as_it_is(one):
                return

    def free_by_meshes(self, *, just: bool = False) -> abc.Iterator[Candidate]:
        """Yield candidates whose meshes are apart, though their hulls are not.

        The best first; apart by the required distance, or `just` apart. Without any motion that
        satisfies all, one whose hulls overlap slightly may be the only one whose meshes do not.
        """
        bodies = self.formulation.envelope.bodies
        if not self.is_unmet or all(model.is_all_convex for model, _ in bodies):
            return
        for candidate in sorted(self.broken, key=Candidate.score):
            q = candidate.evaluation().trajectory.q
            own = q[:, : self.formulation.robot.dof]
            if all(model.worst(own).value >= (0.0 if just else far) for model, far in bodies):
                yield candidate

    def judge_as_it_is(self, best: Candidate) -> bool:
        """Let a motion be it if it is verified; return whether it is."""
        judged = self._judged(Part(self.formulation, best))
        if judged.certificate.verified:
            self.judged = judged
        return judged.certificate.verified

    def judge_part(self, suspect: float = 0.0) -> bool:
        """Judge the largest part, with more poses about a time [s]; return whether there is one."""
        effort = self.effort
        if effort.max_evaluations is None:
            most = _FREE_PART_EVALUATIONS if self.is_free else _PART_EVALUATIONS
            effort = replace(effort, max_evaluations=most)
        known = self.reach(suspect)
        self.progress("longest part that can be followed", 1, 1)
        found = largest_part(self.formulation, known, effort)
        if found is None:
            return False
        _refine_both(found.candidate, None, self.progress)
        self.judged = self._judged(found)
        for _ in range(_SHORTER_PARTS):
            # Besides that it ends, nothing should be wrong with it.
            if len(self.judged.certificate.failures) < 2 or found.candidate.cut_short:
                break
            if (shorter := shorter_part(self.formulation, found, effort)) is None:
                break
            found = shorter
            _refine_both(found.candidate, None, self.progress)
            judged = self._judged(found)
            if len(judged.certificate.failures) < 2:
                self.judged = judged
        return True

    def _judged(self, part: Part, rival_cost: float | None = None) -> Judged:
        """Return a motion on the first grid that holds the tolerance, with its check."""
        found = judge(self.formulation, part, self.tolerance, self.progress)
        return replace(found, rival_cost=rival_cost)

    def interrupted(self) -> None:
        """Make the best that is known the outcome; raise KeyboardInterrupt where nothing is."""
        if self.best is None and not self.waiting:
            ranked = [] if self.ranking is None else self.ranking.ranked[:1]
            begun = (self.taken_up(motion.trajectory) for motion in ranked)
            self.waiting = [candidate for candidate in begun if candidate is not None]
        for candidate in self.waiting if self.best is None else ():
            candidate.end(Status.INTERRUPTED)
            self.consider(candidate)
        if self.best is None:
            raise KeyboardInterrupt
        self.best.end(Status.INTERRUPTED)


def _refine_both(best: Candidate, rival: Candidate | None, progress: Progress) -> float | None:
    """Refine a motion, and the one it is compared with; return the latter's cost, if sufficient.

    An interruption ends both as they are.
    """
    try:
        progress("refining", 1, 1)
        best.settle()
        if rival is not None and rival is not best and not best.cut_short:
            rival.settle()
            if rival.cut_short:
                best.end(rival.status)
            return None if rival.violations else rival.solution.cost
    except KeyboardInterrupt:
        best.end(Status.INTERRUPTED)
    return None
