"""Plan: a motion, its problem, the report of the planner, and the certificate."""

from __future__ import annotations

import math
from collections.abc import Mapping, MutableMapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.metadata import entry_points
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Protocol

import numpy.typing as npt

from selfmotion.basics import (
    Array,
    CollisionError,
    FileFormatError,
    PlanError,
    ProblemError,
    Progress,
    RenderError,
    RobotError,
    SelfmotionError,
    as_path,
    description_of,
    digest_of,
    in_angle,
    in_length,
    silent,
)
from selfmotion.certificate import (
    Certificate,
    Extreme,
    FinishedMotion,
    Requirement,
    Tolerance,
    allowed_text,
    approaches,
    relaxed_text,
)
from selfmotion.model.collision import Obstacle
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.redundancy import (
    PIXELS,
    RedundancyMap,
    coordinates_of,
    redundancy_map_of,
)
from selfmotion.planning.result.archive import Archive, in_order_of
from selfmotion.planning.result.measured import (
    LimitsUsed,
    NullSpaceVelocity,
    cost_of,
    deviation_along,
    limits_used,
    null_space_velocity,
)
from selfmotion.planning.result.report import FUNCTION, Report
from selfmotion.planning.result.reversals import Reversals
from selfmotion.problem.costs import Cost, FunctionCost, LostCost, metres_of
from selfmotion.problem.problem import Problem

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Views(Protocol):
    """Views of plans, which the replay makes: it depends on plans."""

    def notebook_html(self, plan: Plan) -> str:
        """Return the replay as HTML for a notebook."""

    def figure(self, plan: Plan) -> Figure:
        """Return the plan's curves as a matplotlib figure."""

    def write_replay(self, plan: Plan, file: FilePath) -> None:
        """Write the replay as a page."""


@cache
def views() -> Views:
    """Return what makes views of plans: the package's entry point of this name.

    Raises
    ------
    RenderError
        The package was installed before it had one, or is not installed.
    """
    entry = next(iter(entry_points(group="selfmotion_views", name="replay")), None)
    if entry is None:
        raise RenderError(
            "what draws plans is found by the entry point 'replay' of the installed package, which "
            "has none: install it again (`pip install .`, or `pip install -e .` in a checkout)"
        )
    found: Views = entry.load()
    return found


def _digests(costs: Sequence[Cost]) -> dict[str, str]:
    """Return the digest of each cost by its name; "" of a function that no file had."""

    def digest(cost: Cost) -> str:
        if isinstance(cost, LostCost):
            return ""
        if isinstance(cost, FunctionCost):
            return f"{FUNCTION}{id(cost.g)}"
        return digest_of(description_of(cost))

    return {cost.name: digest(cost) for cost in costs}


def _are_same(costs: Mapping[str, str], known: Mapping[str, str] | None) -> bool:
    """Whether costs are those that a report is of, as far as files know them."""
    return (
        known is not None
        and costs.keys() == known.keys()
        and all(own in ("", known[name]) for name, own in costs.items())
    )


