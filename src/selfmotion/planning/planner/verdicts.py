"""Let a motion be judged: the best one, others as they are, and parts of the path."""

from collections.abc import Iterator
from dataclasses import replace

from selfmotion.planning.planner.judging import Judged, judge, refined_both
from selfmotion.planning.planner.largest_part import Part, largest_part, shorter_part
from selfmotion.planning.planner.planner import Planner
from selfmotion.planning.planner.solution import Solution
from selfmotion.planning.planner.solve import at_warm_start

# Evaluations of the cost on each of several parts of the path.
_PART_EVALUATIONS = 150
# The same with a free start: the start with the largest part is among many.
_FREE_PART_EVALUATIONS = 30
# Largest number of shorter parts where the end of one is too rough.
_SHORTER_PARTS = 3


def judge_incumbent(planner: Planner, incumbent: Solution) -> None:
    """Judge the best motion, on grids that are fine enough."""
    own = planner.setup
    best, rival_cost = refined_both(incumbent, planner.rival, own.progress)
    judged = judge(own.formulation, Part(own.formulation, best), own.tolerance, own.progress)
    planner.judged = replace(judged, rival_cost=rival_cost)
    planner.incumbent = best = judged.part.solution
    if judged.certificate.verified:
        return
    known = [at_warm_start(best.guess)]
    if best.cut_short:
        # An iterate on the way to an optimum may violate more than earlier motions.
        known += [planner.runner_up, Solution.of(best.guess)]
    for one in filter(None, known):
        # What was evaluated is reported, whichever motion it led to.
        told = replace(one, history=one.history or best.history)
        if judge_as_it_is(planner, told.ended_by(best.status) if best.cut_short else told):
            return


def judge_as_it_is(planner: Planner, solution: Solution) -> bool:
    """Let a motion be the plan's if it is verified; return whether it is.

    An interruption while it is judged ends the plan, also where the motion is not taken.
    """
    own = planner.setup
    judged = judge(own.formulation, Part(own.formulation, solution), own.tolerance, own.progress)
    ended = judged.part.solution
    if judged.certificate.verified:
        planner.judged = judged
    elif ended.cut_short and not planner.is_over:
        planner.end(ended.status)
    return judged.certificate.verified


def judge_part(planner: Planner, suspect: float = 0.0) -> bool:
    """Judge the largest part, with more poses about a time [s]; return whether there is one."""
    own, effort = planner.setup, planner.effort
    if effort.max_evaluations is None:
        most = _FREE_PART_EVALUATIONS if own.is_free else _PART_EVALUATIONS
        effort = replace(effort, max_evaluations=most)
    known = planner.reach(suspect)
    own.progress("longest part that can be followed", 1, 1)
    found = largest_part(own.formulation, known, effort)
    if found is None:
        return False

    def judged(part: Part) -> Judged:
        refined, _ = refined_both(part.solution, None, own.progress)
        return judge(own.formulation, replace(part, solution=refined), own.tolerance, own.progress)

    # What was judged before is the plan until then: an interruption finds it.
    planner.judged = last = judged(found)
    for _ in range(_SHORTER_PARTS):
        # Besides that it ends, nothing should be wrong with a part.
        if len(last.certificate.failures) < 2 or last.part.solution.cut_short:
            break
        if (shorter := shorter_part(own.formulation, found, effort)) is None:
            break
        found = shorter
        last = judged(found)
        if len(last.certificate.failures) < 2:
            planner.judged = last
        elif last.part.solution.cut_short:
            best = planner.judged.part
            ended = best.solution.ended_by(last.part.solution.status)
            planner.judged = replace(planner.judged, part=replace(best, solution=ended))
    return True


def free_by_meshes(planner: Planner, *, just: bool = False) -> Iterator[Solution]:
    """Yield solutions whose meshes are apart, though their hulls are not.

    The best first; apart by the required distance, or `just` apart. Without any motion that
    satisfies all, one whose hulls overlap slightly may be the only one whose meshes do not.
    """
    if not planner.is_unmet:
        return
    bodies = planner.formulation.envelope.bodies
    if all(model.is_all_convex for model, _ in bodies):
        return
    for solution in sorted(planner.broken, key=Solution.score):
        q = solution.evaluation.trajectory.q[:, : planner.formulation.robot.dof]
        if all(model.worst(q).value >= (0.0 if just else far) for model, far in bodies):
            yield solution
