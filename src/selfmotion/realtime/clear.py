"""Clearance from obstacles that move."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, ProblemError, nearest
from selfmotion.collision import ClearanceModel, CollisionModel
from selfmotion.constraints import Clearance
from selfmotion.costs import Samples
from selfmotion.robot import RobotModel
from selfmotion.task import as_pose

# Plans aim at this much more than the distance that is asked for [m]: nodes are apart.
_MARGIN = 5e-3
# From so much beyond on, distances level off [m].
_NEAR = 0.01
# A plan that comes too near within this time [s] is not begun: the arm can stop in less.
_SOON = 0.5
# How fast what came too near is to be left [m/s].
_LEAVING = 0.05
# What is no more than this nearer than now comes no nearer [m].
_NEARER = 1e-4


class Surroundings:
    """Keeps the arm apart from itself and from obstacles, wherever these are by now.

    While a plan is made they are taken to stay there. Bodies are their convex hulls.

    Parameters
    ----------
    robot : RobotModel
    clearance : Clearance
        The distance, the obstacles and where they are at first.

    Attributes
    ----------
    blocked : bool
        Whether the last plan comes nearer than the distance soon.
    message : str
        What is too near, and when.
    """

    def __init__(self, robot: RobotModel, clearance: Clearance) -> None:
        # A model of its own: that of the certificate has obstacles that stand still.
        exact = CollisionModel(robot, clearance.obstacles, clearance.disabled)
        self._model = ClearanceModel(exact, clearance.distance + _NEAR)
        self._distance = clearance.distance
        self._names = [item.name for item in clearance.obstacles]
        # Obstacles that came too near are to be left again, at this speed; links need not.
        self._leaving = np.array(
            [_LEAVING * (pair[1] in self._names) for pair in self._model.pairs]
        )
        self.blocked, self.message = False, ""

    def move(self, obstacles: Mapping[str, pin.SE3]) -> None:
        """Put obstacles somewhere else: name → pose in world axes."""
        for name, pose in obstacles.items():
            if name not in self._names:
                hint = nearest(name, self._names)
                raise ProblemError(
                    f"obstacle '{name}' is none of the clearance's: {', '.join(self._names)}{hint}"
                )
            self._model.move(name, as_pose(pose, f"obstacle '{name}'"))

    def distances(self, q: Array) -> Array:
        """Return the smallest distance at configurations (K, n), levelled off, (K,) [m]."""
        return np.asarray(self._model.clearances(q).values.min(axis=1, initial=np.inf))

    def rows(self, samples: Samples, by_q: Array) -> tuple[Array, Array]:
        """Return what keeps a step of the plan clear: rows (R, d) and their largest values (R,).

        Notes whether the plan is blocked as it is.
        """
        nodes = samples.nodes
        found = self._model.clearances(samples.q[nodes])
        values = found.values
        times = samples.sampling.node_times
        soon = values[times <= _SOON]
        allowed = np.minimum(self._distance, soon[0] - _NEARER) if soon.size else soon
        self.blocked = bool((soon[1:] < allowed).any())
        if self.blocked:
            row, pair = np.argwhere(soon[1:] < allowed)[0]
            first, second = self._model.pairs[pair]
            self.message = (
                f"'{first}' and '{second}' would be {soon[row + 1, pair] * 1e3:.1f} mm apart in "
                f"{times[row + 1]:.2f} s, wanted {self._distance * 1e3:.1f} mm"
            )
        rows = -(found.slopes[:, None] @ by_q[nodes[found.rows]])[:, 0]
        # From where the arm is, no more can be asked for than to come no nearer.
        reached = values[0] + times[:, None] * self._leaving
        room = values - np.minimum(self._distance + _MARGIN, reached)
        later = found.rows > 0
        return rows[later], room[found.rows, found.columns][later]
