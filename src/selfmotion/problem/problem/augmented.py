"""A problem as planners see it: its tolerances are virtual joints, and no row is relaxed."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import fields, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Progress, read_only, silent
from selfmotion.certificate import Certificate, Requirement, Tolerance
from selfmotion.model.collision import CollisionModel
from selfmotion.model.follow import AugmentedTaskFrames
from selfmotion.model.motion import Trajectory
from selfmotion.model.path import Path
from selfmotion.model.task import DampingLaw
from selfmotion.problem.constraints import (
    BoundClearance,
    BoundConstraint,
    BoundEnd,
    BoundLimits,
    Clearance,
    Constraint,
    Envelope,
)
from selfmotion.problem.costs import Cost
from selfmotion.problem.problem.of_arm import (
    BodiesOfArm,
    BoundOfArm,
    RowWithinBand,
    WithinBand,
    cost_of_arm,
    quantity_of_arm,
    springs,
    widest_band,
)
from selfmotion.problem.problem.problem import Problem


class AugmentedProblem(Problem):
    """A problem with virtual joints after the arm's own; motions have all of them.

    Parameters
    ----------
    asked : Problem
        As it was asked; some of its rows are relaxed.
    """

    follows: AugmentedTaskFrames
    _original: Problem

    def __init__(self, asked: Problem) -> None:
        follows = AugmentedTaskFrames.with_tolerances(asked.follows, asked.relaxations)
        given = {one.name: getattr(asked, one.name) for one in fields(Problem)}
        dof = follows.robot.dof
        given["robot"], given["task"], given["relaxations"] = (
            follows.robot,
            follows.virtual.task,
            (),
        )
        given["costs"] = tuple(cost_of_arm(cost, asked.follows, dof) for cost in asked.costs)
        for name, value in {**given, "_original": asked, "follows": follows}.items():
            object.__setattr__(self, name, value)
        if asked.given_start is not None:
            start = self.at(np.zeros(1), asked.given_start[None])[0]
            object.__setattr__(self, "start", read_only(start))

    @property
    def _derived(self) -> set[str]:
        """See `Problem._derived`: what is followed is given here."""
        return super()._derived - {"follows"}

    @property
    @override
    def asked(self) -> Problem:
        return self._original

    @property
    @override
    def augmented(self) -> "AugmentedProblem":
        return self

    @override
    def softened(self, cost: float) -> "Problem":
        virtual = self.robot.upper[self._dof :]
        if not np.isfinite(virtual).any() or not 0.0 < cost < np.inf:
            return self
        weights = np.append(np.zeros(self._dof), 2.0 * cost / self.path.duration / virtual**2)
        return self._with_costs((*self.costs, springs(weights)))

    @cached_property
    @override
    def with_windows_shut(self) -> Problem:
        if not self.follows.holds:
            return self
        found = copy(self)
        object.__setattr__(found, "follows", self.follows.with_windows_shut)
        return found

    def changed(self, **changes: Any) -> Problem:
        """See `Problem.changed`; costs are those of all joints, as here."""
        costs = changes.pop("costs", None)
        found = replace(self.asked, **changes).augmented if changes else self
        return found if costs is None else cast(AugmentedProblem, found)._with_costs(costs)

    def _with_costs(self, costs: tuple[Cost, ...]) -> "AugmentedProblem":
        found = copy(self)
        object.__setattr__(found, "costs", costs)
        found.__dict__.pop("all_costs", None)
        return found

    @override
    def along(
        self, other: Callable[[Path], Path], when: Callable[[Array], Array] | None = None
    ) -> dict[str, Any]:
        return self.asked.along(other, when)

    @property
    def _dof(self) -> int:
        return self.asked.robot.dof

    @override
    def own(self, trajectory: Trajectory) -> Trajectory:
        n, qdd = self._dof, trajectory.qdd
        return Trajectory(
            trajectory.t,
            trajectory.q[:, :n],
            trajectory.qd[:, :n],
            trajectory.joint_names[:n],
            None if qdd is None else qdd[:, :n],
        )

    @override
    def at(self, t: Array, q: Array) -> Array:
        return self._with_virtual(self.path, t, q)

    def _with_virtual(self, path: Path, t: Array, q: Array) -> Array:
        """Return q (K, n) with the virtual joints that put the tool on a path at times t (K,)."""
        _, turns, places = self.asked.follows.items[0].chain.along(q)
        wanted = path.samples(np.minimum(t, path.duration))
        found = self.follows.virtual.coordinates(
            (turns, places), (wanted.rotation, wanted.translation)
        )
        held = self.follows.held(t * (self.path.duration / path.duration))
        found[held[:, self._dof :]] = 0.0
        return np.hstack([q, found])

    @override
    def with_own(self, trajectory: Trajectory, path: Path) -> Trajectory:
        from scipy.interpolate import CubicSpline

        t = trajectory.t
        q = self._with_virtual(path, t, trajectory.q)
        virtual = q[:, self._dof :]
        rates = CubicSpline(t, virtual)(t, 1) if len(t) > 2 else np.zeros_like(virtual)
        return Trajectory(t, q, np.hstack([trajectory.qd, rates]), self.robot.joint_names)

    @cached_property
    @override
    def own_collision(self) -> Clearance | None:
        return self.asked.own_collision

    @override
    def keeps_off_itself(self, q: Array) -> bool:
        return self.asked.keeps_off_itself(q[:, : self._dof])

    @property
    @override
    def all_constraints(self) -> tuple[Constraint, ...]:
        return self.asked.all_constraints

    def bind_constraints(
        self, start: Array, end: Array, *, apart: bool = True, decomposed: bool = False
    ) -> tuple[BoundConstraint, ...]:
        """See `Problem.bind_constraints`: with the bands, and that pinned ends are on the path."""
        n, ends = self._dof, (start, end)
        own = self.asked.bind_constraints(start[:n], end[:n], apart=apart, decomposed=decomposed)
        found = [self._bound(item, ends) for item in own]
        bands = [item for item in self.asked.relaxations if np.isfinite(item.band)]
        limited = set[frozenset[int]]()
        for item in bands:
            of_row = RowWithinBand.of_row(item, self.follows)
            if of_row is not None:
                found.append(of_row)
                continue
            found.append(WithinBand.of(item, self.follows))
            each = RowWithinBand.of_each(item, self.follows)
            # Rows with bands in several windows are limited once: nothing is asked twice at once.
            rows = frozenset(item.indices)
            if each is not None and rows not in limited:
                limited.add(rows)
                found.append(each)
        pinned = any(item.pins[1] for item in self.asked.constraints)
        given = any(item.fixed_end(self.asked.robot) is not None for item in self.asked.constraints)
        if pinned and not given:
            at_zero = n + np.flatnonzero(self.follows.virtual.at_zero)
            null = np.eye(self.robot.dof)[:, at_zero]
            found.append(BoundEnd("end on the path", (0,), np.zeros(self.robot.dof), null))
        return tuple(found)

    def _bound(self, item: BoundConstraint, ends: tuple[Array, Array]) -> BoundConstraint:
        """Return a condition on the arm as one on all joints, of motions between such ends."""
        if isinstance(item, BoundLimits | BoundClearance):
            # They ask of the arm's joints alone, by their numbers.
            return item
        if not isinstance(item, BoundEnd):
            return BoundOfArm(item, self.asked.follows)
        at, target = ends[0 if item.target is None else item.row], item.target
        if target is not None:
            duration = self.path.duration
            if 0 in item.orders:
                at = self.at(np.array([duration if item.row else 0.0]), target[None])[0]
                target = at
            else:
                target = np.append(target, np.zeros(self.robot.dof - self._dof))
        return replace(item, target=target, null=self.follows.null_basis(at))

    @cached_property
    @override
    def rest_orders(self) -> tuple[int, int]:
        return self.asked.rest_orders

    @cached_property
    @override
    def damping_law(self) -> DampingLaw | None:
        return self.asked.damping_law

    @cached_property
    @override
    def requirements(self) -> tuple[Requirement, ...]:
        return self.asked.requirements

    @cached_property
    @override
    def envelope_without_arm(self) -> Envelope:
        return self._envelope(self.asked.envelope_without_arm)

    @cached_property
    @override
    def envelope(self) -> Envelope:
        return self._envelope(self.asked.envelope)

    def _envelope(self, own: Envelope) -> Envelope:
        """Return an arm's envelope with that of its virtual joints."""
        n, robot = self._dof, self.robot
        free = np.full(robot.dof - n, np.inf)
        bodies = [(cast(CollisionModel, BodiesOfArm(model)), far) for model, far in own.bodies]
        several = [
            widest_band(item, self.follows)
            for item in self.asked.relaxations
            if len(item.rows) > 1 and np.isfinite(self.follows.virtual.widest(item.indices))
        ]
        speed, acceleration, jerk = (
            read_only(np.append(rate, free)) for rate in (own.speed, own.acceleration, own.jerk)
        )
        return Envelope(
            read_only(np.append(own.lower, robot.lower[n:])),
            read_only(np.append(own.upper, robot.upper[n:])),
            speed,
            acceleration,
            jerk,
            tuple(bodies),
            (*(quantity_of_arm(item, n) for item in own.quantities), *several),
        )

    def certify(
        self,
        trajectory: Trajectory,
        tolerance: Tolerance | None = None,
        ending: str = "",
        besides: Sequence[Requirement] = (),
        progress: Progress = silent,
    ) -> Certificate:
        """See `Problem.certify`: of the arm's own motion."""
        own = self.own(trajectory)
        return self.asked.certify(own, tolerance, ending, besides, progress)

    @override
    def errors_between(self, trajectory: Trajectory) -> Array:
        return self.asked.errors_between(self.own(trajectory))

    @cached_property
    @override
    def knots(self) -> Array:
        return self.asked.knots

    @cached_property
    @override
    def length_in_reaches(self) -> float:
        return self.asked.length_in_reaches


# `Problem.augmented` makes one; this file imports that one, so that the class is set here.
Problem._augmentation = AugmentedProblem
