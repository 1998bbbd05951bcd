"""Shapes and commands for the viewer: meshcat and three.js objects as plain dictionaries."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array

# Viridis at nine places: perceptually even, readable without colour vision and in grey.
COLOR_SCALE = (
    "#440154 #472d7b #3b528b #2c728e #21918c #28ae80 #5ec962 #addc30 #fde725".split()  # noqa: SIM905
)

Indices = npt.NDArray[np.int64]
Surface = tuple[Array, Indices]


def colors_of(values: Array, low: float, high: float) -> Array:
    """Return the colour of each value on the scale from `low` to `high`, (K, 3) in 0..1."""
    stops = np.array([[int(stop[i : i + 2], 16) / 255 for i in (1, 3, 5)] for stop in COLOR_SCALE])
    place = np.clip((values - low) / (high - low), 0.0, 1.0)
    where = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(place, where, stops[:, k]) for k in range(3)], axis=1)


def distinct(points: Array, spacing: float) -> npt.NDArray[np.intp]:
    """Return the indices of points at least `spacing` from the one kept before; first included."""
    kept = [0]
    for k in range(1, len(points)):
        if np.linalg.norm(points[k] - points[kept[-1]]) >= spacing:
            kept.append(k)
    return np.array(kept)


def tube(points: Array, radius: float, sides: int = 8) -> Surface:
    """Return a tube around a polyline of at least two distinct points.

    Vertex ``sides * k + j`` belongs to point k. The ring is carried along without twisting.
    """
    tangents = _tangents(points)
    normals = np.empty_like(points)
    normal = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    for k, tangent in enumerate(tangents):
        normal = normal - (normal @ tangent) * tangent
        normal = normal / math.sqrt(normal @ normal)
        normals[k] = normal
    angles = 2 * np.pi * np.arange(sides) / sides
    rings = points[:, None] + radius * (
        np.cos(angles)[:, None] * normals[:, None]
        + np.sin(angles)[:, None] * np.cross(tangents, normals)[:, None]
    )
    ring = np.arange(sides)
    start = sides * np.arange(len(points) - 1)[:, None]
    a, b = start + ring, start + np.roll(ring, -1)
    quads = np.stack([a, b, b + sides, a, b + sides, a + sides], axis=-1)
    return rings.reshape(-1, 3), quads.reshape(-1, 3)


def _tangents(points: Array) -> Array:
    """Return unit directions along a polyline; where it turns back, that of arrival."""
    sections = np.diff(points, axis=0)
    sections /= np.linalg.norm(sections, axis=1, keepdims=True)
    arriving, leaving = np.vstack([sections[:1], sections]), np.vstack([sections, sections[-1:]])
    mean = 0.5 * (arriving + leaving)
    lengths = np.linalg.norm(mean, axis=1, keepdims=True)
    return np.where(lengths > 0.1, mean / np.maximum(lengths, 0.1), arriving)


def beads(points: Array, radius: float) -> Surface:
    """Return one small ball per point, as octahedra split once; 18 vertices each."""
    corners = np.vstack([np.eye(3), -np.eye(3)])
    eighths = [
        (0, 1, 2),
        (1, 3, 2),
        (3, 4, 2),
        (4, 0, 2),
        (1, 0, 5),
        (3, 1, 5),
        (4, 3, 5),
        (0, 4, 5),
    ]
    vertices = list(corners)
    middle: dict[tuple[int, int], int] = {}

    def halfway(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middle:
            middle[key] = len(vertices)
            point = vertices[a] + vertices[b]
            vertices.append(point / np.linalg.norm(point))
        return middle[key]

    faces = []
    for a, b, c in eighths:
        ab, bc, ca = halfway(a, b), halfway(b, c), halfway(c, a)
        faces += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return _copies(np.array(vertices) * radius, np.array(faces), points, None)


def triads(points: Array, rotations: Array, length: float) -> tuple[Array, Indices, Array]:
    """Return x, y, z axes in red, green, blue at each pose: vertices, faces, colours."""
    width = 0.035 * length
    corners = np.array([[x, y, z] for x in (0, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    box = corners * [length, width, width]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([(s[0], s[i], s[i + 1]) for s in sides for i in (1, 2)])
    # Turning the coordinates round takes the x axis's bar to y, then to z.
    vertices = np.vstack([np.roll(box, k, axis=1) for k in range(3)])
    faces = np.vstack([faces + 8 * k for k in range(3)])
    colors = np.repeat([[0.86, 0.20, 0.18], [0.18, 0.62, 0.25], [0.16, 0.42, 0.90]], 8, axis=0)
    moved, indices = _copies(vertices, faces, points, rotations)
    return moved, indices, np.tile(colors, (len(points), 1))


def _copies(vertices: Array, faces: Indices, points: Array, rotations: Array | None) -> Surface:
    turned = (
        np.broadcast_to(vertices, (len(points), *vertices.shape))
        if rotations is None
        else np.einsum("kij,vj->kvi", rotations, vertices)
    )
    moved = (turned + points[:, None]).reshape(-1, 3)
    indices = (faces + len(vertices) * np.arange(len(points))[:, None, None]).reshape(-1, 3)
    return moved, indices


def capsule_profile(radius: float, half_length: float) -> list[dict[str, float]]:
    """Return the outline of a capsule about the y axis, bottom to top, for a lathe."""
    quarter = np.linspace(0.0, np.pi / 2, 12)
    x = radius * np.concatenate([np.sin(quarter), np.cos(quarter)])
    y = np.concatenate(
        [-half_length - radius * np.cos(quarter), half_length + radius * np.sin(quarter)]
    )
    return [{"x": float(a), "y": float(b)} for a, b in zip(x, y, strict=True)]


# Meshcat commands and three.js objects as plain dictionaries.
#
# meshcat's own Python classes give every object a random id; ours is its path, so that the same
# plan makes the same page.

Json = dict[str, Any]
_Z_TO_Y = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def material(color: Any, *, opacity: float = 1.0, **options: Any) -> Json:
    """Return a standard material; `color` is red, green, blue in 0..1."""
    red, green, blue = (round(255 * float(np.clip(value, 0.0, 1.0))) for value in color[:3])
    return {
        "type": "MeshStandardMaterial",
        "color": red << 16 | green << 8 | blue,
        "roughness": 0.55,
        "metalness": 0.05,
        "side": 2,
        "opacity": float(opacity),
        "transparent": bool(opacity < 1.0),
        **options,
    }


def ghostly(color: Any, opacity: float) -> Json:
    """Return a material for something seen through, which never hides what is opaque.

    It writes no depth and is pushed a little away from the viewer, so that an opaque surface at
    the same place always wins: no flicker.
    """
    return material(
        color,
        opacity=opacity,
        depthWrite=False,
        polygonOffset=True,
        polygonOffsetFactor=2,
        polygonOffsetUnits=2,
    )


def set_object(path: str, geometry: Json, look: Json, matrix: Array | None = None) -> Json:
    """Return the command that puts a mesh at `path`, at `matrix` (4, 4) below that node."""
    placed = np.eye(4) if matrix is None else np.asarray(matrix)
    return {
        "type": "set_object",
        "path": path,
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{"uuid": f"{path}#geometry", **geometry}],
            "materials": [{"uuid": f"{path}#material", **look}],
            "object": {
                "uuid": path,
                "type": "Mesh",
                "geometry": f"{path}#geometry",
                "material": f"{path}#material",
                "matrix": placed.T.ravel().tolist(),
            },
        },
    }


def set_light(path: str, position: Array, **properties: Any) -> Json:
    """Return the command that puts a light at `position` [m]."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return {
        "type": "set_object",
        "path": path,
        "object": {
            "metadata": {"version": 4.5, "type": "Object"},
            "object": {"uuid": path, "matrix": matrix.T.ravel().tolist(), **properties},
        },
    }


