"""The steps of a plan: look, propose and optimise, judge; in this order, each with its condition.

A proposal is one or several initial guesses, cheap ones first. `Planner.take` optimises each and
keeps the best; a proposal is skipped where the present motion suffices. In the end the best is
judged, on finer grids until its certificate has no failure, or a part of it is.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np

from selfmotion.basics import (
    BreakdownError,
    InverseKinematicsError,
    NoSequenceError,
    SelfmotionError,
)
from selfmotion.certificate import arm_limits
from selfmotion.model.task import SE3
from selfmotion.planning.formulation import Formulation, deferred_clearance
from selfmotion.planning.planner.effort import Search
from selfmotion.planning.planner.grids import is_on_nodes
from selfmotion.planning.planner.guess import on_start
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.proposals import (
    VERY_LONG_PATH,
    is_long,
    keep_to_posture,
    may_stack,
    optimise_sequences,
    optimise_stacked,
    optimise_starts,
    optimise_where_it_breaks,
)
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.planner.verdicts import (
    free_by_meshes,
    judge_as_it_is,
    judge_incumbent,
    judge_part,
)
from selfmotion.planning.result import Attempt
from selfmotion.planning.search import Obstruction, obstruction

# Step that checks single poses first, and its outcome where all are within reach.
LOOK_AT_POSES, NOTHING_IN_THE_WAY = "look at single poses", "nothing is in the way"
_WHERE_IT_BREAKS = "starts where it breaks"


def go_through(planner: Planner) -> None:
    """Try everything that applies, in order.

    An interruption ends one step; of those after it, the ones that apply to the best so far are
    done.

    Raises
    ------
    SelfmotionError
        There is no motion.
    KeyboardInterrupt
        The interruption came before there was a complete motion.
    """
    for name, step in STEPS:
        began = time.perf_counter()
        try:
            tried = step(planner)
        except KeyboardInterrupt:
            planner.interrupted()
            tried = True
        if tried:
            seconds = time.perf_counter() - began
            planner.attempts.append(Attempt(name, *_outcome(planner), seconds))


def _outcome(planner: Planner) -> tuple[str, float | None]:
    """Return the best motion in words, and its cost."""
    judged, best = planner.judged, planner.incumbent
    if judged is not None:
        parts = (judged.part.ending, judged.certificate.verdict)
        return "; ".join(text for text in parts if text), judged.motion.cost
    if best is not None:
        wrong = "; ".join(best.violations)
        if wrong:
            return f"not all constraints are met: {wrong}", best.outcome.cost
        itself = "" if best.outcome.keeps_off_itself else ", but the arm meets itself"
        return f"all constraints are met{itself}", best.outcome.cost
    if planner.failure is not None:
        return str(planner.failure), None
    return planner.blocked.reason if planner.blocked else NOTHING_IN_THE_WAY, None


def _look_first(planner: Planner) -> bool:
    """Check whether the arm can reach some single poses, before anything is known."""
    if not planner.setup.is_free or planner.setup.has_motion:
        return False
    blocked = planner.blocked = _looked_at(planner.formulation, planner.setup.search)
    if blocked is not None:
        # Planning the rest takes many times as long as this message.
        planner.setup.progress(f"no motion passes t = {blocked.time:.6g} s: {blocked.reason}", 0, 0)
    return True


def _plan_before_blocked_pose(planner: Planner) -> bool:
    """Plan the part before a pose that is out of reach."""
    blocked = planner.blocked
    if blocked is None or blocked.is_met:
        return False
    told = blocked.help.removeprefix("; ")
    planner.notes += [told] if told else []
    try:
        found = judge_part(planner, blocked.time)
    except InverseKinematicsError:
        found = False
    if not found:
        raise _obstruction_error(planner.formulation, blocked)
    return True


def _follow_guide(planner: Planner) -> bool:
    """Optimise from a motion that is known."""
    guide = planner.setup.guide
    if guide is None:
        return False
    guess = planner.guess(guide.start, free=planner.setup.is_free, guide=guide)
    if guess is not None:
        planner.take(guess)
    return True


def _warm_start_at_plan(planner: Planner) -> bool:
    """Optimise from a plan of this problem or of one like it, if it leads to a motion."""
    plan = planner.setup.warm_start
    if plan is None or not planner.setup.is_free:
        return False
    try:
        start = on_start(planner.formulation, plan.trajectory.q[0])
    except InverseKinematicsError as error:
        planner.failure = error
        return True
    guess = planner.guess(start, free=True)
    if guess is not None:
        planner.setup.progress("warm start", 1, 1)
        planner.take(guess.with_plan(plan))
    return True


def _keep_to_posture(planner: Planner) -> bool:
    """Optimise from motions in the best postures of a segment, on a very long path."""
    return planner.formulation.length_in_reaches > VERY_LONG_PATH and _try_postures(planner)


def _from_given_start(planner: Planner) -> bool:
    """Optimise from the start that is given."""
    start = planner.formulation.given_start
    if start is None or not (planner.is_sought and planner.is_unmet):
        return False
    guess, plan = planner.guess(start, free=False), planner.setup.warm_start
    if guess is not None:
        planner.take(guess if plan is None else guess.with_plan(plan))
    return True


def _draw_starts(planner: Planner) -> bool:
    """Optimise from the best of starts that are drawn."""
    search, draws = planner.setup.search, planner.setup.takes_starts
    if not (planner.is_sought and draws and (planner.is_unmet or search.compare)):
        return False
    optimise_starts(planner, search.starts, search.finalists)
    return True


def _compare_postures(planner: Planner) -> bool:
    """Do so on a path that is long, where it may lead to a better motion than other starts."""
    return planner.formulation.length_in_reaches <= VERY_LONG_PATH and _try_postures(planner)


def _try_postures(planner: Planner) -> bool:
    wanted = planner.is_unmet or not planner.setup.has_motion
    possible = is_long(planner) and (planner.setup.takes_starts or not planner.setup.is_free)
    if not (planner.is_sought and wanted and possible):
        return False
    keep_to_posture(planner)
    return True


def _stack_rows(planner: Planner) -> bool:
    """Optimise from motions that keep limits and quantities as rows of their task."""
    wanted = planner.is_sought and planner.is_unmet
    begins = planner.setup.takes_starts or not planner.setup.is_free
    if not (wanted and begins and is_on_nodes(planner.formulation, planner.effort)):
        return False
    if not may_stack(planner) or planner.is_out_of_reach():
        return False
    return optimise_stacked(planner, planner.setup.search.finalists)


def _judge_on_meshes(planner: Planner) -> bool:
    """Take a motion that bodies' hulls forbid where their meshes do not."""
    if planner.incumbent is None or not planner.is_sought:
        return False
    tried = False
    for solution in free_by_meshes(planner):
        tried = True
        if judge_as_it_is(planner, solution) and planner.judged is not None:
            planner.incumbent = planner.judged.part.solution
        if not planner.is_sought:
            break
    return tried


