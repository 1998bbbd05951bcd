"""Judge a motion on finer grids, until its certificate finds nothing wrong."""

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Progress
from selfmotion.certificate import LIMIT_NAMES, Certificate, Tolerance
from selfmotion.model.motion import Evaluation, Trajectory
from selfmotion.planning.formulation import (
    Formulation,
    certified,
    deferred_clearance,
    path_errors,
)
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner.largest_part import Part
from selfmotion.planning.planner.refinement import refined
from selfmotion.planning.planner.solution import Solution, have_one_start
from selfmotion.planning.planner.solve import kept_off_itself, settle, solve
from selfmotion.planning.rollout import MAX_HALVINGS

# Path error between nodes, as a share of the tolerance, up to which a grid is fine enough …
_RESOLVED = 0.3
# … and as a share of that on the grid before.
_FALLS = 0.7
# Number of grids on which limits are exceeded between nodes before they count as infeasible.
_ROUGH_GRIDS = 3
# Grids with more steps than this multiple of the first are not optimised again.
_FINER = 4


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
    by = _ByCertificate(formulation, part, tolerance, progress)
    try:
        refined(part, by)
    except KeyboardInterrupt:
        by.part = replace(by.part, solution=by.part.solution.ended_by(Status.INTERRUPTED))
        if by.judged is not None:
            return replace(by.judged, part=by.part)
    # No plan goes without a certificate, interrupted or not.
    return by.judged or _check(formulation, by.part, tolerance)


class _ByCertificate:
    """Judges parts by their certificate, and halves their steps where finer ones may do.

    Attributes
    ----------
    part : Part
        The last one.
    judged : Judged or None
        The last one that has a certificate.
    """

    def __init__(
        self, formulation: Formulation, part: Part, tolerance: Tolerance, progress: Progress
    ) -> None:
        self._formulation, self._tolerance, self._progress = formulation, tolerance, progress
        self._first, self._rounds, self._roughs = part.solution.outcome.steps, MAX_HALVINGS, 0
        self._coarse: Trajectory | None = None
        self._misses: list[float] = []
        self.part = part
        self.judged: Judged | None = None

    def __call__(self, part: Part) -> Part | None:
        """Return the part on a finer grid; None where it is verified, or no finer one will do."""
        if self._rounds == 0:
            return None
        self._rounds -= 1
        self._progress("checking", 1, 1)
        judged = self.judged = _check(self._formulation, part, self._tolerance)
        part = self.part = judged.part
        if _meets_itself(self._formulation, judged.certificate):
            apart = kept_off_itself(part.solution)
            if apart is not None and apart.outcome is not part.solution.outcome:
                self.part = replace(part, solution=settle(apart))
                return self.part
            if apart is not None:
                # That it was tried, and how that ended, is known from now on.
                part = self.part = replace(part, solution=apart)
                judged = self.judged = replace(judged, part=part)
        rough = _rough(self._formulation, judged)
        if self._is_enough(judged, rough):
            return None
        solution = part.solution.refined()
        if rough and not solution.cut_short:
            solution = solve(solution)
        self.part = replace(part, solution=solution)
        return self.part

    def _is_enough(self, judged: Judged, rough: bool) -> bool:
        """Whether nothing is wrong, or nothing that a finer grid would change."""
        self._roughs += rough
        solution, check = judged.part.solution, judged.certificate
        # Where no evaluations are left, finer grids change nothing.
        out = solution.status is Status.MAX_EVALUATIONS
        spent = out or self._roughs > _ROUGH_GRIDS
        spent = spent or solution.outcome.steps > _FINER * self._first
        if check.on_path and (spent or not rough):
            return True
        trajectory, coarse = judged.motion.trajectory, self._coarse
        # The path error of damping is the same on any grid: the grid is fine when the tool's
        # motion is.
        if coarse is not None and _same(self._formulation, coarse, trajectory, self._tolerance):
            return True
        self._coarse = trajectory if judged.motion.damped else None
        # Poses out of reach are so on any grid.
        misses = self._misses
        misses.append(check.position_error.value + check.rotation_error.value)
        if self._coarse is None and len(misses) > 2 and misses[-1] > 0.5 * misses[-3]:
            return True
        return solution.outcome.steps >= solution.guess.most_steps


