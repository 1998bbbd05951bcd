"""Items of a batch and their results: a row for each problem."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from selfmotion.basics import FileFormatError, ProblemError, SelfmotionError
from selfmotion.planning.optimise import Status
from selfmotion.planning.planner import PlanRequest
from selfmotion.planning.result import Plan, files_of, identity_of, key_of, load_plan, own_modules
from selfmotion.problem.costs import FunctionCost
from selfmotion.problem.problem import Problem, problem_to_dict

# The reason of what its deadline left without a verified motion.
LATE = "deadline"
# Arguments of `plan` besides the problem.
OPTIONS = ("search", "optimizer", "tolerance", "max_evaluations")


@dataclass(frozen=True, eq=False)
class Item:
    """One of many problems.

    Attributes
    ----------
    name : str
        Of its files.
    make : callable
        Returns the job; may raise what is wrong with it.
    settings : dict
        What tells it from the others: keys of the grid and their values.
    file : Path or None
        The problem file whose grid it is of.
    write : callable, optional
        Of a grid's combination: writes its problem file to a path.
    """

    name: str
    make: Callable[[], PlanRequest]
    settings: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None
    write: Callable[[Path], None] | None = None

    @cached_property
    def task(self) -> dict[str, Any]:
        """The task for a worker.

        Raises
        ------
        SelfmotionError
            The problem is none, or cannot be sent.
        """
        job = self.make()
        lost = [cost.name for cost in job.problem.costs if isinstance(cost, FunctionCost)]
        if lost:
            raise ProblemError(
                f"cost '{lost[0]}' is a function, which cannot be sent to another process; derive "
                f"a class from selfmotion.costs.Cost"
            )
        problem = problem_to_dict(job.problem)
        # A class in a script that is run is known to processes that begin with it alone.
        modules = [name for name in own_modules(problem) if name != "__main__"]
        options = {**job.settings, "goal": job.goal, "keep": job.keep, "parts": job.parts}
        files = files_of(job.problem.robot, job.problem.all_constraints, {})
        return {"problem": problem, "options": options, "modules": modules, "files": files}

    def forget(self) -> None:
        """Let go of the task, which is large and not needed any more."""
        self.__dict__.pop("task", None)

    @cached_property
    def key(self) -> str:
        """A digest of all that decides the plan."""
        try:
            task = self.task
        except SelfmotionError as error:
            return f"error: {error}"
        return key_of((task["problem"], identity_of(task["options"])), task["files"])


def unread_item(file: Path, error: SelfmotionError) -> Item:
    """Return the item of a file that cannot be read: its row says why."""

    def fails() -> PlanRequest:
        raise error

    return Item(file.stem, fails, {}, file)


def problem_items(problems: list[Problem | PlanRequest], options: Mapping[str, Any]) -> list[Item]:
    """Return an item for each problem; ProblemError for what is none."""
    for name in options:
        if name not in OPTIONS:
            raise ProblemError(f"{name}: is no option of a batch; expected {', '.join(OPTIONS)}")
        if problems and all(isinstance(given, PlanRequest) for given in problems):
            raise ProblemError(
                f"{name}: has no effect: each problem is a PlanRequest, which says its own"
            )
    digits = len(str(max(len(problems) - 1, 0)))
    items = []
    for k, given in enumerate(problems):
        if not isinstance(given, Problem | PlanRequest):
            raise ProblemError(f"problems[{k}] is {given!r}, expected a Problem or a PlanRequest")
        job = given if isinstance(given, PlanRequest) else PlanRequest(given, **options)
        items.append(Item(f"plan-{k:0{digits}d}", lambda job=job: job))  # type: ignore[misc]
    return items


@dataclass(frozen=True)
class Row:
    """The result of one problem.

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
        What was planned for: `PlanRequest.goal`.
    error : str
        "" where there is a plan.
    reason : str
        A short reason why it is not verified; "" if it is.
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
        Smallest distance between bodies [m]; None without a clearance.
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
    """Return the entries of a row for a plan with a goal (`PlanRequest.goal`)."""
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
        return LATE
    if plan.report.ending:
        return "ends on the way"
    broken = [item.requirement for item in certificate.findings if not item.satisfied]
    return broken[0] if broken else "off the path"
