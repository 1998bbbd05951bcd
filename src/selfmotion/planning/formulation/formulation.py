"""A problem as planners see it: coordinates z = (q, δ), cost terms, conditions, ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError, read_only
from selfmotion.certificate import Certificate, Tolerance, arm_limits, errors_of_poses
from selfmotion.model.follow import (
    Coordinates,
    Follows,
    completed,
    completed_along,
    has_windows,
    null_basis,
    windows_shut,
    with_tolerances,
)
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.path import Path, path_length
from selfmotion.model.robot import RobotModel
from selfmotion.planning.formulation.sampled import SampledMotion
from selfmotion.planning.formulation.tolerances import band_conditions, of_arm, widest_band
from selfmotion.problem.constraints import (
    BoundConstraint,
    BoundEnd,
    BoundLimits,
    Clearance,
    Conditions,
    Constraint,
    DependsOn,
    EndCondition,
    Envelope,
    JointPositionLimits,
    JointVelocityLimits,
)
from selfmotion.problem.costs import Cost, JointVelocity, Samples
from selfmotion.problem.problem import (
    Problem,
    envelope_of_problem,
    envelope_without_arm,
    prescribed_end,
    smooth_knots,
)


class BoundConditions(NamedTuple):
    """Conditions on a motion of all coordinates, by how they are imposed.

    Attributes
    ----------
    limits : tuple of BoundLimits
        On the control points of the curve.
    points : tuple of BoundConstraint
        At collocation points.
    ends : tuple of BoundEnd
        Equalities at the first and the last node.
    """

    limits: tuple[BoundLimits, ...] = ()
    points: tuple[BoundConstraint, ...] = ()
    ends: tuple[BoundEnd, ...] = ()

    @property
    def inequalities(self) -> tuple[BoundConstraint, ...]:
        """Limits, then the conditions at points."""
        return (*self.limits, *self.points)

    @property
    def every(self) -> tuple[BoundConstraint, ...]:
        """All of them."""
        return (*self.limits, *self.points, *self.ends)


@dataclass(frozen=True, eq=False)
class Formulation:
    """A problem as planners see it: motions of z = (q, δ).

    q are the arm's joints, δ the virtual joints of its tolerances, mostly none. Costs, constraints
    and bodies are functions of q alone.

    Attributes
    ----------
    problem : Problem
        The user's.
    follows : Follows
        Task frames of all coordinates: the tip of the virtual joints is on the path.
    costs : tuple of Cost
        Of the arm's motion.
    springs : (v,) or None
        Stiffness w of the further cost ½ Σ w δ², in place of limits of δ; None for none.
    """

    problem: Problem
    follows: Follows
    costs: tuple[Cost, ...]
    springs: Array | None = None

    @classmethod
    def of(cls, problem: Problem) -> Formulation:
        """Return a problem's: its tolerances are virtual joints."""
        if not problem.relaxations:
            return on_path(problem)
        follows = with_tolerances(problem.follows, problem.relaxations)
        return replace(on_path(problem), follows=follows)

    @property
    def robot(self) -> RobotModel:
        """The arm."""
        return self.problem.robot

    @property
    def path(self) -> Path:
        """The tool's motion."""
        return self.problem.path

    @property
    def coordinates(self) -> Coordinates:
        """Names, limits and weights of z."""
        return self.follows.coordinates

    @cached_property
    def given_start(self) -> Array | None:
        """The start (n,), with the virtual joints that it needs; None where it is free."""
        start = self.problem.given_start
        return (
            None
            if start is None
            else read_only(completed(self.follows, np.zeros(1), start[None])[0])
        )

    def conditions(
        self, start: Array, end: Array, *, apart: bool = True, decomposed: bool = False
    ) -> BoundConditions:
        """Return the conditions on motions, given first and last configuration, (n,) each.

        Those of the initial motion. Without the `deferred_clearance` unless `apart`; with links
        `decomposed` where their hulls are too large. With the arm's own limits where constraints
        have none: no motion beyond these is verified. With the bands of tolerances, and that pinned
        ends are on the path.
        """
        problem = self.problem
        own = _conditions(self, apart=apart, decomposed=decomposed)
        bound = bound_conditions(self, own, start, end)
        if not self.follows.virtual.each:
            return bound
        ends = list(bound.ends)
        bands = band_conditions(self.follows, problem.relaxations)
        pinned = any(item.ends.pins[1] for item in problem.constraints)
        if pinned and prescribed_end(self.robot, problem.constraints) is None:
            ends.append(_on_path_at_end(self.follows))
        # Those that are there with `apart` alone come last, so that others keep their places.
        limits, points = (*own.limits, *bands.limits), (*bands.points, *own.points)
        return BoundConditions(limits, points, tuple(ends))

    @cached_property
    def _known_conditions(self) -> dict[tuple[bool, bool], Conditions]:
        return {}

    @cached_property
    def envelope_without_arm(self) -> Envelope:
        """Limits and bodies of the constraints, without the arm's own limits."""
        problem = self.problem
        return _with_virtual(self, envelope_without_arm(problem.robot, problem.all_constraints))

    @cached_property
    def envelope(self) -> Envelope:
        """The same, with the arm's own limits; those of virtual joints come after them."""
        problem = self.problem
        return _with_virtual(self, envelope_of_problem(problem))

    @cached_property
    def knots(self) -> Array:
        """Times [s] between which paths and deviations are smooth; see `Path.knots`."""
        return smooth_knots(self.problem.follows, self.problem.relaxations)

    @cached_property
    def speed_weights(self) -> Array:
        """Weights of squared speeds of the arm's joints, (n,).

        The usual ones, scaled to those of the costs: the optimum is independent of the unit of the
        cost.
        """
        arm = self.robot
        found = np.zeros(arm.dof)
        found[:] = np.asarray(JointVelocity.usual(arm).weight)
        own = [cost.curvature(arm.dof).get(1) for cost in self.costs]
        total = sum(float(np.trace(each)) for each in own if each is not None)
        return read_only(found * (total / float(found.sum())) if total > 0.0 else found)

    @cached_property
    def length_in_reaches(self) -> float:
        """Path length of the tool, as a multiple of the arm's reach."""
        return path_length(self.path) / self.robot.reach


