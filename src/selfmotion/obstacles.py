"""Bodies that stand around or ride along, and what measures their distances."""

from selfmotion.model.collision import (
    Box,
    Capsule,
    CollisionModel,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
)

__all__ = [
    "Box",
    "Capsule",
    "CollisionModel",
    "Cylinder",
    "Mesh",
    "Obstacle",
    "Sphere",
]
