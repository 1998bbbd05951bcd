"""The motion of a candidate on the first grid that holds the tolerance, with its certificate."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Progress
from selfmotion.certificate import LIMIT_NAMES, Certificate, Tolerance
from selfmotion.motion import Evaluation, Trajectory
from selfmotion.optimise import Status
from selfmotion.paper import MOST_HALVINGS
from selfmotion.planning.candidate import Candidate
from selfmotion.planning.largest_part import Part
from selfmotion.planning.settings import FALLS, FINER, RESOLVED, ROUGH_GRIDS
from selfmotion.problem import Problem


@dataclass(frozen=True, eq=False)
class Judged:
    """What a plan is made of: a motion along all of the path or a part of it, and its check.

    Attributes
    ----------
    part : Part
    motion, still : Evaluation
        The motion, and the minimum-norm one on the same grid.
    certificate : Certificate
    rival_cost : float or None
        That of the best motion from the chains of the search, where it keeps the constraints.
    """

    part: Part
    motion: Evaluation
    still: Evaluation
    certificate: Certificate
    rival_cost: float | None = None


def judge(problem: Problem, part: Part, tolerance: Tolerance, progress: Progress) -> Judged:
    """Return what there is on the first grid on which the motion holds the tolerance."""
    candidate = part.candidate
    judged: Judged | None = None
    coarse: Trajectory | None = None
    misses: list[float] = []
    roughs, first = 0, candidate.solution.steps
    for _ in range(MOST_HALVINGS):
        try:
            progress("checking", 1, 1)
            judged = _check(problem, part, tolerance)
            if _meets_itself(problem, judged.certificate) and candidate.keep_off_itself():
                candidate.settle()
                continue
            rough = _rough(problem, judged, candidate)
            roughs += rough
            # Where no evaluations are left, finer grids change nothing.
            out = candidate.status is Status.MAX_EVALUATIONS
            spent = out or roughs > ROUGH_GRIDS or candidate.solution.steps > FINER * first
            if judged.certificate.on_path and (spent or not rough):
                break
            trajectory = judged.motion.trajectory
            # What damping costs stays on any grid: there, the motion stands when the tool does.
            if coarse is not None and _same(problem, coarse, trajectory, tolerance):
                break
            coarse = trajectory if judged.motion.damped else None
            # What is out of reach is so on any grid.
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
    return judged or _check(problem, part, tolerance)


def _resolved(problem: Problem, candidate: Candidate, tolerance: Tolerance) -> Evaluation:
    """Return the motion, steps halved between whose nodes the tool was off the path."""
    allowed, before = np.array([tolerance.position, tolerance.rotation]), np.inf
    motion = candidate.evaluation()
    for _ in range(MOST_HALVINGS):
        errors = problem.errors_between(motion.trajectory) / allowed
        worst = float(errors.max())
        # Written so that NaN is no progress. Damping's error is not that of the steps.
        stuck = not worst < FALLS * before or len(errors) > candidate.most_steps
        if motion.damped or worst <= RESOLVED or stuck:
            break
        before = worst
        candidate.refine((errors > RESOLVED).any(axis=1))
        motion = candidate.evaluation()
    return motion


def _meets_itself(problem: Problem, certificate: Certificate) -> bool:
    """Whether nothing else is wrong than that the arm meets itself, which only the default asks."""
    asked = problem.own_collision is not None and len(certificate.failures) == 1
    return asked and not certificate.findings[-1].satisfied


def _rough(problem: Problem, judged: Judged, candidate: Candidate) -> bool:
    """Whether what was asked for and is kept at the nodes is not so between them."""
    if candidate.violations or not judged.certificate.on_path:
        return False
    asked = {item.name for item in problem.requirements}
    if problem.own_collision is not None:
        # Where only the default asks it, it was not asked of the nodes either.
        asked.discard(problem.requirements[-1].name)
    nodes = judged.motion.trajectory.t
    # Rates are judged on both sides of a node; anything else that is wrong there stays so.
    return any(
        item.requirement in LIMIT_NAMES or item.time not in nodes
        for item in judged.certificate.findings
        if not item.satisfied and item.requirement in asked
    )


def _same(problem: Problem, coarse: Trajectory, fine: Trajectory, tolerance: Tolerance) -> bool:
    """Whether two motions put all that is followed in the same place in the prescribed rows."""
    pairs = list(zip(coarse(fine.t), fine.q, strict=True))
    misses = np.array(
        [
            item.miss(item.chain.place(first), second)
            for item in problem.follows.items
            for first, second in pairs
        ]
    )
    position, rotation = misses.max(axis=0)
    return bool(position <= tolerance.position and rotation <= tolerance.rotation)


def _check(problem: Problem, part: Part, tolerance: Tolerance) -> Judged:
    motion = _resolved(problem, part.candidate, tolerance)
    certificate = problem.certify(motion.trajectory, tolerance, part.ending)
    return Judged(part, motion, part.candidate.still_evaluation(), certificate)