def deferred_clearance(problem: Problem) -> Clearance | None:
    """Return the clearance that motions are optimised without at first; None where there is none.

    The last one, where it requires no more than that links do not overlap: few motions break it,
    and distances take long.
    """
    last = problem.clearances[-1:]
    return next((x for x in last if x.is_no_overlap and x.applies(problem.robot)), None)


def on_path(problem: Problem) -> Formulation:
    """Return the formulation of a problem whose tolerances are not used."""
    return Formulation(problem, problem.follows, problem.all_costs)


def without_tolerances(formulation: Formulation) -> Formulation:
    """Return the same where tolerances are not used."""
    return replace(formulation, follows=formulation.problem.follows)


def with_springs(formulation: Formulation, cost: float) -> Formulation:
    """Return it with a cost of deviations in place of limits of their bands.

    At `cost`, the cost of a motion, being at a band all the time doubles it.
    """
    widest = formulation.coordinates.upper[formulation.robot.dof :]
    if not np.isfinite(widest).any() or not 0.0 < cost < np.inf:
        return formulation
    return replace(formulation, springs=2.0 * cost / formulation.path.duration / widest**2)


def with_windows_shut(formulation: Formulation) -> Formulation:
    """Return the same where motions without self-motion make no use of tolerances in windows."""
    if not has_windows(formulation.follows):
        return formulation
    return replace(formulation, follows=windows_shut(formulation.follows))


def arm_motion(formulation: Formulation, trajectory: Trajectory) -> Trajectory:
    """Return the arm's part of a motion of all coordinates."""
    n, qdd = formulation.robot.dof, trajectory.qdd
    if trajectory.q.shape[1] == n:
        return trajectory
    return Trajectory(
        trajectory.t,
        trajectory.q[:, :n],
        trajectory.qd[:, :n],
        trajectory.joint_names[:n],
        None if qdd is None else qdd[:, :n],
    )


def motion_of_all(formulation: Formulation, trajectory: Trajectory, path: Path) -> Trajectory:
    """Return the motion of all coordinates for one of the arm along a path like this one's."""
    from scipy.interpolate import CubicSpline

    if not formulation.follows.virtual.each:
        return trajectory
    t = trajectory.t
    q = completed_along(formulation.follows, path, t, trajectory.q)
    virtual = q[:, formulation.robot.dof :]
    rates = CubicSpline(t, virtual)(t, 1) if len(t) > 2 else np.zeros_like(virtual)
    return Trajectory(t, q, np.hstack([trajectory.qd, rates]), formulation.coordinates.names)


def sampled(formulation: Formulation, every: Samples) -> SampledMotion:
    """Return a motion of all coordinates as costs and conditions see it."""
    return SampledMotion(formulation.problem.follows, every)


def sampled_along(
    formulation: Formulation, sampling: Sampling, q: Array, qd: Array
) -> SampledMotion:
    """Return the same of q and q̇ (S, n) of all coordinates."""
    return sampled(formulation, Samples.along(formulation.follows, sampling, q, qd))


def cost_of_motion(formulation: Formulation, motion: SampledMotion) -> float:
    """Return the cost of a motion."""
    weights = motion.every.sampling.weights
    return sum(float(weights @ cost.value(motion.arm)) for cost in formulation.costs)


def keeps_off_itself(formulation: Formulation, q: Array) -> bool:
    """Whether the arm's meshes in configurations (K, n) are free of self-collision.

    Only for a `deferred_clearance`: other clearances are the optimisation's.
    """
    if deferred_clearance(formulation.problem) is None:
        return True
    own = q[:, : formulation.robot.dof]
    return all(model.worst(own).value >= far for model, far in formulation.envelope.bodies)


