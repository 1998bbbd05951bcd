"""Collisions: exact distances for certificates, smooth conservative ones for optimisation."""

from selfmotion.model.collision.bodies import (
    Body as Body,
    link_bodies as link_bodies,
    place_of as place_of,
)
from selfmotion.model.collision.by_design import (
    ALWAYS as ALWAYS,
    PERHAPS as PERHAPS,
    overlap_warning as overlap_warning,
    overlapping_by_design as overlapping_by_design,
)
from selfmotion.model.collision.clearance import (
    ClearanceModel as ClearanceModel,
    Clearances as Clearances,
)
from selfmotion.model.collision.displaced import (
    DisplacedBodies as DisplacedBodies,
    Separation as Separation,
)
from selfmotion.model.collision.exact import CollisionModel as CollisionModel
from selfmotion.model.collision.obstacles import (
    Obstacle as Obstacle,
    obstacle_from_dict as obstacle_from_dict,
    obstacle_shapes as obstacle_shapes,
)
from selfmotion.model.collision.overlaps import (
    SAMPLES as SAMPLES,
    Closest as Closest,
    Overlap as Overlap,
    how_near as how_near,
    srdf_line as srdf_line,
)
from selfmotion.model.collision.pairs import (
    disabled_links as disabled_links,
    srdf_notes as srdf_notes,
)
from selfmotion.model.collision.shapes import (
    Box as Box,
    Capsule as Capsule,
    Cylinder as Cylinder,
    Mesh as Mesh,
    Sphere as Sphere,
)
from selfmotion.model.collision.solids import Solid as Solid

__all__ = [
    "Box",
    "Capsule",
    "CollisionModel",
    "Cylinder",
    "Mesh",
    "Obstacle",
    "Sphere",
]
