"""Newton's method onto the self-motions of many poses at once, and along a path's waypoints."""

from collections.abc import Callable

import numpy as np

from selfmotion.basics import Array, Flags, Ints, RobotError, called, inlined, kernel
from selfmotion.basics.layout import Layout
from selfmotion.model.follow import Follows, band_limits, chain_tables, linear_rows
from selfmotion.model.kernels import (
    carried,
    cholesky,
    clear_held,
    errors_and_rows,
    gram,
    rows_of,
    solve_cholesky,
    view,
)
from selfmotion.model.robot import null_space, place_tips

# Largest correction in one step [rad or m]: far starts diverge where J is nearly singular.
LONGEST_CORRECTION = 0.5
# Newton steps onto the path from nearby …
_NEAR_STEPS = 10
# … and from anywhere.
_FAR_STEPS = 60
# The damped method ends when its relative gain is below this …
_LITTLE_GAIN = 1e-3
# … in this number of steps in turn.
_LITTLE_GAINS = 5


# Size of a Newton correction [rad or m] at convergence: the error is its square.
CONVERGED = 1e-6
# Error of a converged solution [m, rad].
NOTHING_LEFT = 1e-12
# Difference of compiled kinematics and Pinocchio's by rounding [m, or rows of a rotation].
_AGREE = 1e-9


@kernel
def correct(
    q: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    target: Array,
    layout: Layout,
    tangent: Array,
    longest: float,
    space: Array,
) -> float:
    """Add J⁺e to q, no longer than `longest`, and project `tangent` onto the null space of J.

    Of all tips, (F, 6, n), (F, 3, 3) and (F, 3); `target` (12 F,) is as `Follows.targets` has it,
    `space` to work in, see `correction_space`. Returns the norm of the correction before it was
    shortened; -1 where J has no full rank.
    """
    n, m = jacobians.shape[2], rows_of(layout)
    z, along, step = view(space, 0, (m,)), view(space, m, (m,)), view(space, 2 * m, (n,))
    jacobian, factor = view(space, 2 * m + n, (m, n)), view(space, 2 * m + n + m * n, (m, m))
    errors_and_rows(layout, target, jacobians, rotations, translations, z, jacobian)
    for i in range(m):
        along[i] = 0.0
        for k in range(n):
            along[i] += jacobian[i, k] * tangent[k]
    gram(jacobian, factor)
    if not cholesky(factor):
        return -1.0
    solve_cholesky(factor, z)
    solve_cholesky(factor, along)
    length, norm = 0.0, 0.0
    for k in range(n):
        step[k] = 0.0
        for i in range(m):
            step[k] += jacobian[i, k] * z[i]
            tangent[k] -= jacobian[i, k] * along[i]
        length += step[k] ** 2
        norm += tangent[k] ** 2
    length, norm = np.sqrt(length), np.sqrt(norm)
    scale = longest / length if length > longest else 1.0
    for k in range(n):
        q[k] += scale * step[k]
        tangent[k] /= norm
    return float(length)


@inlined
def correction_space(n: int, m: int) -> int:
    """Return the length of the array that `correct` works in."""
    return 2 * m + n + m * n + m * m


@called
def stopped(q: Array, lower: Array, upper: Array, held: Flags) -> bool:
    """Put joints (n,) that are beyond a limit onto it and note that; return whether none was."""
    inside = True
    for j in range(len(q)):
        if q[j] < lower[j] or q[j] > upper[j]:
            q[j] = min(max(q[j], lower[j]), upper[j])
            held[j], inside = True, False
    return inside


@kernel
def project_all(
    q: Array,
    targets: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    locked: Flags,
    longest: float,
    steps: int,
    arrived: Flags,
) -> None:
    """Put each of q (K, n) onto its target (K, 12 F) by Newton's method, in place.

    A joint that would leave its limits (K, n) stays at the limit, and the others move on; joints
    that are `locked` (K, n) are at 0. `arrived` (K,) is the mask of convergence within the steps.
    """
    n, tips = q.shape[1], layout.shape[0]
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, unused = np.zeros((tips, 6, n)), np.empty(n)
    held, space = np.zeros(n, dtype=np.bool_), np.empty(correction_space(n, rows_of(layout)))
    for k in range(len(q)):
        arrived[k] = False
        for j in range(n):
            held[j] = locked[k, j]
            if locked[k, j]:
                q[k, j] = 0.0
        length = np.inf
        for _ in range(steps):
            inside = stopped(q[k], lower[k], upper[k], held)
            if inside and length < CONVERGED:
                arrived[k] = True
                break
            place_tips(q[k], chains, r, p, rotations, positions, jacobians)
            unused[:] = 1.0
            clear_held(held, jacobians)
            length = correct(
                q[k], jacobians, rotations, positions, targets[k], layout, unused, longest, space
            )
            # Singular, or not a number.
            if not length >= 0.0:
                break


