"""A picture of a plan as SVG: for print, and for where no script runs."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from selfmotion.basics import Array
from selfmotion.collision import Obstacle, Solid
from selfmotion.motion import Trajectory
from selfmotion.replay.payload import Json
from selfmotion.robot import RobotModel

# The arm at these shares of the motion's time, from pale to dark.
_SHARES = (0.0, 0.5, 1.0)
_INKS = ("#b9c4d6", "#7f93b5", "#2f4a7d")
# Width of the picture, and what is left free around it, in its own units.
_WIDTH, _MARGIN = 900.0, 40.0


def still(
    robot: RobotModel, motion: Trajectory, obstacles: Sequence[Obstacle], camera: Json
) -> str:
    """Return the arm at the begin, in the middle and at the end, its tool's path and obstacles.

    Parameters
    ----------
    robot : RobotModel
    motion : Trajectory
    obstacles : sequence of Obstacle
        Those that stand in the world are drawn, as outlines.
    camera : dict
        From where the scene is seen; see `scene.camera`.
    """
    right, up = _axes(np.array(camera["direction"]))
    view = np.stack([right, -up], axis=1)
    first, last = motion.t[[0, -1]]
    arms = [_skeleton(robot, motion(first + share * (last - first))) @ view for share in _SHARES]
    chain = robot.chain_to(robot.tool)
    path = np.array([chain.place(q).translation for q in motion(np.linspace(first, last, 101))])
    path = path @ view
    blocks = [
        corners @ view for item in obstacles if item.frame is None for corners in _outlines(item)
    ]
    seen = np.concatenate([path, *(arm.reshape(-1, 2) for arm in arms)])
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = (_WIDTH - 2.0 * _MARGIN) / max(float((high - low).max()), 1e-9)
    height = float((high - low)[1]) * scale + 2.0 * _MARGIN

    def drawn(points: Array) -> str:
        placed = (points - low) * scale + _MARGIN
        # In the middle, if the scene is higher than wide.
        placed[:, 0] += 0.5 * (_WIDTH - 2.0 * _MARGIN - float((high - low)[0]) * scale)
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)

    parts = [
        f'<polygon points="{drawn(_hull(block))}" fill="#d9a05b" fill-opacity="0.35" '
        f'stroke="#a36a22"/>'
        for block in blocks
    ]
    for arm, ink in zip(arms, _INKS, strict=True):
        parts += [
            f'<polyline points="{drawn(bone)}" stroke="{ink}" stroke-width="9"/>' for bone in arm
        ]
    parts.append(f'<polyline points="{drawn(path)}" stroke="#d0482f" stroke-width="3"/>')
    return (
        f'<svg id="still" viewBox="0 0 {_WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="The arm at the begin, in the middle and at the end of its motion" '
        f'fill="none" stroke-linecap="round" stroke-linejoin="round">{"".join(parts)}</svg>'
    )


def _axes(direction: Array) -> tuple[Array, Array]:
    """Return what is right and up in the picture, seen from a direction."""
    right = np.cross([0.0, 0.0, 1.0], direction)
    right = right / np.linalg.norm(right)
    return right, np.cross(direction, right)


def _skeleton(robot: RobotModel, q: Array) -> Array:
    """Return the lines from each joint to those that it carries, and to the tool, (B, 2, 3)."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q)
    places = [np.array(place.translation) for place in data.oMi]
    bones = [[places[model.parents[joint]], places[joint]] for joint in range(1, model.njoints)]
    carrier, _ = robot.carrier_of(robot.tool)
    bones.append([places[carrier], np.array(robot.chain_to(robot.tool).place(q).translation)])
    return np.array(bones)


def _outlines(item: Obstacle) -> list[Array]:
    """Return the corners (V, 3) of the convex pieces of an obstacle."""
    pieces = Solid(item.geometry(), item.label).pieces
    turn, at = item.pose.rotation, item.pose.translation
    return [piece.surface()[0] @ turn.T + at for piece in pieces]


def _hull(points: Array) -> Array:
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points[:1]
