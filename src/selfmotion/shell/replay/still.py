"""A plan as a picture for print: SVG, and plots by matplotlib."""

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from selfmotion.basics import Array, RenderError
from selfmotion.model.collision import Obstacle, Solid
from selfmotion.model.motion import Trajectory
from selfmotion.model.robot import RobotModel
from selfmotion.planning.result import Plan
from selfmotion.shell.replay import scene
from selfmotion.shell.replay.meshes import Json
from selfmotion.shell.replay.motion import Curves, curves
from selfmotion.shell.replay.scene import color_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The arm at these shares of the motion's time, from pale to dark.
_SHARES = (0.0, 0.5, 1.0)
_INKS = ("#b9c4d6", "#7f93b5", "#2f4a7d")
# Of the tool's path, and of the moves between seams that have colours of their own.
_PATH, _MOVE = "#d0482f", "#8a94a3"
# Width of the picture, and what is left free around it, in its own units.
_WIDTH, _MARGIN = 900.0, 40.0


def still(
    robot: RobotModel,
    motion: Trajectory,
    obstacles: Sequence[Obstacle],
    camera: Json,
    seams: Sequence[tuple[float, float, str]] = (),
) -> str:
    """Return the arm at the begin, in the middle and at the end, its tool's path and obstacles.

    Parameters
    ----------
    robot : RobotModel
    motion : Trajectory
    obstacles : sequence of Obstacle
        Drawn as outlines; those that ride on a link where that is in the end.
    camera : dict
        What is seen, and from where; see `scene.camera`.
    seams : sequence of (float, float, str)
        Parts of the path with a colour of their own: from when to when [s], and which.
    """
    right, up = _axes(np.array(camera["direction"]))
    view = np.stack([right, -up], axis=1)
    first, last = motion.t[[0, -1]]
    arms = [_skeleton(robot, motion(first + share * (last - first))) @ view for share in _SHARES]
    chain = robot.chain_to(robot.tool)

    def traced(begin: float, end: float) -> Array:
        times = first + np.linspace(begin, end, 101)
        return np.array([chain.place(q).translation for q in motion(times)]) @ view

    seen = np.array(camera["points"]) @ view
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = (_WIDTH - 2.0 * _MARGIN) / max(float((high - low).max()), 1e-9)
    height = float((high - low)[1]) * scale + 2.0 * _MARGIN

    def drawn(points: Array) -> str:
        placed = (points - low) * scale + _MARGIN
        # In the middle, if the scene is higher than wide.
        placed[:, 0] += 0.5 * (_WIDTH - 2.0 * _MARGIN - float((high - low)[0]) * scale)
        return " ".join(f"{x:.1f},{y:.1f}" for x, y in placed)

    # Behind and before each other as in the scene, which pieces of one body are not.
    behind, before = list[str](), list[str]()
    for item in obstacles:
        ink = "rgb({}, {}, {})".format(*(round(255 * part) for part in color_of(item, robot)))
        pieces = _outlines(item, robot, motion(last))
        inner = "".join(f'<polygon points="{drawn(_hull(each @ view))}"/>' for each in pieces)
        body = f'<g fill="{ink}" stroke="{ink}" opacity="0.6">{inner}</g>'
        (behind if item.frame is None else before).append(body)
    parts = behind
    for arm, ink in zip(arms, _INKS, strict=True):
        parts += [
            f'<polyline points="{drawn(bone)}" stroke="{ink}" stroke-width="9"/>' for bone in arm
        ]
    parts += before
    whole = (0.0, float(last - first), _MOVE if seams else _PATH)
    parts += [
        f'<polyline points="{drawn(traced(begin, end))}" stroke="{ink}" stroke-width="3"/>'
        for begin, end, ink in (whole, *seams)
    ]
    return (
        f'<svg id="still" viewBox="0 0 {_WIDTH:.0f} {height:.0f}" role="img" '
        f'aria-label="The arm at the begin, in the middle and at the end of its motion" '
        f'fill="none" stroke-linecap="round" stroke-linejoin="round">{"".join(parts)}</svg>'
    )


def picture(
    robot: RobotModel,
    motion: Trajectory,
    obstacles: Sequence[Obstacle],
    seams: Sequence[tuple[float, float, str]] = (),
) -> str:
    """Return the same picture of lines alone: what is seen is the arm's joints and its tool's path.

    No mesh of the arm is read. Parameters as in `still`.
    """
    chain, times = robot.chain_to(robot.tool), np.linspace(motion.t[0], motion.t[-1], 101)
    tool = np.array([chain.place(q).translation for q in motion(times)])
    arms = [_skeleton(robot, q).reshape(-1, 3) for q in motion(times[::25])]
    seen = np.concatenate([tool, *arms])
    radius = scene.Extent(seen.min(axis=0), seen.max(axis=0)).radius
    around = scene.outlines(obstacles, radius)
    return still(
        robot, motion, obstacles, scene.camera(np.concatenate([seen, *around]), tool), seams
    )


