"""Collisions: exact distances for certificates, smooth conservative ones for optimisation."""

from selfmotion.collision.clearance import ClearanceModel, Clearances
from selfmotion.collision.exact import Closest, CollisionModel, Overlap, srdf_line
from selfmotion.collision.obstacles import (
    Box,
    Capsule,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
    obstacle_from_dict,
)

__all__ = [
    "Box",
    "Capsule",
    "ClearanceModel",
    "Clearances",
    "Closest",
    "CollisionModel",
    "Cylinder",
    "Mesh",
    "Obstacle",
    "Overlap",
    "Sphere",
    "obstacle_from_dict",
    "srdf_line",
]
