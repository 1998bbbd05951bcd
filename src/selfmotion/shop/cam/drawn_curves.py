"""Entities of DXF drawings as points (N, 3) along them, in units of the drawing."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags

# Largest number of points of a curve.
_MAX_POINTS = 200_000
# Largest distance from zero that is no fault of what wrote it [units of the drawing].
_MAX_COORDINATE = 1e100
# Largest radius of an arc that is no fault of what wrote it [deviations of a chord].
_MAX_RADIUS = 1e11
# Number of chords between two knots, and in half of an ellipse, to begin with.
_FIRST_CHORDS = 4
# Largest number of times that chords are halved.
_MAX_HALVINGS = 30
# Ratio of the largest deviation of a cubic from its chord to that at thirds of its parameter.
_CUBIC_RATIO = 1.31
# Flags of polylines that are fitted by a curve or a spline, and of meshes.
_FITTED_OR_MESH = 2 | 4 | 16 | 64


def entity_points(entity: Any, deviation: float) -> Array:
    """Return points (N, 3) along an entity of one of the `ENTITY_TYPES`.

    Parameters
    ----------
    entity : ezdxf.entities.DXFEntity
    deviation : float
        Largest distance of the entity from the chords between its points.

    Raises
    ------
    ValueError
        The entity is not a curve, or its numbers are no sensible ones.
    """
    return _POINTS[entity.dxftype()](entity, deviation)


def _line_points(entity: Any, deviation: float) -> Array:
    return np.array([entity.dxf.start, entity.dxf.end])


def _arc_points(entity: Any, deviation: float) -> Array:
    radius = abs(entity.dxf.radius)
    if not 0.0 < radius < _MAX_RADIUS * deviation:
        raise ValueError(f"its radius is {radius:.6g}")
    return np.array(list(entity.flattening(min(deviation, 0.5 * radius))))


def _ellipse_points(entity: Any, deviation: float) -> Array:
    ellipse = entity.construction_tool()
    parameters = np.linspace(0.0, ellipse.param_span, 2 * _FIRST_CHORDS + 1)
    return _curve_points(lambda t: ellipse.vertices(ellipse.start_param + t), parameters, deviation)


def _spline_points(entity: Any, deviation: float) -> Array:
    spline = entity.construction_tool()
    first, last = spline.knots()[spline.order - 1], spline.knots()[spline.count]
    knots = np.unique([first, *(knot for knot in spline.knots() if first < knot < last), last])
    chords = np.arange(_FIRST_CHORDS * (len(knots) - 1) + 1)
    parameters = np.interp(chords / _FIRST_CHORDS, range(len(knots)), knots)
    return _curve_points(spline.points, parameters, deviation)


def _polyline_points(entity: Any, deviation: float) -> Array:
    """Return the corners of a polyline, and points of the arcs between them."""
    if entity.dxf.flags & _FITTED_OR_MESH and entity.dxftype() == "POLYLINE":
        raise ValueError("is a mesh, or fitted by a curve; explode it")
    if entity.dxftype() == "POLYLINE" and entity.is_3d_polyline:
        corners = [vertex.dxf.location for vertex in entity.vertices]
        return np.array(corners + corners[:1] if entity.is_closed else corners)
    points = np.zeros((0, 3))
    for part in entity.virtual_entities():
        part_points = entity_points(part, deviation)
        # Arcs go round to the left, also where the polyline goes to the right.
        last = points[-1] if len(points) else np.array(_first_corner(entity))
        gap = np.linalg.norm(part_points[[0, -1]] - last, axis=1)
        points = np.concatenate([points, part_points[::-1] if gap[1] < gap[0] else part_points])
    return points


def _first_corner(entity: Any) -> Any:
    if entity.dxftype() == "POLYLINE":
        return next(iter(entity.points_in_wcs()))
    return next(iter(entity.vertices_in_wcs()))


def _curve_points(curve: Callable[[Array], Any], parameters: Array, deviation: float) -> Array:
    """Return points of a curve whose chords are nowhere off it by more than a deviation.

    Chords that are farther off are halved, beginning with those between some parameters.
    """
    t = parameters
    for _ in range(_MAX_HALVINGS):
        points = np.array([tuple(point) for point in curve(t)])
        if not np.isfinite(points).all():
            raise ValueError("is not finite")
        if not np.abs(points).max() < _MAX_COORDINATE:
            raise ValueError(f"is farther away than {_MAX_COORDINATE:g}")
        is_far = _are_chords_far(curve, t, points, deviation)
        if not is_far.any():
            return points
        if len(t) + is_far.sum() > _MAX_POINTS:
            break
        t = np.sort(np.concatenate([t, t[:-1][is_far] + 0.5 * np.diff(t)[is_far]]))
    raise ValueError(f"needs more than {_MAX_POINTS} chords to be near enough")


def _are_chords_far(
    curve: Callable[[Array], Any], t: Array, points: Array, deviation: float
) -> Flags:
    """Return which chords between points (N, 3) at parameters t are off a curve, (N - 1,).

    Between two parameters it is taken for a cubic, which is what is between two knots of a spline
    of degree three, and soon what is left of any other curve.
    """
    chords, steps = np.diff(points, axis=0), np.diff(t)
    is_far = np.zeros(len(chords), dtype=bool)
    squared_lengths = np.maximum((chords * chords).sum(axis=1), np.finfo(np.float64).tiny)
    for third in (1.0 / 3.0, 2.0 / 3.0):
        offsets = np.array([tuple(point) for point in curve(t[:-1] + third * steps)]) - points[:-1]
        offsets = np.clip(offsets, -_MAX_COORDINATE, _MAX_COORDINATE)
        along = np.clip((offsets * chords).sum(axis=1) / squared_lengths, 0.0, 1.0)
        distances = np.linalg.norm(offsets - along[:, None] * chords, axis=1)
        # Written so that NaN is far.
        is_far |= ~(_CUBIC_RATIO * distances <= deviation)
    return is_far


# Type of an entity → its points.
_POINTS: Mapping[str, Callable[[Any, float], Array]] = {
    "LINE": _line_points,
    "ARC": _arc_points,
    "CIRCLE": _arc_points,
    "ELLIPSE": _ellipse_points,
    "SPLINE": _spline_points,
    "LWPOLYLINE": _polyline_points,
    "POLYLINE": _polyline_points,
}
# Types of entities that are drawn.
ENTITY_TYPES = tuple(_POINTS)
