"""A finished plan: the motion, how it was found, and what the check says."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from selfmotion.basics import Array, FileFormatError, PlanError, files
from selfmotion.certificate import (
    Certificate,
    DampedStretch,
    Extreme,
    Requirements,
    Tolerance,
    certify,
)
from selfmotion.collision import obstacle_from_dict
from selfmotion.constraints import Clearance
from selfmotion.motion import Trajectory
from selfmotion.optimise import Iteration, Status
from selfmotion.path import Path, path_from_dict
from selfmotion.robot import RobotModel, rebuild_robot
from selfmotion.task import DampingLaw, Relaxation, Task

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Gap:
    """How far a plan is from the global optimum, as far as the search over self-motions knows it.

    No bound: the search sees samples of the self-motions, and joint path lengths. So there are two
    comparisons, with different strengths. The costs are alike (same cost, same constraints, same
    optimiser), but that of the search is refined from a few of its sequences only. The lengths
    are of all sequences there are, but say little where the cost is another one.

    Attributes
    ----------
    cost : float
        F of the plan.
    best_cost : float or None
        F of the best motion refined from the sequences that the search found; None where none
        keeps the constraints.
    length : float
        Σ|Δq| of the plan over waypoints and joints [rad or m].
    best_length : float
        That of the shortest sequence of configurations within the same limits, clearance and
        steps.
    spacing : float
        Distance of the samples of the self-motions [rad or m], configuration norm.
    sequences : int
        How many sequences, unlike each other, were refined.
    """

    cost: float
    best_cost: float | None
    length: float
    best_length: float
    spacing: float
    sequences: int

    @property
    def cost_excess(self) -> float | None:
        """The plan's cost above the best one, as a share; negative where the plan is better."""
        if self.best_cost is None or self.best_cost == 0.0:
            return None
        return (self.cost - self.best_cost) / abs(self.best_cost)

    @property
    def length_excess(self) -> float:
        """The plan's joint path above the shortest one, as a share."""
        return self.length / self.best_length - 1.0


@dataclass(frozen=True, eq=False)
class Report:
    """How a plan was found.

    Attributes
    ----------
    cost, initial_cost : float
        F of the plan, and of the motion without self-motion (x = 0).
    terms, initial_terms : dict
        What each cost contributes to them.
    evaluations, gradient_evaluations : int
        How often F and ∇F were computed, on all grids.
    jacobian_evaluations : int
        How often Pinocchio was asked for the frame Jacobian.
    steps : int
        Runge-Kutta steps of the finest grid.
    iterations : int
        Of the optimiser.
    history : tuple of Iteration
        One per iteration, each grid's first being its start.
    status : Status
    message : str
        What the status means and what to do about it.
    seconds : float
        Wall time of `plan`.
    gap : Gap or None
        Distance from the global optimum, where a global search was made.
    """

    cost: float
    initial_cost: float
    terms: Mapping[str, float]
    initial_terms: Mapping[str, float]
    evaluations: int
    gradient_evaluations: int
    jacobian_evaluations: int
    steps: int
    iterations: int
    history: tuple[Iteration, ...]
    status: Status
    message: str
    seconds: float
    gap: Gap | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """A joint motion along a tool motion.

    Attributes
    ----------
    robot : RobotModel
    path : Path
    task : Task
    trajectory : Trajectory
        The motion; shorter than the path where the arm cannot follow it to the end.
    initial_trajectory : Trajectory
        The motion without self-motion (x = 0), for comparison.
    coefficients : (size,)
        x, the null motion's coefficients.
    report : Report
    certificate : Certificate
    requirements : Requirements
        What the certificate checked besides the path, but for clearance.
    clearance : Clearance or None
        The obstacles and the distance kept from them, where asked for.
    tolerance : Tolerance
        What the motion may miss the path by.
    """

    robot: RobotModel
    path: Path
    task: Task
    trajectory: Trajectory
    initial_trajectory: Trajectory
    coefficients: Array
    report: Report
    certificate: Certificate
    requirements: Requirements = field(default_factory=Requirements)
    clearance: Clearance | None = None
    tolerance: Tolerance = field(default_factory=Tolerance)

    def check(self) -> Certificate:
        """Return a new certificate of the motion, by the same tolerance and requirements."""
        wanted = self.requirements
        if self.clearance is not None:
            model = self.clearance.model(self.robot)
            wanted = dataclasses.replace(wanted, collision=model, clearance=self.clearance.distance)
        return certify(self.robot, self.path, self.task, self.trajectory, self.tolerance, wanted)

    def require(self) -> "Plan":
        """Return the plan itself if its certificate is verified.

        Raises
        ------
        PlanError
            It is not; the message is the verdict.
        """
        if not self.certificate.verified:
            raise PlanError(f"{self.robot.name}: {self.certificate.verdict}")
        return self

    def save(self, file: str | FilePath) -> None:
        """Write the plan, without loss, to a ``.npz`` file that `load_plan` reads.

        The file carries the URDF's text, so that it can be checked where the URDF is not.
        The write is atomic.
        """
        description, arrays = _describe(self)
        files.write_archive(FilePath(file), description, arrays)

    def to_csv(self, file: str | FilePath) -> None:
        """Write ``t`` and a column per joint for q, then q̇ (``NAME`` and ``NAME_velocity``)."""
        motion = self.trajectory
        names = [*motion.joint_names, *(f"{name}_velocity" for name in motion.joint_names)]
        table = np.column_stack([motion.t, motion.q, motion.qd])
        files.write_csv(FilePath(file), ["t", *names], table)

    def figure(self) -> "Figure":
        """Return joint positions and velocities, manipulability and path error as a figure.

        Needs matplotlib (``pip install 'selfmotion[plots]'``).
        """
        from selfmotion.replay import figure

        return figure(self)

    def _repr_html_(self) -> str:
        """Show the replay inline in a notebook."""
        from selfmotion.replay import notebook_html

        return notebook_html(self)


