"""What is tried, in what order, and when: the list that a plan goes through."""

import time
from collections.abc import Callable

from selfmotion.basics import BreakdownError, InverseKinematicsError, NoSequenceError
from selfmotion.planning.draft import Draft
from selfmotion.planning.long_paths import is_long, keep_to_posture
from selfmotion.planning.refusal import looked_at, no_way
from selfmotion.planning.sequences import optimise_sequences
from selfmotion.planning.session import Session
from selfmotion.planning.settings import SECOND_EFFORT, VERY_LONG_WAY
from selfmotion.planning.starts import optimise_starts
from selfmotion.planning.warm_start import on_start
from selfmotion.result import Attempt
from selfmotion.search import guides


def go_through(draft: Draft) -> None:
    """Try everything that applies, in order.

    An interruption ends one attempt; of those after it, what applies to the best so far is done.

    Raises
    ------
    SelfmotionError
        There is no motion.
    KeyboardInterrupt
        The interruption came before there was a complete motion.
    """
    for name, attempt in ATTEMPTS:
        began = time.perf_counter()
        try:
            tried = attempt(draft)
        except KeyboardInterrupt:
            draft.interrupted()
            tried = True
        if tried:
            seconds = time.perf_counter() - began
            draft.attempts.append(Attempt(name, *_outcome(draft), seconds))


def _outcome(draft: Draft) -> tuple[str, float | None]:
    """Return in words what stands, and what it costs."""
    proved, best = draft.proved, draft.best
    if proved is not None:
        parts = (proved.part.ending, proved.finished.certificate.verdict)
        return "; ".join(text for text in parts if text), proved.finished.motion.cost
    if best is not None:
        wrong = "; ".join(best.violations)
        if wrong:
            return f"not all constraints are met: {wrong}", best.standing.cost
        itself = "" if best.standing.keeps_off_itself else ", but the arm meets itself"
        return f"all constraints are met{itself}", best.standing.cost
    if draft.failure is not None:
        return str(draft.failure), None
    return draft.blocked.reason if draft.blocked else "nothing is in the way", None


def _look(draft: Draft) -> bool:
    """Look whether the arm can be at some single poses at all, where nothing is known yet."""
    known = draft.known
    if not draft.is_free or known.plan is not None or known.guide is not None:
        return False
    blocked = draft.blocked = looked_at(draft.problem, draft.search)
    if blocked is not None:
        # What can be planned all the same takes many times as long as the 'no'.
        draft.progress(f"no motion passes t = {blocked.time:.6g} s: {blocked.reason}", 0, 0)
    return True


def _plan_before_blocked_pose(draft: Draft) -> bool:
    """Plan what comes before a pose that is out of reach."""
    blocked = draft.blocked
    if blocked is None or blocked.is_met:
        return False
    told = blocked.help.removeprefix("; ")
    draft.notes += [told] if told else []
    try:
        found = draft.prove_part(blocked.time)
    except InverseKinematicsError:
        found = False
    if not found:
        raise no_way(draft.problem, blocked)
    return True


def _follow_guide(draft: Draft) -> bool:
    """Optimise from a motion that is known."""
    guide = draft.known.guide
    if guide is None:
        return False
    session = draft.begin(guide.start, free=draft.is_free, guide=guide)
    if session is not None:
        draft.optimise(session)
    return True


def _begin_at_plan(draft: Draft) -> bool:
    """Optimise from a plan of this problem or of one like it, if it leads to a motion."""
    plan = draft.known.plan
    if plan is None or not draft.is_free:
        return False
    try:
        start = on_start(draft.problem, plan.trajectory.q[0])
    except InverseKinematicsError as error:
        draft.failure = error
        return True
    session = draft.begin(start, free=True)
    if session is not None:
        session.adopt(plan)
        draft.progress("warm start", 1, 1)
        draft.optimise(session)
    return True


def _keep_to_posture(draft: Draft) -> bool:
    """Optimise from motions in the postures that are best on a stretch, on a very long path."""
    return draft.problem.way_in_reaches > VERY_LONG_WAY and _try_postures(draft)


def _begin_at_start(draft: Draft) -> bool:
    """Optimise from the start that is given."""
    start = draft.problem.given_start
    if start is None or not (draft.is_sought and draft.is_unmet):
        return False
    session = draft.begin(start, free=False)
    if session is not None:
        if draft.known.plan is not None:
            session.adopt(draft.known.plan)
        draft.optimise(session)
    return True


