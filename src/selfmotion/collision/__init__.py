"""Collisions: exact distances for certificates, smooth conservative ones for optimisation."""

from selfmotion.collision.clearance import ClearanceModel, Clearances
from selfmotion.collision.exact import Closest, CollisionModel
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
    "Sphere",
    "obstacle_from_dict",
]
