"""A motion at sample times, in the coordinates that costs and conditions are functions of."""

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Sampling
from selfmotion.problem.constraints import BoundConstraint, DependsOn
from selfmotion.problem.costs import LazySamples, Samples

# Derivatives of samples, by order.
_NAMES = ("q", "qd", "qdd", "qddd")


class CurveSamples(LazySamples):
    """A motion whose derivatives are known.

    Parameters
    ----------
    follows : Follows
    sampling : Sampling
    of_order : callable
        ``of_order(o)`` → q (0), q̇ (1), q̈ (2) or the jerk (3) at the samples, (S, n).
    """

    _of_order: Callable[[int], Array]

    def __init__(
        self, follows: Follows, sampling: Sampling, of_order: Callable[[int], Array]
    ) -> None:
        object.__setattr__(self, "_of_order", of_order)
        super().__init__(follows, sampling)

    @cached_property
    def q(self) -> Array:
        """Joint coordinates, (S, n)."""
        return self._cached(0)

    @cached_property
    def qd(self) -> Array:
        """Joint velocities, (S, n)."""
        return self._cached(1)

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n)."""
        return self._cached(2)

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return self._cached(3)

    def _cached(self, order: int) -> Array:
        values: Array = self._of_order(order)
        return read_only(values)


class SampledMotion:
    """A motion of z = (q, δ), and its parts: of the arm, and of the virtual joints.

    Parameters
    ----------
    follows : Follows
        Task frames of the arm alone.
    every : Samples
        The motion of all coordinates.

    Attributes
    ----------
    every : Samples
    """

    def __init__(self, follows: Follows, every: Samples) -> None:
        self._follows, self.every = follows, every

    @cached_property
    def arm(self) -> Samples:
        """The arm's joints, as costs and constraints see them."""
        n = self._follows.dof
        if self.every.q.shape[1] == n:
            return self.every
        return self._columns(slice(0, n))

    @cached_property
    def tolerances(self) -> Samples:
        """The virtual joints."""
        return self._columns(slice(self._follows.dof, None))

    def _columns(self, which: slice) -> CurveSamples:
        every = self.every

        def of_order(order: int) -> Array:
            return np.ascontiguousarray(getattr(every, _NAMES[order])[:, which])

        return CurveSamples(self._follows, every.sampling, of_order)

    def seen_by(self, item: BoundConstraint) -> Samples:
        """Return the motion in the coordinates that a condition is a function of."""
        match item.depends_on:
            case DependsOn.ARM:
                return self.arm
            case DependsOn.TOLERANCES:
                return self.tolerances
            case DependsOn.ALL:
                return self.every

    def with_conditions(
        self, conditions: Iterable[BoundConstraint]
    ) -> Iterator[tuple[BoundConstraint, Samples]]:
        """Yield conditions, each with the motion as it sees it."""
        return ((item, self.seen_by(item)) for item in conditions)
