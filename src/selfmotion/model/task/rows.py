"""Tasks: the rows of the tool's twist that a path prescribes."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, ProblemError, shown

_ROW_NAMES = ("vx", "vy", "vz", "wx", "wy", "wz")


class Task(Enum):
    """The rows of the twist [v, ω] that the path prescribes.

    v is the linear velocity of the tool frame's origin and ω the angular velocity, both in world
    axes; the angular rows of `POINTING` are in tool axes, so that rotation about the tool's z axis
    stays free.

    ============== ==== =====================================================
    task           rows prescribed
    ============== ==== =====================================================
    `POSE`         6    position and orientation
    `POSITION`     3    position
    `POINTING`     5    position and direction of the tool's z axis
    `PLANAR`       2    x and y
    `PLANAR_POSE`  3    x, y and the angle about z (planar arms)
    ============== ==== =====================================================
    """

    POSE = "pose"
    POSITION = "position"
    POINTING = "pointing"
    PLANAR = "planar"
    PLANAR_POSE = "planar_pose"

    @classmethod
    def of(cls, task: Task | str) -> Task:
        """Return the task of that name.

        Raises
        ------
        ProblemError
            No task has that name.
        """
        try:
            return cls(task)
        except ValueError:
            names = ", ".join(member.value for member in cls)
            raise ProblemError(f"unknown task {shown(task)}, expected one of: {names}") from None

    @property
    def rows(self) -> npt.NDArray[np.intp]:
        """Indices into [v, ω] of the prescribed rows, (m,)."""
        return _ROWS[self]

    @property
    def dimension(self) -> int:
        """Number m of prescribed rows."""
        return len(_ROWS[self])

    @property
    def tool_axes(self) -> bool:
        """Whether the angular rows are in tool axes."""
        return self is Task.POINTING

    @property
    def angular(self) -> bool:
        """Whether it prescribes anything of the orientation."""
        return bool(np.any(self.rows >= 3))

    @property
    def row_names(self) -> Sequence[str]:
        """Names of the prescribed rows."""
        return [_ROW_NAMES[i] for i in _ROWS[self]]

    def select(self, twists: Array, rotation: Array) -> Array:
        """Return the prescribed rows of `twists`.

        Parameters
        ----------
        twists : (6, k)
            Columns [v, ω] in world axes, for example a Jacobian.
        rotation : (3, 3)
            The tool's orientation.

        Returns
        -------
        (m, k)
        """
        if self.tool_axes:
            twists = np.vstack([twists[:3], rotation.T @ twists[3:]])
        return twists[self.rows]

    def select_along(self, twists: Array, rotations: Array) -> Array:
        """Return `select` of twists (S, 6, k) at orientations (S, 3, 3), (S, m, k)."""
        if self.tool_axes:
            turned = rotations.transpose(0, 2, 1) @ twists[:, 3:]
            twists = np.concatenate([twists[:, :3], turned], axis=1)
        return twists if self.dimension == 6 else np.ascontiguousarray(twists[:, self.rows])

    def twist_error(self, target: pin.SE3, actual: pin.SE3) -> Array:
        """Return the twist that takes `actual` to `target` in unit time, world axes, (6,) [m, rad].

        The angular part is log(R_target Rᵀ) on SO(3); for `POINTING` the shortest rotation that
        aligns the two z axes. Rows that the task leaves free are not zeroed: see `select`.
        """
        if self.tool_axes:
            angular = align_axes(actual.rotation[:, 2], target.rotation[:, 2])
        else:
            angular = pin.log3(target.rotation @ actual.rotation.T)
        return np.concatenate([target.translation - actual.translation, angular])

    def miss(self, target: pin.SE3, actual: pin.SE3) -> tuple[float, float]:
        """Return the distance of `actual` from `target` in the prescribed rows, (m, rad)."""
        error = self.select(self.twist_error(target, actual)[:, None], actual.rotation)[:, 0]
        linear = self.rows < 3
        return float(np.linalg.norm(error[linear])), float(np.linalg.norm(error[~linear]))


def align_axes(axis: Array, target: Array) -> Array:
    """Return the shortest rotation vector that takes unit vector `axis` to `target`, (3,) [rad]."""
    cross = np.cross(axis, target)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ target)
    if sine == 0.0:
        if cosine > 0.0:
            return np.zeros(3)
        # Opposite axes: every perpendicular direction serves; take the one least aligned with axis.
        helper = np.zeros(3)
        helper[np.argmin(np.abs(axis))] = 1.0
        cross = np.cross(axis, helper)
        return np.asarray(np.pi * cross / np.linalg.norm(cross))
    return np.asarray(np.arctan2(sine, cosine) * cross / sine)


_ROWS = {
    Task.POSE: np.arange(6),
    Task.POSITION: np.arange(3),
    Task.POINTING: np.arange(5),
    Task.PLANAR: np.arange(2),
    Task.PLANAR_POSE: np.array([0, 1, 5]),
}
