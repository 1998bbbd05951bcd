"""The robot's visuals as commands for the viewer: the arm itself and its ghost."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np

from selfmotion.basics import Array, RobotError
from selfmotion.model.robot import RobotModel
from selfmotion.shell.replay import three
from selfmotion.shell.replay.meshes import Color, DrawnMesh, Json, Payload, read_meshes

ROBOT, GHOST = "/selfmotion/robot", "/selfmotion/ghost"
# Blue-violet: no robot in example-robot-data has it, and it shows on light and dark ground.
_GHOST_COLOR = (0.42, 0.36, 0.95)
_GHOST_OPACITY = 0.28


@dataclass(frozen=True, eq=False)
class Visual:
    """One coloured piece of a link.

    Attributes
    ----------
    joint : int
        Index of the moving joint that carries it, -1 for the fixed base.
    link : str
        The link it belongs to.
    name : str
        Unique within the robot.
    geometry : dict
        three.js geometry, or ``{"mesh": k}`` for mesh k of the page.
    matrix : (4, 4)
        Where it sits in the joint's frame, scale included.
    color : tuple of float
        Red, green, blue, opacity.
    corners : (8, 3)
        Bounding box in the joint's frame [m].
    """

    joint: int
    link: str
    name: str
    geometry: Json
    matrix: Array
    color: Color
    corners: Array


@dataclass(frozen=True, eq=False)
class Arm:
    """All visuals of a robot.

    Attributes
    ----------
    visuals : tuple of Visual
        Pieces of all links.
    meshes : list of dict
        The meshes they share, packed.
    missing : tuple of str
        What cannot be drawn, and why.
    """

    visuals: tuple[Visual, ...]
    meshes: list[Json]
    missing: tuple[str, ...]


def bake(robot: RobotModel, payload: Payload) -> Arm:
    """Read every visual of `robot` into `payload`, each mesh file once, and tell which are bad.

    Parameters
    ----------
    robot : RobotModel
        The arm.
    payload : Payload
        Takes the meshes.

    Raises
    ------
    RobotError
        A shape cannot be drawn; names the visual.
    """
    geometry, missing = robot.visuals()
    objects = list(geometry.geometryObjects)
    files: dict[str, list[DrawnMesh]] = {}
    for item in objects:
        if _is_mesh(item) and item.meshPath not in files:
            files[item.meshPath] = read_meshes(
                item.meshPath, f"visual '{item.name}'", item.geometry, _scale(item)
            )
    meshes: list[Json] = []
    numbers: dict[str, list[int]] = {}
    for path, group in files.items():
        numbers[path] = list(range(len(meshes), len(meshes) + len(group)))
        meshes.extend(payload.mesh(mesh) for mesh in group)
    visuals = [
        visual
        for item in objects
        for visual in _visuals(
            item,
            robot.link_of(item.parentFrame),
            files.get(item.meshPath, []),
            numbers.get(item.meshPath, []),
        )
    ]
    return Arm(tuple(visuals), meshes, missing)


def _is_mesh(item: Any) -> bool:
    return isinstance(item.geometry, coal.BVHModelBase | coal.ConvexBase)


def _scale(item: Any) -> Array:
    return np.asarray(item.meshScale, dtype=np.float64).reshape(3)


def _visuals(item: Any, link: str, meshes: list[DrawnMesh], numbers: list[int]) -> Iterator[Visual]:
    joint = int(item.parentJoint) - 1
    placement: Array = item.placement.homogeneous
    red, green, blue, opacity = (float(value) for value in item.meshColor)
    own: Color = (red, green, blue, opacity)
    if not _is_mesh(item):
        geometry, turned, half = _primitive(item, placement)
        box = _box(-half, half, placement)
        yield Visual(joint, link, item.name, geometry, turned, own, box)
        return
    matrix = placement @ np.diag([*_scale(item), 1.0])
    for part, (mesh, number) in enumerate(zip(meshes, numbers, strict=True)):
        vertices = mesh.vertices
        corners = _box(vertices.min(axis=0), vertices.max(axis=0), matrix)
        color = own if item.overrideMaterial or mesh.color is None else mesh.color
        name = f"{item.name}_{part}" if len(meshes) > 1 else item.name
        yield Visual(joint, link, name, {"mesh": number}, matrix, color, corners)


def _primitive(item: Any, placement: Array) -> tuple[Json, Array, Array]:
    """Return geometry, placement as three.js wants it, and half the size along the axes."""
    shape = item.geometry
    if isinstance(shape, coal.Box):
        half = np.asarray(shape.halfSide, dtype=float)
        return three.box(2 * half), placement, half
    if isinstance(shape, coal.Sphere):
        return three.sphere(shape.radius), placement, np.full(3, shape.radius)
    if isinstance(shape, coal.Cylinder):
        half = np.array([shape.radius, shape.radius, shape.halfLength])
        drawn = three.cylinder(shape.radius, 2 * shape.halfLength)
        return drawn, three.about_z(placement), half
    if isinstance(shape, coal.Capsule):
        half = np.array([shape.radius, shape.radius, shape.halfLength + shape.radius])
        drawn = three.capsule(shape.radius, 2 * shape.halfLength)
        return drawn, three.about_z(placement), half
    raise RobotError(
        f"visual '{item.name}' is a {type(shape).__name__}; a replay draws boxes, spheres, "
        f"cylinders, capsules and meshes"
    )


def _box(low: Array, high: Array, matrix: Array) -> Array:
    ends = np.array([low, high])
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i, j, k in np.ndindex(2, 2, 2)])
    return np.asarray(corners @ matrix[:3, :3].T + matrix[:3, 3])


def joint_name(robot: RobotModel, joint: int) -> str:
    """Return the name of the node that moves with joint `joint` of the model; -1 is the base."""
    return safe(robot.model.names[joint + 1]) if joint >= 0 else "base"


def link_node(robot: RobotModel, visual: Visual) -> str:
    """Return the path of the node that holds the visuals of a link."""
    return f"{ROBOT}/{joint_name(robot, visual.joint)}/{safe(visual.link)}"


def safe(name: str) -> str:
    """Return `name` as one part of a node's path."""
    return name.replace("/", "_")


def arm_commands(robot: RobotModel, arm: Arm) -> list[Json]:
    """Return the commands that draw the arm below `ROBOT`."""
    return [
        three.set_object(
            f"{link_node(robot, visual)}/{safe(visual.name)}",
            visual.geometry,
            three.material(visual.color, opacity=visual.color[3]),
            visual.matrix,
        )
        for visual in arm.visuals
    ]


def ghost_commands(robot: RobotModel, arm: Arm) -> list[Json]:
    """Return the commands that draw the moving links once more below `GHOST`."""
    look = three.ghostly(_GHOST_COLOR, _GHOST_OPACITY)
    return [
        three.set_object(
            f"{GHOST}/{joint_name(robot, visual.joint)}/{safe(visual.name)}",
            visual.geometry,
            look,
            visual.matrix,
        )
        for visual in arm.visuals
        if visual.joint >= 0
    ]
