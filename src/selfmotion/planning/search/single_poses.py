"""Whether the arm can be at single poses of a path at all: limits, bodies."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.collision import Closest
from selfmotion.model.robot import RobotModel
from selfmotion.planning.search.curves import SPACING, SelfMotion
from selfmotion.planning.search.manifold import Manifold
from selfmotion.planning.search.nodes import Admissible
from selfmotion.planning.search.starts import TRACING_SEEDS, spread
from selfmotion.problem.problem import Problem

# Branches of solutions that are followed from one pose to the next, and seeds where none of them
# goes on.
_BRANCHES = 12
_SEEDS = 24
# Before a pose counts as out of reach, so many seeds more are tried, and a slower method from some:
# poses at joint limits are missed from 24.
_MORE_SEEDS = 300
# Who gets so near [m + rad] counts as there.
_NEARLY = 1e-5
# The slower method brings so many seeds nearer; and so many where a pose would be given up: near
# limits it arrives from a third of them, Newton's from one in 300.
_APPROACHED, _MORE_APPROACHED = 48, 400
# Of those that meet something, so many are looked at, and so many of these, which meet the least,
# moved aside at random, by less and less [rad].
MOST_LOOKED_AT, CLIMBERS = 80, 8
# Random walks along the self-motions, so many at a time, so often, in steps of these sizes [rad].
_WALKERS, _WALKS, _WALK_STEPS = 64, 12, (0.1, 0.3, 0.8)
_CLIMBS = (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.02, 0.02)
# Seeds near a pose are its nearest configurations, each so far off [rad], and some others.
_CLOSE = (0.0, 0.03, 0.1, 0.3)


@dataclass(frozen=True, eq=False)
class Found:
    """Configurations at one pose.

    Attributes
    ----------
    free : (K, n)
        Within the limits, and clear of bodies.
    met : (K', n)
        Within the limits, but not clear; looked for only while none was free.
    tries : int
        From so many configurations it was tried to get there.
    """

    free: Array
    met: Array
    tries: int


class SinglePoses:
    """Inverse kinematics of single poses, within limits, clear of bodies, tolerances made use of.

    Parameters
    ----------
    problem : Problem
    rng : Generator
        Shifts the seeds.
    clear : bool
        Whether bodies have to keep their distances.
    """

    def __init__(self, problem: Problem, rng: np.random.Generator, *, clear: bool = True) -> None:
        problem = problem.augmented
        asked = problem.asked_envelope
        self.problem, self._rng, self._clear = problem, rng, clear
        self.robot: RobotModel = asked.arm(problem.robot)
        self.follows = problem.follows.for_robot(self.robot)
        self._manifold = Manifold(self.follows, asked.lower, asked.upper)
        self.bounds = Admissible(
            asked.lower, asked.upper, self.robot.is_revolute, asked.bodies if clear else ()
        )
        self._seeds = spread(self.robot, _SEEDS, rng)
        self._shift = np.zeros(3)
        # A path takes a millisecond to say where it is, and is asked again and again.
        self._targets: dict[float, Array] = {}

    def of(self, problem: Problem) -> "SinglePoses":
        """Return that of another problem, its path moved as far as this one's."""
        other = SinglePoses(problem, self._rng, clear=self._clear)
        other._shift = self._shift
        return other

    def shifted(self, shift: Array) -> "SinglePoses":
        """Return that of the path moved by so much (3,) [m], among the same bodies."""
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
        """Return where the tips are at a time [s], (12 F,)."""
        if t not in self._targets:
            self._targets[t] = self.follows.targets(np.array([t]))[0]
        target = self._targets[t].copy()
        target[:3] += self._shift
        return target

    def _held(self, t: float) -> Flags:
        return np.asarray(self.follows.held(np.array([t]))[0])

    def project(self, q: Array, t: float, *, far: bool = False) -> tuple[Array, Flags]:
        """Return what Newton's method makes of q (K, n) at a time [s], and where it arrives, (K,).

        `far` says that q is any configuration, instead of one near a solution.
        """
        return self._manifold.project(q, self.target(t), far=far, held=self._held(t))

    def first_blocked(self, times: Array) -> float | None:
        """Return the first of some times [s] at whose poses nothing is found by a quick look."""
        known = np.empty((0, self.robot.dof))
        for t in times.tolist():
            found = self.look(t, known)
            if not len(found.free):
                q = self._by_damped_steps(t, _APPROACHED)
                found = replace(found, free=q[self.bounds.keep(q)])
            if not len(found.free):
                return float(t)
            known = found.free
        return None

    def look(self, t: float, known: Array) -> Found:
        """Return what is found at t [s] from configurations nearby (K, n), and from anywhere."""
        near = self._reached(t, known[:_BRANCHES])
        free = near[self.bounds.keep(near)]
        if len(free):
            return Found(free, near[:0], len(known[:_BRANCHES]))
        far = self._reached(t, self._seeds, far=True)
        free = far[self.bounds.keep(far)]
        return Found(free, np.concatenate([near, far]), len(known[:_BRANCHES]) + len(self._seeds))

    def look_closely(self, t: float, before: Found) -> Found:
        """Return what is found by everything that is known, where a look found nothing free."""
        seeds = spread(self.robot, _MORE_SEEDS, self._rng)
        far = self._reached(t, seeds, far=True)
        tries = before.tries + len(seeds)
        free = far[self.bounds.keep(far)]
        met = np.concatenate([before.met, far])
        if len(free):
            return Found(free, met, tries)
        slowly = self._by_damped_steps(t, _MORE_APPROACHED)
        tries += _MORE_APPROACHED
        free, met = slowly[self.bounds.keep(slowly)], np.concatenate([met, slowly])
        if len(free) or not len(met):
            return Found(free, met, tries)
        for more in (self._along_curves, self._wandered, self._climbed):
            q = more(t, met)
            free, met = q[self.bounds.keep(q)], np.concatenate([met, q])
            tries += len(q)
            if len(free):
                break
        return Found(free, met, tries)

    def _reached(self, t: float, seeds: Array, *, far: bool = False) -> Array:
        """Return what Newton's method makes of seeds (K, n) for the pose at t, (K', n)."""
        found, arrived = self.project(seeds, t, far=far)
        return np.asarray(found[arrived])

    def _by_damped_steps(self, t: float, count: int) -> Array:
        """Return what the slower method finds, which comes to limits and edges, (K, n)."""
        q, misses = self.nearest(t, count)
        near = q[misses.sum(axis=1) < _NEARLY]
        within = (np.abs(near) <= self.follows.within_bands(near)).all(axis=1)
        pulled, arrived = self.project(near[~within], t)
        return np.concatenate([near[within], pulled[arrived]])

    def nearest(self, t: float, count: int = _APPROACHED) -> tuple[Array, Array]:
        """Return configurations as near to a pose as limits let them (K, n), misses [m, rad]."""
        seeds = spread(self.robot, count, self._rng)
        q, misses = self._manifold.approach(seeds, self.target(t), self._held(t))
        order = np.argsort(misses.sum(axis=1), kind="stable")
        return q[order], misses[order]

    def some(self, t: float, count: int) -> Array:
        """Return seeds (K, n) from which something may be found near the pose at t [s]."""
        q, _ = self.nearest(t)
        near = np.repeat(q[:count], len(_CLOSE), axis=0)
        noise = self._rng.normal(size=near.shape) * np.tile(_CLOSE, count)[: len(near), None]
        return np.concatenate([near + noise / self.robot.joint_weights, self._seeds])

    def _along_curves(self, t: float, met: Array) -> Array:
        """Return samples of all self-motions of a pose, where these are curves, (K, n).

        Those within the limits: the curves go on beyond them.
        """
        if self.follows.redundancy != 1 or self._held(t).any():
            return np.empty((0, self.robot.dof))
        motion = SelfMotion(self.follows, SPACING)
        target = self.target(t)
        seeds = spread(self.robot, TRACING_SEEDS, self._rng)
        samples = [curve.q for curve in motion.curves(target, seeds).curves]
        every = np.concatenate([np.empty((0, self.robot.dof)), *samples])
        q = self.bounds.representative(every)
        most = self.follows.within_bands(q)
        lower, upper = np.maximum(self.bounds.lower, -most), np.minimum(self.bounds.upper, most)
        return np.asarray(q[((q >= lower) & (q <= upper)).all(axis=1)])

    def _wandered(self, t: float, met: Array) -> Array:
        """Return configurations that random walks along the self-motions lead to, (K, n).

        From anywhere Newton's method may lead to few of them only, where limits are near.
        """
        known = met
        for _ in range(_WALKS):
            here = known[self._rng.integers(len(known), size=_WALKERS)]
            size = self._rng.choice(_WALK_STEPS, size=(_WALKERS, 1))
            away = self._rng.normal(size=here.shape) * size / self.robot.joint_weights
            found, arrived = self.project(here + away, t)
            known = np.concatenate([known, found[arrived]])
            if self.bounds.keep(found[arrived]).any():
                break
        return np.asarray(known[len(met) :])

    def _climbed(self, t: float, met: Array) -> Array:
        """Return configurations that are less near to bodies than those that were found, (K, n)."""
        some = met[:: -(-len(met) // MOST_LOOKED_AT)]
        best = some[np.argsort([-self.room(q)[0] for q in some])[:CLIMBERS]]
        room = np.array([self.room(q)[0] for q in best])
        for size in _CLIMBS:
            away = self._rng.normal(scale=size, size=best.shape) / self.robot.joint_weights
            found, arrived = self.project(best + away, t)
            for k in np.flatnonzero(arrived):
                here = self.room(found[k])[0]
                if here > room[k]:
                    best[k], room[k] = found[k], here
            if room.max() > 0.0:
                break
        return best

    def room(self, q: Array) -> tuple[float, Closest, float]:
        """Return what bodies have beyond what is asked at q (n,) [m], the worst pair, and that."""
        each = [(model.distance(q), asked) for model, asked in self.bounds.bodies]
        rooms = ((closest.value - asked, closest, asked) for closest, asked in each)
        return min(rooms, key=lambda found: found[0])
