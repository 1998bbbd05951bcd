"""What became of one problem of a batch."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError
from selfmotion.result import Plan, load_plan


@dataclass(frozen=True)
class Row:
    """What became of one problem.

    Attributes
    ----------
    name : str
    key : str
        Digest of the problem and its options.
    settings : dict
        Its values of the grid.
    file : Path
        The plan's archive; not there where `error` says why.
    digest : str
        The SHA-256 of that file.
    goal : str
        What was planned for: `Job.goal`.
    error : str
        "" where there is a plan.
    reason : str
        In a few words, why it is not verified; "" where it is.
    fault : bool
        Whether the error is a fault of a program rather than of the problem; such are tried again.
    verified, verdict, cost, initial_cost, duration, evaluations
        Of the plan.
    aim : float
        What it is ranked by, the smaller the better: the duration of what was to be the fastest
        motion, else the cost.
    margin : float or None
        Smallest distance of a joint from its position limits [rad or m]; None without a plan.
    margin_unit : str
        Its unit, by the joint.
    clearance : float or None
        Smallest distance between bodies [m]; None where it was not asked for.
    ends : float or None
        When the motion ends where that is before the path does [s].
    seconds : float
        Its worker's time.
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
        """Its place among others, the smaller the better: what has a plan, and a verified one."""
        return bool(self.error), not self.verified, self.aim

    @property
    def outcome(self) -> str:
        """Its cost; of what is only a part of the path when it ends."""
        return f"{self.cost:.6g}" if self.ends is None else f"ends at t = {self.ends:.4g} s"

    def plan(self) -> Plan:
        """Read the plan; FileFormatError where there is none."""
        if self.error:
            raise FileFormatError(f"{self.name}: has no plan: {self.error}")
        return load_plan(self.file)


def measured(plan: Plan, goal: str) -> dict[str, Any]:
    """Return what a row says of a plan that was made for a goal (`Job.goal`)."""
    report, certificate, duration = plan.report, plan.certificate, plan.trajectory.duration
    nearest = {certificate.limit_margin.name} & set(plan.robot.joint_names)
    is_part = bool(report.ending)
    aim = duration if goal == "fastest" else report.cost
    return {
        "verified": certificate.verified,
        "verdict": certificate.verdict,
        "reason": _reason(plan),
        "margin": certificate.limit_margin.value,
        "margin_unit": plan.robot.unit_of(*nearest),
        "clearance": None if certificate.clearance is None else certificate.clearance.value,
        "cost": report.cost,
        "initial_cost": report.initial_cost,
        "duration": duration,
        "evaluations": report.evaluations,
        # What is only a part of the path is not compared with the whole.
        "aim": float("inf") if is_part else aim,
        "ends": duration if is_part else None,
    }


def _reason(plan: Plan) -> str:
    """Say in a few words why a plan is not verified; "" where it is."""
    certificate = plan.certificate
    if certificate.verified:
        return ""
    if plan.report.ending:
        return "ends on the way"
    broken = [item.requirement for item in certificate.findings if not item.satisfied]
    return broken[0] if broken else "off the path"