def _decompose_links(planner: Planner) -> bool:
    """Optimise again with links in convex pieces, where only their hulls meet something."""
    search, effort = planner.setup.search, planner.effort
    if effort.decomposed or not (planner.is_sought and planner.is_unmet):
        return False
    best = next(free_by_meshes(planner, just=True), None)
    if best is None:
        return False
    planner.effort = replace(effort, decomposed=True)
    known = best.evaluation.trajectory
    guess = planner.guess(known.q[0], free=best.guess.free, motion=known)
    if guess is not None:
        planner.take(guess)
    if planner.is_unmet and planner.setup.takes_starts and not planner.is_over:
        optimise_starts(planner, search.starts, search.finalists)
    return True


def _draw_where_it_breaks(planner: Planner) -> bool:
    """Draw configurations where the best motion breaks something most, or where none goes on."""
    best, failure, search = planner.incumbent, planner.failure, planner.setup.search
    wanted = planner.is_sought and planner.setup.takes_starts and planner.is_unmet
    if (
        not (wanted and is_on_nodes(planner.formulation, planner.effort))
        or planner.is_out_of_reach()
    ):
        return False
    if best is None and not isinstance(failure, BreakdownError):
        return False
    # Conditions on ends and self-collision have no time: others do.
    at = best.outcome.breaks_at if best is not None else cast(BreakdownError, failure).time
    optimise_where_it_breaks(planner, at or 0.0, search.starts, search.finalists)
    return True


