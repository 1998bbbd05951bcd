"""Results of a batch: a row for each problem."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError
from selfmotion.planning.optimise import Status
from selfmotion.planning.result import Plan, load_plan

# Reason of a row whose deadline passed before a motion was verified.
DEADLINE_REASON = "deadline"


@dataclass(frozen=True)
class Row:
    """The result of one problem.

    Attributes
    ----------
    name : str
    key : str
        Digest of the problem and its options.
    settings : dict
        Values of the grid's keys.
    file : Path
        The plan's archive; it does not exist where there is an `error`.
    digest : str
        The SHA-256 of that file.
    goal : str
        What was planned for: `PlanRequest.goal`.
    error : str
        Why there is no plan; "" where there is one.
    reason : str
        A short reason why it is not verified; "" if it is.
    fault : bool
        Whether the error is a fault of a program rather than of the problem; such are tried again.
    verified, verdict, cost, initial_cost, duration, evaluations
        Of the plan.
    aim : float
        Rows are ranked by it, the smaller the better: the duration where the goal was the fastest
        motion, else the cost.
    margin : float or None
        Smallest distance of a joint from its position limits [rad or m]; None without a plan.
    margin_unit : str
        Its unit, by the joint.
    clearance : float or None
        Smallest distance between bodies [m]; None without a clearance.
    ends : float or None
        Time at which the motion ends, where that is before the end of the path [s].
    seconds : float
        Time that the worker took [s].
    """

    name: str
    key: str
    file: Path
    settings: Mapping[str, Any] = field(default_factory=dict)
    digest: str = ""
    goal: str = "best"
    error: str = ""
    reason: str = "no plan"
    fault: bool = False
    verified: bool = False
    verdict: str = ""
    cost: float = float("inf")
    initial_cost: float = float("inf")
    duration: float = 0.0
    evaluations: int = 0
    aim: float = float("inf")
    margin: float | None = None
    margin_unit: str = ""
    clearance: float | None = None
    ends: float | None = None
    seconds: float = 0.0

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """Key to sort rows by: those with a verified plan first, then those with any plan."""
        return bool(self.error), not self.verified, self.aim

    @property
    def outcome(self) -> str:
        """Its cost in words; of a motion along a part of the path, when it ends."""
        return f"{self.cost:.6g}" if self.ends is None else f"ends at t = {self.ends:.4g} s"

    def plan(self) -> Plan:
        """Read the plan; FileFormatError where there is none."""
        if self.error:
            raise FileFormatError(f"{self.name}: has no plan: {self.error}")
        return load_plan(self.file)


def row_values(plan: Plan, goal: str) -> dict[str, Any]:
    """Return the values of a row's fields from `verified` on, for a plan.

    Parameters
    ----------
    plan : Plan
    goal : str
        What was planned for: `PlanRequest.goal`.
    """
    report, certificate, duration = plan.report, plan.certificate, plan.trajectory.duration
    nearest_joint = {certificate.limit_margin.name} & set(plan.robot.joint_names)
    is_part = bool(report.ending)
    aim = duration if goal == "fastest" else report.cost
    return {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        "reason": _reason(plan),
        "margin": certificate.limit_margin.value,
        "margin_unit": plan.robot.unit_of(*nearest_joint),
        "clearance": None if certificate.clearance is None else certificate.clearance.value,
        "cost": report.cost,
        "initial_cost": report.initial_cost,
        "duration": duration,
        "evaluations": report.evaluations,
        # A part of the path is not compared with the whole.
        "aim": float("inf") if is_part else aim,
        "ends": duration if is_part else None,
    }


def _reason(plan: Plan) -> str:
    """Return a short reason why a plan is not verified; "" if it is."""
    certificate = plan.certificate
    if certificate.verified:
        return ""
    if plan.report.status is Status.DEADLINE:
        return DEADLINE_REASON
    if plan.report.ending:
        return "ends on the way"
    broken = [item.requirement for item in certificate.findings if not item.satisfied]
    return broken[0] if broken else "off the path"
