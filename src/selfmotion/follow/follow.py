"""A chain's tip that follows a path, in the rows that are prescribed."""

from dataclasses import dataclass

import pinocchio as pin

from selfmotion.basics import Array
from selfmotion.path import Path, PathSamples
from selfmotion.robot import Chain
from selfmotion.task import Task


@dataclass(frozen=True, eq=False)
class Follow:
    """The tip of a chain on a path, in the rows of a task.

    Poses, twists and errors are those of the tip in the chain's base frame, in its axes.

    Attributes
    ----------
    chain : Chain
    path : Path
    task : Task
    """

    chain: Chain
    path: Path
    task: Task

    def target(self, t: Array) -> PathSamples:
        """Return where the tip has to be at times t (K,), and how it moves."""
        return self.path.samples(t)

    def jacobian(self, q: Array) -> Array:
        """Return the prescribed rows of the Jacobian at q (n,), (m, n); q is not checked."""
        jacobian, rotation, _ = self.chain.at(q)
        return self.task.select(jacobian, rotation)

    def twist(self, t: float) -> Array:
        """Return the prescribed rows of the path's twist at t [s], (m,) [m/s, rad/s]."""
        target = self.path.samples(t)
        return self.task.select(target.twist[0][:, None], target.rotation[0])[:, 0]

    def error(self, t: float, q: Array) -> Array:
        """Return what takes the tip at q (n,) to its path at t [s], in the rows, (m,) [m, rad]."""
        actual = self.chain.place(q)
        twist = self.task.twist_error(self.path.pose(t), actual)
        return self.task.select(twist[:, None], actual.rotation)[:, 0]

    def miss(self, pose: pin.SE3, q: Array) -> tuple[float, float]:
        """Return how far the tip at q (n,) is from a pose in the rows, (m, rad)."""
        return self.task.miss(pose, self.chain.place(q))
