"""Relaxations: rows of the tool's pose that may deviate from the path, in a band or a window."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from selfmotion.basics import TURN, Array, ProblemError, shown

POSITION_ROWS = ("x", "y", "z")
_ROTATION = ("rx", "ry", "rz")
ROW_NAMES = (*POSITION_ROWS, *_ROTATION)


@dataclass(frozen=True)
class Relaxation:
    """Rows in which the tool may leave the path, by how much, and when.

    The deviation of the tool from the path has six rows: the position's difference x, y, z [m], in
    world axes or in those of the path's tool frame; and the rotation vector rx, ry, rz [rad] that
    takes the path's orientation to the tool's, in the axes of the path's tool frame. Rows that are
    given together share one band: √(Σ deviation²) ≤ band at any time, so that

    - ``Relaxation("z", 2e-3)`` is ± 2 mm,
    - ``Relaxation(("x", "y"), 1e-3)`` a disc,
    - ``Relaxation(("rx", "ry"), 0.2)`` a cone of 0.2 rad around the tool axis,
    - ``Relaxation("rz", during=(1.0, 2.0))`` leaves the rotation about the tool axis free for a
      second: the row is switched off and on again.

    The motion enters and leaves a window without a jump in velocity or acceleration.

    Parameters
    ----------
    rows : str or sequence of str
        All of x, y, z or all of rx, ry, rz.
    band : float
        Largest deviation [m or rad]; infinite by default, which leaves the rows free.
    during : (float, float), optional
        First and last time of the window [s]; by default the whole motion.
    axes : {"world", "tool"}
        Of x, y and z; rotations are in tool axes always.

    Raises
    ------
    ProblemError
        A row is unknown or given twice, rows of position and rotation are mixed, the band is not
        positive, or the window is empty.
    """

    rows: tuple[str, ...] | str | Sequence[str]
    band: float = np.inf
    during: tuple[float, float] | None = None
    axes: str = "world"

    def __post_init__(self) -> None:
        _check_types(self.rows, self.band, self.during)
        rows = (self.rows,) if isinstance(self.rows, str) else tuple(map(str, self.rows))
        object.__setattr__(self, "rows", rows)
        if not rows or len(set(rows)) != len(rows) or not set(rows) <= set(ROW_NAMES):
            raise ProblemError(
                f"relaxation: rows are '{', '.join(map(str, rows))}', expected some of "
                f"{', '.join(ROW_NAMES)}, each once"
            )
        if not (set(rows) <= set(POSITION_ROWS) or set(rows) <= set(_ROTATION)):
            raise ProblemError(
                f"relaxation: rows {', '.join(rows)} mix metres and radians, which cannot share a "
                f"band; give two relaxations"
            )
        if not self.band > 0.0:
            raise ProblemError(f"relaxation {self.name}: band is {self.band}, expected > 0")
        if self.angular and TURN < self.band < np.inf:
            raise ProblemError(
                f"relaxation {self.name}: a band of {self.band:g} rad is more than a turn; in "
                f"degrees? 10° is 0.1745 rad"
            )
        if self.axes not in ("world", "tool"):
            raise ProblemError(
                f"relaxation {self.name}: axes are '{self.axes}', expected 'world' or 'tool'"
            )
        if self.during is not None:
            times = tuple(float(time) for time in self.during)
            if not (len(times) == 2 and np.isfinite(times[1]) and 0.0 <= times[0] < times[1]):
                raise ProblemError(
                    f"relaxation {self.name}: during is {self.during}, expected two times "
                    f"0 ≤ first < last [s]"
                )
            object.__setattr__(self, "during", times)

    @property
    def name(self) -> str:
        """The rows, for messages."""
        return f"({', '.join(self.rows)})"

    @property
    def label(self) -> str:
        """The rows and the window, for messages about one of several."""
        if self.during is None:
            return self.name
        return f"{self.name} at {self.during[0]:.6g} to {self.during[1]:.6g} s"

    @property
    def indices(self) -> list[int]:
        """Which of the six rows x, y, z, rx, ry, rz."""
        return [ROW_NAMES.index(row) for row in self.rows]

    @property
    def angular(self) -> bool:
        """Whether the rows are those of the rotation."""
        return self.rows[0] in _ROTATION

    @property
    def in_tool_axes(self) -> bool:
        """Whether the rows are positions in the axes of the path's tool frame."""
        return self.axes == "tool" and not self.angular

    def window(self, duration: float) -> tuple[float, float]:
        """Return first and last time of the window in a motion of length `duration` [s]."""
        return (0.0, duration) if self.during is None else self.during

    def moved(self, when: Callable[[Array], Array]) -> Relaxation | None:
        """Return the same with its window at other times [s]; None for an empty window."""
        if self.during is None:
            return self
        first, last = when(np.array(self.during)).tolist()
        return replace(self, during=(first, last)) if first < last else None

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-safe description: ``Relaxation(**description)`` restores it."""
        window = None if self.during is None else list(self.during)
        return {**asdict(self), "rows": list(self.rows), "during": window}


def _check_types(rows: Any, band: Any, during: Any) -> None:
    for name, value, kind, wanted in (
        ("rows", rows, Iterable, "names of rows"),
        ("band", band, Real, "a number"),
        ("during", during, list | tuple | None, "two times"),
    ):
        if not isinstance(value, kind):
            raise ProblemError(f"relaxation: {name} is {shown(value)}, expected {wanted}")
    if during is not None and not all(isinstance(time, Real) for time in during):
        raise ProblemError(f"relaxation: during is {shown(during)}, expected two times")
