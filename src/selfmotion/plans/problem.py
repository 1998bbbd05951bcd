"""What to plan: an arm, a tool motion, the rows that count, and what to minimise."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, RedundancyError, StartError, read_only
from selfmotion.certificate import Requirements
from selfmotion.constraints import (
    BoundConstraint,
    Clearance,
    ClosedPath,
    Constraint,
    EndConfiguration,
    EndVelocity,
    JointAccelerationLimits,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.costs import Cost, JointVelocity
from selfmotion.motion import NullMotion, PolynomialNullMotion
from selfmotion.path import Path
from selfmotion.plans.relaxed_rows import check_relaxations
from selfmotion.robot import RobotModel
from selfmotion.task import PATH_ERROR, Damping, DampingLaw, Relaxation, Task

# An end configuration may be this far off [m, rad]: what the certificate grants it.
_NEAR_END = 1e-6
# A start nearer to the path than this is on it: far above rounding, far below any tolerance.
_ON_PATH = 1e-7


@dataclass(frozen=True, eq=False)
class Problem:
    """A planning problem.

    Parameters
    ----------
    robot : RobotModel
    path : Path
        The tool's motion.
    task : Task or str
        The rows of it that are prescribed; ``"pose"`` by default.
    start : (n,) or "free", optional
        q(0) [rad or m]; must put the tool on the start of the path. By default free: many starts
        are tried, and the best ones optimised along with the rest of the motion.
    null_motion : NullMotion
        The parameterisation of the self-motion.
    costs : sequence of Cost
        Their integrals are added up. By default ∫ ½ q̇ᵀq̇ dt.
    constraints : sequence of Constraint
        What the motion must keep. By default the URDF's limits of joint position and velocity.
    relaxations : sequence of Relaxation
        Rows in which the tool may leave the path, by how much and when; the deviation is optimised
        along with the self-motion. By default none. A given start is on the path itself, and so
        are both ends of a closed path and the end of one with conditions there.
    damping : Damping, optional
        Go through singular poses, and past the edge of the workspace, at the price of the path: by
        default the tool stays on the path, and there is no motion through such poses. Adds the
        cost "path error".

    Raises
    ------
    RedundancyError
        The task leaves no self-motion, and no row is relaxed.
    StartError
        `start` is off the path.
    ProblemError
        The arm cannot move in all the rows, two costs share a name, a cost does not fit the arm, a
        relaxation does not fit the path or the task.
    """

    robot: RobotModel
    path: Path
    task: Task | str = Task.POSE
    start: npt.ArrayLike | str | None = None
    null_motion: NullMotion = field(default_factory=PolynomialNullMotion)
    costs: Sequence[Cost] = field(default_factory=lambda: (JointVelocity(),))
    constraints: Sequence[Constraint] = field(
        default_factory=lambda: (JointPositionLimits(), JointVelocityLimits())
    )
    relaxations: Sequence[Relaxation] = ()
    damping: Damping | None = None

    def __post_init__(self) -> None:
        for name, kind in (("robot", RobotModel), ("path", Path)):
            if not isinstance(getattr(self, name), kind):
                raise ProblemError(
                    f"{name} is {getattr(self, name)!r}, expected a {kind.__name__} "
                    f"(load_robot, Line, Circle, Waypoints, …)"
                )
        object.__setattr__(self, "task", Task.of(self.task))
        listed = (("costs", "value"), ("constraints", "bind"), ("relaxations", "window"))
        for name, method in listed:
            object.__setattr__(self, name, _sequence(getattr(self, name), name, method))
        check_relaxations(self.relaxations, self.path, self.rows)
        if not hasattr(self.null_motion, "functions"):
            raise ProblemError(
                f"null_motion is {self.null_motion!r}, expected PolynomialNullMotion or "
                f"BSplineNullMotion"
            )
        if not isinstance(self.damping, Damping | None):
            raise ProblemError(f"damping is {self.damping!r}, expected a Damping or None")
        if isinstance(self.start, str):
            if self.start != "free":
                raise ProblemError(f"start is '{self.start}', expected numbers, 'free' or None")
            object.__setattr__(self, "start", None)
        self._check_rank()
        self._check_costs()
        self._check_constraints()
        self._check_closed()
        self._check_rest()
        self._check_end()
        if self.start is not None:
            start = read_only(self.robot.configuration(self.start))
            object.__setattr__(self, "start", start)
            self._check_start(start)

    @property
    def rows(self) -> Task:
        """The task."""
        return Task.of(self.task)

    @property
    def given_start(self) -> Array | None:
        """The start configuration (n,), or None where it is free."""
        return None if self.start is None else np.asarray(self.start, dtype=np.float64)

    def bind_constraints(self, start: Array, end: Array) -> tuple[BoundConstraint, ...]:
        """Return the constraints for this arm, given first and last configuration, (n,) each.

        Those of the motion that the optimisation begins with.
        """
        return tuple(item.bind(self.robot, self.rows, start, end) for item in self.constraints)

    @cached_property
    def clearance(self) -> Clearance | None:
        """The clearance asked for."""
        found = [item for item in self.constraints if isinstance(item, Clearance)]
        return found[0] if found else None

    @cached_property
    def damping_law(self) -> DampingLaw | None:
        """The damping in numbers [m, rad] for this arm and task."""
        if self.damping is None:
            return None
        best = self.robot.task_jacobian(self.robot.dexterous_configuration(self.rows), self.rows)
        return self.damping.law(float(np.linalg.svd(best, compute_uv=False)[-1]))

    @cached_property
    def requirements(self) -> Requirements:
        """What the certificate has to check besides the path."""
        wanted = Requirements(relaxations=tuple(self.relaxations), damping=self.damping_law)
        for item in self.constraints:
            wanted = _require(wanted, item, self.robot)
        return wanted

    @cached_property
    def knots(self) -> Array:
        """Times [s] between which path and deviations are smooth; see `Path.knots`."""
        duration, knots = self.path.duration, list(self.path.knots)
        for item in self.relaxations:
            for time in np.linspace(*item.window(duration), item.intervals + 1):
                # Nearer to each other than rounding, two knots are one.
                if np.abs(np.array(knots) - time).min() > 1e-9 * duration:
                    knots.append(time)
        return read_only(sorted(knots))

    @property
    def pinned(self) -> tuple[bool, bool]:
        """Whether the tool has to be on the path itself at its start and at its end."""
        closed = any(isinstance(item, ClosedPath) for item in self.constraints)
        ends = (EndConfiguration, EndVelocity)
        ended = any(isinstance(item, ends) for item in self.constraints)
        return self.start is not None or closed, closed or ended

    def _check_rank(self) -> None:
        robot, task = self.robot, self.rows
        redundancy = robot.redundancy(task)
        if not robot.can_follow(task):
            raise ProblemError(
                f"{robot.name}: task '{task.value}' prescribes {task.dimension} rows "
                f"({', '.join(task.row_names)}), but the arm cannot move '{robot.tool}' freely in "
                f"all of them; choose another task ('planar' for a planar arm)"
            )
        if redundancy == 0 and not self.relaxations:
            raise RedundancyError(
                f"{robot.name}: {robot.dof} joints and task '{task.value}' with "
                f"{task.dimension} rows leave no self-motion; choose a task with fewer rows "
                f"('pointing', 'position'), relax some (relaxations=), or take an arm with more "
                f"joints",
                dof=robot.dof,
                rows=task.dimension,
            )

    def _check_costs(self) -> None:
        names = [cost.name for cost in self.costs]
        if self.damping is not None:
            names.append(PATH_ERROR)
        if not self.costs:
            raise ProblemError("no cost is given, so that nothing tells one motion from another")
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ProblemError(f"two costs are called '{twice[0]}'; give one another name=")
        for cost in self.costs:
            cost.check(self.robot.dof)

    def _check_constraints(self) -> None:
        kinds = [type(item).__name__ for item in self.constraints]
        twice = [kind for kind in kinds if kinds.count(kind) > 1]
        if twice:
            raise ProblemError(
                f"there are two constraints {twice[0]}; make one of them, with the tighter limits "
                f"or with all obstacles"
            )

    def _check_end(self) -> None:
        for item in self.constraints:
            if not isinstance(item, EndConfiguration):
                continue
            end = self.path.pose(self.path.duration)
            actual = self.robot.pose(self.robot.configuration(item.q))
            position, rotation = self.rows.miss(end, actual)
            if max(position, rotation) > _NEAR_END:
                raise ProblemError(
                    f"{self.robot.name}: the end configuration puts '{self.robot.tool}' "
                    f"{position:.3g} m and {rotation:.3g} rad off the end of the path; take "
                    f"robot.inverse_kinematics(path.pose(path.duration), task, seed=q)"
                )

    def _check_closed(self) -> None:
        if not any(isinstance(item, ClosedPath) for item in self.constraints):
            return
        first, last = self.path.pose(0.0), self.path.pose(self.path.duration)
        position, rotation = self.rows.miss(first, last)
        if max(position, rotation) > _ON_PATH:
            raise ProblemError(
                f"a closed joint path needs a closed tool path, but the tool ends {position:.3g} m "
                f"and {rotation:.3g} rad from where it began"
            )

    def _check_rest(self) -> None:
        if not any(isinstance(x, EndVelocity) and not np.any(x.qd) for x in self.constraints):
            return
        duration = self.path.duration
        rotation = self.path.pose(duration).rotation
        twist = self.rows.select(self.path.twist(duration)[:, None], rotation)
        speed = float(np.abs(twist).max())
        # Waypoints and velocity functions end at rest up to their own rounding.
        if speed > _ON_PATH:
            raise ProblemError(
                f"the motion cannot end at rest: the path ends at {speed:.3g} m/s or rad/s; give "
                f"the path a time law that ends at rest (time_law='minimum_jerk'), or ask for "
                f"another end velocity"
            )

    def _check_start(self, start: Array) -> None:
        pose = self.path.pose(0.0)
        position, rotation = self.rows.miss(pose, self.robot.pose(start))
        if max(position, rotation) > _ON_PATH:
            raise StartError(
                f"{self.robot.name}: the start configuration puts '{self.robot.tool}' "
                f"{position:.3g} m and {rotation:.3g} rad off the start of the path; "
                f"leave it out, or take robot.inverse_kinematics(path.pose(0.0), task, seed=start)",
                position_miss=position,
                rotation_miss=rotation,
            )


def _sequence(items: Any, name: str, method: str) -> tuple[Any, ...]:
    """Return one item or several as a tuple; ProblemError for anything else."""
    listed = (items,) if hasattr(items, method) else items
    if not isinstance(listed, list | tuple) or not all(hasattr(item, method) for item in listed):
        raise ProblemError(f"{name} are {items!r}, expected a list of {name}")
    return tuple(listed)


def _require(wanted: Requirements, item: Constraint, robot: RobotModel) -> Requirements:
    """Return the requirements with those of one constraint."""
    if isinstance(item, JointPositionLimits):
        lower = robot.lower if item.lower is None else read_only(item.lower)
        upper = robot.upper if item.upper is None else read_only(item.upper)
        return replace(wanted, lower=lower, upper=upper)
    if isinstance(item, JointVelocityLimits) and item.limit is not None:
        return replace(wanted, velocity=item.of(robot))
    if isinstance(item, JointAccelerationLimits):
        return replace(wanted, acceleration=item.of(robot))
    if isinstance(item, EndConfiguration):
        return replace(wanted, end=read_only(item.q))
    if isinstance(item, EndVelocity):
        return replace(wanted, end_velocity=item.target(robot))
    if isinstance(item, ClosedPath):
        return replace(wanted, closed=True, closed_velocity=item.velocity)
    if isinstance(item, Clearance):
        return replace(wanted, collision=item.model(robot), clearance=item.distance)
    return wanted
