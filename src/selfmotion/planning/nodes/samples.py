"""Samples of a motion of nodes, which costs and constraints are functions of."""

from collections.abc import Callable
from functools import cached_property

from selfmotion.basics import Array, read_only
from selfmotion.model.follow import Follows
from selfmotion.model.motion import Sampling
from selfmotion.problem.costs import PlacedLater


class CurveSamples(PlacedLater):
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

    def forget(self) -> None:
        """Drop cached values."""
        for name in ("q", "qd", "qdd", "qddd", "_placed", "_of_arm"):
            self.__dict__.pop(name, None)
