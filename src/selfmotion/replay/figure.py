"""The replay's plots as a matplotlib figure."""

from typing import TYPE_CHECKING

import numpy as np

from selfmotion.basics import Array, RenderError
from selfmotion.replay.motion import Curves, curves
from selfmotion.result import Plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
    drawing.suptitle(f"{robot.name}, {plan.task.value} task: {plan.certificate.verdict}")
    (positions, velocities), (manipulability, errors) = drawing.subplots(2, 2, sharex=True)
    unit = robot.unit_of()
    _per_joint(positions, shown.t, shown.q, robot.joint_names, robot.lower, robot.upper)
    positions.set_ylabel(f"q [{unit}]")
    positions.legend(fontsize="x-small", ncols=2)
    limit = robot.velocity_limit
    _per_joint(velocities, shown.t, shown.qd, robot.joint_names, -limit, limit)
    velocities.set_ylabel(f"q̇ [{unit.replace('rad', 'rad/s').replace('m', 'm/s')}]")
    manipulability.plot(shown.t, shown.manipulability, label="plan")
    manipulability.plot(start.t, start.manipulability, ":", label="minimum-norm")
    manipulability.set(ylabel="manipulability √det(JJᵀ)", ylim=(0, None), xlabel="t [s]")
    manipulability.legend(fontsize="x-small")
    _errors(errors, shown, plan)
    return drawing


def _per_joint(
    axes: "Axes", t: Array, values: Array, names: tuple[str, ...], low: Array, high: Array
) -> None:
    """Draw a curve per joint, and its limits where they are in sight."""
    for k, name in enumerate(names):
        (line,) = axes.plot(t, values[:, k], label=name)
        for limit in (low[k], high[k]):
            if np.isfinite(limit):
                axes.axhline(limit, color=line.get_color(), linestyle="--", linewidth=0.8)
    room = 0.06 * float(np.ptp(values)) or 1.0
    axes.set_ylim(float(values.min()) - room, float(values.max()) + room)


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
