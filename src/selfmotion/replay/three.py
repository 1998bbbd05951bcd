"""Meshcat commands and three.js objects as plain dictionaries.

meshcat's own Python classes give every object a random id; ours is its path, so that the same plan
makes the same page.
"""

from typing import Any

import numpy as np

from selfmotion.basics import Array
from selfmotion.replay.shapes import capsule_profile

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
