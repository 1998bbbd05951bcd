"""Fitting capsules around the outline of a link."""

import itertools
import math

import numpy as np

from selfmotion.basics import Array, kernel
from selfmotion.collision.capsules import capsule_volume
from selfmotion.collision.outlines import Outline, extreme

# A capsule of more than this many times the volume of the convex hull is worth dividing,
_WASTE = 1.5
# as long as each further capsule takes away this share of the volume,
_GAIN = 0.1
# up to so many.
_MOST = 3


def fit(shape: Outline) -> Array:
    """Return rows [middle, half, radius] of the capsules around an outline, (1 to 3, 7).

    Several are fitted to slabs of equal thickness along one of the principal axes.
    """
    points, radii = extreme(shape.points, shape.radii)
    best = _enclose(points, radii)[None]
    hull = _hull_volume(points)
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    for parts in range(2, _MOST + 1):
        if _total(best) < _WASTE * hull or radii.any():
            break
        smallest = min((_split(shape, axis, parts) for axis in axes), key=_total)
        if _total(smallest) < (1.0 - _GAIN) * _total(best):
            best = smallest
    return best


def _hull_volume(points: Array) -> float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):  # flat, or too few
        return 0.0


def _split(shape: Outline, axis: Array, parts: int) -> Array:
    height = shape.points @ axis
    levels = np.linspace(height.min(), height.max(), parts + 1)
    # The outermost planes must not lose a point to rounding.
    levels[0], levels[-1] = -np.inf, np.inf
    slabs = (shape.slab(axis, low, high) for low, high in itertools.pairwise(levels))
    return np.array([_enclose(*extreme(*slab)) for slab in slabs if len(slab[0])])


def _total(capsules: Array) -> float:
    return sum(capsule_volume(2.0 * float(np.linalg.norm(row[3:6])), row[6]) for row in capsules)


def _enclose(points: Array, radii: Array) -> Array:
    """Return [middle, half, radius] of a small capsule around balls.

    Nelder-Mead over the direction and place of the axis and the radius, from the best principal
    axis; for these the segment follows in closed form, so that every trial contains the balls.
    """
    points = np.ascontiguousarray(points)
    centre = points.mean(axis=0)
    size = max(float(np.ptp(points, axis=0).max()), float(radii.max()), 1e-9)
    axes = np.linalg.svd(np.vstack([points - centre, 1e-12 * np.eye(3)]), full_matrices=False)[2]
    starts = [
        (points, radii, centre, np.ascontiguousarray(np.roll(axes, -k, axis=0)), size)
        for k in range(3)
    ]
    start = min(starts, key=lambda fixed: _trial_volume(np.zeros(5), *fixed))
    from scipy.optimize import minimize

    answer = minimize(
        _trial_volume,
        np.zeros(5),
        args=start,
        method="Nelder-Mead",
        options={"initial_simplex": 0.1 * np.eye(6, 5, k=-1), "maxfev": 400, "xatol": 1e-4},
    )
    best = _trial(answer.x, *start)
    # The radius anew, from the finished segment: containment must not rest on rounding above.
    best[6] = (_axis_distance(points, best[:3], best[3:6]) + radii).max()
    return best


def _axis_distance(points: Array, middle: Array, half: Array) -> Array:
    """Return the distance of points (N, 3) from the segment middle ± half [m]."""
    offset = points - middle
    length = float(half @ half)
    s = np.clip(offset @ half / length, -1.0, 1.0) if length > 0.0 else np.zeros(len(points))
    distance: Array = np.linalg.norm(offset - s[:, None] * half, axis=1)
    return distance


@kernel
def _trial(
    x: Array, points: Array, radii: Array, centre: Array, frame: Array, size: float
) -> Array:
    """Return the shortest capsule about the axis that x = (tilt, shift, widening) describes."""
    axis = frame[0] + x[0] * frame[1] + x[1] * frame[2]
    axis /= math.sqrt((axis * axis).sum())
    origin = centre + size * (x[2] * frame[1] + x[3] * frame[2])
    along, aside = np.empty(len(points)), np.empty(len(points))
    radius = 0.0
    for i in range(len(points)):
        u, v, w = points[i, 0] - origin[0], points[i, 1] - origin[1], points[i, 2] - origin[2]
        along[i] = u * axis[0] + v * axis[1] + w * axis[2]
        aside[i] = math.sqrt(max(u * u + v * v + w * w - along[i] ** 2, 0.0))
        radius = max(radius, aside[i] + radii[i])
    radius *= 1.0 + x[4] ** 2
    low, high = math.inf, -math.inf
    for i in range(len(points)):
        cap = math.sqrt(max((radius - radii[i]) ** 2 - aside[i] ** 2, 0.0))
        low, high = min(low, along[i] + cap), max(high, along[i] - cap)
    if low > high:  # any point between serves as the centre of a ball
        low = high = 0.5 * (low + high)
    capsule = np.empty(7)
    capsule[:3] = origin + 0.5 * (low + high) * axis
    capsule[3:6] = 0.5 * (high - low) * axis
    capsule[6] = radius
    return capsule


@kernel
def _trial_volume(
    x: Array, points: Array, radii: Array, centre: Array, frame: Array, size: float
) -> float:
    capsule = _trial(x, points, radii, centre, frame, size)
    length, radius = 2.0 * math.sqrt((capsule[3:6] ** 2).sum()), capsule[6]
    volume: float = math.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    return volume
