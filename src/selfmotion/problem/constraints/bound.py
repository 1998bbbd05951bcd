"""Conditions of constraints on the motion of one arm, by how they are imposed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from selfmotion.problem.constraints.bound_ends import EndCondition
from selfmotion.problem.constraints.bound_limits import BoundLimits
from selfmotion.problem.constraints.conditions import BoundConstraint


class Conditions(NamedTuple):
    """Conditions of constraints on an arm.

    Attributes
    ----------
    limits : tuple of BoundLimits
        Of joints, imposed on the control points of the curve, so that it keeps them everywhere.
    points : tuple of BoundConstraint
        Any other inequalities, imposed at collocation points of each interval.
    ends : tuple of EndCondition
        Equalities at the ends of the motion.
    """

    limits: tuple[BoundLimits, ...] = ()
    points: tuple[BoundConstraint, ...] = ()
    ends: tuple[EndCondition, ...] = ()

    @classmethod
    def joined(cls, each: Iterable[Conditions]) -> Conditions:
        """Return the conditions of several constraints as one, in their order."""
        parts = list(each)
        return cls(
            tuple(item for part in parts for item in part.limits),
            tuple(item for part in parts for item in part.points),
            tuple(item for part in parts for item in part.ends),
        )
