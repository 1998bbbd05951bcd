"""Collision bodies, and bounds of their motion by the joints."""

import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, CollisionError, nearest
from selfmotion.model.collision.obstacles import Obstacle
from selfmotion.model.collision.solids import Solid
from selfmotion.model.robot import RobotModel, Urdf


@dataclass(frozen=True, eq=False)
class Body:
    """Geometry and the frame that carries it.

    Attributes
    ----------
    name : str
        The link it belongs to, or the obstacle.
    link : str
        The link that it is of, or that carries it; "" for the world.
    joint : int
        Index of the joint that moves it; 0 for the world.
    place : pinocchio.SE3
        Its frame in that of the joint.
    solid : Solid
    """

    name: str
    link: str
    joint: int
    place: pin.SE3
    solid: Solid

    @property
    def is_obstacle(self) -> bool:
        """Whether it belongs to the world rather than to the robot."""
        return not self.link


def link_bodies(robot: RobotModel) -> list[Body]:
    """Return every collision element of the robot as a body, locked joints where they are held.

    Raises
    ------
    RobotError
        A mesh file is missing or cannot be read.
    CollisionError
        An element is no body, or Pinocchio has read none for it.
    """
    geometries = robot.geometry(pin.GeometryType.COLLISION).geometryObjects
    links = [robot.link_of(geometry_object.parentFrame) for geometry_object in geometries]
    _check_count(robot.urdf, links)
    bodies = []
    for link, geometry_object in zip(links, geometries, strict=True):
        file = f" ({geometry_object.meshPath})" if geometry_object.meshPath else ""
        solid = Solid(geometry_object.geometry, f"{robot.urdf.source}: link '{link}'{file}")
        carrier = robot.urdf.carrier(link)
        bodies.append(
            Body(link, carrier, geometry_object.parentJoint, geometry_object.placement, solid)
        )
    return bodies


def obstacle_bodies(obstacles: Sequence[Obstacle], robot: RobotModel) -> list[Body]:
    """Return the obstacles as bodies, those that ride on links before those of the world.

    A body on a link that no joint moves belongs to the world.

    Raises
    ------
    CollisionError
        A name is that of a link or taken twice, a frame is no link, or the geometry is no body.
    """
    links, riding, standing = robot.urdf.links, [], []
    taken = set(links)
    for item in obstacles:
        if item.name in taken:
            raise CollisionError(f"{item.label}: a link or another obstacle has this name too")
        taken.add(item.name)
        if item.frame is not None and item.frame not in links:
            raise CollisionError(
                f"{item.label}: its frame '{item.frame}' is no link of {robot.name}"
                f"{nearest(item.frame, links)}; links: {', '.join(links)}"
            )
        joint, place = place_of(item, item.pose, robot)
        solid = Solid(item.geometry(), item.label)
        if joint:
            riding.append(Body(item.name, robot.urdf.carrier(str(item.frame)), joint, place, solid))
        else:
            standing.append(Body(item.name, "", 0, place, solid))
    return [*riding, *standing]


def place_of(obstacle: Obstacle, pose: pin.SE3, robot: RobotModel) -> tuple[int, pin.SE3]:
    """Return the joint that moves an obstacle, and where in its frame a pose of it is."""
    if obstacle.frame is None:
        return 0, pose
    joint, link = robot.carrier_of(obstacle.frame)
    return joint, link * pose


def _check_count(urdf: Urdf, links: Sequence[str]) -> None:
    root, built = ElementTree.fromstring(urdf.text), Counter(links)
    for link in root.findall("link"):
        name, wanted = link.get("name", ""), len(link.findall("collision"))
        if built[name] != wanted:
            raise CollisionError(
                f"{urdf.source}: link '{name}' has {wanted} <collision> elements, but Pinocchio "
                f"made {built[name]} bodies of them; look for a part that is no valid URDF"
            )


Ints = npt.NDArray[np.int64]


def axis_distances(robot: RobotModel, bodies: Sequence[Body]) -> Array:
    """Return bounds on the distance of every point of a body from every joint's axis, (B, N) [m].

    Of all joints of the model, those that mimic others, too.

    They hold at all configurations within the joint limits. Of a body and an axis that one joint
    parts, it is the largest distance of the body's outline from the axis. Beyond, the distances
    from one joint's origin to the next along the tree add to it, and the travel of prismatic joints
    between them. Bodies on either side of the joint are measured: those beyond it are moved by it,
    the others are at rest.

    For a prismatic joint it is 1 [m/m]: there every point moves as far as the joint.
    """
    tree = _Tree(robot)
    distances = np.ones((len(bodies), robot.model.nv))
    for b, body in enumerate(bodies):
        points, radius = body.solid.outline
        points = points @ body.place.rotation.T + body.place.translation
        for joint in range(1, robot.model.nv + 1):
            if tree.is_revolute[joint]:
                distances[b, joint - 1] = tree.distance(points, body.joint, joint) + radius
    return distances


