"""The list of facts: a new one is a line here, and is on the terminal, page, sheet and in JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from selfmotion.certificate import LIMIT_NAMES, Certificate, Extreme, Finding
from selfmotion.model.robot import Dynamics, RobotModel, has_masses
from selfmotion.planning.result import Plan, Report
from selfmotion.shell.facts.fact import Fact
from selfmotion.work.job import Program
from selfmotion.work.margins import Margins

# Samples at which a power is measured.
_SAMPLES = 400
# Number of longest moves that are reported.
_LONGEST = 3


def certificate_facts(
    certificate: Certificate, approaches: Mapping[str, Extreme], robot: RobotModel
) -> list[Fact]:
    """Return what a certificate has found, with how near bodies come."""
    nearest = certificate.limit_margin
    unit = robot.unit_of(*({nearest.name} & set(robot.joint_names)))
    return [
        *Fact.worst("position error", certificate.position_error, "m", "path"),
        *Fact.worst("rotation error", certificate.rotation_error, "rad", "path"),
        *(
            fact
            for position, rotation in certificate.others
            for fact in (
                *Fact.worst(f"position error of {position.name}", position, "m", "path"),
                *Fact.worst(f"rotation error of {rotation.name}", rotation, "rad", "path"),
            )
        ),
        *(
            replace(fact, remark="as allowed")
            for worst in certificate.deviations
            for fact in Fact.worst(
                f"off the path, as relaxed {worst.name}",
                replace(worst, name=""),
                "rad" if "r" in worst.name else "m",
                "path",
            )
        ),
        *Fact.worst("smallest singular value", certificate.smallest_singular_value, "", "path"),
        *Fact.worst("margin to joint limits", nearest, unit, "motion"),
        *Fact.worst("speed", certificate.velocity_ratio, "of its limit", "motion"),
        *Fact.worst("acceleration", certificate.acceleration_ratio, "of its limit", "motion"),
        *(
            fact
            for name, near in approaches.items()
            for fact in Fact.worst(f"closest to {name}", near, "m", "near")
        ),
        *([] if approaches else Fact.worst("clearance", certificate.clearance, "m", "near")),
        *finding_facts(certificate, robot),
        Fact("joint distance, end to start", certificate.closure, robot.unit_of(), group="motion"),
        Fact("checked at", f"{certificate.samples} times", remark="by forward kinematics"),
    ]


def finding_facts(certificate: Certificate, robot: RobotModel) -> list[Fact]:
    """Return what each requirement has found."""
    return [_found(item, robot) for item in certificate.findings]


def _found(finding: Finding, robot: RobotModel) -> Fact:
    name, unit, allowed = finding.requirement, finding.unit, finding.allowed
    above = finding.at_least or finding.satisfied == (finding.amount > allowed)
    limit: float | None = allowed
    if name == LIMIT_NAMES[0]:
        joints = {finding.subject} & set(robot.joint_names)
        unit, limit = robot.unit_of(*joints), None
    elif allowed == 1.0 and not unit:
        unit, limit = "of its limit", None
    elif name == "rest":
        name = "acceleration at rest" if unit.endswith("²") else "speed at rest"
    return Fact(
        name, finding.amount, unit, finding.time, finding.subject, limit, above,
        finding.satisfied, "requirement",
    )  # fmt: skip


def plan_facts(plan: Plan) -> list[Fact]:
    """Return what is known of a plan."""
    report, certificate, robot = plan.report, plan.certificate, plan.robot
    if not certificate.findings:
        # An arm that stands, for a page without a motion.
        return [Fact("verdict", certificate.verdict)]
    used, *which = str(plan.limits_used).split(": ", 1)
    turns, *turned = str(plan.reversals).split(" ", 1)
    follows = plan.problem.follows
    return [
        Fact("verdict", certificate.verdict),
        _compared("cost", report.cost, report.initial_cost),
        *_remaining(report, certificate),
        *(
            _compared(f"cost term: {name}", value, report.initial_terms.get(name))
            for name, value in report.terms.items()
        ),
        *certificate_facts(certificate, plan.approaches, robot),
        *Fact.worst("largest power of a joint", largest_power(plan), "W", "motion"),
        Fact("limits used fully", used, remark="".join(which), group="motion"),
        Fact("joint reversals", turns, remark="".join(turned).strip("()"), group="motion"),
        Fact("duration", plan.trajectory.duration, "s"),
        Fact(
            "task",
            " and ".join(item.task.value for item in follows.items),
            remark=f"{follows.dimension} rows, {robot.dof} joints",
        ),
        Fact("outcome", str(report.status.value), remark=report.message, group="search"),
        Fact(
            "iterations",
            str(report.iterations),
            remark=f"in {report.seconds:.3g} s",
            group="search",
        ),
        Fact(
            "evaluations",
            f"{report.evaluations} of F, {report.gradient_evaluations} of ∇F",
            remark=f"{report.jacobian_evaluations} Jacobians, {report.steps} steps",
            group="search",
        ),
    ]


def largest_power(plan: Plan) -> Extreme | None:
    """Return the largest power |τ q̇| of a joint [W], of samples; None of an arm without masses."""
    if not has_masses(plan.robot):
        return None
    motion = plan.trajectory
    t = np.linspace(motion.t[0], motion.t[-1], _SAMPLES)
    q, qd, qdd = (motion(t, order) for order in range(3))
    power = np.abs(Dynamics(plan.robot).torques(q, qd, qdd) * qd)
    at, joint = np.unravel_index(int(power.argmax()), power.shape)
    return Extreme(float(power.max()), float(t[at]), plan.robot.joint_names[joint])


def _compared(label: str, value: float, start: float | None) -> Fact:
    remark = "" if start is None else f"minimum-norm: {start:.6g}"
    return Fact(label, f"{value:.6g}", remark=remark)


def _remaining(report: Report, certificate: Certificate) -> list[Fact]:
    left = report.remaining
    # Of a motion that breaks constraints the estimate is of no use: that is not saved.
    if left is None or not certificate.verified:
        return []
    share = f"{100 * left / abs(report.cost):.2g} % with any null motion"
    remark = share if left and report.cost else ""
    return [Fact("further saving possible, estimate", f"{left:.2g}", remark=remark)]


def program_facts(
    verdict: str, duration: float, seams: int, moves: Sequence[tuple[str, float]]
) -> list[Fact]:
    """Return what is known of seams and moves, which have a name and seconds each."""
    longest = sorted(moves, key=lambda move: -move[1])[:_LONGEST]
    names = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in longest)
    seconds = sum(seconds for _, seconds in moves)
    return [
        Fact("verdict", verdict),
        Fact("duration", duration, "s"),
        Fact("seams", str(seams)),
        Fact("moves", seconds, "s", remark=f"longest: {names}" if names else ""),
    ]


def facts_of_program(program: Program) -> list[Fact]:
    """Return what is known of a program."""
    made = [step for step in program.steps if not (step.is_seam or step.is_missing)]
    moves = [(step.name, step.duration) for step in made]
    return program_facts(program.verdict, program.duration, len(program.order), moves)


def without_repeats(facts: Sequence[Fact]) -> list[Fact]:
    """Return facts without requirements whose worst value is a fact of its own."""
    told = {"clearance", *LIMIT_NAMES}
    return [item for item in facts if not (item.group == "requirement" and item.label in told)]


def margin_facts(margins: Margins) -> list[Fact]:
    """Return how far part, tool and base may be off."""
    return [
        Fact(f"{item.name}, {kind}", found.size, where=found.reason, group="margin")
        for item in margins.subjects
        for kind, found in item.rows
    ]
