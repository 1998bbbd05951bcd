"""The motion of a session on the first grid that holds the tolerance, with its certificate."""

from dataclasses import dataclass

import numpy as np

from selfmotion.basics import Progress
from selfmotion.certificate import LIMIT_NAMES, Certificate, Tolerance
from selfmotion.motion import Evaluation, Trajectory
from selfmotion.optimise import Status
from selfmotion.paper import MOST_HALVINGS
from selfmotion.planning.largest_part import LargestPart
from selfmotion.planning.session import Session
from selfmotion.planning.settings import FALLS, FINER, RESOLVED, ROUGH_GRIDS
from selfmotion.problem import Problem


@dataclass(frozen=True, eq=False)
class Finished:
    """A motion, the one at x = 0 on the same grid, and the check.

    Attributes
    ----------
    motion, still : Evaluation
    certificate : Certificate
    """

    motion: Evaluation
    still: Evaluation
    certificate: Certificate


def finish(
    problem: Problem, part: LargestPart, tolerance: Tolerance, progress: Progress
) -> Finished:
    """Return what there is on the first grid on which the motion holds the tolerance."""
    session = part.session
    finished: Finished | None = None
    coarse: Trajectory | None = None
    misses: list[float] = []
    roughs, first = 0, session.standing.steps
    for _ in range(MOST_HALVINGS):
        try:
            progress("checking", 1, 1)
            finished = _check(problem, session, tolerance, part.ending)
            if _meets_itself(problem, finished.certificate) and session.keep_off_itself():
                session.settle()
                continue
            rough = _rough(problem, finished, session)
            roughs += rough
            # Where no evaluations are left, finer grids change nothing.
            out = session.status is Status.MAX_EVALUATIONS
            spent = out or roughs > ROUGH_GRIDS or session.standing.steps > FINER * first
            if finished.certificate.on_path and (spent or not rough):
                break
            trajectory = finished.motion.trajectory
            # What damping costs stays on any grid: there, the motion stands when the tool does.
            if coarse is not None and _same(problem, coarse, trajectory, tolerance):
                break
            coarse = trajectory if finished.motion.damped else None
            # What is out of reach is so on any grid.
            check = finished.certificate
            misses.append(check.position_error.value + check.rotation_error.value)
            if coarse is None and len(misses) > 2 and misses[-1] > 0.5 * misses[-3]:
                break
            if session.standing.steps >= session.beginning.most_steps:
                break
            session.refine()
            if rough and not session.cut_short:
                session.minimize()
        except KeyboardInterrupt:
            session.end(Status.INTERRUPTED)
            break
    # No plan goes without a certificate, interrupted or not.
    return finished or _check(problem, session, tolerance, part.ending)


def _resolved(problem: Problem, session: Session, tolerance: Tolerance) -> Evaluation:
    """Return the motion, steps halved between whose nodes the tool was off the path."""
    allowed, before = np.array([tolerance.position, tolerance.rotation]), np.inf
    motion = session.motion()
    for _ in range(MOST_HALVINGS):
        errors = problem.errors_between(motion.trajectory) / allowed
        worst = float(errors.max())
        # Written so that NaN is no progress. Damping's error is not that of the steps.
        stuck = not worst < FALLS * before or len(errors) > session.beginning.most_steps
        if motion.damped or worst <= RESOLVED or stuck:
            break
        before = worst
        session.refine((errors > RESOLVED).any(axis=1))
        motion = session.motion()
    return motion


def _meets_itself(problem: Problem, certificate: Certificate) -> bool:
    """Whether nothing else is wrong than that the arm meets itself, which only the default asks."""
    asked = problem.own_collision is not None and len(certificate.failures) == 1
    return asked and not certificate.findings[-1].satisfied


def _rough(problem: Problem, finished: Finished, session: Session) -> bool:
    """Whether what was asked for and is kept at the nodes is not so between them."""
    if session.violations or not finished.certificate.on_path:
        return False
    asked = {item.name for item in problem.requirements}
    if problem.own_collision is not None:
        # Where only the default asks it, it was not asked of the nodes either.
        asked.discard(problem.requirements[-1].name)
    nodes = finished.motion.trajectory.t
    # Rates are judged on both sides of a node; anything else that is wrong there stays so.
    return any(
        item.requirement in LIMIT_NAMES or item.time not in nodes
        for item in finished.certificate.findings
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


def _check(problem: Problem, session: Session, tolerance: Tolerance, ending: str) -> Finished:
    motion = _resolved(problem, session, tolerance)
    certificate = problem.certify(motion.trajectory, tolerance, ending)
    return Finished(motion, session.still_evaluation(), certificate)
