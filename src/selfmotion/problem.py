"""What to plan: an arm, a tool motion, the rows that count, and what to minimise."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from selfmotion.arrays import Array, read_only
from selfmotion.costs import Cost, JointVelocity
from selfmotion.errors import ProblemError, RedundancyError, StartError
from selfmotion.null_motion import NullMotion, PolynomialNullMotion
from selfmotion.path import Path
from selfmotion.robot import RobotModel
from selfmotion.task import Task

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
    start : (n,), optional
        q(0) [rad or m]; must put the tool on the start of the path. By default an
        inverse-kinematics solution.
    null_motion : NullMotion
        The parameterisation of the self-motion.
    costs : sequence of Cost
        Their integrals are added up. By default ∫ ½ q̇ᵀq̇ dt.

    Raises
    ------
    RedundancyError
        The task leaves no self-motion.
    StartError
        `start` is off the path.
    ProblemError
        The arm cannot move in all the rows, two costs share a name, a cost does not fit the arm.
    """

    robot: RobotModel
    path: Path
    task: Task | str = Task.POSE
    start: npt.ArrayLike | None = None
    null_motion: NullMotion = field(default_factory=PolynomialNullMotion)
    costs: Sequence[Cost] = field(default_factory=lambda: (JointVelocity(),))

    def __post_init__(self) -> None:
        object.__setattr__(self, "task", Task.of(self.task))
        object.__setattr__(self, "costs", tuple(self.costs))
        self._check_rank()
        self._check_costs()
        if self.start is not None:
            start = read_only(self.robot.configuration(self.start))
            object.__setattr__(self, "start", start)
            self._check_start(start)

    @property
    def rows(self) -> Task:
        """The task."""
        return Task.of(self.task)

    @cached_property
    def start_configuration(self) -> Array:
        """q(0), (n,): the given one, or an inverse-kinematics solution.

        Raises
        ------
        InverseKinematicsError
            Nothing was given and no configuration reaches the start of the path.
        """
        if self.start is not None:
            return np.asarray(self.start)
        pose = self.path.pose(0.0)
        return read_only(self.robot.inverse_kinematics(pose, self.rows))

    def _check_rank(self) -> None:
        robot, task = self.robot, self.rows
        redundancy = robot.redundancy(task)
        if not robot.can_follow(task):
            raise ProblemError(
                f"{robot.name}: task '{task.value}' prescribes {task.dimension} rows "
                f"({', '.join(task.row_names)}), but the arm cannot move '{robot.tool}' freely in "
                f"all of them; choose another task ('planar' for a planar arm)"
            )
        if redundancy == 0:
            raise RedundancyError(
                f"{robot.name}: {robot.dof} joints and task '{task.value}' with "
                f"{task.dimension} rows leave no self-motion; choose a task with fewer rows "
                f"('pointing', 'position') or an arm with more joints",
                dof=robot.dof,
                rows=task.dimension,
            )

    def _check_costs(self) -> None:
        names = [cost.name for cost in self.costs]
        if not names:
            raise ProblemError("no cost is given, so that nothing tells one motion from another")
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise ProblemError(f"two costs are called '{twice[0]}'; give one another name=")
        for cost in self.costs:
            cost.check(self.robot.dof)

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