def _axes(direction: Array) -> tuple[Array, Array]:
    """Return what is right and up in the picture, seen from a direction."""
    right = np.cross([0.0, 0.0, 1.0], direction)
    right = right / np.linalg.norm(right)
    return right, np.cross(direction, right)


def _skeleton(robot: RobotModel, q: Array) -> Array:
    """Return the lines from each joint to those that it carries, and to the tool, (B, 2, 3)."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, robot.coupling.spread(q))
    places = [np.array(place.translation) for place in data.oMi]
    bones = [[places[model.parents[joint]], places[joint]] for joint in range(1, model.njoints)]
    carrier, _ = robot.carrier_of(robot.tool)
    bones.append([places[carrier], np.array(robot.chain_to(robot.tool).place(q).translation)])
    return np.array(bones)


def _outlines(item: Obstacle, robot: RobotModel, q: Array) -> list[Array]:
    """Return the corners (V, 3) of the convex pieces of an obstacle, with the arm at q."""
    pieces = Solid(item.geometry(), item.label).pieces
    pose = item.pose if item.frame is None else robot.chain_to(item.frame).place(q) * item.pose
    turn, at = pose.rotation, pose.translation
    return [piece.surface()[0] @ turn.T + at for piece in pieces]


def _hull(points: Array) -> Array:
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points[:1]


# Letters of the title in a line, so that it is as wide as the figure at most.
_TITLE = 120
# What dashed lines are called.
_LIMIT = "limit"


def figure(plan: Plan) -> "Figure":
    """Return joint positions and velocities with limits, manipulability and path error over time.

    The figure is not registered with pyplot: nothing needs closing, and notebooks show it.

    Raises
    ------
    RenderError
        matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise RenderError("figures need matplotlib: pip install 'selfmotion[plots]'") from None
    robot = plan.robot
    shown, start = curves(plan, plan.trajectory), curves(plan, plan.initial_trajectory)
    drawing = Figure(figsize=(10, 6.5), layout="constrained")
    title = f"{robot.name}, {plan.task.value} task: {plan.certificate.summary}"
    drawing.suptitle("\n".join(textwrap.wrap(title, _TITLE)), fontsize="medium")
    (positions, velocities), (manipulability, errors) = drawing.subplots(2, 2, sharex=True)
    unit = robot.unit_of()
    _per_joint(positions, shown.t, shown.q, robot.joint_names, robot.lower, robot.upper)
    positions.set_ylabel(f"q [{unit}]")
    limit = robot.velocity_limit
    _per_joint(velocities, shown.t, shown.qd, robot.joint_names, -limit, limit)
    velocities.set_ylabel(f"q̇ [{unit.replace('rad', 'rad/s').replace('m', 'm/s')}]")
    manipulability.plot(shown.t, shown.manipulability, label="plan")
    manipulability.plot(start.t, start.manipulability, ":", label="minimum-norm")
    manipulability.set(ylabel="manipulability √det(JJᵀ)", ylim=(0, None), xlabel="t [s]")
    _errors(errors, shown, plan)
    # Beside the curves, which they would cover.
    joints = _of_joints(positions, velocities)
    drawing.legend(*joints, loc="outside right center", fontsize="x-small")
    for axes in (manipulability, errors):
        axes.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="x-small", frameon=False
        )
    return drawing


def _of_joints(*several: "Axes") -> tuple[list[Any], list[str]]:
    """Return the curves of a legend of joints and their limits, each once, and their names."""
    found = {
        label: handle
        for axes in several
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    # Limits come last, whichever joint has one in sight.
    found |= {_LIMIT: found.pop(_LIMIT)} if _LIMIT in found else {}
    return list(found.values()), list(found)


def _per_joint(
    axes: "Axes", t: Array, values: Array, names: tuple[str, ...], low: Array, high: Array
) -> None:
    """Draw a curve per joint, and its limits where they are in sight."""
    room = 0.06 * float(np.ptp(values)) or 1.0
    bottom, top = float(values.min()) - room, float(values.max()) + room
    for k, name in enumerate(names):
        (line,) = axes.plot(t, values[:, k], label=name)
        for limit in (low[k], high[k]):
            if bottom <= limit <= top:
                color = line.get_color()
                axes.axhline(limit, color=color, linestyle="--", linewidth=0.8, label=_LIMIT)
    axes.set_ylim(bottom, top)


def _errors(axes: "Axes", shown: Curves, plan: Plan) -> None:
    rows = plan.task.rows
    # Zero has no place on a logarithmic axis.
    floor = 1e-16
    if np.any(rows < 3):
        axes.semilogy(shown.t, np.maximum(shown.position_error, floor), label="position [m]")
    if np.any(rows >= 3):
        axes.semilogy(shown.t, np.maximum(shown.rotation_error, floor), label="rotation [rad]")
    label = "off the path, relaxed rows too" if plan.problem.relaxations else "path error"
    axes.set(ylabel=label, xlabel="t [s]")
    axes.legend(fontsize="x-small")