def _conditions(formulation: Formulation, *, apart: bool, decomposed: bool) -> Conditions:
    """Return the conditions on the arm's motion, of all constraints in their order."""
    known, problem = formulation._known_conditions, formulation.problem
    if (apart, decomposed) not in known:
        deferred = None if apart else deferred_clearance(problem)
        every = (*_own_limits(formulation), *problem.all_constraints)
        given = [item for item in every if item is not deferred]
        if all(formulation.problem.rest_orders):
            given = [item.at_rest() for item in given]
        known[apart, decomposed] = Conditions.joined(
            item.decomposed_conditions(formulation.robot)
            if decomposed
            else item.conditions(formulation.robot)
            for item in given
        )
    return known[apart, decomposed]


def bound_conditions(
    formulation: Formulation, own: Conditions, start: Array, end: Array
) -> BoundConditions:
    """Return conditions on the arm as those on motions between such ends, (n,) each."""
    for item in own.points:
        _check_point(item)
    ends = tuple(_end(formulation, item, start, end) for item in own.ends)
    return BoundConditions(own.limits, own.points, ends)


def _own_limits(formulation: Formulation) -> tuple[Constraint, ...]:
    """Return the arm's own limits of position and velocity that constraints say nothing of."""
    problem = formulation.problem
    said = {type(item) for item in problem.constraints}
    judged = {item.order for item in arm_limits(formulation.robot, problem.requirements)}
    own = enumerate((JointPositionLimits(), JointVelocityLimits()))
    return tuple(
        item
        for order, item in own
        if order in judged and type(item) not in said and item.applies(formulation.robot)
    )


def _end(formulation: Formulation, item: EndCondition, start: Array, end: Array) -> BoundEnd:
    """Return a condition on an end with its target in all coordinates."""
    at = start if item.target is None or item.at_start else end
    target = item.target
    if target is not None and 0 in item.orders:
        time = 0.0 if item.at_start else formulation.path.duration
        at = target = completed(formulation.follows, np.array([time]), target[None])[0]
    elif target is not None:
        target = np.append(target, np.zeros(formulation.follows.dof - len(target)))
    return BoundEnd.of(item, target, null_basis(formulation.follows, at))


def _with_virtual(formulation: Formulation, own: Envelope) -> Envelope:
    """Return an arm's envelope with that of its virtual joints; bodies are the arm's."""
    follows, n = formulation.follows, formulation.robot.dof
    if not follows.virtual.each:
        return own
    virtual = Coordinates.of(formulation.robot, follows.virtual)
    free = np.full(virtual.dof - n, np.inf)
    several = [
        widest_band(item, follows)
        for item in formulation.problem.relaxations
        if len(item.rows) > 1 and np.isfinite(follows.virtual.widest(item.indices))
    ]
    speed, acceleration, jerk = (
        read_only(np.append(rate, free)) for rate in (own.speed, own.acceleration, own.jerk)
    )
    return Envelope(
        read_only(np.append(own.lower, virtual.lower[n:])),
        read_only(np.append(own.upper, virtual.upper[n:])),
        speed,
        acceleration,
        jerk,
        own.bodies,
        (*(of_arm(item, n) for item in own.quantities), *several),
        tuple(item.extended(virtual.dof - n) for item in own.curves),
        own.tool_speed,
    )


def certified(
    formulation: Formulation,
    trajectory: Trajectory,
    tolerance: Tolerance | None = None,
    ending: str = "",
) -> Certificate:
    """See `Problem.certify`, of a motion of all coordinates."""
    return formulation.problem.certify(arm_motion(formulation, trajectory), tolerance, ending)


def path_errors(formulation: Formulation, trajectory: Trajectory) -> Array:
    """Return the errors of a motion in the middle between samples, (N, 2) [m, rad]: no proof."""
    problem, t = formulation.problem, 0.5 * (trajectory.t[:-1] + trajectory.t[1:])
    q = arm_motion(formulation, trajectory)(t)
    found = []
    for k, item in enumerate(problem.follows.items):
        _, rotation, translation = item.chain.along(q)
        relaxations = () if k else problem.relaxations
        found.append(errors_of_poses(item, t, rotation, translation, relaxations))
    return np.asarray(np.max(found, axis=0))


def _on_path_at_end(follows: Follows) -> BoundEnd:
    """Return that virtual joints end at 0 where the tool is on the path itself."""
    at_zero = follows.robot.dof + np.flatnonzero(follows.virtual.at_zero)
    null = np.eye(follows.dof)[:, at_zero]
    return BoundEnd("end on the path", (0,), np.zeros(follows.dof), null)


def _check_point(item: BoundConstraint) -> None:
    """Raise ProblemError for an equality that is none on the ends, or one of all coordinates."""
    if item.depends_on is DependsOn.ALL:
        raise ProblemError(
            f"constraint '{item.name}': it is of joints and tolerances, expected a condition of "
            f"the joints alone at all nodes; those on the ends are of both"
        )
    if item.equality:
        raise ProblemError(
            f"constraint '{item.name}': it is an equality, expected h ≤ 0 at all nodes; "
            f"equalities are asked of the ends alone (ClosedPath, EndConfiguration, …), and "
            f"others are two-sided bands"
        )
