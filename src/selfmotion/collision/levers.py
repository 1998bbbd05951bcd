"""How far points of a body can move per unit of each joint's travel, whatever the configuration."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array
from selfmotion.collision.bodies import Body
from selfmotion.robot import RobotModel

Ints = npt.NDArray[np.int64]


def axis_distances(robot: RobotModel, bodies: Sequence[Body]) -> Array:
    """Return bounds on the distance of every point of a body from every joint's axis, (B, n) [m].

    They hold at all configurations within the joint limits. Of a body and an axis that one joint
    parts, it is the largest distance of the body's outline from the axis. Beyond, the distances
    from one joint's origin to the next add to it, and the travel of prismatic joints between
    them. Bodies on either side of the joint are measured; those beyond it are moved by it, the
    others stand still.

    For a prismatic joint it is 1 [m/m]: there every point moves as far as the joint.
    """
    chain = _Chain(robot)
    distances = np.ones((len(bodies), robot.dof))
    for b, body in enumerate(bodies):
        points, radius = body.solid.outline
        points = points @ body.place.rotation.T + body.place.translation
        for joint in range(1, robot.dof + 1):
            if chain.is_revolute[joint]:
                beyond = chain.outwards if joint <= body.joint else chain.inwards
                distances[b, joint - 1] = beyond(points, body.joint, joint) + radius
    return distances


def moved_by(bodies: Sequence[Body], dof: int) -> npt.NDArray[np.bool_]:
    """Return which bodies each joint moves, (B, n): all that it or a later one carries."""
    carriers = np.array([body.joint for body in bodies], dtype=np.int64).reshape(-1, 1)
    return np.asarray(carriers > np.arange(dof))


def pair_levers(distances: Array, moved: npt.NDArray[np.bool_], pairs: Ints) -> Array:
    """Return bounds on the change of each pair's distance per unit of each joint, (P, n).

    Joints that move both bodies or none do not count. For one that moves one of them, the rate is
    n · (ω × x), with n the direction between the closest points, and the same for both of these:
    the one nearer to the axis bounds it.
    """
    first, second = pairs.T
    nearer = np.minimum(distances[first], distances[second])
    return np.asarray(np.where(moved[first] != moved[second], nearer, 0.0))


def is_turned(robot: RobotModel) -> npt.NDArray[np.bool_]:
    """Return which joints are revolute, (n,)."""
    return robot.is_revolute


def travel_beyond(robot: RobotModel, farthest: Array) -> float:
    """Return how much longer levers get where joints go as far as `farthest` (n,) from 0 [m]."""
    return float(np.maximum(farthest - _travel(robot), 0.0)[~is_turned(robot)].sum())


def _travel(robot: RobotModel) -> Array:
    """Return how far prismatic joints go from 0 within their limits, 0 for the others, (n,)."""
    lower, upper = robot.finite_limits()
    return np.where(is_turned(robot), 0.0, np.maximum(np.abs(lower), np.abs(upper)))


class _Chain:
    """The joints of an arm, one after the other; index 0 is the world, as in Pinocchio."""

    def __init__(self, robot: RobotModel) -> None:
        model = robot.model
        self._places = [pin.SE3(place) for place in model.jointPlacements]
        axes, is_revolute = robot.tree.axes, robot.tree.is_revolute
        self.is_revolute = [False, *is_revolute.tolist()]
        self._axes = [np.zeros(3), *axes]
        self._travel = [0.0, *_travel(robot).tolist()]

    def outwards(self, points: Array, carrier: int, joint: int) -> float:
        """Return how far points (V, 3) of a body that the joint moves are from its axis at most."""
        if carrier == joint:
            return _from_line(points, np.zeros(3), self._axes[joint])
        reach = _farthest(points) + sum(self._travel[joint + 1 : carrier + 1])
        reach += sum(
            float(np.linalg.norm(self._places[k].translation))
            for k in range(joint + 2, carrier + 1)
        )
        following = self._places[joint + 1].translation
        return float(reach + _from_line(following[None], np.zeros(3), self._axes[joint]))

    def inwards(self, points: Array, carrier: int, joint: int) -> float:
        """Return how far points (V, 3) of a body before the joint are from its axis at most."""
        place = self._places[joint]
        axis = place.rotation @ self._axes[joint]
        if carrier == joint - 1:
            return _from_line(points, place.translation, axis)
        reach = _farthest(points - self._places[carrier + 1].translation)
        reach += sum(
            float(np.linalg.norm(self._places[k].translation)) for k in range(carrier + 2, joint)
        )
        reach += sum(self._travel[carrier + 1 : joint])
        return float(reach + _from_line(np.zeros((1, 3)), place.translation, axis))


def _farthest(points: Array) -> float:
    return float(np.linalg.norm(points, axis=1).max())


def _from_line(points: Array, origin: Array, axis: Array) -> float:
    """Return the largest distance of points (V, 3) from a line along a unit vector."""
    return _farthest(np.cross(points - origin, axis))
