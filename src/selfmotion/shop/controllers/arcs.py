r"""Circular steps between tool poses, as ``SCIRC``, ``MoveC`` and ``movec`` make them.

The position goes along the circle through the begin, a via point and the end, evenly. The
orientation turns from that of the begin to that of the end about one axis evenly, relative to the
work object, and external axes are linear, as in a straight step. The makers document that
orientation for ``$CIRC_TYPE = #BASE`` (KUKA), ``CirPathMode \ObjectFrame`` (ABB) and ``mode=0``
(Universal Robots). A via pose is in the middle of its step in all of that, so that a controller
that heeds its orientation does the same.
"""

from typing import NamedTuple

import numpy as np

from selfmotion.basics import Array

# Ratio of height to chord below which a circle is a line.
_FLAT = 1e-6
# Largest angle of a circular step [rad]: ABB's are below 240°.
MAX_TURN = np.radians(200.0)
# Smallest angle of a circular step [rad]: ABB requires points that are 1° apart.
MIN_TURN = np.radians(3.0)
# Shortest circular step [m]: ABB requires points that are 0.1 mm apart.
MIN_LENGTH = 1e-3


class Arc(NamedTuple):
    """The circle through three points.

    Attributes
    ----------
    center, axis : (3,)
        It goes right-handed about the axis.
    arm : (3,)
        From the centre to the begin [m].
    angle : float
        How far it goes [rad].
    """

    center: Array
    axis: Array
    arm: Array
    angle: float

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return self.angle * float(np.linalg.norm(self.arm))

    @property
    def is_meant(self) -> bool:
        """Whether controllers make a step of it."""
        return MIN_TURN <= self.angle <= MAX_TURN and self.length >= MIN_LENGTH

    def at(self, share: Array) -> Array:
        """Return points at shares of it (K,), (K, 3)."""
        turned = (self.angle * share)[:, None]
        across = np.cross(self.axis, self.arm)
        return np.asarray(self.center + np.cos(turned) * self.arm + np.sin(turned) * across)


def arc_through(begin: Array, via: Array, end: Array) -> Arc | None:
    """Return the arc from a point by another to a third (3,); None where they are on a line."""
    first, second = via - begin, end - begin
    axis = np.cross(first, second)
    size, chord = float(np.linalg.norm(axis)), float(np.linalg.norm(second))
    if size <= _FLAT * max(chord, float(np.linalg.norm(first))) ** 2:
        return None
    # The circumcentre, from the begin.
    away = np.cross(axis, first) * (second @ second) + np.cross(second, axis) * (first @ first)
    away = away / (2.0 * size**2)
    axis = axis / size
    arm = -away
    last = end - begin - away
    angle = float(np.arctan2(np.cross(arm, last) @ axis, arm @ last)) % (2.0 * np.pi)
    return Arc(begin + away, axis, arm, angle)


def step_lengths(positions: Array, vias: Array) -> Array:
    """Return how long the steps between places (K + 1, 3) are, (K,) [m].

    Parameters
    ----------
    positions : (K + 1, 3)
    vias : (K, 3)
        Where a step goes round; no numbers where it goes straight.
    """
    lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    for k in np.flatnonzero(np.isfinite(vias[:, 0])):
        arc = arc_through(positions[k], vias[k], positions[k + 1])
        lengths[k] = lengths[k] if arc is None else arc.length
    return np.asarray(lengths)


def put_on_arcs(rows: Array, times: Array, t: Array, positions: Array, vias: Array) -> None:
    """Put the positions of rows (N, 3 + …) at times where steps go round, in place."""
    step = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    for k in np.flatnonzero(np.isfinite(vias[:, 0])):
        arc = arc_through(positions[k], vias[k], positions[k + 1])
        here = step == k
        if arc is not None and here.any():
            rows[here, :3] = arc.at((times[here] - t[k]) / (t[k + 1] - t[k]))
