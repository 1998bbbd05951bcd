"""What stands around the arm: ground, light, camera, traces of the tool, obstacles."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from selfmotion.basics import Array
from selfmotion.model.collision import (
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
from selfmotion.model.robot import RobotModel
from selfmotion.shell.replay import three
from selfmotion.shell.replay.links import Arm, joint_name, safe
from selfmotion.shell.replay.meshes import Json, Payload, read_meshes
from selfmotion.shell.replay.motion import Curves, KeyFrames
from selfmotion.shell.replay.three import Indices, Surface

_ROOT = "/selfmotion"
_PRESCRIBED = (0.55, 0.57, 0.60)
# three.js: draw only faces seen from behind.
_INSIDE = 1


@dataclass(frozen=True, eq=False)
class Extent:
    """An axis-aligned box in world axes [m].

    Attributes
    ----------
    low, high : (3,)
        Opposite corners.
    """

    low: Array
    high: Array

    @property
    def center(self) -> Array:
        """Middle of the box."""
        return np.asarray(0.5 * (self.low + self.high))

    @property
    def radius(self) -> float:
        """Half the diagonal."""
        return float(0.5 * np.linalg.norm(self.high - self.low))


def outline(arm: Arm, motions: list[KeyFrames], points: list[Array]) -> Array:
    """Return the corners of the hull of arm and `points` during all `motions`, (K, 3) [m]."""
    corners = list(points)
    for visual in arm.visuals:
        if visual.joint < 0:
            corners.append(visual.corners)
            continue
        for frames in motions:
            for k in np.linspace(0, len(frames.t) - 1, 25).astype(int):
                pose = frames.transforms(k)[visual.joint]
                corners.append(visual.corners @ pose[:3, :3].T + pose[:3, 3])
    stacked = np.concatenate(corners)
    # Joggled, because a planar motion's hull may be flat.
    return np.asarray(stacked[ConvexHull(stacked, qhull_options="QJ").vertices])


def camera(hull: Array, tool: Array) -> Json:
    """Return where to look from: a flat scene from above, others from beside the tool path.

    The page works out the distance, which depends on the shape of the window.
    """
    size = np.ptp(hull, axis=0)
    if size[2] < 0.15 * max(size[0], size[1]):
        direction = np.array([0.0, -0.45, 1.0])
    else:
        ahead = tool.mean(axis=0)
        azimuth = np.arctan2(ahead[1], ahead[0]) - np.radians(55.0)
        direction = np.array([np.cos(azimuth), np.sin(azimuth), 0.36])
    return {
        "points": np.round(hull, 4).tolist(),
        "direction": (direction / np.linalg.norm(direction)).tolist(),
    }


def stage_commands(box: Extent) -> list[Json]:
    """Return the commands for light, shadow and a ground grid."""
    center, reach = box.center, max(box.radius, 0.1)
    far = float(np.linalg.norm(center)) + 4.0 * reach
    half = float(np.linalg.norm(center)) + 1.2 * reach
    ground = np.eye(4)
    ground[:3, 3] = [center[0], center[1], box.low[2] - 0.002 * reach]
    return [
        three.set_light(
            f"{_ROOT}/stage/sky",
            np.array([0.0, 0.0, 1.0]),
            type="HemisphereLight",
            color=0xFFFFFF,
            groundColor=0xA7ADB8,
            intensity=0.78,
        ),
        three.set_light(
            f"{_ROOT}/stage/sun",
            center + reach * np.array([0.9, -1.3, 2.6]),
            type="DirectionalLight",
            color=0xFFFFFF,
            intensity=0.55,
            shadow={
                "bias": -0.0005,
                "normalBias": 0.01 * reach,
                "radius": 4,
                "mapSize": [2048, 2048],
                "camera": {
                    "uuid": "sun-shadow",
                    "type": "OrthographicCamera",
                    "left": -half,
                    "right": half,
                    "top": half,
                    "bottom": -half,
                    "near": 0.01 * reach,
                    "far": far + 2.0 * half,
                    "zoom": 1,
                },
            },
        ),
        three.set_object(
            f"{_ROOT}/stage/ground",
            {"type": "PlaneGeometry", "width": 12 * reach, "height": 12 * reach},
            # It hides nothing: tables and floors may be below it.
            {
                "type": "ShadowMaterial",
                "color": 0,
                "opacity": 0.16,
                "transparent": True,
                "depthWrite": False,
            },
            ground,
        ),
        _grid(center, reach, float(box.low[2])),
    ]


def _grid(center: Array, reach: float, height: float) -> Json:
    """Return lines on the ground at a round spacing: 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(reach / 2))
    spacing = max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= reach / 2)
    count = int(np.ceil(2.2 * reach / spacing))
    middle = np.round(center[:2] / spacing) * spacing
    ends = spacing * np.arange(-count, count + 1)
    z = height - 0.001 * reach
    lines = [
        point
        for end in ends
        for point in (
            (middle[0] + end, middle[1] + ends[0], z),
            (middle[0] + end, middle[1] + ends[-1], z),
            (middle[0] + ends[0], middle[1] + end, z),
            (middle[0] + ends[-1], middle[1] + end, z),
        )
    ]
    path = f"{_ROOT}/stage/grid"
    command = three.set_object(
        path,
        {"lines": np.round(np.array(lines), 6).ravel().tolist()},
        {"type": "LineBasicMaterial", "color": 0x8A919C, "opacity": 0.38, "transparent": True},
    )
    command["object"]["object"]["type"] = "LineSegments"
    return command


