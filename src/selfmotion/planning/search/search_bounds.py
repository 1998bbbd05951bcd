"""Bounds of the search: which configurations may be vertices, and at which turns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.model.collision import CollisionModel

# Distance at which a joint is at its limit [rad or m].
AT_LIMIT = 1e-3
# Clearance of sequences in addition to the required one [m]: they are checked at waypoints only.
_CLEARANCE_MARGIN = 2.5e-4
# A whole turn [rad].
_TURN = 2.0 * np.pi


@dataclass(frozen=True, eq=False)
class SearchBounds:
    """Conditions on vertices: joint limits and minimum distances of bodies.

    Attributes
    ----------
    lower, upper : (n,)
        Joint limits [rad or m], ±inf for none.
    revolute : (n,)
        Whether a turn leads to the same pose.
    bodies : tuple of (CollisionModel, float)
        Bodies with a minimum distance [m].
    """

    lower: Array
    upper: Array
    revolute: Flags
    bodies: tuple[tuple[CollisionModel, float], ...]

    @property
    def is_unbounded(self) -> Flags:
        """Mask of revolute joints without limits: their angles count modulo 2π."""
        return np.asarray(self.revolute & np.isinf(self.lower) & np.isinf(self.upper))

    def with_unbounded_turns(self) -> "SearchBounds":
        """Return bounds in which joints with a range of 2π or more are unbounded.

        The search is much smaller: six joints of two turns each have 64 vertices for one
        configuration.
        """
        wide = self.revolute & (self.upper - self.lower >= _TURN)
        return replace(
            self,
            lower=np.where(wide, -np.inf, self.lower),
            upper=np.where(wide, np.inf, self.upper),
        )

    def with_limits_of(self, bounds: "SearchBounds", joints: Flags) -> "SearchBounds":
        """Return these bounds with the limits of `bounds` for the joints of a mask (n,)."""
        return replace(
            self,
            lower=np.where(joints, bounds.lower, self.lower),
            upper=np.where(joints, bounds.upper, self.upper),
        )

    def centred(self, q: Array) -> Array:
        """Return a motion (W, n) shifted by whole turns of each joint, nearest to mid-range."""
        bounded = self.revolute & np.isfinite(self.lower) & np.isfinite(self.upper)
        lower, upper = np.where(bounded, self.lower, 0.0), np.where(bounded, self.upper, 0.0)
        offset = 0.5 * (lower + upper - q.min(axis=0) - q.max(axis=0))
        return q + _TURN * np.where(bounded, np.round(offset / _TURN), 0.0)

    def exceeded(self, q: Array) -> Flags:
        """Return the mask (n,) of joints that exceed their limits in a motion (W, n)."""
        return np.asarray(np.any((q < self.lower) | (q > self.upper), axis=0))

    def layer(self, q: Array) -> Array:
        """Return all turns of admissible samples (K, n), sorted by the first joint, (K', n)."""
        # Adding and subtracting a turn may round a joint at its limit to beyond it.
        vertices = np.clip(self.all_turns(q), self.lower, self.upper)
        return np.ascontiguousarray(vertices[np.argsort(vertices[:, 0], kind="stable")])

    def representative(self, q: Array) -> Array:
        """Return q (…, n) with each revolute joint at or above its lower limit by the least turn.

        Angles without lower limit are brought into [-π, π), or to the first turn below the upper
        limit.
        """
        below = np.where(np.isfinite(self.upper), self.upper - _TURN, -np.pi)
        base = np.where(np.isfinite(self.lower), self.lower, below)
        return np.where(self.revolute, base + np.mod(q - base, _TURN), q)

    def excess(self, q: Array) -> Array:
        """Return by how much q (…, n) exceeds the limits at the nearest turn, (…, n)."""
        first = self.representative(q)
        above = np.maximum(first - self.upper, 0.0)
        below = np.maximum(self.lower - first, 0.0)
        turned = np.where(self.revolute, np.maximum(self.lower - (first - _TURN), 0.0), np.inf)
        return np.maximum(np.minimum(above, turned), below)

    def is_admissible_modulo_turns(self, q: Array) -> Flags:
        """Whether each of q (K, n) is within the limits at some turn, and free of collision."""
        return self.is_admissible(self.representative(q))

    def is_admissible(self, q: Array) -> Flags:
        """Whether each of q (K, n) is within the limits as given, and free of collision."""
        admissible = np.asarray(np.all((q <= self.upper) & (q >= self.lower), axis=-1))
        admissible[admissible] = self._is_collision_free(q[admissible])
        return admissible

    def _is_collision_free(self, q: Array) -> Flags:
        """Whether bodies keep their distances at each of q (K, n)."""
        is_free = np.ones(len(q), dtype=bool)
        for model, distance in self.bodies:
            is_free[is_free] = ~model.colliding(q[is_free, : model.robot.dof], distance)
        return is_free

    def all_turns(self, q: Array) -> Array:
        """Return q (K, n), within the limits at some turn, at every turn within them, (K', n)."""
        q = self.representative(q)
        for k in np.flatnonzero(self.revolute & np.isfinite(self.lower) & np.isfinite(self.upper)):
            turns = [q]
            for count in range(1, int((self.upper[k] - self.lower[k]) / _TURN) + 1):
                more = q.copy()
                more[:, k] += count * _TURN
                turns.append(more[more[:, k] <= self.upper[k]])
            q = np.concatenate(turns)
        return q


def with_clearance_margin(
    bodies: Sequence[tuple[CollisionModel, float]],
) -> tuple[tuple[CollisionModel, float], ...]:
    """Return bodies with a minimum distance that leaves room between waypoints [m]."""
    return tuple((model, distance + _CLEARANCE_MARGIN) for model, distance in bodies)
