r"""Circular steps between tool poses, as ``SCIRC``, ``MoveC`` and ``movec`` make them.

The position moves evenly along the circle through the start, a via point and the end. The
orientation turns evenly about one axis from that of the start to that of the end, relative to the
work object. External axes are linear, as in a straight step. The makers document that
orientation for ``$CIRC_TYPE = #BASE`` (KUKA), ``CirPathMode \ObjectFrame`` (ABB) and ``mode=0``
(Universal Robots). Via poses are in the middle of their steps, in orientation and external axes as
well, so that a controller that takes their orientation into account moves in the same way.
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
        The arc is right-handed about the axis.
    arm : (3,)
        From the centre to the start [m].
    angle : float
        From the start to the end [rad].
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
    def is_programmable(self) -> bool:
        """Whether all controllers accept it as a circular motion."""
        return MIN_TURN <= self.angle <= MAX_TURN and self.length >= MIN_LENGTH

    def at(self, share: Array) -> Array:
        """Return the points at shares of the arc (K,), from 0 to 1, (K, 3) [m]."""
        angles = (self.angle * share)[:, None]
        across = np.cross(self.axis, self.arm)
        return np.asarray(self.center + np.cos(angles) * self.arm + np.sin(angles) * across)


def arc_through(start: Array, via: Array, end: Array) -> Arc | None:
    """Return the arc from a point (3,) through another to a third; None for points on a line."""
    first, second = via - start, end - start
    axis = np.cross(first, second)
    size, chord = float(np.linalg.norm(axis)), float(np.linalg.norm(second))
    if size <= _FLAT * max(chord, float(np.linalg.norm(first))) ** 2:
        return None
    # The circumcentre, from the start.
    away = np.cross(axis, first) * (second @ second) + np.cross(second, axis) * (first @ first)
    away = away / (2.0 * size**2)
    axis = axis / size
    arm = -away
    last = end - start - away
    angle = float(np.arctan2(np.cross(arm, last) @ axis, arm @ last)) % (2.0 * np.pi)
    return Arc(start + away, axis, arm, angle)


def step_lengths(positions: Array, vias: Array) -> Array:
    """Return the lengths of steps between positions, along arcs where they are circular, (K,) [m].

    Parameters
    ----------
    positions : (K + 1, 3)
    vias : (K, 3)
        Via points of circular steps; NaN for straight ones.
    """
    lengths = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    for k in np.flatnonzero(np.isfinite(vias[:, 0])):
        arc = arc_through(positions[k], vias[k], positions[k + 1])
        lengths[k] = lengths[k] if arc is None else arc.length
    return np.asarray(lengths)


def put_on_arcs(rows: Array, times: Array, t: Array, positions: Array, vias: Array) -> None:
    """Move the positions of rows (N, 3 + …) onto the arcs of circular steps, in place.

    Parameters
    ----------
    rows : (N, 3 + …)
        Begin with positions [m].
    times : (N,)
        Of the rows [s].
    t : (K + 1,)
        Of the positions, between which the steps are [s].
    positions, vias
        See `step_lengths`.
    """
    step = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(t) - 2)
    for k in np.flatnonzero(np.isfinite(vias[:, 0])):
        arc = arc_through(positions[k], vias[k], positions[k + 1])
        in_step = step == k
        if arc is not None and in_step.any():
            rows[in_step, :3] = arc.at((times[in_step] - t[k]) / (t[k + 1] - t[k]))
