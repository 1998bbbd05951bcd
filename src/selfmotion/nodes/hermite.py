"""What costs and constraints see of a motion between nodes."""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from selfmotion.basics import Array, read_only
from selfmotion.costs import PlacedLater
from selfmotion.follow import Follows
from selfmotion.motion import Trajectory
from selfmotion.nodes.spline import SHARES, Hermite

_SAMPLES = len(SHARES)


class _WithRates(PlacedLater, ABC):
    """A motion whose derivatives are known; those of splines at nodes are means of both sides."""

    @cached_property
    def q(self) -> Array:
        """Joint coordinates, (S, n)."""
        return read_only(self._of_order(0))

    @cached_property
    def qd(self) -> Array:
        """Joint velocities, (S, n)."""
        return read_only(self._of_order(1))

    @cached_property
    def qdd(self) -> Array:
        """Joint accelerations, (S, n)."""
        return self._of_order(2)

    @cached_property
    def qddd(self) -> Array:
        """Joint jerks, (S, n)."""
        return self._of_order(3)

    @abstractmethod
    def _of_order(self, order: int) -> Array:
        """Return a derivative of q at the samples, (S, n)."""


class HermiteSamples(_WithRates):
    """A Hermite spline as costs see it.

    Parameters
    ----------
    follows : Follows
    spline : Hermite
    q, qd : (N + 1, n)
        At the nodes.

    Attributes
    ----------
    spline : Hermite
    ends : (N, 4, n)
        q and q̇ at both ends of each interval.
    """

    ends: Array
    spline: Hermite
    _at_nodes: tuple[Array, Array]

    def __init__(self, follows: Follows, spline: Hermite, q: Array, qd: Array) -> None:
        ends = np.stack([q[:-1], qd[:-1], q[1:], qd[1:]], axis=1)
        if spline.gaps.size:
            ends[spline.gaps, 2] = ends[spline.gaps, 0]
            ends[spline.gaps, 1::2] = 0.0
        for name, value in (("spline", spline), ("_at_nodes", (q, qd)), ("ends", ends)):
            object.__setattr__(self, name, value)
        super().__init__(follows, spline.sampling)

    @cached_property
    def checked(self) -> "CheckedSamples":
        """The same as constraints see it."""
        return CheckedSamples(self)

    def forget(self) -> None:
        """Let go of what can be computed anew."""
        for name in ("checked", "q", "qd", "qdd", "qddd", "_placed", "_of_arm"):
            self.__dict__.pop(name, None)

    def _of_order(self, order: int) -> Array:
        count, _, n = self.ends.shape
        found = np.empty((_SAMPLES * count + 1, n))
        inner = self.spline.bases[order] @ self.ends
        found[:-1] = inner.reshape(-1, n)
        found[::_SAMPLES] = self.at_nodes(order)
        return found

    def at_nodes(self, order: int) -> Array:
        """Return q (0), q̇ (1), q̈ (2) or the jerk (3) at the nodes, (N + 1, n)."""
        if order < 2:
            return self._at_nodes[order]
        return self.spline.at_nodes(order, *self._at_nodes)


class CheckedSamples(_WithRates):
    """A Hermite spline as constraints see it: at its nodes, and `between` them.

    Parameters
    ----------
    samples : HermiteSamples
    """

    _samples: HermiteSamples

    def __init__(self, samples: HermiteSamples) -> None:
        object.__setattr__(self, "_samples", samples)
        super().__init__(samples.follows, samples.spline.checked)

    def _of_order(self, order: int) -> Array:
        samples = self._samples
        found = np.empty((2 * len(samples.ends) + 1, samples.ends.shape[2]))
        found[::2] = samples.at_nodes(order)
        between = samples.spline.between[order]
        found[1::2] = np.einsum("ka,kan->kn", between, samples.ends)
        return found


class QuinticSamples(_WithRates):
    """A trajectory as costs see it.

    Parameters
    ----------
    follows : Follows
    spline : Hermite
        Of the same nodes.
    trajectory : Trajectory
    """

    _trajectory: Trajectory

    def __init__(self, follows: Follows, spline: Hermite, trajectory: Trajectory) -> None:
        object.__setattr__(self, "_trajectory", trajectory)
        super().__init__(follows, spline.sampling)

    def _of_order(self, order: int) -> Array:
        return self._trajectory.within(SHARES, order)
