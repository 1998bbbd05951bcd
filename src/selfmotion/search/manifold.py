"""Newton's method onto the self-motions of many poses at once."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, RobotError
from selfmotion.engine import transport
from selfmotion.follow import Follows
from selfmotion.search import kernels

_NEAR_STEPS, _FAR_STEPS = 10, 60
# Longest single correction [rad or m].
_LONGEST = 0.5
# Compiled kinematics and Pinocchio's differ by rounding alone [m, or rows of a rotation].
_AGREE = 1e-9


class Manifold:
    """Projects configurations onto {q : F(q) = x} within limits, each by Newton's method.

    Parameters
    ----------
    follows : Follows
    lower, upper : (n,)
        Joint limits [rad or m], ±inf where there is none. Joints stop there while others go on.

    Attributes
    ----------
    revolute : (n,)
    chain : ChainArrays
        What compiled kinematics need: `Chain.arrays`.
    layout : (1, 9 + n)
        See `Follows.layout`.

    Raises
    ------
    RobotError
        The compiled kinematics are not those of Pinocchio.
    """

    def __init__(self, follows: Follows, lower: Array, upper: Array) -> None:
        self.follows, self.robot, self.task = follows, follows.robot, follows.task
        # Copies: kernels are compiled anew for what may not be written to.
        self._limits = np.array(lower), np.array(upper)
        self.chain = follows.only.chain.arrays
        self.revolute: npt.NDArray[np.bool_] = self.chain.is_revolute
        self.layout = follows.layout
        self._check()

    def project(
        self, q: Array, target: Array, *, far: bool = False
    ) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Return the configurations (K, n) that Newton's method reaches, and where it does, (K,).

        Parameters
        ----------
        q : (K, n)
        target : (12,) or (K, 12)
            See `targets`.
        far : bool
            Whether q is any configuration instead of one near the solution.
        """
        found, arrived = np.array(q), np.zeros(len(q), dtype=bool)
        wanted = np.array(np.broadcast_to(target, (len(q), 12)), order="C")
        steps = _FAR_STEPS if far else _NEAR_STEPS
        kernels.project_all(
            found, wanted, self.chain, self.layout, *self._limits, _LONGEST, steps, arrived
        )
        return found, arrived

    def carried_bases(self, q: Array) -> Array:
        """Return null-space bases along a motion (W, n), (W, n, r), each turned to the last one."""
        return transport(np.array([self.follows.jacobian(here) for here in q]))

    def _check(self) -> None:
        """Compare with Pinocchio: where it puts the tool, nothing is left to correct."""
        ends = zip(self._limits, self.robot.finite_limits(), strict=True)
        lower, upper = (np.where(np.isfinite(own), own, finite) for own, finite in ends)
        for q in np.random.default_rng(0).uniform(lower, upper, (3, self.robot.dof)):
            pose = self.robot.pose(q)
            target = np.concatenate([pose.translation, pose.rotation.ravel()])
            found, arrived = self.project(q[None], target)
            miss = max(self.task.miss(pose, self.robot.pose(found[0])))
            if not (arrived[0] and miss < _AGREE):
                raise RobotError(
                    f"{self.robot.name}: compiled kinematics put '{self.robot.tool}' {miss:.3g} "
                    f"off where Pinocchio does; this is an error of selfmotion's"
                )
