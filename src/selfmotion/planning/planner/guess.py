"""Initial guesses: a start, the minimum-norm motion from there, and motions that are known."""

from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, BreakdownError, InverseKinematicsError, ProblemError, shown
from selfmotion.model.follow import is_plain
from selfmotion.model.motion import Grid, Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.formulation import BoundConditions, Formulation, with_windows_shut
from selfmotion.planning.planner.effort import Effort
from selfmotion.planning.planner.grids import first_nodes, most_nodes
from selfmotion.planning.planner.outcomes import MinimumNormOutcome
from selfmotion.planning.result import Plan
from selfmotion.planning.rollout import (
    MAX_HALVINGS,
    Guide,
    MinimumNormMotion,
    converged_minimum_norm,
)
from selfmotion.planning.search import Manifold
from selfmotion.problem.problem import Problem


def check_warm_start(plan: object, problem: Problem) -> None:
    """Raise ProblemError where a plan is none, or one of another arm."""
    if not isinstance(plan, Plan):
        raise ProblemError(f"warm_start is {shown(plan)}, expected a Plan; load_plan reads one")
    check_joints(plan.robot, problem.robot)


def check_joints(theirs: RobotModel, ours: RobotModel) -> None:
    """Raise ProblemError where what is known has another arm's joints."""
    if theirs.joint_names != ours.joint_names:
        raise ProblemError(
            f"warm_start: its joints are {', '.join(theirs.joint_names)}, expected those of "
            f"{ours.name}: {', '.join(ours.joint_names)}"
        )


def on_start(formulation: Formulation, seed: Array) -> Array:
    """Return the configuration (n,) near another one that is on the start of all paths.

    Raises
    ------
    InverseKinematicsError
        There is none.
    """
    follows, robot = formulation.follows, formulation.robot
    own = follows.coordinates
    if not is_plain(follows):
        manifold = Manifold(follows, own.lower, own.upper)
        held = follows.held(np.zeros(1))
        q, arrived = manifold.project(seed[None], follows.targets(np.zeros(1)), far=True, held=held)
        if not arrived[0]:
            misses = np.array([item.miss(item.path.pose(0.0), q[0]) for item in follows.items])
            position, rotation = misses.max(axis=0)
            raise InverseKinematicsError(
                f"{robot.name}: from the configuration that is known none was found in which all "
                f"frames are where their paths begin",
                position_miss=float(position),
                rotation_miss=float(rotation),
            )
        return np.asarray(q[0])
    first, task = formulation.path.pose(0.0), formulation.problem.task
    return formulation.robot.inverse_kinematics(first, task, seed)


def pace_of(plan: Plan, formulation: Formulation) -> float:
    """Return the duration of a plan's path over that of the problem's."""
    return plan.path.duration / formulation.path.duration


def lasting(trajectory: Trajectory, duration: float) -> Trajectory:
    """Return the same motion, as much faster or slower that it ends at a time [s], exactly."""
    pace = trajectory.t[-1] / duration
    qdd = None if trajectory.qdd is None else pace**2 * trajectory.qdd
    t, qd = trajectory.t / pace, pace * trajectory.qd
    # By rounding the last time would be another one.
    t[-1] = duration
    return Trajectory(t, trajectory.q, qd, trajectory.joint_names, qdd)


def moved_to(trajectory: Trajectory, start: Array) -> Trajectory:
    """Return the same motion from another start (n,); where it is off the path, it is put there."""
    q = trajectory.q + (start - trajectory.q[0])
    return Trajectory(trajectory.t, q, trajectory.qd, trajectory.joint_names, trajectory.qdd)


