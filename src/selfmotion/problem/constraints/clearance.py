"""Clearance: distance from obstacles, and between links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, cast
from weakref import WeakKeyDictionary

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints, ProblemError, as_number, shown
from selfmotion.certificate import Separation
from selfmotion.model.collision import (
    ClearanceModel,
    Clearances,
    CollisionModel,
    Obstacle,
    disabled_links,
    how_near,
    obstacle_from_dict,
)
from selfmotion.model.robot import RobotModel
from selfmotion.problem.constraints.base import Constraint, Envelope
from selfmotion.problem.constraints.bound import Conditions
from selfmotion.problem.constraints.conditions import (
    BoundConstraint,
    Linear,
    NodeTangents,
    motion_of_order,
)
from selfmotion.problem.costs import Samples

# Largest distance that is accepted [m].
_FARTHEST = 3.0


@dataclass(frozen=True, eq=False)
class Clearance(Constraint):
    """The arm and attached bodies have a minimum distance from obstacles and from each other.

    An obstacle with a `frame` rides on that link, like another link that is fixed to it. While
    optimising, links are their convex hulls and obstacles with hollows convex pieces that contain
    them; the certificate measures the meshes themselves.
    Obstacles of the world are not checked against the immovable base: no motion changes that
    distance, and an arm bolted to a table touches it.

    Parameters
    ----------
    obstacles : Obstacle or sequence of Obstacle
        Obstacles in the world, and bodies attached to links.
    distance : float
        Smallest distance [m].
    srdf : path, optional
        File whose ``disable_collisions`` are left out as well. It is read once, here.
    disabled : sequence of (str, str)
        Pairs of links or obstacles that are left out.
    only : sequence of str
        Names of obstacles: pairs of which neither is one of these are left out. By default none is.

    Raises
    ------
    CollisionError
        The SRDF cannot be read.
    """

    kept_moving: ClassVar[bool] = True

    obstacles: tuple[Obstacle, ...] = ()
    distance: float = 5e-3
    srdf: InitVar[str | Path | None] = None
    disabled: tuple[tuple[str, str], ...] = ()
    only: tuple[str, ...] = ()

    def __post_init__(self, srdf: str | Path | None) -> None:
        given: Any = self.obstacles
        listed = (given,) if isinstance(given, Obstacle) else given
        if not (
            isinstance(listed, list | tuple) and all(isinstance(item, Obstacle) for item in listed)
        ):
            raise ProblemError(
                f"clearance: obstacles are {shown(self.obstacles)}, expected Box, Sphere, "
                f"Cylinder, Capsule or Mesh"
            )
        object.__setattr__(self, "obstacles", tuple(listed))
        if not isinstance(self.disabled, list | tuple):
            raise ProblemError(
                f"clearance: disabled is {shown(self.disabled)}, expected pairs of names of links"
            )
        pairs = [_pair(item) for item in self.disabled]
        read = () if srdf is None else disabled_links(srdf)
        object.__setattr__(self, "disabled", tuple(dict.fromkeys((*pairs, *read))))
        object.__setattr__(self, "only", self._only())
        distance = as_number(self.distance, "clearance: distance", least=0.0)
        if distance > _FARTHEST:
            raise ProblemError(
                f"clearance: distance is {distance:g} m, farther than arms keep from anything, "
                f"expected at most {_FARTHEST:g}; in millimetres? It is in m (distance_mm in files)"
            )
        object.__setattr__(self, "distance", distance)

    def _only(self) -> tuple[str, ...]:
        """Return the names in `only`, or raise ProblemError."""
        given: Any = self.only
        known = [item.name for item in self.obstacles]
        if not isinstance(given, list | tuple):
            raise ProblemError(f"clearance: only is {shown(given)}, expected names of obstacles")
        for name in given:
            if name not in known:
                raise ProblemError(
                    f"clearance: only has {shown(name)}, which is none of its obstacles; expected "
                    f"one of {', '.join(known)}"
                )
        return tuple(given)

    @property
    def is_no_overlap(self) -> bool:
        """Whether it asks no more than that links do not overlap, which they rarely do."""
        return not self.obstacles and self.distance == 0.0

    def keeps_as_far(self, other: Clearance) -> bool:
        """Return whether it keeps all that another does of the arm itself and its own bodies."""
        keeps_pairs = not self.only or (bool(other.only) and set(other.only) <= set(self.only))
        return (
            keeps_pairs
            and self.distance >= other.distance
            and set(self.disabled) <= set(other.disabled)
        )

    @override
    def applies(self, robot: RobotModel) -> bool:
        """Return whether the arm has bodies, for the default one; else True."""
        return self is not NO_OVERLAP or robot.urdf.has_collisions

    def model(self, robot: RobotModel) -> CollisionModel:
        """Return the exact model that the certificate uses, cached by arm.

        Raises
        ------
        ProblemError
            The arm has no collision geometry.
        """
        return self._models(robot).exact

    @override
    def conditions(self, robot: RobotModel) -> Conditions:
        return Conditions(points=(BoundClearance(self._models(robot).smooth, self.distance),))

    @override
    def decomposed_conditions(self, robot: RobotModel) -> Conditions:
        return Conditions(points=(BoundClearance(self._models(robot).decomposed, self.distance),))

    @override
    def requirement(self, robot: RobotModel) -> Separation:
        return Separation(self.model(robot), self.distance)

    @override
    def envelope(self, robot: RobotModel) -> Envelope:
        return replace(Envelope.unbounded(robot.dof), bodies=((self.model(robot), self.distance),))

    @classmethod
    @override
    def from_dict(cls, values: Mapping[str, Any], **context: Any) -> Clearance:
        obstacles = tuple(obstacle_from_dict(item) for item in values["obstacles"])
        return cls(**{**values, "obstacles": obstacles})

    @override
    def to_dict(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "obstacles": [obstacle.to_dict() for obstacle in self.obstacles],
            "distance": self.distance,
            "disabled": [list(pair) for pair in self.disabled],
            # Files of before have none.
            **({"only": list(self.only)} if self.only else {}),
        }

    def _models(self, robot: RobotModel) -> _Models:
        by_robot = _models_of.setdefault(self, WeakKeyDictionary())
        if robot not in by_robot:
            by_robot[robot] = _Models(self, robot)
        return by_robot[robot]


# Default: links must not overlap; one object, so that its bodies are built once by arm.
NO_OVERLAP = Clearance(distance=0.0)


# Warning where a clearance is among the constraints of what is called {}.
MOVED_CLEARANCE = (
    "a Clearance is among the constraints, where the next version will not take it: write "
    "{}(…, clearance=Clearance(…)), or clearance=[Clearance(…), …] of several"
)


def as_clearances(given: Any) -> tuple[Clearance, ...]:
    """Return what is given as a clearance: one or several, None for none.

    Raises
    ------
    ProblemError
        It is something else.
    """
    listed = (given,) if isinstance(given, Clearance) else () if given is None else given
    if isinstance(listed, list | tuple) and all(isinstance(item, Clearance) for item in listed):
        return tuple(listed)
    raise ProblemError(
        f"clearance is {shown(given)}, expected a Clearance, a list of several, or None"
    )


def with_own_distances(clearance: Clearance, own: Mapping[str, float]) -> tuple[Clearance, ...]:
    """Return a clearance, and one for each of its obstacles with a distance of its own (by name).

    Raises
    ------
    ProblemError
        The clearance is `only` of some obstacles.
    """
    apart = [item for item in clearance.obstacles if item.name in own]
    if not apart:
        return (clearance,)
    if clearance.only:
        raise ProblemError(
            f"clearance: is only of {', '.join(clearance.only)}, and obstacle '{apart[0].name}' "
            f"has a distance of its own; give one of the two"
        )
    rest = tuple(item for item in clearance.obstacles if item.name not in own)
    found = [_of_obstacles(clearance, rest, clearance.distance)]
    for item in apart:
        # What stands does not come near to what stands.
        others = (
            other
            for other in clearance.obstacles
            if other is not item and (item.frame is not None or other.frame is not None)
        )
        found.append(_of_obstacles(clearance, (item, *others), own[item.name], item.name))
    return tuple(found)


def _of_obstacles(
    clearance: Clearance, obstacles: Sequence[Obstacle], distance: float, only: str = ""
) -> Clearance:
    """Return a clearance of some obstacles, and of one of them alone, at another distance."""
    left = {item.name for item in clearance.obstacles} - {item.name for item in obstacles}
    disabled = tuple(
        pair for pair in clearance.disabled if left.isdisjoint(pair) and (not only or only in pair)
    )
    return Clearance(tuple(obstacles), distance, disabled=disabled, only=(only,) if only else ())


def clearances_among(constraints: Sequence[Constraint]) -> tuple[Clearance, ...]:
    """Return the clearances among constraints, in their order."""
    return tuple(item for item in constraints if isinstance(item, Clearance))


def without_clearances(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
    """Return the other constraints, in their order."""
    return tuple(item for item in constraints if not isinstance(item, Clearance))


def separate_clearances(
    constraints: Sequence[Constraint], clearance: Any
) -> tuple[tuple[Constraint, ...], tuple[Clearance, ...]]:
    """Return constraints without clearances, and all clearances.

    Those among the constraints come first, and take the place of the default.
    """
    moved, given = clearances_among(constraints), as_clearances(clearance)
    if moved and len(given) == 1 and given[0] is NO_OVERLAP:
        given = ()
    return without_clearances(constraints), (*moved, *given)


def _pair(given: Any) -> tuple[str, str]:
    """Return a pair of links as it was given, or raise ProblemError."""
    match given:
        case [str() as first, str() as second] if first != second:
            return first, second
    raise ProblemError(f"clearance: disabled has {shown(given)}, expected pairs of names of links")


class _Models:
    """The exact model of a clearance, and the one that the optimiser follows."""

    def __init__(self, wanted: Clearance, robot: RobotModel) -> None:
        self.exact = CollisionModel(robot, wanted.obstacles, wanted.disabled, wanted.only)
        self._near = wanted.distance + _NEAR
        if not self.exact.has_bodies:
            raise ProblemError(
                f"{robot.name}: a clearance is asked for, but its URDF has no collision geometry "
                f"to measure from; add <collision> to its links, or leave the clearance out"
            )
        if self.exact.standing and not self.exact.to_world.any():
            raise ProblemError(
                f"{robot.name}: a clearance from obstacles is asked for, but no link that moves "
                f"has collision geometry; add <collision> to those, or leave the obstacles out"
            )

    @cached_property
    def smooth(self) -> ClearanceModel:
        return ClearanceModel(self.exact, self._near)

    @cached_property
    def decomposed(self) -> ClearanceModel:
        return ClearanceModel(self.exact, self._near, decompose_links=True)


# Models take a good part of a second to make, and each start of a plan needs them.
_models_of: WeakKeyDictionary[Clearance, WeakKeyDictionary[RobotModel, _Models]] = (
    WeakKeyDictionary()
)


@dataclass(frozen=True, eq=False)
class BoundClearance(BoundConstraint):
    """h = (d_min + margin - d) / 0.1 m for each pair of bodies."""

    model: ClearanceModel
    distance: float
    name: str = "clearance"
    margin: float = 1e-4
    tolerance: float = field(init=False)
    _last: list[Any] = field(default_factory=list, init=False, repr=False)

    def __post_init__(self) -> None:
        # Half the margin is left.
        object.__setattr__(self, "tolerance", 0.5 * self.margin / _METRE)

    @override
    def residual(self, samples: Samples) -> Array:
        return (self.distance + self.margin - self._clearances(samples).values) / _METRE

    @override
    def exceeds(self, samples: Samples, level: float) -> Flags:
        # Where the distances are not known yet, this takes much less time than these.
        least = self.distance + self.margin - level * _METRE
        q = motion_of_order(samples, 0)
        if self._knows(q):
            return np.asarray((self._last[1].values < least).any(axis=1))
        return self.model.closer(q, least)

    @override
    def stricter(self, by: float) -> BoundClearance:
        return replace(self, distance=self.distance + by)

    @override
    def tangents(self, samples: Samples, motion: NodeTangents) -> Array:
        return _Pull(self._clearances(samples)).all(motion)

    @override
    def linearised_at(self, samples: Samples) -> tuple[tuple[int, int], Linear]:
        now = self._clearances(samples)
        return (len(now.values), now.values.shape[1]), _Pull(now)

    def _clearances(self, samples: Samples) -> Clearances:
        """Return the distances at the nodes; those of the last motion are cached."""
        q = motion_of_order(samples, 0)
        if not self._knows(q):
            self._last[:] = [q, self.model.clearances(q)]
        return cast(Clearances, self._last[1])

    def _knows(self, q: Array) -> bool:
        return bool(self._last) and np.array_equal(self._last[0], q)

    @override
    def easing(self, column: int) -> tuple[float, str]:
        first, second = self.model.pairs[column]
        return 1e-3 / _METRE, f"1 mm less between '{first}' and '{second}'"

    @override
    def describe(self, samples: Samples, row: int, column: int) -> str:
        first, second = self.model.pairs[column]
        value = self.distance + self.margin - self.residual(samples)[row, column] * _METRE
        of_hulls = "" if self.model.is_exact(column) else "the convex hulls of "
        return (
            f"{of_hulls}'{first}' and '{second}' {how_near(value)} at t = "
            f"{samples.sampling.node_times[row]:.3f} s, wanted {self.distance * 1e3:.2f} mm"
        )


@dataclass(frozen=True, eq=False)
class _Pull:
    """Derivatives of clearances by the motion."""

    clearances: Clearances

    def all(self, motion: NodeTangents) -> Array:
        """Return the entries of all rows and columns."""
        return self.clearances.along(-motion.q / _METRE)

    def picked(self, motion: NodeTangents, rows: Ints, columns: Ints) -> Array:
        """See `Linear.picked`."""
        slopes = self.clearances.slopes_at(rows, columns)
        return np.asarray(np.einsum("kn,knd->kd", slopes, motion.q[rows])) / -_METRE


# Distances saturate this far beyond the required one [m]: well outside of the optimiser's active
# range.
_NEAR = 0.01
# Unit of clearances [m]: with it they have about the weight of joint angles.
_METRE = 0.1
