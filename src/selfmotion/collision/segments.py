"""Signed distance of a segment from a segment, box or cylinder, and its gradient.

Each function returns the distance d, a normal and a point of the first segment. Moving the
segment by a small rigid motion changes d by normal · (velocity at that point). Vectors are
triples of floats: numba keeps them in registers.
"""

import math

from selfmotion.basics import kernel

Vector = tuple[float, float, float]
Contact = tuple[float, Vector, Vector]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return a · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def blend(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@kernel
def _project(point: Vector, middle: Vector, half: Vector) -> float:
    """Return s in [-1, 1] of the point of the segment middle + s half closest to `point`."""
    length = dot(half, half)
    if length == 0.0:
        return 0.0
    return min(1.0, max(-1.0, dot(blend(point, -1.0, middle), half) / length))


@kernel
def segment_segment(c: Vector, e: Vector, f: Vector, g: Vector) -> Contact:
    """Return distance, normal and point of the segments c ± e and f ± g.

    The minimum is at an end of one of them or between two interior points; comparing all five
    candidates keeps nearly parallel segments accurate.
    """
    best = math.inf
    first, second = c, f
    for sign in (-1.0, 1.0):
        end = blend(c, sign, e)
        near = blend(f, _project(end, f, g), g)
        gap = blend(end, -1.0, near)
        if dot(gap, gap) < best:
            best, first, second = dot(gap, gap), end, near
        end = blend(f, sign, g)
        near = blend(c, _project(end, c, e), e)
        gap = blend(near, -1.0, end)
        if dot(gap, gap) < best:
            best, first, second = dot(gap, gap), near, end
    ee, gg, eg = dot(e, e), dot(g, g), dot(e, g)
    determinant = ee * gg - eg * eg
    if determinant > 1e-14 * ee * gg:
        between = blend(f, -1.0, c)
        s = (dot(e, between) * gg - dot(g, between) * eg) / determinant
        t = (dot(e, between) * eg - dot(g, between) * ee) / determinant
        if abs(s) < 1.0 and abs(t) < 1.0:
            near, end = blend(c, s, e), blend(f, t, g)
            gap = blend(near, -1.0, end)
            if dot(gap, gap) < best:
                best, first, second = dot(gap, gap), near, end
    distance = math.sqrt(best)
    if distance > 1e-12:
        gap = blend(first, -1.0, second)
        return distance, (gap[0] / distance, gap[1] / distance, gap[2] / distance), first
    # The centre lines cross: every direction across both of them separates equally fast.
    across = cross(e, g)
    size = math.sqrt(dot(across, across))
    if size == 0.0:
        return distance, (0.0, 0.0, 1.0), first
    return distance, (across[0] / size, across[1] / size, across[2] / size), first


@kernel
def _excess(x: float, h: float) -> float:
    """Return how far x is beyond [-h, h], with its sign."""
    return x - h if x > h else (x + h if x < -h else 0.0)


@kernel
def _box_slope(c: Vector, e: Vector, h: Vector, s: float) -> float:
    """Return half the derivative by s of the squared distance of c + s e from the box ±h."""
    return (
        e[0] * _excess(c[0] + s * e[0], h[0])
        + e[1] * _excess(c[1] + s * e[1], h[1])
        + e[2] * _excess(c[2] + s * e[2], h[2])
    )


@kernel
def _closest_to_box(c: Vector, e: Vector, h: Vector) -> float:
    """Return s in [-1, 1] that minimises the distance of c + s e from the box ±h.

    The slope increases with s and is linear between the at most six planes the line crosses, so
    bracketing the root by these and interpolating is exact.
    """
    low, high = -1.0, 1.0
    at_low, at_high = _box_slope(c, e, h, low), _box_slope(c, e, h, high)
    if at_low >= 0.0:
        return low
    if at_high <= 0.0:
        return high
    for k in range(3):
        if e[k] != 0.0:
            for side in (-h[k], h[k]):
                s = (side - c[k]) / e[k]
                if low < s < high:
                    slope = _box_slope(c, e, h, s)
                    if slope <= 0.0:
                        low, at_low = s, slope
                    else:
                        high, at_high = s, slope
    return low - at_low * (high - low) / (at_high - at_low)


@kernel
def _out_of_box(c: Vector, e: Vector, h: Vector) -> Contact:
    """Return minus the shortest translation that takes the segment out of the box ±h.

    Box plus segment is a polytope with the box's faces and those spanned by the segment and a box
    edge; the shortest way out of a polytope is through the nearest face.
    """
    best, normal, point = -math.inf, (0.0, 0.0, 1.0), c
    for k in range(3):
        gap = abs(c[k]) - h[k] - abs(e[k])
        if gap > best:
            side = 1.0 if c[k] >= 0.0 else -1.0
            best = gap
            normal = (side * (k == 0), side * (k == 1), side * (k == 2))
            point = blend(c, -side if e[k] >= 0.0 else side, e)
    for k in range(3):
        axis = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        n = cross(axis, e)
        size = math.sqrt(dot(n, n))
        if size <= 1e-9 * math.sqrt(dot(e, e)):
            continue
        size = size if dot(c, n) >= 0.0 else -size
        n = (n[0] / size, n[1] / size, n[2] / size)
        gap = dot(c, n) - h[0] * abs(n[0]) - h[1] * abs(n[1]) - h[2] * abs(n[2])
        if gap > best:
            edge = (math.copysign(h[0], n[0]), math.copysign(h[1], n[1]), math.copysign(h[2], n[2]))
            along = cross(n, axis)
            s = dot(blend(edge, -1.0, c), along) / dot(e, along)
            best, normal, point = gap, n, blend(c, min(1.0, max(-1.0, s)), e)
    return best, normal, point


@kernel
def segment_box(c: Vector, e: Vector, h: Vector) -> Contact:
    """Return distance, normal and point of the segment c ± e and the solid box ±h.

    Negative inside: minus the shortest translation that separates them.
    """
    point = blend(c, _closest_to_box(c, e, h), e)
    gap = (_excess(point[0], h[0]), _excess(point[1], h[1]), _excess(point[2], h[2]))
    distance = math.sqrt(dot(gap, gap))
    if distance < 1e-12:
        return _out_of_box(c, e, h)
    return distance, (gap[0] / distance, gap[1] / distance, gap[2] / distance), point


@kernel
def _point_cylinder(p: Vector, radius: float, half: float) -> tuple[float, Vector]:
    """Return the signed distance of a point from a solid cylinder about z, and its gradient."""
    rho = math.hypot(p[0], p[1])
    outward = (p[0] / rho, p[1] / rho, 0.0) if rho > 0.0 else (1.0, 0.0, 0.0)
    upward = (0.0, 0.0, 1.0 if p[2] >= 0.0 else -1.0)
    side, top = rho - radius, abs(p[2]) - half
    if side > 0.0 and top > 0.0:
        distance = math.hypot(side, top)
        x = side / distance
        return distance, (x * outward[0], x * outward[1], top / distance * upward[2])
    if side > top:
        return side, outward
    return top, upward


@kernel
def segment_cylinder(c: Vector, e: Vector, radius: float, half: float) -> Contact:
    """Return distance, normal and point of the segment c ± e and the solid cylinder about z.

    Negative inside: the signed distance of the segment's deepest point. A convex function of the
    point, so bisecting its slope along the segment finds the minimum. Where the slope jumps there,
    the normal is the mean of both sides across which the slope is zero.
    """
    low, high = -1.0, 1.0
    low_value, low_normal = _point_cylinder(blend(c, low, e), radius, half)
    if dot(low_normal, e) >= 0.0:
        return low_value, low_normal, blend(c, low, e)
    high_value, high_normal = _point_cylinder(blend(c, high, e), radius, half)
    if dot(high_normal, e) <= 0.0:
        return high_value, high_normal, blend(c, high, e)
    for _ in range(60):
        s = 0.5 * (low + high)
        value, normal = _point_cylinder(blend(c, s, e), radius, half)
        if dot(normal, e) < 0.0:
            low, low_value, low_normal = s, value, normal
        else:
            high, high_value, high_normal = s, value, normal
    down, up = -dot(low_normal, e), dot(high_normal, e)
    share = up / (down + up)
    n = (share * low_normal[0], share * low_normal[1], share * low_normal[2])
    return min(low_value, high_value), blend(n, 1.0 - share, high_normal), blend(c, low, e)
