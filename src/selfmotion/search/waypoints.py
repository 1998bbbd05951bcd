"""A path's waypoints as the sampled search knows them: where configurations are, how they move."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.engine import carried_bases
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel
from selfmotion.search.allowed import Allowed
from selfmotion.search.manifold import Manifold
from selfmotion.search.settings import FEWEST_STRAYS
from selfmotion.task import Relaxation


class Waypoints(Protocol):
    """Configurations that put the tool where it may be at each of W waypoints."""

    @property
    def robot(self) -> RobotModel:
        """The arm."""

    @property
    def count(self) -> int:
        """W."""

    @property
    def fewest_strays(self) -> int:
        """So many tries at least around the samples that a chain reaches, however few these are."""

    def project(self, q: Array, i: int, *, far: bool = False) -> tuple[Array, Flags]:
        """Return what Newton's method makes of q (K, n) at waypoint i, and where it arrives."""

    def project_each(self, q: Array, i: Ints) -> tuple[Array, Flags]:
        """Return the same of q (K, n), each at its own waypoint (K,)."""

    def bases(self, q: Array) -> Array:
        """Return bases of the directions that a motion q (W, n) may move aside in, (W, n, d).

        Each turned to the one before.
        """


class OnPath:
    """Those whose tool is on its path.

    Parameters
    ----------
    follows : Follows
    t : (W,)
        Times of the waypoints [s].
    lower, upper : (n,)
        Joint limits [rad or m].
    """

    def __init__(self, follows: Follows, t: Array, lower: Array, upper: Array) -> None:
        self._follows, self._manifold = follows, Manifold(follows, lower, upper)
        self._targets, self.robot, self.count = follows.targets(t), follows.robot, len(t)
        self.fewest_strays = 0

    def project(self, q: Array, i: int, *, far: bool = False) -> tuple[Array, Flags]:
        """See `Waypoints.project`."""
        return self._manifold.project(q, self._targets[i], far=far)

    def project_each(self, q: Array, i: Ints) -> tuple[Array, Flags]:
        """See `Waypoints.project_each`."""
        return self._manifold.project(q, self._targets[i])

    def bases(self, q: Array) -> Array:
        """See `Waypoints.bases`."""
        return carried_bases(self._follows, q)


class NearPath:
    """Those whose tool is on its path up to what relaxed rows allow.

    Parameters
    ----------
    follows : Follows
    relaxations : sequence of Relaxation
    pinned : (bool, bool)
    t : (W,)
        Times of the waypoints [s].
    lower, upper : (n,)
        Joint limits [rad or m].
    """

    def __init__(
        self,
        follows: Follows,
        relaxations: Sequence[Relaxation],
        pinned: tuple[bool, bool],
        t: Array,
        lower: Array,
        upper: Array,
    ) -> None:
        self.allowed = Allowed(follows, relaxations, pinned, lower, upper)
        self._follows, self.t = follows, t
        self.robot, self.count = follows.robot, len(t)
        # With deviations there are more directions in which to stray.
        self.fewest_strays = FEWEST_STRAYS
        # Where a pose is looked for from anywhere, deviations are anywhere, too.
        self._rng = np.random.default_rng(0)

    def project(self, q: Array, i: int, *, far: bool = False) -> tuple[Array, Flags]:
        """See `Waypoints.project`."""
        if not len(q):
            return q, np.zeros(0, dtype=bool)
        t = float(self.t[i])
        away = self.allowed.anywhere(len(q), t, self._rng) if far else self.allowed.deviation(q, t)
        found, _, arrived = self.allowed.project(q, t, far=far, deviation=away)
        return found, arrived

    def project_each(self, q: Array, i: Ints) -> tuple[Array, Flags]:
        """See `Waypoints.project_each`."""
        found, arrived = q.copy(), np.zeros(len(q), dtype=bool)
        for waypoint in np.unique(i):
            here = i == waypoint
            found[here], arrived[here] = self.project(q[here], int(waypoint))
        return found, arrived

    def bases(self, q: Array) -> Array:
        """See `Waypoints.bases`."""
        spaces = [self.allowed.directions(x, float(t)) for x, t in zip(q, self.t, strict=True)]
        # Windows begin and end: what all have in common, so that a chain moves aside as a whole.
        least = min(space.shape[1] for space in spaces)
        return turned_to_the_last([space[:, :least] for space in spaces])


def turned_to_the_last(spaces: Sequence[Array]) -> Array:
    """Return bases (W, n, d) of spaces with orthonormal columns, each turned to the one before."""
    turned = [spaces[0]]
    for space in spaces[1:]:
        left, _, right = np.linalg.svd(space.T @ turned[-1])
        turned.append(space @ (left @ right))
    return np.array(turned)
