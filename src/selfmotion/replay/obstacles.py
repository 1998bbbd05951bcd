"""Obstacles as commands for the viewer: in the world, or on the links that carry them."""

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
    place_of,
)
from selfmotion.replay import three
from selfmotion.replay.links import safe
from selfmotion.replay.meshes import read_meshes
from selfmotion.replay.payload import Json, Payload
from selfmotion.replay.scene import triangles
from selfmotion.robot import RobotModel

_OBSTACLE = (0.80, 0.62, 0.42)


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
    look = three.material(_OBSTACLE, opacity=0.85)
    return [
        three.set_object(f"{obstacle_node(root, item)}/{k}", geometry, look, matrix)
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
