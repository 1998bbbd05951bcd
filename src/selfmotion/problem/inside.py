"""A path that goes through obstacles, which nothing notices where the tool has no body."""

from collections.abc import Iterator, Sequence

import coal
import numpy as np

from selfmotion.basics import Array
from selfmotion.collision import Obstacle, Solid
from selfmotion.follow import Follows
from selfmotion.robot import RobotModel, mounting_of

# Where a path is looked at, and how deep it may be in what it works on [m].
_LOOKS, _DEEP = 101, 2e-3


def inside_remarks(
    robot: RobotModel, follows: Follows, obstacles: Sequence[Obstacle]
) -> Iterator[str]:
    """Yield the obstacles that the tool's point goes through; none where the arm holds a body."""
    first = follows.items[0]
    if mounting_of(robot.urdf, robot.tool).bodies:
        return
    t = np.linspace(0.0, first.path.duration, _LOOKS)
    places = first.path.samples(t).translation
    for item in dict.fromkeys(obstacles):
        # Of others it depends on how the arm stands.
        if item.frame != robot.reference:
            continue
        depths = _depths(item, places)
        k = int(depths.argmax())
        if depths[k] > _DEEP:
            yield (
                f"the path is {1e3 * depths[k]:.3g} mm inside {item.label} at t = {t[k]:.3g} s, "
                f"and nothing is checked there: the arm holds no body (robot.bodies)"
            )


def _depths(obstacle: Obstacle, places: Array) -> Array:
    """Return how deep points (K, 3) are inside an obstacle (K,) [m], 0 outside."""
    solid = Solid(obstacle.geometry(), obstacle.label)
    points = (places - obstacle.pose.translation) @ obstacle.pose.rotation
    found = np.zeros(len(points))
    within = np.all((points > solid.low) & (points < solid.high), axis=1)
    request, point = coal.DistanceRequest(), coal.Sphere(1e-6)
    for k in np.flatnonzero(within):
        place = coal.Transform3s(np.eye(3), points[k])
        still = coal.Transform3s.Identity()
        away = coal.distance(point, place, solid.geometry, still, request, coal.DistanceResult())
        inside = solid.contains_any(points[k : k + 1]) if solid.is_mesh else away < 0.0
        found[k] = abs(away) if inside else 0.0
    return found