def _search_globally(planner: Planner) -> bool:
    """Optimise from the best chains of configurations over all self-motions."""
    wanted = planner.setup.search.compare or (planner.setup.chooses_globally and planner.is_unmet)
    can = planner.setup.is_searchable and (planner.setup.is_free or planner.incumbent)
    if not (planner.is_sought and wanted and can) or planner.is_out_of_reach():
        return False
    optimise_sequences(planner, chosen=planner.setup.chooses_globally)
    return True


def _plan_largest_part(planner: Planner) -> bool:
    """Plan the largest part, where there is no motion, or poses are out of reach.

    No other motion on finer grids would be better then.
    """
    best, failure = planner.incumbent, planner.failure
    if best is not None:
        is_damped = planner.formulation.problem.damping_law is not None
        short = planner.is_sought and _may_meet_more(best) and not is_damped
        if short and planner.reach().reason:
            judge_part(planner)
            return True
        return False
    if planner.judged is not None:
        return False
    if failure is None:
        raise RuntimeError("each start leads to a motion or to an error")
    if not isinstance(failure, BreakdownError | NoSequenceError):
        raise failure
    # Chains of configurations end at obstacles and step limits as well: these stay errors.
    blocked = isinstance(failure, NoSequenceError) and not planner.reach(failure.time).reason
    if blocked:
        raise failure
    if not judge_part(planner, failure.time):
        reason = planner.reach(failure.time).reason
        if isinstance(failure, BreakdownError) and reason:
            raise BreakdownError(
                f"{planner.formulation.robot.name}: {reason}; and of the path before that no "
                f"part was found that can be followed; start elsewhere (start=), or move the path",
                time=failure.time,
            ) from failure
        raise failure
    return True


def _may_meet_more(best: Solution) -> bool:
    return bool(best.violations) and not best.is_spent


def _judge(planner: Planner) -> bool:
    """Go on to finer grids, until the certificate finds nothing wrong."""
    if planner.incumbent is None or planner.judged is not None:
        return False
    judge_incumbent(planner, planner.incumbent)
    return True


def _plan_part_instead(planner: Planner) -> bool:
    """Plan the largest part where a motion along all of the path is off it, or past limits."""
    best, judged = planner.incumbent, planner.judged
    if best is None or judged is None or best is not judged.part.solution:
        return False
    check = judged.certificate
    # With damping the motion goes on off the path, as requested.
    if best.is_spent or planner.formulation.problem.damping_law is not None:
        return False
    out_of_limits = bool(best.violations) and check.limit_margin.value < 0.0
    suspect = check.position_error.time
    # Where single poses are in reach, constraints that are not met say more than a part.
    if (check.on_path and not out_of_limits) or not planner.reach(suspect).reason:
        return False
    judge_part(planner, suspect)
    return True


def _draw_where_proof_fails(planner: Planner) -> bool:
    """Draw configurations where the proof fails, if nothing was known to break there before."""
    best, judged, search = planner.incumbent, planner.judged, planner.setup.search
    if best is None or judged is None or best is not judged.part.solution or best.is_spent:
        return False
    fails_at, known = judged.fails_at, {item.name for item in planner.attempts}
    if fails_at is None or _WHERE_IT_BREAKS in known or not planner.setup.takes_starts:
        return False
    if not is_on_nodes(planner.formulation, planner.effort) or planner.is_out_of_reach():
        return False
    planner.incumbent = planner.judged = None
    try:
        optimise_where_it_breaks(planner, fails_at, search.starts, search.finalists)
        found = planner.incumbent
        if found is not None and found.will_do:
            judge_incumbent(planner, found)
    finally:
        found = planner.incumbent
        if planner.judged is None or not planner.judged.certificate.verified:
            planner.incumbent, planner.judged = best, judged
            if found is not None and found.cut_short:
                planner.end(found.status)
    return True


