"""A path's waypoints as the sampled search knows them: where configurations are, how they move."""

from selfmotion.basics import Array, Flags, Ints
from selfmotion.follow import Follows
from selfmotion.kernels import carried
from selfmotion.robot import null_space
from selfmotion.search.manifold import Manifold


class OnPath:
    """Configurations that put the tool on its path at each of W waypoints.

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
        self._held = follows.held(t)

    def project(self, q: Array, i: int, *, far: bool = False) -> tuple[Array, Flags]:
        """Return what Newton's method makes of q (K, n) at waypoint i, and where it arrives."""
        return self._manifold.project(q, self._targets[i], far=far, held=self._held[i])

    def project_each(self, q: Array, i: Ints) -> tuple[Array, Flags]:
        """Return the same of q (K, n), each at its own waypoint (K,)."""
        return self._manifold.project(q, self._targets[i], held=self._held[i])

    def bases(self, q: Array) -> Array:
        """Return bases of the directions that a motion q (W, n) may move aside in, (W, n, d).

        Each turned to the one before.
        """
        jacobians = self._follows.jacobians(q)
        return carried(null_space(jacobians[0]), jacobians)
