"""Configurations that put the tool where it is allowed at a time: on its path, or nearly so."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.follow import Follows
from selfmotion.robot import null_space
from selfmotion.search import slack
from selfmotion.search.manifold import Manifold
from selfmotion.search.settings import (
    FAR_STEPS,
    ITERATIONS,
    LONGEST_CORRECTION,
    NEAR_STEPS,
    WITHIN_BAND,
)
from selfmotion.task import Relaxation


class Allowed:
    """{q : within limits, the tool on its path at t up to a deviation that is allowed then}.

    Parameters
    ----------
    follows : Follows
    relaxations : sequence of Relaxation
        Rows of the first path that need not be kept, by how much and when.
    pinned : (bool, bool)
        Whether its first and its last pose are to be kept all the same.
    lower, upper : (n,)
        Joint limits [rad or m].
    """

    def __init__(
        self,
        follows: Follows,
        relaxations: Sequence[Relaxation],
        pinned: tuple[bool, bool],
        lower: Array,
        upper: Array,
    ) -> None:
        self._pinned = pinned
        self.manifold, self.follows = Manifold(follows, lower, upper), follows
        self._shift = np.zeros(3)
        # A path takes a millisecond to say where it is, and is asked again and again.
        self._targets: dict[float, Array] = {}
        self._limits = np.array(lower), np.array(upper)
        self._relaxations = tuple(relaxations)
        self._in_tool_axes = any(item.in_tool_axes for item in relaxations)

    def shifted(self, shift: Array) -> "Allowed":
        """Return that of the first path moved by so much (3,) [m]."""
        other = copy(self)
        other._shift = self._shift + shift
        return other

    def with_limits(self, lower: Array, upper: Array) -> "Allowed":
        """Return that of an arm with other limits (n,)."""
        other = copy(self)
        other._limits = np.array(lower), np.array(upper)
        other.manifold = Manifold(self.follows, lower, upper)
        return other

    def relaxed_besides(self, more: Relaxation) -> "Allowed":
        """Return that with other rows relaxed, too; as asked now, where they were already."""
        rest = (
            replace(item, rows=tuple(row for row in item.rows if row not in more.rows))
            for item in self._relaxations
            if not set(item.rows) <= set(more.rows)
        )
        other = copy(self)
        other._relaxations = (*rest, more)
        return other

    def target(self, t: float) -> Array:
        """Return where the tips are without deviation at a time [s], (12 F,)."""
        if t not in self._targets:
            self._targets[t] = self.follows.targets(np.array([t]))[0]
        target = self._targets[t].copy()
        target[:3] += self._shift
        return target

    def relaxed(self, t: float) -> list[Relaxation]:
        """Return what is relaxed at a time [s]."""
        duration, (at_start, at_end) = self.follows.duration, self._pinned
        relaxed = []
        for item in self._relaxations:
            first, last = item.window(duration)
            begun = t > first or (first == 0.0 and not at_start)
            lasts = t < last or (last >= duration and not at_end)
            if begun and lasts:
                relaxed.append(item)
        return relaxed

    def project(
        self, q: Array, t: float, *, far: bool = False, deviation: Array | None = None
    ) -> tuple[Array, Array, Flags]:
        """Return what Newton's method makes of configurations (K, n) at a time [s].

        Parameters
        ----------
        q : (K, n)
        t : float
        far : bool
            Whether q is any configuration instead of one near a solution.
        deviation : (K, 6), optional
            To begin with; by default none.

        Returns
        -------
        q, deviation : (K, n), (K, 6)
            Deviations as `Relaxation` has them: x, y, z [m], and a rotation vector [rad].
        arrived : (K,)
            Which of them it was possible for.
        """
        target, relaxed = self.target(t), self.relaxed(t)
        if not relaxed:
            found, arrived = self.manifold.project(q, target, far=far)
            return found, np.zeros((len(q), 6)), arrived
        found, arrived = np.array(q), np.zeros(len(q), dtype=bool)
        groups, bands = _grouped(relaxed)
        away = self._away(deviation, groups, len(q))
        slack.project_relaxed(
            found,
            away,
            target,
            self.manifold.chains,
            self.manifold.layout,
            *self._limits,
            groups,
            bands,
            self._in_tool_axes,
            LONGEST_CORRECTION,
            FAR_STEPS if far else NEAR_STEPS,
            arrived,
        )
        return found, away, arrived

    def approach(
        self, q: Array, t: float, deviation: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Return configurations (K, n) brought as near to where the tool may be as limits let them.

        Slower than `project`, it arrives at stretched poses and with joints at their limits, too.

        Returns
        -------
        q, deviation : (K, n), (K, 6)
        misses : (K, 2)
            What is left [m], [rad].
        """
        groups, bands = _grouped(self.relaxed(t))
        found, away = np.array(q), self._away(deviation, groups, len(q))
        left = np.zeros((len(q), self.follows.dimension))
        slack.approach_all(
            found,
            away,
            self.target(t),
            self.manifold.chains,
            self.manifold.layout,
            *self._limits,
            groups,
            bands,
            self._in_tool_axes,
            ITERATIONS,
            left,
        )
        in_metres = np.where(self.follows.linear, left, 0.0)
        in_radians = np.where(self.follows.linear, 0.0, left)
        misses = [np.sqrt(np.einsum("km,km->k", part, part)) for part in (in_metres, in_radians)]
        return found, away, np.stack(misses, axis=1)

    def _away(self, deviation: Array | None, groups: Ints, count: int) -> Array:
        return np.zeros((count, 6)) if deviation is None else np.where(groups >= 0, deviation, 0.0)

    def deviation(self, q: Array, t: float) -> Array:
        """Return the tool's deviation from its path in the relaxed rows at q (K, n), (K, 6).

        A little within the bands, so that it may leave their borders.
        """
        from scipy.spatial.transform import Rotation

        relaxed, away = self.relaxed(t), np.zeros((len(q), 6))
        if not relaxed or not len(q):
            return away
        item, target = self.follows.items[0], self.target(t)
        _, rotations, translations = item.chain.along(q)
        turn = target[3:12].reshape(3, 3)
        moved = translations - target[:3]
        relative = turn.T @ rotations
        there = np.zeros((len(q), 6))
        there[:, :3] = moved @ turn if self._in_tool_axes else moved
        there[:, 3:] = (
            _tilts(relative) if item.task.tool_axes else Rotation.from_matrix(relative).as_rotvec()
        )
        for one in relaxed:
            rows = there[:, one.indices]
            size = np.linalg.norm(rows, axis=1)
            inside = np.minimum(1.0, WITHIN_BAND**2 * one.band / np.maximum(size, 1e-300))
            away[:, one.indices] = rows * inside[:, None]
        return away

    def directions(self, q: Array, t: float) -> Array:
        """Return a basis of the directions at q (n,) in which the tool stays allowed, (n, d).

        As far as a step tells: they bend with the deviation.
        """
        item, relaxed = self.follows.items[0], self.relaxed(t)
        free = [k for one in relaxed for k in one.indices]
        if not free:
            return self.follows.null_basis(q)
        jacobian, _, _ = item.chain.at(q)
        turn = self.target(t)[3:12].reshape(3, 3)
        axes = turn if self._in_tool_axes else np.eye(3)
        own = np.concatenate([axes.T @ jacobian[:3], turn.T @ jacobian[3:]])
        kept = own[[k for k in item.task.rows if k not in free]]
        others = [other.jacobian(q) for other in self.follows.items[1:]]
        return null_space(np.concatenate([kept, *others]))

    def anywhere(self, count: int, t: float, rng: np.random.Generator) -> Array:
        """Return deviations all over the bands at a time [s], the first of them none, (K, 6)."""
        away = np.zeros((count, 6))
        for item in self.relaxed(t):
            width = min(item.band, np.pi)
            away[1:, item.indices] = rng.uniform(-width, width, (count - 1, len(item.indices)))
        return away


def _tilts(rotations: Array) -> Array:
    """Return the shortest rotation vectors that turn the z axis to those of rotations, (K, 3)."""
    sine = np.hypot(rotations[:, 0, 2], rotations[:, 1, 2])
    angle = np.arctan2(sine, rotations[:, 2, 2])
    share = angle / np.maximum(sine, 1e-300)
    return np.stack(
        [-rotations[:, 1, 2] * share, rotations[:, 0, 2] * share, np.zeros(len(rotations))], axis=1
    )


def _grouped(relaxed: Sequence[Relaxation]) -> tuple[Ints, Array]:
    """Return the number of each row's group (6,), -1 for none, and the groups' bands (6,)."""
    groups, bands = np.full(6, -1), np.full(6, np.inf)
    for number, item in enumerate(relaxed):
        groups[item.indices], bands[number] = number, WITHIN_BAND * item.band
    return groups, bands
