"""Newton's method onto the self-motions of many poses at once."""

import numpy as np

from selfmotion.basics import Array, Flags, RobotError
from selfmotion.follow import Follows
from selfmotion.search import projection
from selfmotion.search.settings import FAR_STEPS, ITERATIONS, LONGEST_CORRECTION, NEAR_STEPS

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
    chains : (F, c + 1, 6, 3)
        See `Follows.chains`.
    layout : (1, 9 + n)
        See `Follows.layout`.

    Raises
    ------
    RobotError
        The compiled kinematics are not those of Pinocchio.
    """

    def __init__(self, follows: Follows, lower: Array, upper: Array) -> None:
        self.follows, self.robot = follows, follows.robot
        # Copies: kernels are compiled anew for what may not be written to.
        self._limits = np.array(lower), np.array(upper)
        self._limited = np.isfinite(upper)
        self.chains = follows.chains
        self.revolute: Flags = follows.robot.is_revolute
        self.layout = follows.layout
        self._check()

    def project(
        self, q: Array, target: Array, *, far: bool = False, held: Flags | None = None
    ) -> tuple[Array, Flags]:
        """Return the configurations (K, n) that Newton's method reaches, and where it does, (K,).

        From where it reaches none of its target, it is given more steps.

        Parameters
        ----------
        q : (K, n)
        target : (12 F,) or (K, 12 F)
            See `Follows.targets`.
        far : bool
            Whether q is any configuration instead of one near the solution.
        held : (n,) or (K, n), optional
            Joints that have to stand at 0; by default none.
        """
        wanted = np.array(np.broadcast_to(target, (len(q), np.shape(target)[-1])), order="C")
        still = np.array(np.broadcast_to(False if held is None else held, q.shape))
        found, arrived = self._within(q, wanted, still, FAR_STEPS if far else NEAR_STEPS)
        # Near singular poses Newton's method takes many steps, from near as well.
        alone = ~arrived if np.ndim(target) == 2 else np.full(len(q), not arrived.any())
        if not far and alone.any():
            found[alone], arrived[alone] = self._within(
                q[alone], wanted[alone], still[alone], FAR_STEPS
            )
        # Joints that share a band may be within their limits, and beyond that together.
        within = np.where(self._limited, self.follows.within_bands(found), np.inf)
        beyond = arrived & (np.abs(found) > within).any(axis=1)
        if beyond.any():
            given = found[beyond], wanted[beyond], still[beyond], FAR_STEPS, within[beyond]
            found[beyond], arrived[beyond] = self._within(*given)
        return found, arrived

    def approach(self, q: Array, target: Array, held: Flags) -> tuple[Array, Array]:
        """Return configurations (K, n) brought as near to a target (12 F,) as limits let them.

        Slower than `project`, it arrives at stretched poses and with joints at their limits, too;
        joints that are `held` (n,) stand at 0.

        Returns
        -------
        q : (K, n)
        misses : (K, 2)
            What is left [m], [rad].
        """
        found, left = np.array(q), np.zeros((len(q), self.follows.dimension))
        limits = *self._limits, np.array(held)
        projection.approach_all(found, target, self.chains, self.layout, *limits, ITERATIONS, left)
        linear = self.follows.linear > 0.0
        parts = np.where(linear, left, 0.0), np.where(linear, 0.0, left)
        misses = [np.sqrt(np.einsum("km,km->k", part, part)) for part in parts]
        return found, np.stack(misses, axis=1)

    def _within(
        self, q: Array, targets: Array, still: Flags, steps: int, most: Array | float = np.inf
    ) -> tuple[Array, Flags]:
        """Return what Newton's method makes of q (K, n), no |q| more than `most` besides limits."""
        found, arrived = np.array(q, order="C"), np.zeros(len(q), dtype=bool)
        # In one order of memory: each is a kernel of its own.
        sides = np.maximum(self._limits[0], -most), np.minimum(self._limits[1], most)
        lower, upper = (np.array(np.broadcast_to(side, q.shape), order="C") for side in sides)
        projection.project_all(
            found,
            targets,
            self.chains,
            self.layout,
            lower,
            upper,
            np.array(still, order="C"),
            LONGEST_CORRECTION,
            steps,
            arrived,
        )
        return found, arrived

    def _check(self) -> None:
        """Compare with Pinocchio: where it puts the tool, nothing is left to correct."""
        ends = zip(self._limits, self.robot.finite_limits(), strict=True)
        lower, upper = (np.where(np.isfinite(own), own, finite) for own, finite in ends)
        for q in np.random.default_rng(0).uniform(lower, upper, (3, self.robot.dof)):
            items = self.follows.items
            poses = [item.chain.place(q) for item in items]
            target = np.concatenate(
                [part for pose in poses for part in (pose.translation, pose.rotation.ravel())]
            )
            still = np.zeros((1, len(q)), dtype=np.bool_)
            found, arrived = self._within(q[None], target[None], still, NEAR_STEPS)
            for item, pose in zip(items, poses, strict=True):
                miss = max(item.miss(pose, found[0]))
                if not (arrived[0] and miss < _AGREE):
                    raise RobotError(
                        f"{self.robot.name}: compiled kinematics put '{item.chain.tip_name}' "
                        f"{miss:.3g} off where Pinocchio does; this is an error of selfmotion's"
                    )
