"""Notes on a problem before planning: suspicious limits, bodies or placements."""

from collections.abc import Iterator, Sequence

import coal
import numpy as np

from selfmotion.basics import Array
from selfmotion.certificate import Requirement
from selfmotion.model.collision import Body, Mesh, Obstacle, Solid, overlap_warning
from selfmotion.model.follow import Follows
from selfmotion.model.path import TURN_NOTE, spread_along
from selfmotion.model.robot import RobotModel, mounting_of
from selfmotion.problem.constraints import Constraint, Envelope
from selfmotion.problem.problem.defaults import KEPT

# Samples of a path.
_SAMPLES = 101
# Depth in a workpiece up to which no note is made [m].
_DEEP = 2e-3
# Meshes with more triangles are slow.
_MANY_TRIANGLES = 200_000
# A link larger than this many times its arm is in other units …
_LARGE = 5.0
# … for arms smaller than this, in multiples of it [m].
_SMALL_ARM = 0.5
# No process is as slow as this [m/s].
_SLOWEST_FEED = 1e-4


def inside_remarks(
    robot: RobotModel, follows: Follows, obstacles: Sequence[Obstacle]
) -> Iterator[str]:
    """Yield the obstacles that the tool's point goes through; none where the arm holds a body."""
    first = follows.items[0]
    if mounting_of(robot.urdf, robot.tool).bodies:
        return
    t = spread_along(first.path, _SAMPLES)
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
    """Return the depths of points (K, 3) inside an obstacle (K,) [m], 0 outside."""
    solid = Solid(obstacle.geometry(), obstacle.label)
    points = (places - obstacle.pose.translation) @ obstacle.pose.rotation
    depths = np.zeros(len(points))
    within = np.all((points > solid.low) & (points < solid.high), axis=1)
    request, point = coal.DistanceRequest(), coal.Sphere(1e-6)
    for k in np.flatnonzero(within):
        place = coal.Transform3s(np.eye(3), points[k])
        identity = coal.Transform3s.Identity()
        result = coal.DistanceResult()
        distance = coal.distance(point, place, solid.geometry, identity, request, result)
        is_inside = solid.contains_any(points[k : k + 1]) if solid.is_mesh else distance < 0.0
        depths[k] = abs(distance) if is_inside else 0.0
    return depths


def remarks_on(
    robot: RobotModel,
    follows: Follows,
    constraints: Sequence[Constraint],
    requirements: Sequence[Requirement],
    envelope: Envelope,
) -> Iterator[str]:
    """Yield notes on a problem, for its user to look at.

    On elements of the URDF that are ignored, slow feeds, links that overlap or are in other units,
    limits that are unknown, and points of the path inside the workpiece.
    """
    yield from robot.urdf.notes
    yield from _path_remarks(follows)
    for model, _ in envelope.bodies:
        yield from _body_remarks(robot, model.every_body)
        if overlap := overlap_warning(robot, model):
            yield overlap
    for constraint in constraints:
        yield from constraint.remarks(robot)
    yield from _unknown_limits(robot, constraints)
    obstacles = [body for item in requirements for body in item.obstacles]
    yield from (body.note for body in obstacles if isinstance(body, Mesh) and body.note)
    yield from inside_remarks(robot, follows, obstacles)


def _path_remarks(follows: Follows) -> Iterator[str]:
    """Yield the paths' own notes, and feeds that look like another unit."""
    for followed in follows.items:
        task = followed.task
        is_turned = task.angular and not task.tool_axes
        yield from (note for note in followed.path.notes if is_turned or note != TURN_NOTE)
        slowest = min((item.asked for item in followed.path.feeds), default=np.inf)
        if slowest < _SLOWEST_FEED:
            yield (
                f"a feed of {1e3 * slowest:g} mm/s takes {followed.path.duration:.4g} s; are these "
                f"m/s? Then it is feed = {1e3 * slowest:g}, feed_mm = {1e6 * slowest:g}"
            )


def _unknown_limits(robot: RobotModel, constraints: Sequence[Constraint]) -> Iterator[str]:
    """Yield limits that are asked for, and that nothing says of this arm."""
    for constraint in constraints:
        # A default, or a limit that another constraint has, needs no note.
        is_default = any(constraint is default for default in KEPT)
        same_kind = (other for other in constraints if type(other) is type(constraint))
        if is_default or any(other.applies(robot) for other in same_kind):
            continue
        option = f"{constraint.option}, or " if constraint.option else ""
        kind, key = type(constraint).__name__, constraint.key
        yield (
            f"{constraint.requirement(robot).name}: none are known of {robot.name}, so none are "
            f'kept; give {option}in the file [[constraints]] kind = "{kind}", {key} = …, in '
            f"Python {kind}(…)"
        )


def _body_remarks(robot: RobotModel, bodies: Sequence[Body]) -> Iterator[str]:
    """Yield meshes that take long, and links so large that their files are in other units."""
    for body in bodies:
        solid = body.solid
        if solid.is_mesh and solid.geometry.num_tris > _MANY_TRIANGLES:
            yield (
                f"'{body.name}' has {solid.geometry.num_tris} triangles: reading them takes most "
                f"of the time, and some GB of memory beyond a million; export it with "
                f"{_MANY_TRIANGLES} or fewer"
            )
        size, reach = float((solid.high - solid.low).max()), robot.reach
        if not body.is_obstacle and reach < np.inf and size > _LARGE * max(reach, _SMALL_ARM):
            yield (
                f"link '{body.name}' has a body {size:.3g} m long, and the arm reaches {reach:.3g} "
                f'm; is its mesh in another unit? Then scale it (<mesh scale="0.001 0.001 0.001">)'
            )
