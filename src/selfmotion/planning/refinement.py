"""Finer grids and more freedom of the null motion, until these save nothing."""

from dataclasses import replace

import numpy as np

from selfmotion.basics import Progress
from selfmotion.motion import NullMotion
from selfmotion.optimise import Status
from selfmotion.planning.session import Session
from selfmotion.planning.settings import COST_AGREEMENT, RISE, RISES, ROUGH_AGREEMENT
from selfmotion.planning.standing import relative_change

# After these there is nothing to go on from.
_ADRIFT = (Status.UNBOUNDED, Status.GRADIENT)


def settle_both(best: Session, rival: Session | None, progress: Progress) -> float | None:
    """Settle a motion, and what it is compared with; return what the latter costs, if it will do.

    An interruption ends both as they are.
    """
    try:
        progress("finer grid", 1, 1)
        settle(best)
        if rival is not None and rival is not best and not best.cut_short:
            settle(rival)
            if rival.cut_short:
                best.end(rival.status)
            return None if rival.violations else rival.standing.cost
    except KeyboardInterrupt:
        best.end(Status.INTERRUPTED)
    return None


def settle(session: Session) -> None:
    """Optimise until finer grids and more freedom of the null motion save nothing.

    What freedom is wanted is found on a coarse grid, where it costs little.
    """
    if session.on_nodes is not None or session.take_nodes():
        session.settle_nodes()
        return
    error = _refine_until(session, ROUGH_AGREEMENT)
    coarse = session.standing.cost
    enriched = _enriched(session)
    if enriched or error > COST_AGREEMENT:
        _refine_until(session, COST_AGREEMENT)
    if enriched or abs(session.standing.cost - coarse) > ROUGH_AGREEMENT * abs(coarse):
        while _enriched(session):
            _refine_until(session, COST_AGREEMENT)


def _refine_until(session: Session, agreement: float) -> float:
    """Optimise on halved grids until the cost agrees with that of the one before.

    Return how well it does, as a share of the cost; 0 where no finer grid would help.
    """
    rises, error = 0, 0.0
    while session.standing.steps < session.beginning.most_steps:
        if session.is_spent or session.status in _ADRIFT:
            return 0.0
        unmet, before = bool(session.violations), session.standing.cost
        session.refine()
        after = session.standing.cost
        error = relative_change(before, after)
        # A cost that grows and grows, and what two grids in turn could not meet: the path runs
        # past the edge of the workspace between their nodes, or limits are too tight.
        rises = rises + 1 if after > RISE * abs(before) else 0
        if rises == RISES:
            return 0.0
        session.minimize()
        if unmet and session.violations:
            return 0.0
        # The optimum agrees, too: a motion that a coarse grid praises may be none on this one.
        error = max(error, relative_change(before, session.standing.cost))
        if error <= agreement:
            break
    return error


def _enriched(session: Session) -> bool:
    """Give the null motion more freedom if that pays, and know what is left; return whether."""
    if session.violations or session.is_spent or session.status in _ADRIFT:
        return False
    problem, rolled = session.beginning.problem, session.rolled
    wanted = problem.null_motion
    left = rolled.left(bound=session.bound)
    session.rolled = rolled = replace(rolled, remaining=left.most)
    enough = wanted.gain * abs(rolled.cost)
    if left.most <= enough:
        return False
    rows = rolled.objective.null_motion.rows
    finer = wanted.finer(left.intervals(0.5 * enough), rows, any(problem.rests))
    # Only what can be what the present one is: around that, fewer functions may look enough.
    if _functions(finer) <= _functions(rolled.null_motion):
        return False
    session.rolled = rolled.with_null_motion(finer)
    session.minimize()
    return True


def _functions(motion: NullMotion) -> int:
    """Return how many functions a null motion has."""
    return int(motion.functions(np.zeros(1), 1.0).shape[1])
