"""The robot's visuals as commands for the viewer: the arm itself and its ghost."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from selfmotion.arrays import Array
from selfmotion.errors import RobotError
from selfmotion.replay import three
from selfmotion.replay.meshes import Color, DrawnMesh, read_meshes, simplify
from selfmotion.replay.payload import Json, Payload
from selfmotion.robot import RobotModel

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
    triangles : int
        How many triangles the mesh files have that are used.
    drawn : int
        How many of them are in the page: fewer when a budget was exceeded.
    """

    visuals: tuple[Visual, ...]
    meshes: list[Json]
    triangles: int
    drawn: int


def bake(robot: RobotModel, payload: Payload, triangle_budget: int) -> Arm:
    """Read every visual of `robot` into `payload`, each mesh file once.

    Parameters
    ----------
    robot : RobotModel
        The arm.
    payload : Payload
        Takes the meshes.
    triangle_budget : int
        Meshes are simplified only when all files together have more triangles than this.

    Raises
    ------
    RobotError
        A mesh cannot be read, or a shape cannot be drawn; names the visual and the file.
    """
    objects = list(robot.geometry(pin.GeometryType.VISUAL).geometryObjects)
    files: dict[str, list[DrawnMesh]] = {}
    for item in objects:
        if _is_mesh(item) and item.meshPath not in files:
            files[item.meshPath] = read_meshes(
                item.meshPath, f"visual '{item.name}'", item.geometry, _scale(item)
            )
    triangles = sum(len(mesh.faces) for group in files.values() for mesh in group)
    if triangles > triangle_budget:
        share = triangle_budget / triangles
        files = {path: [_within(mesh, share) for mesh in group] for path, group in files.items()}
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
            robot.model.frames[item.parentFrame].name,
            files.get(item.meshPath, []),
            numbers.get(item.meshPath, []),
        )
    ]
    drawn = sum(len(mesh.faces) for group in files.values() for mesh in group)
    return Arm(tuple(visuals), meshes, triangles, drawn)


def _within(mesh: DrawnMesh, share: float) -> DrawnMesh:
    """Simplify until at most `share` of the triangles are left."""
    cells, most = 256, share * len(mesh.faces)
    while len(mesh.faces) > most and cells > 2:
        mesh, cells = simplify(mesh, cells), cells * 3 // 4
    return mesh


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
    """Return the name of the node that moves with joint `joint`; -1 is the fixed base."""
    return safe(robot.joint_names[joint]) if joint >= 0 else "base"


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