@kernel
def approach_all(
    q: Array,
    target: Array,
    chains: Array,
    layout: Layout,
    lower: Array,
    upper: Array,
    locked: Flags,
    iterations: int,
    errors: Array,
) -> None:
    """Move each of q (K, n) as near to a target as limits allow.

    Levenberg-Marquardt with steps that are cut off at the limits. It converges also where Newton's
    method does not, and to the nearest point where nothing converges; joints that are `locked` (n,)
    are at 0. `errors` (K, m) are the remaining ones in the rows [m, rad]; inf where the first one
    is NaN.
    """
    n, tips, m = q.shape[1], layout.shape[0], rows_of(layout)
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    rotations, positions = np.empty((tips, 3, 3)), np.empty((tips, 3))
    jacobians, error, step = np.zeros((tips, 6, n)), np.empty(m), np.empty(m)
    jacobian, factor, steep = np.empty((m, n)), np.empty((m, m)), np.empty((m, n))
    trial = np.empty(n)
    for k in range(len(q)):
        damping, best, idle = 1e-3, np.inf, 0
        trial[:], error[:] = q[k], np.inf
        for _ in range(iterations):
            for j in range(n):
                trial[j] = 0.0 if locked[j] else min(max(trial[j], lower[j]), upper[j])
            place_tips(trial, chains, r, p, rotations, positions, jacobians)
            clear_held(locked, jacobians)
            errors_and_rows(layout, target, jacobians, rotations, positions, step, steep)
            size = 0.0
            for i in range(m):
                size += step[i] ** 2
            if size < best:
                idle = idle + 1 if size > (1.0 - _LITTLE_GAIN) * best else 0
                best, damping = size, max(0.1 * damping, 1e-14)
                error[:], jacobian[:], q[k] = step, steep, trial
                hold(q[k], lower, upper, error, jacobian)
            else:
                damping *= 10.0
                # NaN at the first step: there is no direction.
                if damping > 1e6 or best == np.inf:
                    break
            if best < NOTHING_LEFT**2 or idle == _LITTLE_GAINS:
                break
            gram(jacobian, factor)
            for i in range(m):
                factor[i, i] += damping
                step[i] = error[i]
            if not cholesky(factor):
                break
            solve_cholesky(factor, step)
            for j in range(n):
                along = 0.0
                for i in range(m):
                    along += jacobian[i, j] * step[i]
                trial[j] = q[k, j] + along
        errors[k] = error


@called
def hold(q: Array, lower: Array, upper: Array, error: Array, jacobian: Array) -> None:
    """Take the joints at limits that a step would leave out of J (m, n)."""
    for j in range(len(q)):
        slope = 0.0
        for i in range(len(error)):
            slope += jacobian[i, j] * error[i]
        if (q[j] <= lower[j] and slope < 0.0) or (q[j] >= upper[j] and slope > 0.0):
            jacobian[:, j] = 0.0