def load_plan(file: str | FilePath) -> Plan:
    """Read a plan that `Plan.save` wrote.

    Raises
    ------
    FileFormatError
        The file is missing, is no plan, or lacks something.
    """
    description, arrays = files.read_archive(FilePath(file))
    try:
        return _restore(description, arrays)
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"{file}: is no plan, or of another version: {error!r}") from error


def _describe(plan: Plan) -> tuple[dict[str, Any], dict[str, Array]]:
    robot, report = plan.robot, plan.report
    description = {
        "robot": {
            "text": robot.urdf.text,
            "package_dirs": list(robot.urdf.package_dirs),
            "source": robot.urdf.source,
            "continuous": sorted(robot.urdf.continuous()),
            "tool": robot.tool,
            "locked": dict(robot.locked),
        },
        "path": plan.path.to_dict(),
        "task": plan.task.value,
        "joint_names": list(plan.trajectory.joint_names),
        "report": {
            **{
                field.name: getattr(report, field.name)
                for field in dataclasses.fields(report)
                if field.name not in ("history", "status")
            },
            "terms": dict(report.terms),
            "initial_terms": dict(report.initial_terms),
            "status": report.status.value,
            "gap": None if report.gap is None else dataclasses.asdict(report.gap),
        },
        "history": [
            {
                "cost": iteration.cost,
                "gradient_norm": iteration.gradient_norm,
                "update": iteration.update,
                "step": iteration.step,
                "evaluations": iteration.evaluations,
            }
            for iteration in report.history
        ],
        "certificate": dataclasses.asdict(plan.certificate),
        "requirements": _requirements_to_dict(plan),
        "tolerance": dataclasses.asdict(plan.tolerance),
    }
    arrays = {
        "t": plan.trajectory.t,
        "q": plan.trajectory.q,
        "qd": plan.trajectory.qd,
        "initial_t": plan.initial_trajectory.t,
        "initial_q": plan.initial_trajectory.q,
        "initial_qd": plan.initial_trajectory.qd,
        "coefficients": plan.coefficients,
        "history_x": np.array([iteration.x for iteration in report.history]),
    }
    return description, arrays


def _restore(description: dict[str, Any], arrays: Mapping[str, Array]) -> Plan:
    names = tuple(description["joint_names"])
    history = tuple(
        Iteration(x=x, **record)
        for x, record in zip(arrays["history_x"], description["history"], strict=True)
    )
    report = dict(description["report"])
    report["status"] = Status(report["status"])
    report["gap"] = None if report["gap"] is None else Gap(**report["gap"])
    certificate: dict[str, Any] = {
        key: Extreme(**value) if isinstance(value, dict) else value
        for key, value in description["certificate"].items()
    }
    certificate["failures"] = tuple(certificate["failures"])
    certificate["deviations"] = tuple(Extreme(**item) for item in certificate["deviations"])
    certificate["damped"] = tuple(DampedStretch(**item) for item in certificate["damped"])
    return Plan(
        robot=rebuild_robot(**description["robot"]),
        path=path_from_dict(description["path"]),
        task=Task.of(description["task"]),
        trajectory=Trajectory(arrays["t"], arrays["q"], arrays["qd"], names),
        initial_trajectory=Trajectory(
            arrays["initial_t"], arrays["initial_q"], arrays["initial_qd"], names
        ),
        coefficients=arrays["coefficients"],
        report=Report(history=history, **report),
        certificate=Certificate(**certificate),
        **_requirements_from_dict(description["requirements"]),
        tolerance=Tolerance(**description["tolerance"]),
    )


def _requirements_to_dict(plan: Plan) -> dict[str, Any]:
    wanted, clearance = plan.requirements, plan.clearance
    arrays = {
        name: None if getattr(wanted, name) is None else getattr(wanted, name).tolist()
        for name in ("lower", "upper", "velocity", "acceleration", "end", "end_velocity")
    }
    return {
        **arrays,
        "closed": wanted.closed,
        "closed_velocity": wanted.closed_velocity,
        "relaxations": [item.to_dict() for item in wanted.relaxations],
        "ending": wanted.ending,
        "damping": None if wanted.damping is None else dataclasses.asdict(wanted.damping),
        "clearance": None
        if clearance is None
        else {
            "obstacles": [obstacle.to_dict() for obstacle in clearance.obstacles],
            "distance": clearance.distance,
            "srdf": None if clearance.srdf is None else str(clearance.srdf),
        },
    }


def _requirements_from_dict(description: Mapping[str, Any]) -> dict[str, Any]:
    values = dict(description)
    stored = values.pop("clearance")
    clearance = None
    if stored is not None:
        obstacles = tuple(obstacle_from_dict(item) for item in stored["obstacles"])
        clearance = Clearance(obstacles, stored["distance"], stored["srdf"])
    damping = values.pop("damping")
    plain: dict[str, Any] = {
        "closed": values.pop("closed"),
        "closed_velocity": values.pop("closed_velocity"),
        "ending": values.pop("ending"),
        "relaxations": tuple(Relaxation(**item) for item in values.pop("relaxations")),
        "damping": None if damping is None else DampingLaw(**damping),
    }
    arrays: dict[str, Any] = {
        name: None if x is None else np.array(x) for name, x in values.items()
    }
    return {"clearance": clearance, "requirements": Requirements(**arrays, **plain)}
