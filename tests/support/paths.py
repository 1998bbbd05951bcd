"""Paths that several laws are checked on."""

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

import selfmotion as sm
from selfmotion.basics import Array


def polygon(seed: int, scale: float = 0.1) -> tuple[Array, Array]:
    """Return 3 to 6 positions and quaternions near a Panda's home pose."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 7))
    points = scale * np.cumsum(rng.normal(size=(count, 3)), axis=0)
    turns = Rotation.from_rotvec(0.4 * rng.normal(size=(count, 3))).as_quat(scalar_first=True)
    return points, turns


def pose(seed: int) -> pin.SE3:
    return pin.exp6(np.random.default_rng(seed).normal(size=6))


def random_waypoints(corners: str = "blend") -> sm.paths.Waypoints:
    rng = np.random.default_rng(5)
    poses = [pose(1) * pin.exp6(0.4 * rng.normal(size=6)) for _ in range(9)]
    return sm.paths.Waypoints.from_poses(np.linspace(0, 2, 9), poses, corners=corners)


def there_and_back() -> sm.paths.Path:
    """A line, a pause at its end, and the way back."""
    way, back = sm.paths.Line(pose(1), pose(2), 2.0), sm.paths.Line(pose(2), pose(1), 3.0)
    return way + sm.paths.Dwell(pose(2), 0.7) + back


def line_of(robot: sm.RobotModel, task: str, length: float = 0.2) -> sm.paths.Line:
    pose = robot.pose(robot.dexterous_configuration(task))
    end = pose.copy()
    end.translation = pose.translation - [0.0, 0.0, length]
    return sm.paths.Line(pose, end, 2.0)