@dataclass(frozen=True, eq=False)
class Guess:
    """An initial guess of a motion.

    Attributes
    ----------
    formulation : Formulation
    effort : Effort
    free : bool
        Whether the start may move along its self-motion.
    minimum_norm : MinimumNormOutcome
        The minimum-norm motion from the start.
    plan : Plan or None
        Warm start: its motion comes first, unless that is worse.
    motion : Trajectory or None
        A motion that is known, in place of the minimum-norm one.
    """

    formulation: Formulation
    effort: Effort
    free: bool
    minimum_norm: MinimumNormOutcome
    plan: Plan | None = None
    motion: Trajectory | None = None

    @classmethod
    def of(
        cls,
        formulation: Formulation,
        effort: Effort,
        start: Array,
        *,
        free: bool,
        guide: Guide | None = None,
        grid: Grid | None = None,
    ) -> "Guess":
        """Return the guess from a start (n,).

        Parameters
        ----------
        formulation : Formulation
        effort : Effort
        start : (n,)
        free : bool
        guide : Guide, optional
            The null motion that stands for x = 0 in eq. 4: where the search found one worth
            starting from.
        grid : Grid, optional
            To begin with; it is refined until the motion stays near the path.

        Raises
        ------
        BreakdownError
            The minimum-norm motion runs into a singular pose.
        """
        begun, jacobians = _begun(formulation, start, guide, grid)
        effort.counts.jacobians += jacobians
        conditions = formulation.conditions(
            start, begun.end, apart=effort.apart, decomposed=effort.decomposed
        )
        first = MinimumNormOutcome(formulation, begun, conditions, effort.counts)
        return cls(formulation, effort, free, first)

    @property
    def conditions(self) -> BoundConditions:
        """Conditions on the motion, bound to the ends of the minimum-norm motion."""
        return self.minimum_norm.conditions

    @property
    def most_steps(self) -> int:
        """Number of steps above which a grid is not refined any more."""
        return int(self.minimum_norm.motion.grid.steps * 2**MAX_HALVINGS)

    def near(self, motion: Trajectory) -> "Guess":
        """Return it with a motion that is known, in place of the minimum-norm one."""
        return replace(self, motion=motion)

    def with_plan(self, plan: Plan) -> "Guess":
        """Return it with a plan's motion to begin with, unless that is worse."""
        return replace(self, plan=plan)

    def kept_apart(self) -> "Guess":
        """Return it with the default clearance of the arm from itself as a constraint."""
        effort, begun = replace(self.effort, apart=True), self.minimum_norm.motion
        conditions = self.formulation.conditions(
            begun.start, begun.end, decomposed=effort.decomposed
        )
        first = replace(self.minimum_norm, conditions=conditions)
        return replace(self, effort=effort, minimum_norm=first)

    def first_motions(self) -> tuple[list[Trajectory], Array]:
        """Return motions to begin near, and the times of the first nodes (N + 1,).

        That of the warm start first, if its path is whole.
        """
        formulation, warm, t = self.formulation, self.plan, first_nodes(self.formulation)
        motions = [self.motion or self.minimum_norm.evaluation.trajectory]
        if warm is not None and warm.trajectory.t[-1] == warm.path.duration:
            own = lasting(warm.trajectory, formulation.path.duration)
            if not self.free:
                own = moved_to(own, self.minimum_norm.motion.start)
            motions = [own, *motions]
            if len(own.t) <= most_nodes(formulation):
                # Its nodes are where such a motion needs them.
                t = np.unique(np.append(own.t, formulation.knots))
        return motions, t


def _begun(
    formulation: Formulation, start: Array, guide: Guide | None, grid: Grid | None
) -> tuple[MinimumNormMotion, int]:
    """Return the motion at x = 0, see `converged_minimum_norm`.

    It keeps out of tolerances in windows, so that it is one that may be followed. Where the path
    cannot be followed like that, it makes use of them, at any time: to begin with, that will do.
    """
    shut = with_windows_shut(formulation)
    try:
        return converged_minimum_norm(shut, start, guide, grid)
    except BreakdownError:
        if shut is formulation:
            raise
        return converged_minimum_norm(formulation, start, guide, grid)
