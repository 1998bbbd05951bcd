"""Layout of the stacked rows of several tips: a table for compiled kernels.

A layout (F, 9 + n) has, for each of F tips: the kind of its angular error, its first row among all,
the number of its rows, these rows of [v, ω], and the joints in the order of its chain.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from selfmotion.basics.arrays import Ints

Layout = npt.NDArray[np.int64]

# Kind of a task without angular error.
NO_ANGLE = 0
# Kind of a task whose angular error is the logarithm on SO(3).
LOGARITHM = 1
# Kind of a task whose angular error is that of the z axis.
POINTING = 2
# Column of the kind.
KIND = 0
# Column of the first row.
FIRST = 1
# Column of the number of rows.
COUNT = 2
# First column of the rows.
ROWS = 3
# First column of the joints.
ORDER = 9


def layout_of(tasks: Sequence[tuple[Ints, bool, Ints]], dof: int) -> Layout:
    """Return the layout of tips with rows of [v, ω], axes of the tool, and joints of a chain."""
    layout = np.zeros((len(tasks), ORDER + dof), dtype=np.int64)
    first = 0
    for line, (rows, tool_axes, joints) in zip(layout, tasks, strict=True):
        line[KIND] = _angle_kind(rows, tool_axes)
        line[FIRST], line[COUNT] = first, len(rows)
        line[ROWS : ROWS + len(rows)] = rows
        # Joints off the chain have columns of zeros, wherever they stand.
        line[ORDER:] = [*joints, *np.setdiff1d(np.arange(dof), joints)]
        first += len(rows)
    return layout


def _angle_kind(rows: Ints, tool_axes: bool) -> int:
    if tool_axes:
        return POINTING
    return LOGARITHM if np.any(rows >= 3) else NO_ANGLE
