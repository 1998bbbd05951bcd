"""What can collide: the links' collision geometry and the obstacles, complete or refused."""

import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import pinocchio as pin

from selfmotion.basics import CollisionError, nearest
from selfmotion.collision.obstacles import Obstacle
from selfmotion.collision.solids import Solid
from selfmotion.robot import RobotModel, Urdf


@dataclass(frozen=True, eq=False)
class Body:
    """A piece of geometry and what carries it.

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
        An element is no body, or is missing among what Pinocchio made of them.
    """
    pieces = robot.geometry(pin.GeometryType.COLLISION).geometryObjects
    links = [robot.link_of(piece.parentFrame) for piece in pieces]
    _check_count(robot.urdf, links)
    bodies = []
    for link, piece in zip(links, pieces, strict=True):
        file = f" ({piece.meshPath})" if piece.meshPath else ""
        solid = Solid(piece.geometry, f"{robot.urdf.source}: link '{link}'{file}")
        carrier = robot.urdf.carrier(link)
        bodies.append(Body(link, carrier, piece.parentJoint, piece.placement, solid))
    return bodies


def obstacle_bodies(obstacles: Sequence[Obstacle], robot: RobotModel) -> list[Body]:
    """Return the obstacles as bodies, those that ride on links before those of the world.

    What a link carries that no joint moves stands in the world.

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
    root, made = ElementTree.fromstring(urdf.text), Counter(links)
    for link in root.findall("link"):
        name, wanted = link.get("name", ""), len(link.findall("collision"))
        if made[name] != wanted:
            raise CollisionError(
                f"{urdf.source}: link '{name}' has {wanted} <collision> elements, but Pinocchio "
                f"made {made[name]} bodies of them; look for a part that is no valid URDF"
            )