def moved_by(bodies: Sequence[Body], robot: RobotModel) -> npt.NDArray[np.bool_]:
    """Return the mask of bodies that each joint of the model carries, (B, N)."""
    tree = _Tree(robot)
    found = np.zeros((len(bodies), robot.model.nv), dtype=bool)
    for b, body in enumerate(bodies):
        found[b, [joint - 1 for joint in tree.supports(body.joint)]] = True
    return found


def pair_levers(distances: Array, moved: npt.NDArray[np.bool_], pairs: Ints) -> Array:
    """Return bounds on the change of each pair's distance per unit of each joint, (P, N).

    Joints that move both bodies or none do not count. For one that moves one of them, the rate is
    n · (ω × x), with n the direction between the closest points, and the same for both of these:
    the one nearer to the axis bounds it.
    """
    first, second = pairs.T
    nearer = np.minimum(distances[first], distances[second])
    return np.asarray(np.where(moved[first] != moved[second], nearer, 0.0))


def is_turned(robot: RobotModel) -> npt.NDArray[np.bool_]:
    """Return the mask of revolute joints of the model, (N,)."""
    return robot.tree.is_revolute


def travel_beyond(robot: RobotModel, farthest: Array) -> float:
    """Return the increase of lever arms where joints are up to `farthest` (n,) from 0 [m]."""
    far = _of_joints(robot, farthest)
    return float(np.maximum(far - _travel(robot), 0.0)[~is_turned(robot)].sum())


def _travel(robot: RobotModel) -> Array:
    """Return the largest |q| of prismatic joints within limits, 0 for the others, (N,)."""
    lower, upper = robot.finite_limits()
    far = _of_joints(robot, np.maximum(np.abs(lower), np.abs(upper)))
    return np.where(is_turned(robot), 0.0, far)


def _of_joints(robot: RobotModel, farthest: Array) -> Array:
    """Return the largest |q| of the model's joints (N,) for coordinates up to `farthest` (n,)."""
    coupling = robot.coupling
    return np.asarray(coupling.bounds(np.eye(len(coupling.scales))) @ farthest) + np.abs(
        coupling.offsets
    )


class _Tree:
    """The joints of an arm and their places; index 0 is the world, as in Pinocchio."""

    def __init__(self, robot: RobotModel) -> None:
        tree = robot.tree
        self._parents = [0, *tree.parents.tolist()]
        self._places = [np.zeros(3), *tree.positions]
        self._turns = [np.eye(3), *tree.rotations]
        self.is_revolute = [False, *tree.is_revolute.tolist()]
        self._axes = [np.zeros(3), *tree.axes]
        self._travel = [0.0, *_travel(robot).tolist()]

    def supports(self, joint: int) -> list[int]:
        """Return the joints from the world to a joint, the world left out."""
        found = []
        while joint:
            found.append(joint)
            joint = self._parents[joint]
        return found[::-1]

    def distance(self, points: Array, carrier: int, joint: int) -> float:
        """Return the largest distance of points (V, 3) of a body from a joint's axis [m]."""
        supports_of = self.supports(carrier)
        if joint in supports_of:
            down = supports_of[supports_of.index(joint) + 1 :]
            return self._beyond(points, down, np.zeros(3), self._axes[joint])
        origin, axis = self._places[joint], self._turns[joint] @ self._axes[joint]
        up = self.supports(self._parents[joint])
        shared = sum(1 for a, b in zip(supports_of, up, strict=False) if a == b)
        up, down = up[shared:], supports_of[shared:]
        if not up:
            return self._beyond(points, down, origin, axis)
        # From the axis to the origin of the frame it is in, and from there on.
        first = self._places[up[0]]
        offset = (
            _farthest(self._places[down[0]][None] - first) if down else _farthest(points - first)
        )
        rest = [*up[1:], *down[1:]]
        reach = offset + self._lengths(rest) + self._far([*up, *down])
        reach += _farthest(points) if down else 0.0
        return float(reach + _from_line(np.zeros((1, 3)), origin, axis))

    def _beyond(self, points: Array, down: list[int], origin: Array, axis: Array) -> float:
        """Return the same bound with the joints `down` alone between axis' frame and body."""
        if not down:
            return _from_line(points, origin, axis)
        reach = _farthest(points) + self._lengths(down[1:]) + self._far(down)
        return float(reach + _from_line(self._places[down[0]][None], origin, axis))

    def _lengths(self, joints: list[int]) -> float:
        return sum(float(np.linalg.norm(self._places[joint])) for joint in joints)

    def _far(self, joints: list[int]) -> float:
        return float(sum(self._travel[joint] for joint in joints))


def _farthest(points: Array) -> float:
    return float(np.linalg.norm(points, axis=1).max())


def _from_line(points: Array, origin: Array, axis: Array) -> float:
    """Return the largest distance of points (V, 3) from a line along a unit vector."""
    return _farthest(np.cross(points - origin, axis))
