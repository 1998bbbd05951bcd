"""Finer grids, until these save nothing."""

from selfmotion.basics import Progress
from selfmotion.optimise import Status
from selfmotion.planning.session import Session


def settle_both(best: Session, rival: Session | None, progress: Progress) -> float | None:
    """Settle a motion, and what it is compared with; return what the latter costs, if it will do.

    An interruption ends both as they are.
    """
    try:
        progress("finer grid", 1, 1)
        best.settle()
        if rival is not None and rival is not best and not best.cut_short:
            rival.settle()
            if rival.cut_short:
                best.end(rival.status)
            return None if rival.violations else rival.standing.cost
    except KeyboardInterrupt:
        best.end(Status.INTERRUPTED)
    return None
