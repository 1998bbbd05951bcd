"""Entities of DXF drawings as points (N, 3) along them, in units of the drawing."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from selfmotion.basics import Array

# Largest number of points of a curve.
_POINTS = 200_000
# Largest distance from zero that is no fault of what wrote it [units of the drawing].
_LARGEST = 1e100
# Ratio of the largest deviation of a cubic from its chord to that at thirds of its parameter.
_BETWEEN_THIRDS = 1.31
# Largest radius of an arc that is no fault of what wrote it [deviations of a chord].
_FLATTEST = 1e11
# Largest number of halvings of a chord.
_HALVINGS = 30
# Number of chords between two knots, and in half of an ellipse, to begin with.
_CHORDS = 4
# Flags of polylines that are fitted by a curve or a spline, and of meshes.
_NOT_AS_DRAWN = 2 | 4 | 16 | 64


def _line_drawn(entity: Any, deviation: float) -> Array:
    return np.array([entity.dxf.start, entity.dxf.end])


def _arc_drawn(entity: Any, deviation: float) -> Array:
    radius = abs(entity.dxf.radius)
    if not 0.0 < radius < _FLATTEST * deviation:
        raise ValueError(f"its radius is {radius:.6g}")
    return np.array(list(entity.flattening(min(deviation, 0.5 * radius))))


def _ellipse_drawn(entity: Any, deviation: float) -> Array:
    ellipse = entity.construction_tool()
    ends = np.linspace(0.0, ellipse.param_span, 2 * _CHORDS + 1)
    return _chords(lambda t: ellipse.vertices(ellipse.start_param + t), ends, deviation)


def _spline_drawn(entity: Any, deviation: float) -> Array:
    spline = entity.construction_tool()
    first, last = spline.knots()[spline.order - 1], spline.knots()[spline.count]
    knots = np.unique([first, *(each for each in spline.knots() if first < each < last), last])
    ends = np.interp(np.arange(_CHORDS * (len(knots) - 1) + 1) / _CHORDS, range(len(knots)), knots)
    return _chords(spline.points, ends, deviation)


def _polyline_drawn(entity: Any, deviation: float) -> Array:
    """Return the corners of a polyline, and points of the arcs between them."""
    if entity.dxf.flags & _NOT_AS_DRAWN and entity.dxftype() == "POLYLINE":
        raise ValueError("is a mesh, or fitted by a curve; explode it")
    if entity.dxftype() == "POLYLINE" and entity.is_3d_polyline:
        corners = [vertex.dxf.location for vertex in entity.vertices]
        return np.array(corners + corners[:1] if entity.is_closed else corners)
    found = np.zeros((0, 3))
    for part in entity.virtual_entities():
        points = DRAWN[part.dxftype()](part, deviation)
        # Arcs go round to the left, also where the polyline goes to the right.
        last = found[-1] if len(found) else np.array(_first_corner(entity))
        away = np.linalg.norm(points[[0, -1]] - last, axis=1)
        found = np.concatenate([found, points[::-1] if away[1] < away[0] else points])
    return found


def _first_corner(entity: Any) -> Any:
    if entity.dxftype() == "POLYLINE":
        return next(iter(entity.points_in_wcs()))
    return next(iter(entity.vertices_in_wcs()))


def _chords(curve: Callable[[Array], Any], ends: Array, deviation: float) -> Array:
    """Return points of a curve whose chords are nowhere off it by more than a deviation.

    Between two parameters it is taken for a cubic, which is what is between two knots of a spline
    of degree three, and soon what is left of any other curve.
    """
    t = ends
    for _ in range(_HALVINGS):
        points = np.array([tuple(each) for each in curve(t)])
        if not np.isfinite(points).all():
            raise ValueError("is not finite")
        if not np.abs(points).max() < _LARGEST:
            raise ValueError(f"is farther away than {_LARGEST:g}")
        chords, steps = np.diff(points, axis=0), np.diff(t)
        far = np.zeros(len(chords), dtype=bool)
        lengths = np.maximum((chords * chords).sum(axis=1), np.finfo(np.float64).tiny)
        for share in (1.0 / 3.0, 2.0 / 3.0):
            here = np.array([tuple(each) for each in curve(t[:-1] + share * steps)]) - points[:-1]
            here = np.clip(here, -_LARGEST, _LARGEST)
            along = np.clip((here * chords).sum(axis=1) / lengths, 0.0, 1.0)
            away = np.linalg.norm(here - along[:, None] * chords, axis=1)
            far |= ~(_BETWEEN_THIRDS * away <= deviation)
        if not far.any():
            return points
        if len(t) + far.sum() > _POINTS:
            break
        t = np.sort(np.concatenate([t, t[:-1][far] + 0.5 * steps[far]]))
    raise ValueError(f"needs more than {_POINTS} chords to be near enough")


DRAWN: Mapping[str, Callable[[Any, float], Array]] = {
    "LINE": _line_drawn,
    "ARC": _arc_drawn,
    "CIRCLE": _arc_drawn,
    "ELLIPSE": _ellipse_drawn,
    "SPLINE": _spline_drawn,
    "LWPOLYLINE": _polyline_drawn,
    "POLYLINE": _polyline_drawn,
}