class Manifold:
    """Projects configurations onto {q : F(q) = x} within limits, each by Newton's method.

    Parameters
    ----------
    follows : Follows
    lower, upper : (n,)
        Joint limits [rad or m], ±inf for none. Joints stop there while others go on.

    Attributes
    ----------
    revolute : (n,)
    chains : (F, c + 1, 6, 3)
        See `chain_tables`.
    layout : (1, 9 + n)
        See `Follows.layout`.

    Raises
    ------
    RobotError
        The compiled kinematics are not those of Pinocchio.
    """

    def __init__(self, follows: Follows, lower: Array, upper: Array) -> None:
        self.follows = follows
        # Copies: kernels would be compiled again for read-only arrays.
        self._limits = np.array(lower), np.array(upper)
        self._limited = np.isfinite(upper)
        self.chains = chain_tables(follows)
        self.revolute: Flags = follows.coordinates.is_revolute
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
        locked = np.array(np.broadcast_to(False if held is None else held, q.shape))
        found, arrived = self._within(q, wanted, locked, _FAR_STEPS if far else _NEAR_STEPS)
        # Near singular poses Newton's method takes many steps, from nearby as well.
        alone = ~arrived if np.ndim(target) == 2 else np.full(len(q), not arrived.any())
        if not far and alone.any():
            found[alone], arrived[alone] = self._within(
                q[alone], wanted[alone], locked[alone], _FAR_STEPS
            )
        # Joints that share a band may be within their limits, and beyond that together.
        within = np.where(self._limited, band_limits(self.follows, found), np.inf)
        beyond = arrived & (np.abs(found) > within).any(axis=1)
        if beyond.any():
            given = found[beyond], wanted[beyond], locked[beyond], _FAR_STEPS, within[beyond]
            found[beyond], arrived[beyond] = self._within(*given)
        return found, arrived

    def approach(self, q: Array, target: Array, held: Flags) -> tuple[Array, Array]:
        """Return configurations (K, n) moved as near to a target (12 F,) as limits allow.

        Slower than `project`, it arrives at stretched poses and with joints at their limits, too;
        joints that are `held` (n,) stand at 0.

        Returns
        -------
        q : (K, n)
        errors : (K, 2)
            Remaining errors [m], [rad].
        """
        found, left = np.array(q), np.zeros((len(q), self.follows.dimension))
        limits = *self._limits, np.array(held)
        approach_all(found, target, self.chains, self.layout, *limits, _FAR_STEPS, left)
        linear = linear_rows(self.follows) > 0.0
        parts = np.where(linear, left, 0.0), np.where(linear, 0.0, left)
        errors = [np.sqrt(np.einsum("km,km->k", part, part)) for part in parts]
        return found, np.stack(errors, axis=1)

    def _within(
        self, q: Array, targets: Array, locked: Flags, steps: int, most: Array | float = np.inf
    ) -> tuple[Array, Flags]:
        """Return the result of Newton's method from q (K, n), with |q| ≤ `most` besides limits."""
        found, arrived = np.array(q, order="C"), np.zeros(len(q), dtype=bool)
        # One memory order: each is a kernel of its own.
        sides = np.maximum(self._limits[0], -most), np.minimum(self._limits[1], most)
        lower, upper = (np.array(np.broadcast_to(side, q.shape), order="C") for side in sides)
        project_all(
            found,
            targets,
            self.chains,
            self.layout,
            lower,
            upper,
            np.array(locked, order="C"),
            LONGEST_CORRECTION,
            steps,
            arrived,
        )
        return found, arrived

    def _check(self) -> None:
        """Compare with Pinocchio: where it puts the tool, nothing is left to correct."""
        ends = zip(self._limits, self.follows.coordinates.finite_limits(), strict=True)
        lower, upper = (np.where(np.isfinite(own), own, finite) for own, finite in ends)
        for q in np.random.default_rng(0).uniform(lower, upper, (3, self.follows.dof)):
            items = self.follows.items
            poses = [item.chain.place(q) for item in items]
            target = np.concatenate(
                [part for pose in poses for part in (pose.translation, pose.rotation.ravel())]
            )
            locked = np.zeros((1, len(q)), dtype=np.bool_)
            found, arrived = self._within(q[None], target[None], locked, _NEAR_STEPS)
            for item, pose in zip(items, poses, strict=True):
                distance = max(item.miss(pose, found[0]))
                if not (arrived[0] and distance < _AGREE):
                    name = self.follows.robot.name
                    raise RobotError(
                        f"{name}: compiled kinematics put '{item.chain.tip_name}' "
                        f"{distance:.3g} off where Pinocchio does; this is an error of selfmotion's"
                    )


def carry(
    starts: Array, count: int, at: int, follow: Callable[[Array, int, int], tuple[Array, Flags]]
) -> tuple[Array, Flags]:
    """Return motions through configurations (K, n) at `count` times, (K, N, n), and which arrive.

    From time number `at` to both ends: ``follow(q, before, k)`` puts configurations of time number
    `before` onto the path at the next one, k, and returns where that is possible.
    """
    motions, going = np.empty((len(starts), count, starts.shape[1])), np.ones(len(starts), bool)
    motions[:, at] = starts
    for step, order in ((1, range(at + 1, count)), (-1, range(at - 1, -1, -1))):
        for k in order:
            motions[:, k], arrived = follow(motions[:, k - step], k - step, k)
            going &= arrived
    return motions, going


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
        self.follows, self._manifold = follows, Manifold(follows, lower, upper)
        self._targets, self.count = follows.targets(t), len(t)
        self.robot, self.coordinates = follows.robot, follows.coordinates
        self._held, self.redundancy = follows.held(t), follows.redundancy

    def held(self, i: int) -> Flags:
        """Return the mask of coordinates that stand at 0 at waypoint i, (n,)."""
        return np.asarray(self._held[i])

    def project(self, q: Array, i: int, *, far: bool = False) -> tuple[Array, Flags]:
        """Return the result of Newton's method from q (K, n) at waypoint i, and its convergence."""
        return self._manifold.project(q, self._targets[i], far=far, held=self._held[i])

    def project_each(self, q: Array, i: Ints) -> tuple[Array, Flags]:
        """Return the same of q (K, n), each at its own waypoint (K,)."""
        return self._manifold.project(q, self._targets[i], held=self._held[i])

    def bases(self, q: Array) -> Array:
        """Return bases of the directions in which a motion q (W, n) may be displaced, (W, n, d).

        Each turned to the one before.
        """
        jacobians = self.follows.jacobians(q)
        return carried(null_space(jacobians[0]), jacobians)
