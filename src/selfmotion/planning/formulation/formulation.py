"""A problem as planners see it: coordinates z = (q, δ), cost terms, conditions, ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from selfmotion.basics import Array, ProblemError, read_only
from selfmotion.certificate import Certificate, Tolerance, arm_limits, errors_between
from selfmotion.model.follow import Coordinates, Follows, RelaxedFrames
from selfmotion.model.motion import Sampling, Trajectory
from selfmotion.model.path import Path
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
from selfmotion.problem.costs import Cost, Samples
from selfmotion.problem.problem import Problem, given_end, length_of, smooth_knots


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
            return cls.on_path(problem)
        follows = RelaxedFrames.with_tolerances(problem.follows, problem.relaxations)
        return replace(cls.on_path(problem), follows=follows)

    @classmethod
    def on_path(cls, problem: Problem) -> Formulation:
        """Return that of a problem whose tolerances are not used."""
        return cls(problem, problem.follows, problem.all_costs)

    @cached_property
    def without_tolerances(self) -> Formulation:
        """The same where tolerances are not used."""
        return replace(self, follows=self.problem.follows)

    def with_costs(self, costs: Sequence[Cost]) -> Formulation:
        """Return it with other costs."""
        return replace(self, costs=tuple(costs))

    def with_springs(self, cost: float) -> Formulation:
        """Return it with a cost of deviations in place of limits of their bands.

        At `cost`, the cost of a motion, being at a band all the time doubles it.
        """
        widest = self.coordinates.upper[self.robot.dof :]
        if not np.isfinite(widest).any() or not 0.0 < cost < np.inf:
            return self
        return replace(self, springs=2.0 * cost / self.path.duration / widest**2)

    @property
    def with_windows_shut(self) -> Formulation:
        """The same where motions without self-motion make no use of tolerances in windows."""
        if not self.follows.holds:
            return self
        return replace(self, follows=self.follows.with_windows_shut)

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
        return None if start is None else read_only(self.completed(np.zeros(1), start[None])[0])

    def completed(self, t: Array, q: Array) -> Array:
        """Return all coordinates (K, n) for the arm's own, at times t (K,) [s] of the path."""
        return self.follows.completed(t, q)

    def of_arm(self, trajectory: Trajectory) -> Trajectory:
        """Return the arm's part of a motion of all coordinates."""
        n, qdd = self.robot.dof, trajectory.qdd
        if trajectory.q.shape[1] == n:
            return trajectory
        return Trajectory(
            trajectory.t,
            trajectory.q[:, :n],
            trajectory.qd[:, :n],
            trajectory.joint_names[:n],
            None if qdd is None else qdd[:, :n],
        )

    def of_all(self, trajectory: Trajectory, path: Path) -> Trajectory:
        """Return the motion of all coordinates for one of the arm along a path like this one's."""
        from scipy.interpolate import CubicSpline

        if not isinstance(self.follows, RelaxedFrames):
            return trajectory
        t = trajectory.t
        q = self.follows.completed_along(path, t, trajectory.q)
        virtual = q[:, self.robot.dof :]
        rates = CubicSpline(t, virtual)(t, 1) if len(t) > 2 else np.zeros_like(virtual)
        return Trajectory(t, q, np.hstack([trajectory.qd, rates]), self.coordinates.names)

    def sampled(self, every: Samples) -> SampledMotion:
        """Return a motion of all coordinates as costs and conditions see it."""
        return SampledMotion(self.problem.follows, every)

    def sampled_along(self, sampling: Sampling, q: Array, qd: Array) -> SampledMotion:
        """Return the same of q and q̇ (S, n) of all coordinates."""
        return self.sampled(Samples.along(self.follows, sampling, q, qd))

    def cost_of(self, motion: SampledMotion) -> float:
        """Return the cost of a motion."""
        weights = motion.every.sampling.weights
        return sum(float(weights @ cost.value(motion.arm)) for cost in self.costs)

    def changed(self, **changes: Any) -> Formulation:
        """Return that of the problem with other parameters."""
        return Formulation.of(self.problem.changed(**changes))

    def along(
        self, other: Callable[[Path], Path], when: Callable[[Array], Array] | None = None
    ) -> dict[str, Any]:
        """See `Problem.along`."""
        return self.problem.along(other, when)

    @cached_property
    def no_overlap(self) -> Clearance | None:
        """The last clearance, if it asks no more than that links do not overlap; else None.

        Motions are optimised without it at first: few break it, and distances take long.
        """
        last = self.problem.clearances[-1:]
        lazy = (item for item in last if item.is_no_overlap and item.applies(self.robot))
        return next(lazy, None)

    def keeps_off_itself(self, q: Array) -> bool:
        """Whether the arm's meshes in configurations (K, n) are free of self-collision.

        Only for `no_overlap`: other clearances are the optimisation's.
        """
        if self.no_overlap is None:
            return True
        own = q[:, : self.robot.dof]
        return all(model.worst(own).value >= far for model, far in self.envelope.bodies)

    def conditions(
        self, start: Array, end: Array, *, apart: bool = True, decomposed: bool = False
    ) -> BoundConditions:
        """Return the conditions on motions, given first and last configuration, (n,) each.

        Those of the initial motion. Without `no_overlap` unless `apart`; with links
        `decomposed` where their hulls are too large. With the arm's own limits where constraints
        have none: no motion beyond these is verified. With the bands of tolerances, and that pinned
        ends are on the path.
        """
        problem = self.problem
        own = self._conditions(apart=apart, decomposed=decomposed)
        bound = self.bound(own, start, end)
        if not isinstance(self.follows, RelaxedFrames):
            return bound
        ends = list(bound.ends)
        bands = band_conditions(self.follows, problem.relaxations)
        pinned = any(item.ends.pins[1] for item in problem.constraints)
        if pinned and given_end(self.robot, problem.constraints) is None:
            ends.append(_on_path_at_end(self.follows))
        # Those that are there with `apart` alone come last, so that others keep their places.
        limits, points = (*own.limits, *bands.limits), (*bands.points, *own.points)
        return BoundConditions(limits, points, tuple(ends))

    def _conditions(self, *, apart: bool, decomposed: bool) -> Conditions:
        """Return the conditions on the arm's motion, of all constraints in their order."""
        known, problem = self._known_conditions, self.problem
        if (apart, decomposed) not in known:
            given = [*self._own_limits, *problem.all_constraints]
            if self.no_overlap is not None and not apart:
                given.pop()
            if all(self.problem.rests):
                given = [item.at_rest() for item in given]
            known[apart, decomposed] = Conditions.joined(
                item.decomposed_conditions(self.robot)
                if decomposed
                else item.conditions(self.robot)
                for item in given
            )
        return known[apart, decomposed]

    @cached_property
    def _known_conditions(self) -> dict[tuple[bool, bool], Conditions]:
        return {}

    def bound(self, own: Conditions, start: Array, end: Array) -> BoundConditions:
        """Return conditions on the arm as those on motions between such ends, (n,) each."""
        for item in own.points:
            _check_point(item)
        ends = tuple(self._end(item, start, end) for item in own.ends)
        return BoundConditions(own.limits, own.points, ends)

    @property
    def _own_limits(self) -> tuple[Constraint, ...]:
        """The arm's own limits of position and velocity, where constraints say nothing of them."""
        problem = self.problem
        said = {type(item) for item in problem.constraints}
        judged = {item.order for item in arm_limits(self.robot, problem.requirements)}
        own = enumerate((JointPositionLimits(), JointVelocityLimits()))
        return tuple(
            item
            for order, item in own
            if order in judged and type(item) not in said and item.applies(self.robot)
        )

    def _end(self, item: EndCondition, start: Array, end: Array) -> BoundEnd:
        """Return a condition on an end with its target in all coordinates."""
        at = start if item.target is None or item.at_start else end
        target = item.target
        if target is not None and 0 in item.orders:
            time = 0.0 if item.at_start else self.path.duration
            at = target = self.completed(np.array([time]), target[None])[0]
        elif target is not None:
            target = np.append(target, np.zeros(self.follows.dof - len(target)))
        return BoundEnd.of(item, target, self.follows.null_basis(at))

    @cached_property
    def envelope_without_arm(self) -> Envelope:
        """See `Problem.envelope_without_arm`."""
        return self._with_virtual(self.problem.envelope_without_arm)

    @cached_property
    def envelope(self) -> Envelope:
        """See `Problem.envelope`: with the limits of virtual joints after the arm's."""
        return self._with_virtual(self.problem.envelope)

    def _with_virtual(self, own: Envelope) -> Envelope:
        """Return an arm's envelope with that of its virtual joints; bodies are the arm's."""
        follows, n = self.follows, self.robot.dof
        if not isinstance(follows, RelaxedFrames):
            return own
        virtual = Coordinates.of(self.robot, follows.virtual)
        free = np.full(virtual.dof - n, np.inf)
        several = [
            widest_band(item, follows)
            for item in self.problem.relaxations
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

    def certify(
        self, trajectory: Trajectory, tolerance: Tolerance | None = None, ending: str = ""
    ) -> Certificate:
        """See `Problem.certify`, of a motion of all coordinates."""
        return self.problem.certify(self.of_arm(trajectory), tolerance, ending)

    def errors_between(self, trajectory: Trajectory) -> Array:
        """Return the errors of a motion in the middle between samples, (N, 2) [m, rad]."""
        own, problem = self.of_arm(trajectory), self.problem
        found = [
            errors_between(item, own, () if k else problem.relaxations)
            for k, item in enumerate(problem.follows.items)
        ]
        return np.asarray(np.max(found, axis=0))

    @cached_property
    def knots(self) -> Array:
        """Times [s] between which paths and deviations are smooth; see `Path.knots`."""
        return smooth_knots(self.problem.follows, self.problem.relaxations)

    @cached_property
    def length_in_reaches(self) -> float:
        """Path length of the tool, as a multiple of the arm's reach."""
        return length_of(self.path) / self.robot.reach


def _on_path_at_end(follows: RelaxedFrames) -> BoundEnd:
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
