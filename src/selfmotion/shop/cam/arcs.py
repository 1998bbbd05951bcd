"""Arcs of machines as points: circles about an axis, and helices."""

import numpy as np

from selfmotion.basics import Array
from selfmotion.shop.cam.cuts import SAME_POSE, Machine

# Largest deviation of chords from their arc [m].
_CHORD_TOLERANCE = 1e-5
# Difference of the distances of an arc's ends from its centre, and by which ends may be farther
# apart than the circle is wide [m].
_RADIUS_TOLERANCE = 2e-4
# Largest radius of an arc that is no fault of what wrote it [m].
_MAX_RADIUS = 1e5
# Largest number of chords of an arc.
_MAX_POINTS = 100_000


def arc_points(
    machine: Machine, start: Array, goal: Array, center: Array, axis: Array, more_turns: int = 0
) -> Array:
    """Return points (K, 3) of an arc, its end the last one.

    It goes right-handed about an axis through the centre, and evenly along it; where both ends are
    in one direction it is a whole turn.

    Parameters
    ----------
    machine : Machine
        Whose line is read.
    start, goal, center, axis : (3,)
    more_turns : int
        Whole turns besides.

    Raises
    ------
    FileFormatError
        The ends are not as far from the axis as each other, or the arc is too large.
    """
    if np.isnan(start).any() or np.isnan(goal).any():
        raise machine.fault(
            "an arc begins where X, Y or Z is not known yet: give X, Y and Z in a rapid before"
        )
    axis = axis / np.linalg.norm(axis)
    heights = (start - center) @ axis, (goal - center) @ axis
    arms = start - center - heights[0] * axis, goal - center - heights[1] * axis
    radius, other = (float(np.linalg.norm(arm)) for arm in arms)
    if radius < SAME_POSE or abs(radius - other) > _RADIUS_TOLERANCE:
        raise machine.fault(
            f"the arc begins {1e3 * radius:.4g} mm from its centre and ends "
            f"{1e3 * other:.4g} mm from it"
        )
    if radius > _MAX_RADIUS:
        raise machine.fault(f"the arc has a radius of {radius:.4g} m")
    x = arms[0] / radius
    y = np.cross(axis, x)
    turn = float(np.arctan2(arms[1] @ y, arms[1] @ x)) % (2.0 * np.pi)
    if turn < 1e-9:
        turn = 2.0 * np.pi
    turn += 2.0 * np.pi * more_turns
    count = max(
        2, int(np.ceil(turn / (2.0 * np.arccos(max(0.0, 1.0 - _CHORD_TOLERANCE / radius)))))
    )
    if count > _MAX_POINTS:
        raise machine.fault(f"the arc takes {count} chords, expected {_MAX_POINTS} at most")
    share = np.arange(1, count + 1)[:, None] / count
    angle, radii = turn * share, radius + (other - radius) * share
    points = center + radii * (np.cos(angle) * x + np.sin(angle) * y)
    points = points + (heights[0] + (heights[1] - heights[0]) * share) * axis
    points[-1] = goal
    return np.asarray(points)


def center_by_radius(
    machine: Machine, start: Array, goal: Array, radius: float, sense: float
) -> Array:
    """Return the centre (2,) of an arc in its plane.

    Parameters
    ----------
    machine : Machine
        Whose line is read.
    start, goal : (2,)
    radius : float
        [m]; below 0 for an arc of more than half a turn.
    sense : float
        1 for an arc that goes right-handed, -1 for one that does not.

    Raises
    ------
    FileFormatError
        No such arc joins the ends.
    """
    chord = goal - start
    length = float(np.linalg.norm(chord))
    if length < SAME_POSE or length > 2.0 * abs(radius) + _RADIUS_TOLERANCE:
        raise machine.fault(
            f"no arc of radius {1e3 * radius:.4g} mm joins points {1e3 * length:.4g} mm apart"
        )
    height = np.sqrt(max(0.0, radius**2 - 0.25 * length**2))
    side = sense if radius > 0.0 else -sense
    normal = np.array([-chord[1], chord[0]]) / length
    return np.asarray(start + 0.5 * chord + side * height * normal)
