"""Bodies as commands for the viewer: obstacles, and what of the links may not meet anything."""

import itertools
from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.collision import (
    Box,
    Capsule,
    Cylinder,
    Mesh,
    Obstacle,
    Solid,
    Sphere,
    link_bodies,
    place_of,
)
from selfmotion.replay import three
from selfmotion.replay.links import joint_name, safe
from selfmotion.replay.meshes import read_meshes
from selfmotion.replay.payload import Json, Payload
from selfmotion.replay.scene import triangles
from selfmotion.robot import RobotModel

# Of what stands around, the part that is worked on, and what the arm carries.
_AROUND, _PART, _CARRIED = (0.80, 0.62, 0.42), (0.47, 0.66, 0.56), (0.36, 0.48, 0.70)
# The links' own, seen through.
BODIES, _BODY_COLOR, _BODY_OPACITY = "/selfmotion/bodies", (0.05, 0.62, 0.58), 0.35
# What the part of a problem file is called.
_WORKPIECE = "workpiece"


def color_of(item: Obstacle, robot: RobotModel) -> tuple[float, float, float]:
    """Return the colour of a body by what it is: red, green and blue in 0..1."""
    if item.name == _WORKPIECE or (item.frame is not None and item.frame == robot.reference):
        return _PART
    return _AROUND if place_of(item, item.pose, robot)[0] == 0 else _CARRIED


def outlines(items: Sequence[Obstacle], largest: float) -> list[Array]:
    """Return the corners (8, 3) of boxes around what stands in the world and is no larger [m]."""
    found = []
    for item in items:
        solid = Solid(item.geometry(), item.label)
        if item.frame is None and np.linalg.norm(solid.high - solid.low) <= largest:
            ends = zip(solid.low, solid.high, strict=True)
            corners = np.array(list(itertools.product(*ends)))
            found.append(corners @ item.pose.rotation.T + item.pose.translation)
    return found


def obstacle_node(root: str, obstacle: Obstacle) -> str:
    """Return the path of the node of an obstacle of the plan at `root`."""
    return f"{root}/obstacles/{safe(obstacle.name)}"


def riders(root: str, robot: RobotModel, obstacles: Sequence[Obstacle]) -> list[Json]:
    """Return the nodes of obstacles that ride on links, each with the joint that moves it."""
    carriers = [(item, place_of(item, item.pose, robot)[0] - 1) for item in obstacles]
    return [
        {"root": obstacle_node(root, item), "carrier": carrier}
        for item, carrier in carriers
        if carrier >= 0
    ]


def obstacle_commands(
    root: str, robot: RobotModel, obstacles: Sequence[Obstacle], payload: Payload
) -> list[Json]:
    """Return the commands that draw the obstacles of the plan at `root`.

    Those that ride on a link are placed in the frame of the joint that carries them.

    Raises
    ------
    RobotError
        A mesh cannot be read.
    CollisionError
        An own shape has no geometry.
    """
    return [
        three.set_object(
            f"{obstacle_node(root, item)}/{k}",
            geometry,
            three.material(color_of(item, robot), opacity=0.85),
            matrix,
        )
        for item in obstacles
        for k, (geometry, matrix) in enumerate(_obstacle(item, robot, payload))
    ]


def _obstacle(item: Obstacle, robot: RobotModel, payload: Payload) -> list[tuple[Json, Array]]:
    matrix: Array = place_of(item, item.pose, robot)[1].homogeneous
    match item:
        case Box():
            return [(three.box(item.size), matrix)]
        case Sphere():
            return [(three.sphere(item.radius), matrix)]
        case Cylinder():
            return [(three.cylinder(item.radius, item.length), three.about_z(matrix))]
        case Capsule():
            return [(three.capsule(item.radius, item.length), three.about_z(matrix))]
        case Mesh():
            scaled = matrix @ np.diag([item.scale, item.scale, item.scale, 1.0])
            meshes = read_meshes(str(item.file), item.label)
            return [(triangles(payload, mesh.vertices, mesh.faces), scaled) for mesh in meshes]
    return [(triangles(payload, *Solid(item.geometry(), item.label).surface()), matrix)]


def body_commands(robot: RobotModel, payload: Payload) -> list[Json]:
    """Return the commands that draw what of the links may not meet anything below `BODIES`."""
    look = three.ghostly(_BODY_COLOR, _BODY_OPACITY)
    return [
        three.set_object(
            f"{BODIES}/{joint_name(robot, body.joint - 1)}/{safe(body.link)}_{number}",
            triangles(payload, *body.solid.surface()),
            look,
            body.place.homogeneous,
        )
        for number, body in enumerate(link_bodies(robot))
    ]
