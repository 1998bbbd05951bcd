"""From what was found to the plan, and what is said of it."""

import time
from collections.abc import Sequence

import numpy as np

from selfmotion.basics import read_only
from selfmotion.certificate import Certificate
from selfmotion.optimise import Status
from selfmotion.planning.effort import Deadline
from selfmotion.planning.judge import Judged
from selfmotion.planning.planner import Planner
from selfmotion.result import Gap, Plan, Report
from selfmotion.search import SPACING


def gathered(planner: Planner, deadline: Deadline) -> Plan:
    """Return the plan.

    Raises
    ------
    KeyboardInterrupt
        The interruptions left no time for a proof.
    """
    judged = planner.judged
    if judged is None:
        raise KeyboardInterrupt
    part, motion, still, check = judged.part, judged.motion, judged.still, judged.certificate
    candidate = part.candidate
    if deadline.passed and candidate.status is Status.INTERRUPTED:
        candidate.end(Status.DEADLINE)
    counts, solution = candidate.effort.counts, candidate.solution
    status = status_of(candidate.status, check)
    report = Report(
        cost=motion.cost,
        initial_cost=still.cost,
        terms=motion.terms,
        initial_terms=still.terms,
        evaluations=counts.evaluations,
        gradient_evaluations=counts.gradients,
        jacobian_evaluations=counts.jacobians,
        steps=len(motion.trajectory.t) - 1,
        iterations=sum(iteration.step > 0.0 for iteration in candidate.history),
        history=tuple(candidate.history),
        status=status,
        message=message_of(
            status,
            candidate.violations,
            check,
            ending=part.ending,
            notes=planner.notes,
            published=planner.is_published,
        ),
        seconds=time.perf_counter() - planner.began,
        gap=_gap(planner, judged),
        ending=part.ending,
        active=solution.active,
        null_motion=solution.null_motion,
        remaining=solution.remaining,
        attempts=tuple(planner.attempts),
    )
    return Plan(
        problem=planner.problem.asked,
        trajectory=planner.problem.own(motion.trajectory),
        initial_trajectory=planner.problem.own(still.trajectory),
        coefficients=read_only(solution.coefficients),
        report=report,
        certificate=check,
    )


def _gap(planner: Planner, judged: Judged) -> Gap | None:
    """Compare a plan with what the global search knows; None where it knows nothing."""
    if not planner.sequences or judged.part.candidate is not planner.best:
        return None
    motion, rival, rival_cost = judged.motion, planner.rival, judged.rival_cost
    shortest = min((each.sequence for each in planner.sequences), key=lambda each: each.length)
    weights = planner.problem.robot.joint_weights
    if rival is not None and rival is planner.best and not rival.violations:
        rival_cost = motion.cost
    return Gap(
        cost=motion.cost,
        best_cost=rival_cost,
        length=float((weights * np.abs(np.diff(motion.trajectory(shortest.t), axis=0))).sum()),
        best_length=shortest.length,
        spacing=SPACING,
        sequences=len(planner.sequences),
    )


def status_of(status: Status, certificate: Certificate) -> Status:
    """Return how the optimisation ended; what the certificate finds kept is not infeasible."""
    kept = status is Status.INFEASIBLE and certificate.verified
    return Status.PRECISION if kept else status


def message_of(
    status: Status,
    violations: Sequence[str],
    certificate: Certificate,
    *,
    ending: str = "",
    notes: Sequence[str] = (),
    published: bool = False,
) -> str:
    """Return in words how the optimisation ended, and what came of it."""
    said = status.message
    if status is Status.GRADIENT and not certificate.on_path:
        least = certificate.smallest_singular_value
        said = (
            f"the motion passes a singular pose near t = {least.time:.4g} s (smallest singular "
            f"value {least.value:.2g}), next to which its cost cannot be lowered"
        )
    parts = [said] if status.is_cut_short or published or not violations else []
    if violations and certificate.verified:
        # Such as the clearance of bodies, whose convex hulls are planned with.
        parts.append(
            f"violated by the optimiser's bounds, kept by the motion: {'; '.join(violations)}"
        )
    elif violations and published:
        parts.append(
            f"the published method keeps nothing but given ends, and this is not kept: "
            f"{'; '.join(violations)}; without null_motion, optimizer and damping it is asked for"
        )
    elif violations:
        parts.append(f"not all constraints could be met: {'; '.join(violations)}")
    if certificate.failures and not (violations or ending):
        parts.append(f"but {certificate.verdict}")
    message = "; ".join(text for text in (ending, *parts, *notes) if text)
    if certificate.damped:
        stretches = " and ".join(map(str, certificate.damped))
        message += f"; the inverse was damped {stretches}"
    return message
