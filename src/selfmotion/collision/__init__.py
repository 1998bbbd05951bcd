"""Collisions: exact distances for certificates, smooth conservative ones for optimisation."""

from selfmotion.collision.clearance import ClearanceModel, Clearances
from selfmotion.collision.exact import CollisionModel
from selfmotion.collision.found import Closest, Overlap, srdf_line
from selfmotion.collision.obstacles import (
    Box,
    Capsule,
    Cylinder,
    Mesh,
    Obstacle,
    Sphere,
    obstacle_from_dict,
    obstacle_shapes,
)
from selfmotion.collision.pairs import disabled_links
from selfmotion.collision.solids import Solid

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
    "Solid",
    "Sphere",
    "disabled_links",
    "obstacle_from_dict",
    "obstacle_shapes",
    "srdf_line",
]