def trace_commands(
    root: str,
    payload: Payload,
    shown: Curves,
    start: Curves,
    target: Array,
    scale: Json,
    radius: float,
) -> list[Json]:
    """Return the commands for one plan's traces, below `root`.

    The prescribed path is the far wall of a wide tube; the plan's trace a solid tube inside,
    coloured by manipulability; the trace of the x = 0 motion a row of beads. All three usually
    coincide, because the tool motion is prescribed, and so they stay apart to the eye. A tool that
    only turns leaves no trace.

    Parameters
    ----------
    root : str
        Node of the plan.
    payload : Payload
        Takes the meshes.
    shown, start : Curves
        The plan and its x = 0 motion.
    target : (M, 3)
        The prescribed path [m].
    scale : dict
        ``low`` and ``high`` of the colour scale.
    radius : float
        Of the plan's trace [m].
    """
    commands = []
    kept = three.distinct(target, 0.5 * radius)
    if len(kept) > 1:
        drawn = triangles(payload, *three.tube(target[kept], 2.2 * radius))
        look = {**three.ghostly(_PRESCRIBED, 0.4), "side": _INSIDE}
        commands.append(three.set_object(f"{root}/prescribed", drawn, look))
    kept = three.distinct(shown.tool, 0.5 * radius)
    if len(kept) > 1:
        drawn = _coloured(payload, scale, shown, kept, three.tube(shown.tool[kept], radius))
        commands.append(three.set_object(f"{root}/trace", drawn, _painted()))
    kept = three.distinct(start.tool, 9.0 * radius)
    drawn = _coloured(payload, scale, start, kept, three.beads(start.tool[kept], 2.6 * radius))
    commands.append(three.set_object(f"{root}/start", drawn, _painted()))
    return commands


def _coloured(
    payload: Payload, scale: Json, curve: Curves, kept: Indices, surface: Surface
) -> Json:
    """Return a surface along a curve, coloured by manipulability."""
    colors = three.colors_of(curve.manipulability[kept], scale["low"], scale["high"])
    copies = len(surface[0]) // len(kept)
    return triangles(payload, *surface, np.repeat(colors, copies, axis=0))


def triad_command(root: str, payload: Payload, shown: Curves, times: Array, length: float) -> Json:
    """Return the command for the tool's axes at the samples nearest to `times` [s]."""
    samples = np.unique(np.abs(shown.t[:, None] - times).argmin(axis=0))
    vertices, faces, colors = three.triads(shown.tool[samples], shown.rotation[samples], length)
    drawn = triangles(payload, vertices, faces, colors)
    return three.set_object(f"{root}/triads", drawn, _painted())


def _painted() -> Json:
    return three.material((1.0, 1.0, 1.0), vertexColors=True, roughness=0.8)


def triangles(
    payload: Payload, vertices: Array, faces: Indices, colors: Array | None = None
) -> Json:
    """Return a surface of triangles as geometry, its vertices coloured where colours are given."""
    drawn: Json = {"vertices": payload.array(vertices), "triangles": payload.array(faces, "u4")}
    if colors is not None:
        drawn["colors"] = payload.array(np.round(255 * colors), "u1")
    return drawn


def ellipsoid_command() -> Json:
    """Return the command for the unit ball that the page stretches to the tool's ellipsoid."""
    return three.set_object(
        f"{_ROOT}/ellipsoid", three.sphere(1.0), three.ghostly((0.95, 0.55, 0.15), 0.38)
    )


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