@dataclass(frozen=True, eq=False)
class Plan:
    """A joint motion along a tool motion.

    Attributes
    ----------
    problem : Problem
        The specification.
    trajectory : Trajectory
        The motion; shorter than the path where the arm cannot follow it to the end.
    initial_trajectory : Trajectory
        The minimum-norm motion (q̇ = J⁺ẋ), for comparison.
    coefficients : (size,)
        x, the null motion's coefficients.
    report : Report
        Of these motions: of one that was put in the place of another, costs are evaluated again.
    certificate : Certificate
        Of this motion and this problem: that of any other is dropped, and the plan is then not
        verified (``replace(plan, trajectory=…)``); `check` computes a new one.
    altered : str
        Why the file that it was read from is not the one that was written; "" where it is.
    """

    problem: Problem
    trajectory: Trajectory
    initial_trajectory: Trajectory
    coefficients: Array
    report: Report
    certificate: Certificate
    altered: str = ""

    def __post_init__(self) -> None:
        # In the robot's order, whichever a file has: motions are joined by columns.
        for name in ("trajectory", "initial_trajectory"):
            object.__setattr__(self, name, in_order_of(self.robot, getattr(self, name)))
        check, motion = self.certificate, self.trajectory
        if (check.motion, check.problem) != (motion.digest, self.problem.digest):
            object.__setattr__(self, "certificate", check.of_another())
        object.__setattr__(self, "report", _own_report(self))

    def __repr__(self) -> str:
        """Return a few lines: arm, cost, and the verdict."""
        report, verdict = self.report, self.certificate.verdict
        costs = f"{report.initial_cost:.6g} → {report.cost:.6g}"
        return (
            f"Plan({self.robot.name}, task '{self.task.value}', {self.trajectory.duration:.6g} s)\n"
            f"  cost {costs} in {report.iterations} iterations: {report.status.value}\n"
            f"  {verdict}"
        )

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.problem.robot

    @property
    def path(self) -> Path:
        """The tool's motion."""
        return self.problem.path

    @property
    def task(self) -> Task:
        """The rows of it that are prescribed."""
        return self.problem.task

    @property
    def tolerance(self) -> Tolerance:
        """Allowed error of the motion from the path."""
        return self.certificate.tolerance

    @property
    def requirements(self) -> tuple[Requirement, ...]:
        """Requirements of the certificate besides the path and the arm's own limits."""
        return self.problem.requirements

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The obstacles that the requirements are about."""
        return tuple(body for item in self.requirements for body in item.obstacles)

    @cached_property
    def approaches(self) -> Mapping[str, Extreme]:
        """Smallest distances of each obstacle and carried body, and of the arm from itself.

        Name → the distance [m], time, and the two bodies; to a fiftieth of it or 0.1 mm, at all
        times. Computed on first use.
        """
        return approaches(self.requirements, FinishedMotion(self.robot, self.trajectory))

    @cached_property
    def limits_used(self) -> LimitsUsed:
        """Shares of the time in which limits of speeds, accelerations, torques … are fully used.

        By joint and limit: they limit the pace of the motion. Computed on first use.
        """
        return limits_used(self.problem, self.trajectory)

    @cached_property
    def reversals(self) -> Reversals:
        """Times of the joints' reversals, above 1 mrad or 1 mm. Computed on first use."""
        return Reversals.of(self.trajectory)

    def null_motion(self, t: npt.ArrayLike) -> NullSpaceVelocity:
        """Return the null-space component of the joint velocities at `t`.

        q̇ = J⁺ẋ + (I − J⁺J) q̇: the first part moves the tool, the second one only the joints. J
        has
        the prescribed rows of all task frames; where tolerances (`relaxations`) are used, ẋ = J q̇
        is the
        tool's twist, not the path's.

        Parameters
        ----------
        t : float or (K,)
            Times within the motion [s].

        Returns
        -------
        NullSpaceVelocity
            In joints, ``joints`` (n,) or (K, n), and in coordinates, ``coordinates`` (r,) or
            (K, r), of a ``basis``.

        Raises
        ------
        ValueError
            A time is outside the motion, or times have another shape.
        """
        return null_space_velocity(self.problem.follows, self.trajectory, t)

    def deviation(self, t: npt.ArrayLike) -> Array:
        """Return the deviation of the tool from its path at `t`, as in the certificate.

        The six rows of a `Relaxation`. x, y, z [m] are the tool's position minus the path's: in
        world axes, or in those of the path's tool frame where a tolerance of positions is
        (``axes="tool"``). rx, ry, rz [rad] are the rotation vector that takes the path's
        orientation to the tool's, in the axes of the path's tool frame; of `POINTING` the shortest
        one between the z axes. Rows that the task leaves free are zero. Poses are those of the
        robot and of the path; nothing is of the joints by which the planner uses tolerances.

        Parameters
        ----------
        t : float or (K,)
            Times within the motion [s].

        Returns
        -------
        (6,) or (K, 6)
            Of the tool; where further frames follow paths (`also`), not of these.

        Raises
        ------
        ValueError
            A time is outside the motion, or times have another shape.
        """
        return deviation_along(self.problem, self.trajectory, t)

    def redundancy_map(
        self,
        coordinate: str | None = None,
        *,
        shape: tuple[int, int] = PIXELS,
        progress: Progress = silent,
    ) -> RedundancyMap:
        """Return what the self-motion could have chosen along the path, and what stops it there.

        Time against one coordinate along the self-motion. A pixel is the configuration with that
        value, continued from the plan's own configuration at that time; it is judged by the
        problem's limits, constraints and bodies.

        Parameters
        ----------
        coordinate : str, optional
            ``"tool"``, the rotation of the tool about its axis (task ``"pointing"``); ``"elbow"``,
            the swivel angle of an arm of seven revolute joints; or the name of a joint. By default
            the first of `redundancy_coordinates`.
        shape : (int, int)
            Numbers of pixels along the path, and along the coordinate.
        progress : callable
            Told how many of the times are judged, as ``("redundancy map", 40, 121)``.

        Raises
        ------
        ProblemError
            There is no such coordinate, or the shape is no shape.
        """
        return redundancy_map_of(
            Formulation.of(self.problem),
            self.trajectory,
            self.initial_trajectory,
            coordinate,
            shape,
            self.report.active,
            progress,
        )

    def redundancy_coordinates(self) -> tuple[str, ...]:
        """Return the coordinates of redundancy maps by name, the one that tells most first.

        With one degree of redundancy that is one: the tool's rotation where it is free; else the
        place of an external axis, the swivel angle, or the joint that the self-motion always moves.
        With more degrees each is a slice: first the joints that keep the plan from a lower cost, by
        the multipliers of their limits and of the distances that they change; then the tool's
        rotation where it is free; then the joints along whose self-motion the cost changes most.
        """
        formulation = Formulation.of(self.problem)
        return coordinates_of(formulation, self.trajectory, self.report.active)

    def evaluate(self, cost: Cost) -> float:
        """Return ∫ G dt of any cost along the plan, also of one that it was not planned for.

        By Gauss-Legendre quadrature with five points on each interval of the motion. Of the plan's
        own costs it is ``report.terms`` (of the published method up to its integration error).

        Raises
        ------
        ProblemError
            It is no cost, does not fit the arm or the task, or is not finite somewhere: the time is
            named. Costs that were functions are not in a plan's file: give them again.
        """
        return cost_of(self.problem.follows, self.trajectory, cost)

    @property
    def metres(self) -> Mapping[str, float]:
        """Weight of a metre of each prismatic joint relative to a radian of the others [rad].

        In the first cost of joint rates; empty for an arm of one kind of joints.
        """
        return metres_of(self.problem.costs, self.robot)

    def check(
        self,
        tolerance: Tolerance | None = None,
        requirements: Sequence[Requirement] = (),
        *,
        progress: Progress = silent,
    ) -> Certificate:
        """Return a new certificate of the motion.

        By all conditions of the problem and by further `requirements`; with another tolerance than
        the plan's if one is given. `progress` is as in `certify`.
        """
        within = tolerance or self.tolerance
        found = self.problem.certify(
            self.trajectory, within, self.report.ending, requirements, progress
        )
        if not self.altered:
            return self.report.explained(found)
        return replace(found, failures=(self.altered, *found.failures))

    def require(self) -> Plan:
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

        The file carries the URDF's text, so that it can be checked where the URDF is not, and the
        problem but for code: costs that are functions are missing when it is loaded.
        The write is atomic.

        Raises
        ------
        PlanError
            The certificate is of another motion.
        """
        if not self.certificate.motion:
            raise PlanError(f"{self.robot.name}: {self.certificate.verdict}")
        Archive(
            self.problem,
            self.trajectory,
            self.initial_trajectory,
            self.coefficients,
            self.report,
            self.certificate,
            self.altered,
        ).write(as_path(file))

    def figure(self) -> Figure:
        """Return joint positions and velocities, manipulability and path error as a figure.

        Needs matplotlib (``pip install 'selfmotion[plots]'``).
        """
        return views().figure(self)

    def _repr_html_(self) -> str:
        """Show the replay inline in a notebook."""
        return views().notebook_html(self)


def _own_report(plan: Plan) -> Report:
    """Return the report of this motion and these costs: that of others is evaluated again.

    If it does not name its motion, it is of the certificate's. Costs that cannot be evaluated,
    as functions that no file has, are NaN.
    """
    motion, initial = plan.trajectory.digest, plan.initial_trajectory.digest
    costs, report = _digests(plan.problem.costs), plan.report
    if not report.motion and plan.certificate.motion:
        return replace(report, motion=motion, initial_motion=initial, costs=costs)
    same_costs = _are_same(costs, report.costs)
    # Files of older versions do not name the minimum-norm motion: the one in it.
    if not (same_costs and report.initial_motion in ("", initial)):
        total, terms = _costs_of(plan, plan.initial_trajectory)
        report = replace(report, initial_cost=total, initial_terms=terms)
    if not (same_costs and report.motion == motion):
        report = report.evaluated(*_costs_of(plan, plan.trajectory))
    return replace(report, motion=motion, initial_motion=initial, costs=costs)


def _costs_of(plan: Plan, motion: Trajectory) -> tuple[float, Mapping[str, float]]:
    """Return the cost of a motion, and the terms; NaN where one cannot be evaluated."""
    terms = {}
    for cost in plan.problem.costs:
        with suppress(ProblemError):
            if not isinstance(cost, LostCost):
                terms[cost.name] = cost_of(plan.problem.follows, motion, cost)
    complete = len(terms) == len(plan.problem.costs)
    return (sum(terms.values()) if complete else math.nan), terms


def reached_text(plans: Sequence[Plan], tolerance: Tolerance) -> str:
    """Return in words how near to their paths plans keep, for the verdict of all of them."""
    found = [
        pair
        for plan in plans
        for check in (plan.certificate,)
        for pair in ((check.position_error, check.rotation_error), *check.others)
    ]
    position = max(one.value for one, _ in found)
    rotation = max(other.value for _, other in found)
    relaxed = any(plan.certificate.deviations for plan in plans)
    return (
        f"at most {in_length(position)} and {in_angle(rotation)} off the path"
        f"{relaxed_text(relaxed)}{allowed_text(tolerance)}"
    )


def load_plan(
    file: str | FilePath,
    *,
    progress: Progress = silent,
    known: MutableMapping[str, Any] | None = None,
) -> Plan:
    """Read a plan that `Plan.save` wrote, and measure its motion anew.

    A file that was changed is never verified. If the robot's own file has changed since, the
    certificate's notes say so: the plan is checked against the arm it was made for. `progress` is
    as in `certify`. For several plans of one arm pass the same `known` each time: it is a cache of
    arms and constraints.

    Raises
    ------
    FileFormatError
        The file is missing, is no plan, lacks something, or was written by a newer version.
    """
    archive = Archive.read(as_path(file), known)
    # The certificate in the file is not trusted.
    plan = Plan(*archive[:-1])
    try:
        certificate = plan.check(progress=progress)
    except (CollisionError, RobotError) as error:
        unknown = f"it could not be checked again: {error}"
        written = archive.certificate
        certificate = replace(
            written,
            failures=(unknown, *written.failures),
            motion=plan.trajectory.digest,
            problem=plan.problem.digest,
        )
    except (SelfmotionError, ArithmeticError, ValueError) as error:
        raise FileFormatError(f"{file}: is a damaged plan: {error}") from error
    source = (plan.robot.urdf.source,) if plan.robot.urdf.has_changed() else ()
    for name in (*source, *archive.changed):
        note = f"{name} has changed since the plan was made"
        certificate = replace(certificate, notes=(*certificate.notes, note))
    return replace(plan, certificate=certificate)