def delete(path: str) -> Json:
    """Return the command that removes a node."""
    return {"type": "delete", "path": path}


def box(size: Any) -> Json:
    """Return a box with sides `size` [m]."""
    width, height, depth = (float(side) for side in size)
    return {"type": "BoxGeometry", "width": width, "height": height, "depth": depth}


def sphere(radius: float) -> Json:
    """Return a ball [m]."""
    return {
        "type": "SphereGeometry",
        "radius": float(radius),
        "widthSegments": 32,
        "heightSegments": 20,
    }


def cylinder(radius: float, length: float) -> Json:
    """Return a cylinder [m] about three.js's y axis; turn it with `about_z`."""
    return {
        "type": "CylinderGeometry",
        "radiusTop": float(radius),
        "radiusBottom": float(radius),
        "height": float(length),
        "radialSegments": 48,
    }


def capsule(radius: float, length: float) -> Json:
    """Return a capsule [m] about the y axis; `length` is that of the cylinder between the balls."""
    return {
        "type": "LatheGeometry",
        "points": capsule_profile(float(radius), float(length) / 2),
        "segments": 48,
    }


def about_z(matrix: Array) -> Array:
    """Return the placement of a shape that three.js draws about y and URDF about z."""
    return np.asarray(matrix @ _Z_TO_Y)
