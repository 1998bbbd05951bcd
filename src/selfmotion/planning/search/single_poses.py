"""Whether the arm can be at single poses of a path at all: limits, bodies."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.collision import Closest
from selfmotion.model.follow import band_limits, within_limits
from selfmotion.planning.formulation import Formulation
from selfmotion.planning.search.curves import SPACING, SelfMotion
from selfmotion.planning.search.manifold import Manifold, carry
from selfmotion.planning.search.pushing import Pushing
from selfmotion.planning.search.search_bounds import AT_LIMIT, SearchBounds
from selfmotion.planning.search.starts import TRACING_SEEDS, spread
from selfmotion.problem.problem import Problem

# Branches of solutions that are followed from one pose to the next.
_BRANCHES = 12
# Seeds where none of them goes on.
_SEEDS = 24
# Additional seeds before a pose counts as out of reach: poses at joint limits are missed from 24.
_MORE_SEEDS = 300
# Error that counts as 0 [m + rad].
_NEARLY = 1e-5
# Seeds of the damped method …
_APPROACHED = 48
# … and before a pose is given up: near limits a third of them converges, of Newton's one in 300.
_MORE_APPROACHED = 400
# Configurations in collision that are evaluated.
MAX_EVALUATED = 80
# Of these, the ones with the smallest overlap that are moved at random.
CLIMBERS = 8
# Random walks along the self-motions: number at a time …
_WALKERS = 64
# … rounds …
_WALKS = 12
# … and sizes of steps [rad].
_WALK_STEPS = (0.1, 0.3, 0.8)
# Standard deviations of the random moves, in turn [rad].
_CLIMBS = (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.02, 0.02)
# Standard deviations around known nearest configurations, as seeds of a pose [rad].
_CLOSE = (0.0, 0.03, 0.1, 0.3)


@dataclass(frozen=True, eq=False)
class Found:
    """Configurations at one pose.

    Attributes
    ----------
    free : (K, n)
        Within the limits, and clear of bodies.
    met : (K', n)
        Solutions within limits, but in collision; computed only without free ones.
    tries : int
        Number of seeds that were tried.
    """

    free: Array
    met: Array
    tries: int


class SinglePoses:
    """Inverse kinematics of single poses, within limits and tolerances, free of collisions.

    Parameters
    ----------
    formulation : Formulation
    rng : Generator
        Shifts the seeds.
    clear : bool
        Whether bodies have to keep their distances.
    """

    def __init__(
        self, formulation: Formulation, rng: np.random.Generator, *, clear: bool = True
    ) -> None:
        required = formulation.envelope_without_arm
        self.formulation, self._rng, self._clear = formulation, rng, clear
        self.follows = within_limits(formulation.follows, required.lower, required.upper)
        self.coordinates = self.follows.coordinates
        self._manifold = Manifold(self.follows, required.lower, required.upper)
        self.bounds = SearchBounds(
            required.lower,
            required.upper,
            self.coordinates.is_revolute,
            required.bodies if clear else (),
        )
        self._seeds = spread(self.coordinates, _SEEDS, rng)
        self._shift = np.zeros(3)
        # Cached: a path takes a millisecond to evaluate.
        self._targets: dict[float, Array] = {}

    def of(self, problem: Problem) -> "SinglePoses":
        """Return that of another problem, its path moved as far as this one's."""
        other = SinglePoses(Formulation.of(problem), self._rng, clear=self._clear)
        other._shift = self._shift
        return other

    def shifted(self, shift: Array) -> "SinglePoses":
        """Return the same with the path displaced by (3,) [m], among the same bodies."""
        other = copy(self)
        other._shift = self._shift + shift
        return other

    def with_limits(self, lower: Array, upper: Array) -> "SinglePoses":
        """Return that of an arm with other limits (n,)."""
        other = copy(self)
        other._manifold = Manifold(self.follows, lower, upper)
        other.bounds = replace(self.bounds, lower=lower, upper=upper)
        return other

    def target(self, t: float) -> Array:
        """Return the poses of the tips at a time [s], (12 F,)."""
        if t not in self._targets:
            self._targets[t] = self.follows.targets(np.array([t]))[0]
        target = self._targets[t].copy()
        target[:3] += self._shift
        return target

    def _held(self, t: float) -> Flags:
        return np.asarray(self.follows.held(np.array([t]))[0])

    def project(self, q: Array, t: float, *, far: bool = False) -> tuple[Array, Flags]:
        """Return the result of Newton's method from q (K, n) at a time [s], and convergence, (K,).

        `far` says that q is any configuration, instead of one near a solution.
        """
        return self._manifold.project(q, self.target(t), far=far, held=self._held(t))

    def solve(self, t: float, known: Array) -> Found:
        """Return the solutions at t [s] from configurations nearby (K, n), and from anywhere."""
        near = self._reached(t, known[:_BRANCHES])
        free = near[self.bounds.is_admissible(near)]
        if len(free):
            return Found(free, near[:0], len(known[:_BRANCHES]))
        far = self._reached(t, self._seeds, far=True)
        free = far[self.bounds.is_admissible(far)]
        return Found(free, np.concatenate([near, far]), len(known[:_BRANCHES]) + len(self._seeds))

    def _reached(self, t: float, seeds: Array, *, far: bool = False) -> Array:
        """Return the solutions of Newton's method from seeds (K, n) for the pose at t, (K', n)."""
        found, arrived = self.project(seeds, t, far=far)
        return np.asarray(found[arrived])

    def _by_damped_steps(self, t: float, count: int) -> Array:
        """Return solutions of the damped method, which also reaches limits and edges, (K, n)."""
        q, errors = self.nearest(t, count)
        near = q[errors.sum(axis=1) < _NEARLY]
        within = (np.abs(near) <= band_limits(self.follows, near)).all(axis=1)
        pulled, arrived = self.project(near[~within], t)
        return np.concatenate([near[within], pulled[arrived]])

    def nearest(self, t: float, count: int = _APPROACHED) -> tuple[Array, Array]:
        """Return configurations as near to a pose as limits allow (K, n), and errors [m, rad]."""
        seeds = spread(self.coordinates, count, self._rng)
        q, errors = self._manifold.approach(seeds, self.target(t), self._held(t))
        order = np.argsort(errors.sum(axis=1), kind="stable")
        return q[order], errors[order]

    def some(self, t: float, count: int) -> Array:
        """Return seeds (K, n) from which something may be found near the pose at t [s]."""
        q, _ = self.nearest(t)
        near = np.repeat(q[:count], len(_CLOSE), axis=0)
        noise = self._rng.normal(size=near.shape) * np.tile(_CLOSE, count)[: len(near), None]
        return np.concatenate([near + noise / self.coordinates.weights, self._seeds])


def first_blocked(poses: SinglePoses, times: Array) -> float | None:
    """Return the first of some times [s] at whose poses a quick search finds nothing."""
    known = np.empty((0, poses.coordinates.dof))
    for t in times.tolist():
        found = poses.solve(t, known)
        if not len(found.free):
            q = poses._by_damped_steps(t, _APPROACHED)
            found = replace(found, free=q[poses.bounds.is_admissible(q)])
        if not len(found.free):
            return float(t)
        known = found.free
    return None


def search_closely(poses: SinglePoses, t: float, before: Found) -> Found:
    """Return the solutions by all methods, after a search without a free one."""
    seeds = spread(poses.coordinates, _MORE_SEEDS, poses._rng)
    far = poses._reached(t, seeds, far=True)
    tries = before.tries + len(seeds)
    free = far[poses.bounds.is_admissible(far)]
    met = np.concatenate([before.met, far])
    if len(free):
        return Found(free, met, tries)
    slowly = poses._by_damped_steps(t, _MORE_APPROACHED)
    tries += _MORE_APPROACHED
    free, met = slowly[poses.bounds.is_admissible(slowly)], np.concatenate([met, slowly])
    if len(free) or not len(met):
        return Found(free, met, tries)
    for more in (pushed, _along_curves, _wandered, _climbed):
        q = more(poses, t, met)
        free, met = q[poses.bounds.is_admissible(q)], np.concatenate([met, q])
        tries += len(q)
        if len(free):
            break
    return Found(free, met, tries)


def pushed(poses: SinglePoses, t: float, q: Array) -> Array:
    """Return free configurations at t [s] that are reached from others there (K, n), (K', n)."""
    pushing = Pushing(poses.follows, poses.bounds)
    return pushing.free(q, lambda x: poses.project(x, t), poses._held(t))


def inside(poses: SinglePoses) -> SinglePoses:
    """Return the same with limits that are a little narrower."""
    lower, upper = poses.bounds.lower, poses.bounds.upper
    # Of a narrow range, as of a tolerance in its own unit, a share.
    within = AT_LIMIT * np.minimum(0.5 * (upper - lower), 1.0)
    return poses.with_limits(lower + within, upper - within)


def carried_within(poses: SinglePoses, q: Array, t: Array, at: int) -> Array:
    """Return the motions without self-motion through q (K, n) at the time of number `at`.

    From each of the times t (N,) [s] to the next, and back, within the limits: (K', N, n), of those
    for which that is possible.
    """
    motions, going = carry(q, len(t), at, lambda x, _, k: poses.project(x, float(t[k])))
    return np.asarray(motions[going])


def _along_curves(poses: SinglePoses, t: float, met: Array) -> Array:
    """Return samples of all self-motions of a pose, where these are curves, (K, n).

    Those within the limits: the curves go on beyond them.
    """
    if poses.follows.redundancy != 1 or poses._held(t).any():
        return np.empty((0, poses.coordinates.dof))
    motion = SelfMotion(poses.follows, SPACING)
    target = poses.target(t)
    seeds = spread(poses.coordinates, TRACING_SEEDS, poses._rng)
    samples = [curve.q for curve in motion.curves(target, seeds).curves]
    every = np.concatenate([np.empty((0, poses.coordinates.dof)), *samples])
    q = poses.bounds.representative(every)
    most = band_limits(poses.follows, q)
    lower, upper = np.maximum(poses.bounds.lower, -most), np.minimum(poses.bounds.upper, most)
    return np.asarray(q[((q >= lower) & (q <= upper)).all(axis=1)])


def _wandered(poses: SinglePoses, t: float, met: Array) -> Array:
    """Return configurations that random walks along the self-motions lead to, (K, n).

    From anywhere Newton's method may lead to few of them only, where limits are near.
    """
    known = met
    for _ in range(_WALKS):
        here = known[poses._rng.integers(len(known), size=_WALKERS)]
        size = poses._rng.choice(_WALK_STEPS, size=(_WALKERS, 1))
        away = poses._rng.normal(size=here.shape) * size / poses.coordinates.weights
        found, arrived = poses.project(here + away, t)
        known = np.concatenate([known, found[arrived]])
        if poses.bounds.is_admissible(found[arrived]).any():
            break
    return np.asarray(known[len(met) :])


def _climbed(poses: SinglePoses, t: float, met: Array) -> Array:
    """Return configurations that are less near to bodies than those that were found, (K, n)."""
    some = met[:: -(-len(met) // MAX_EVALUATED)]
    best = some[np.argsort([-room_of(poses, q)[0] for q in some])[:CLIMBERS]]
    room = np.array([room_of(poses, q)[0] for q in best])
    for size in _CLIMBS:
        away = poses._rng.normal(scale=size, size=best.shape) / poses.coordinates.weights
        found, arrived = poses.project(best + away, t)
        for k in np.flatnonzero(arrived):
            here = room_of(poses, found[k])[0]
            if here > room[k]:
                best[k], room[k] = found[k], here
        if room.max() > 0.0:
            break
    return best


def room_of(poses: SinglePoses, q: Array) -> tuple[float, Closest, float]:
    """Return the excess clearance at q (n,) [m], the worst pair, and the required distance."""
    each = [
        (model.distance(q[: model.robot.dof]), required) for model, required in poses.bounds.bodies
    ]
    rooms = ((closest.value - required, closest, required) for closest, required in each)
    return min(rooms, key=lambda found: found[0])