def _find_obstruction(planner: Planner) -> bool:
    """Find the obstruction of a motion that is not verified: whether single poses are reachable."""
    judged, formulation = planner.judged, planner.formulation
    if judged is None or judged.certificate.verified or judged.part.solution.cut_short:
        return False
    if not planner.effort.keeps_conditions:
        return False
    if judged.part.ending or judged.fails_at is None:
        return False
    failure = planner.failure
    if isinstance(failure, NoSequenceError):
        planner.stops = str(failure).removeprefix(f"{formulation.robot.name}: ")
        return True
    rng = np.random.default_rng(planner.setup.search.rng)
    blocked = obstruction(formulation, rng, judged.fails_at)
    if blocked is not None:
        planner.stops = _passing(blocked)
    elif planner.setup.is_free:
        planner.advice = (
            "the arm can be at each pose that was looked at, but no motion was found that joins "
            "them: plan it in parts (plan_in_parts, parts = true in files)"
        )
    else:
        planner.advice = (
            "the arm can be at each pose that was looked at: another start may do (start=None)"
        )
    return True


def _passing(blocked: Obstruction) -> str:
    return (
        f"no motion along the path passes t = {blocked.time:.6g} s: {blocked.reason}{blocked.help}"
    )


# Names as in reports; each function returns whether it was tried.
STEPS: tuple[tuple[str, Callable[[Planner], bool]], ...] = (
    # Single poses first: a failure before anything is planned.
    (LOOK_AT_POSES, _look_first),
    ("part before a pose out of reach", _plan_before_blocked_pose),
    # Propose and optimise until one suffices.
    ("motion that is known", _follow_guide),
    ("warm start", _warm_start_at_plan),
    ("posture of a stretch", _keep_to_posture),
    ("given start", _from_given_start),
    ("starts", _draw_starts),
    ("postures compared", _compare_postures),
    ("conditions as rows", _stack_rows),
    ("proof on meshes", _judge_on_meshes),
    ("links in pieces", _decompose_links),
    (_WHERE_IT_BREAKS, _draw_where_it_breaks),
    ("global search", _search_globally),
    # Judge.
    ("largest part", _plan_largest_part),
    ("finer grids and proof", _judge),
    ("largest part instead", _plan_part_instead),
    ("starts where the proof fails", _draw_where_proof_fails),
    ("what stops it", _find_obstruction),
)


def _looked_at(formulation: Formulation, search: Search) -> Obstruction | None:
    """Return an unreachable pose; None if all sampled ones are reachable.

    Also None where the motion can go on: damped motions leave their path, and self-collision under
    the default clearance is not required.

    Raises
    ------
    InverseKinematicsError
        It is the first pose, which is out of reach.
    NoSequenceError
        Bodies with a required clearance are met there.
    """
    if formulation.problem.damping_law is not None:
        return None
    blocked = obstruction(formulation, np.random.default_rng(search.rng))
    if blocked is None:
        return None
    if blocked.is_met and deferred_clearance(formulation.problem) is not None:
        return blocked
    if blocked.is_met or blocked.time == 0.0:
        raise _obstruction_error(formulation, blocked)
    return blocked


def _is_in_own_reach(formulation: Formulation, pose: SE3) -> bool:
    """Whether required limits, and not the arm's own, exclude a pose."""
    problem = formulation.problem
    if any(item.order == 0 for item in arm_limits(problem.robot, problem.requirements)):
        # Nothing is asked of positions, but what the arm's own limits are.
        return False
    try:
        problem.robot.inverse_kinematics(pose, problem.task)
    except InverseKinematicsError:
        return False
    return True


def _obstruction_error(formulation: Formulation, blocked: Obstruction) -> SelfmotionError:
    """Return the error with the obstruction and remedies."""
    robot, pose = formulation.robot, formulation.path.pose(blocked.time)
    task = formulation.problem.task.value
    if not blocked.is_met and blocked.time == 0.0:
        position, rotation = blocked.errors
        remedy = "move the pose into the workspace"
        if _is_in_own_reach(formulation, pose):
            remedy = "the arm's own limits let it be there: widen JointPositionLimits"
        return InverseKinematicsError(
            f"{robot.name}: no configuration within the limits puts '{robot.tool}' at "
            f"{np.round(pose.translation, 4).tolist()} m for task '{task}', where "
            f"the path begins: {blocked.reason}; {remedy}{blocked.help}",
            position_miss=position,
            rotation_miss=rotation,
        )
    return NoSequenceError(
        f"{robot.name}: {_passing(blocked)}",
        time=blocked.time,
        reason=blocked.reason,
    )
