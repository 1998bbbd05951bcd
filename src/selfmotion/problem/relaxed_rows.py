"""Whether relaxations fit a path, a task, and each other."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from selfmotion.basics import ProblemError
from selfmotion.path import Path
from selfmotion.task import POSITION_ROWS, ROW_NAMES, Relaxation, Task


def check_relaxations(relaxations: Sequence[Relaxation], path: Path, task: Task) -> None:
    """Check that relaxations fit a path and a task, and each other.

    Raises
    ------
    ProblemError
        A row is not among those the task prescribes, a window ends after the path, two relaxations
        share a row at the same time, or positions are relaxed in different axes.
    """
    prescribed = _prescribed(path, task)
    for item in relaxations:
        free = [row for row in item.rows if row not in prescribed]
        if free:
            raise ProblemError(
                f"relaxation {item.name}: task '{task.value}' does not prescribe "
                f"{', '.join(free)}, only {', '.join(prescribed)}"
            )
        if item.in_tool_axes and not set(POSITION_ROWS) <= set(prescribed):
            raise ProblemError(
                f"relaxation {item.name}: tool axes need a task that prescribes x, y and z, which "
                f"'{task.value}' does not"
            )
        if item.window(path.duration)[1] > path.duration * (1.0 + 1e-9):
            raise ProblemError(
                f"relaxation {item.name}: its window ends at {item.window(path.duration)[1]:.6g} "
                f"s, the path at {path.duration:.6g} s"
            )
    for first, second in combinations(relaxations, 2):
        twice = set(first.rows) & set(second.rows)
        one, other = first.window(path.duration), second.window(path.duration)
        if twice and one[0] < other[1] and other[0] < one[1]:
            raise ProblemError(f"row {', '.join(sorted(twice))} is relaxed twice at the same time")
    if len({item.in_tool_axes for item in relaxations if not item.angular}) > 1:
        raise ProblemError("positions are relaxed in world axes and in tool axes; choose one")


def _prescribed(path: Path, task: Task) -> list[str]:
    """Return the rows of the deviation that the task prescribes."""
    rows = [ROW_NAMES[k] for k in task.rows]
    if task is Task.PLANAR_POSE:
        # Its angle is about the world's z axis: only there is rz that angle.
        axes = path.samples(np.linspace(0.0, path.duration, 9)).rotation[:, :, 2]
        if not np.allclose(axes, [0.0, 0.0, 1.0]):
            rows.remove("rz")
    return rows
