"""Poses that an arm reaches without coming near a singular pose."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from selfmotion.basics import Array
from selfmotion.model.robot import Kinematics
from selfmotion.model.task import SE3, Task
from selfmotion.realtime.horizon import is_damped
from selfmotion.realtime.settings import LARGEST, REACHED, REACHING


class Reach:
    """Tells which poses of the tool an arm reaches, by Newton's method from good configurations.

    Where the arm waits for a path that has left its reach, it is stretched out, and Newton's method
    is ill-conditioned: so it begins elsewhere.

    Parameters
    ----------
    kinematics : Kinematics
    task : Task
        The prescribed rows.
    lower, upper : (n,)
        Limits of position.
    dexterous : (n,)
        A configuration far from singular poses.

    Attributes
    ----------
    last_regular : (n,)
        Where the arm was last on time, and no motion over the horizon came near a singular pose.
    """

    def __init__(
        self, kinematics: Kinematics, task: Task, lower: Array, upper: Array, dexterous: Array
    ) -> None:
        self._kinematics, self._task = kinematics, task
        self._lower, self._upper = lower, upper
        self._dexterous = self.last_regular = dexterous

    def contains(self, poses: Iterable[SE3]) -> bool:
        """Return whether the arm reaches all of some poses, in configurations that are regular."""
        return all(
            any(self._reaches(pose, guess) for guess in (self.last_regular, self._dexterous))
            for pose in poses
        )

    def _reaches(self, pose: SE3, guess: Array) -> bool:
        """Return whether damped Newton steps come from a guess (n,) to a pose.

        Not where the arm is then so near a singular pose that commands are damped.
        """
        kinematics, task, q = self._kinematics, self._task, guess
        for _ in range(REACHING):
            jacobian = kinematics.at(q)
            tool = SE3(kinematics.rotation, kinematics.translation)
            rows = task.select(jacobian, tool.rotation)
            error = task.select(task.twist_error(pose, tool)[:, None], tool.rotation)[:, 0]
            gram = rows @ rows.T
            if np.abs(error).max() < REACHED:
                return not is_damped(gram)
            step = rows.T @ np.linalg.solve(gram + REACHED * np.eye(len(rows)), error)
            step *= min(1.0, LARGEST / float(np.abs(step).max()))
            q = np.clip(q + step, self._lower, self._upper)
        return False