def _draw_starts(draft: Draft) -> bool:
    """Optimise from the best of starts that are drawn."""
    search = draft.search
    if not (draft.is_sought and draft.takes_starts and (draft.is_unmet or search.compare)):
        return False
    optimise_starts(draft, search.starts, search.finalists)
    return True


def _compare_postures(draft: Draft) -> bool:
    """Do so on a path that is long, where it may lead to a better motion than other starts."""
    return draft.problem.way_in_reaches <= VERY_LONG_WAY and _try_postures(draft)


def _try_postures(draft: Draft) -> bool:
    known = draft.known
    nothing = known.plan is None and known.guide is None
    wanted = draft.is_unmet or nothing
    possible = is_long(draft) and (draft.takes_starts or not draft.is_free)
    if not (draft.is_sought and wanted and possible):
        return False
    keep_to_posture(draft)
    return True


def _prove_on_meshes(draft: Draft) -> bool:
    """Take a motion that bodies' hulls forbid where their meshes do not."""
    if draft.best is None or not draft.is_sought or not draft.is_free_by_meshes():
        return False
    draft.prove_as_it_is(draft.best)
    return True


def _search_globally(draft: Draft) -> bool:
    """Optimise from the best chains of configurations over all self-motions."""
    wanted = draft.search.compare or (draft.chooses_globally and draft.is_unmet)
    can = draft.is_searchable and (draft.is_free or draft.best)
    if not (draft.is_sought and wanted and can) or draft.is_out_of_reach():
        return False
    optimise_sequences(draft, guides, chosen=draft.chooses_globally)
    return True


def _draw_more_starts(draft: Draft) -> bool:
    """Draw many more starts; they do not help where the search knows that nothing will."""
    search, more = draft.search, SECOND_EFFORT
    wanted = draft.is_unmet and not draft.notes
    if not (draft.is_sought and draft.takes_starts and wanted) or draft.is_out_of_reach():
        return False
    optimise_starts(draft, more * search.starts, more * search.finalists)
    return True


def _plan_largest_part(draft: Draft) -> bool:
    """Plan the part that can be followed, where there is no motion, or poses are out of reach.

    No other motion on finer grids would be better then.
    """
    best, failure = draft.best, draft.failure
    if best is not None:
        short = draft.is_sought and _may_meet_more(best) and draft.problem.damping is None
        if short and draft.reach().reason:
            draft.prove_part()
            return True
        return False
    if draft.proved is not None:
        return False
    if failure is None:
        raise RuntimeError("each start leads to a motion or to an error")
    if not isinstance(failure, BreakdownError | NoSequenceError):
        raise failure
    # Chains of configurations end at obstacles and step limits as well: these stay errors.
    blocked = isinstance(failure, NoSequenceError) and not draft.reach(failure.time).reason
    if blocked or not draft.prove_part(failure.time):
        raise failure
    return True


def _may_meet_more(best: Session) -> bool:
    return bool(best.violations) and not best.is_spent


def _prove(draft: Draft) -> bool:
    """Go on to finer grids, until the certificate finds nothing wrong."""
    if draft.best is None or draft.proved is not None:
        return False
    draft.prove(draft.best)
    return True


def _plan_part_instead(draft: Draft) -> bool:
    """Plan the largest part where a motion along all of the path is off it, or past limits."""
    best, proved = draft.best, draft.proved
    if best is None or proved is None or best is not proved.part.session:
        return False
    check = proved.finished.certificate
    # With damping the motion goes on where the path cannot be followed: so it was asked for.
    if best.is_spent or draft.problem.damping is not None:
        return False
    out_of_limits = bool(best.violations) and check.limit_margin.value < 0.0
    suspect = check.position_error.time
    # Where single poses are in reach, constraints that are not met say more than a part.
    if (check.on_path and not out_of_limits) or not draft.reach(suspect).reason:
        return False
    draft.prove_part(suspect)
    return True


# By name, as reports have it; each says whether it was tried.
ATTEMPTS: tuple[tuple[str, Callable[[Draft], bool]], ...] = (
    ("look at single poses", _look),
    ("part before a pose out of reach", _plan_before_blocked_pose),
    ("motion that is known", _follow_guide),
    ("warm start", _begin_at_plan),
    ("posture of a stretch", _keep_to_posture),
    ("given start", _begin_at_start),
    ("starts", _draw_starts),
    ("postures compared", _compare_postures),
    ("proof on meshes", _prove_on_meshes),
    ("global search", _search_globally),
    ("more starts", _draw_more_starts),
    ("largest part", _plan_largest_part),
    ("finer grids and proof", _prove),
    ("largest part instead", _plan_part_instead),
)