class _ByPath:
    """Judges solutions by the path between their nodes, and halves the steps that are off it.

    Attributes
    ----------
    motion : Evaluation
        Of the last one.
    """

    motion: Evaluation

    def __init__(self, formulation: Formulation, tolerance: Tolerance) -> None:
        self._formulation, self._rounds, self._worst = formulation, MAX_HALVINGS, np.inf
        self._allowed = np.array([tolerance.position, tolerance.rotation])

    def __call__(self, solution: Solution) -> Solution | None:
        """Return the motion on a finer grid; None where it is near the path, or comes no nearer."""
        motion = self.motion = solution.evaluation
        if self._rounds == 0:
            return None
        self._rounds -= 1
        errors = path_errors(self._formulation, motion.trajectory) / self._allowed
        worst = float(errors.max())
        # Written so that NaN is no progress. Damping's error is not that of the steps.
        stuck = not worst < _FALLS * self._worst or len(errors) > solution.guess.most_steps
        if motion.damped or worst <= _RESOLVED or stuck:
            return None
        self._worst = worst
        return solution.refined((errors > _RESOLVED).any(axis=1))


def _meets_itself(formulation: Formulation, certificate: Certificate) -> bool:
    """Whether self-collision, which was not looked at before, is the only violation."""
    problem = formulation.problem
    deferred = deferred_clearance(problem)
    if deferred is None or len(certificate.failures) != 1:
        return False
    # Findings of feeds come after those of constraints.
    feeds = sum(len(item.path.feeds) for item in problem.follows.items)
    findings = certificate.findings[: len(certificate.findings) - feeds]
    own = zip(reversed(problem.all_constraints), reversed(findings), strict=False)
    return any(item is deferred and not finding.satisfied for item, finding in own)


def _rough(formulation: Formulation, judged: Judged) -> bool:
    """Whether a required condition holds at the nodes, but not between them."""
    if judged.part.solution.violations or not judged.certificate.on_path:
        return False
    problem = formulation.problem
    deferred, requirements = deferred_clearance(problem), problem.requirements
    if deferred is not None:
        # It need not have been a constraint of the nodes.
        own = problem.requirement_of(deferred)
        requirements = tuple(item for item in requirements if item is not own)
    # The arm's own limits always apply.
    required = {item.name for item in requirements} | set(LIMIT_NAMES[:2])
    nodes = judged.motion.trajectory.t
    # Rates are judged on both sides of a node; anything else that is wrong there stays so.
    return any(
        item.requirement in LIMIT_NAMES or item.time not in nodes
        for item in judged.certificate.findings
        if not item.satisfied and item.requirement in required
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
    by = _ByPath(formulation, tolerance)
    solution = refined(part.solution, by)
    certificate = certified(formulation, by.motion.trajectory, tolerance, part.ending)
    resolved = replace(part, solution=solution)
    return Judged(resolved, by.motion, solution.minimum_norm_evaluation, certificate)


def refined_both(
    solution: Solution, rival: Solution | None, progress: Progress
) -> tuple[Solution, float | None]:
    """Return a motion refined, and the cost of the one it is compared with, if that is sufficient.

    An interruption ends both as they are.
    """
    try:
        progress("refining", 1, 1)
        solution = settle(solution)
        if rival is not None and not solution.cut_short and not have_one_start(solution, rival):
            rival = settle(rival)
            if rival.cut_short:
                solution = solution.ended_by(rival.status)
            return solution, None if rival.violations else rival.outcome.cost
    except KeyboardInterrupt:
        solution = solution.ended_by(Status.INTERRUPTED)
    return solution, None
