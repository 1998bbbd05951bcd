"""Checks that relaxations fit a path, a task, and one another."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.model.follow import VirtualJoints
from selfmotion.model.path import Path, spread_along
from selfmotion.model.task import POSITION_ROWS, ROW_NAMES, Relaxation, Task

# Relative rounding of the end of a window.
_TIME_ROUNDING = 1e-9
# Samples of a path for the axes of its tool.
_AXES_SAMPLES = 9


def check_relaxations(relaxations: Sequence[Relaxation], path: Path, task: Task) -> None:
    """Check that relaxations fit a path, a task, and one another.

    Raises
    ------
    ProblemError
        A row is not among those the task prescribes, a window ends after the path, two relaxations
        share a row at the same time, or positions are relaxed in different axes.
    """
    prescribed = _prescribed_rows(path, task)
    for item in relaxations:
        unprescribed = [row for row in item.rows if row not in prescribed]
        if unprescribed:
            raise ProblemError(
                f"relaxation {item.name}: task '{task.value}' does not prescribe "
                f"{', '.join(unprescribed)}, only {', '.join(prescribed)}"
            )
        if item.in_tool_axes and not set(POSITION_ROWS) <= set(prescribed):
            raise ProblemError(
                f"relaxation {item.name}: tool axes need a task that prescribes x, y and z, which "
                f"'{task.value}' does not"
            )
        window_end = item.window(path.duration)[1]
        if window_end > path.duration * (1.0 + _TIME_ROUNDING):
            raise ProblemError(
                f"relaxation {item.name}: its window ends at {window_end:.6g} s, the path at "
                f"{path.duration:.6g} s"
            )
    for first, second in combinations(relaxations, 2):
        shared = set(first.rows) & set(second.rows)
        (begin_1, end_1), (begin_2, end_2) = (
            item.window(path.duration) for item in (first, second)
        )
        if shared and begin_1 < end_2 and begin_2 < end_1:
            raise ProblemError(f"row {', '.join(sorted(shared))} is relaxed twice at the same time")
    if len({item.in_tool_axes for item in relaxations if not item.angular}) > 1:
        raise ProblemError("positions are relaxed in world axes and in tool axes; choose one")
    # Raises for combinations of rows that cannot be virtual joints.
    VirtualJoints(task, relaxations, path.duration, 1.0)


def _prescribed_rows(path: Path, task: Task) -> list[str]:
    """Return the rows of the deviation that the task prescribes."""
    rows = [ROW_NAMES[k] for k in task.rows]
    if task is Task.PLANAR_POSE:
        # The task's angle is about the world's z axis: rz is the same only there.
        axes = path.samples(spread_along(path, _AXES_SAMPLES)).rotation[:, :, 2]
        if not np.allclose(axes, [0.0, 0.0, 1.0]):
            rows.remove("rz")
    return rows
