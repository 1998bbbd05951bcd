"""A tip that follows a path, in the rows that are prescribed: as asked for, and on an arm."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.path import Dwell, Path, PathSamples
from selfmotion.robot import Chain, RobotModel
from selfmotion.task import SE3, Task, as_pose


@dataclass(frozen=True, eq=False)
class Follow:
    """A frame of the arm follows a path, in the rows of a task.

    Parameters
    ----------
    path : Path, SE3 or (4, 4)
        The motion of the tool in the frame of the reference; a pose is held all the time.
    task : Task or str
        The rows of it that are prescribed; ``"pose"`` by default.
    tool : str, optional
        The link that follows; by default the arm's tool.
    reference : str, optional
        The link in whose frame the path is given; by default the arm's reference where the tool is
        its own, else the world.

    Examples
    --------
    Two hands that hold one bar: ``Follow(grasp, tool="right/hand", reference="left/hand")``.
    """

    path: Path | SE3 | npt.ArrayLike
    task: Task | str = Task.POSE
    tool: str | None = None
    reference: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "task", Task.of(self.task))
        if not isinstance(self.path, Path):
            object.__setattr__(self, "path", as_pose(self.path, "follow: the path"))
        for name in ("tool", "reference"):
            given = getattr(self, name)
            if not isinstance(given, str | None):
                raise ProblemError(f"follow: {name} is {shown(given)}, expected the name of a link")

    def on(self, robot: RobotModel, duration: float) -> BoundFollow:
        """Return the same of an arm, for so many seconds.

        Raises
        ------
        RobotError
            There is no such link.
        ProblemError
            The path lasts longer or shorter.
        """
        path: Any = self.path
        if not isinstance(path, Path):
            path = Dwell(path, duration)
        if abs(path.duration - duration) > 1e-9 * duration:
            raise ProblemError(
                f"{robot.name}: the path of '{self.tool or robot.tool}' lasts {path.duration:.6g} "
                f"s, expected {duration:.6g} s as that of '{robot.tool}'"
            )
        reference = self.reference
        if reference is None and self.tool in (None, robot.tool):
            reference = robot.reference
        chain = robot.chain_to(self.tool or robot.tool, reference)
        return BoundFollow(chain, path, Task.of(self.task))

    def along(self, path: Path) -> Follow:
        """Return the same on another path."""
        return replace(self, path=path)


@dataclass(frozen=True, eq=False)
class BoundFollow:
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
    _last: list[PathSamples] = field(default_factory=list, init=False, repr=False)

    def target(self, t: Array) -> PathSamples:
        """Return where the tip has to be at times t (K,), and how it moves.

        Those of the last times are kept: many motions are looked at on the same grid.
        """
        for kept in self._last:
            if np.array_equal(kept.t, t):
                return kept
        found = self.path.samples(t)
        self._last[:] = [found]
        return found

    def jacobian(self, q: Array) -> Array:
        """Return the prescribed rows of the Jacobian at q (n,), (m, n); q is not checked."""
        jacobian, rotation, _ = self.chain.at(q)
        return self.task.select(jacobian, rotation)

    def twists(self, t: Array) -> Array:
        """Return the prescribed rows of the path's twists at times t (K,), (K, m) [m/s, rad/s]."""
        target = self.target(t)
        return self.task.select_along(target.twist[:, :, None], target.rotation)[:, :, 0]

    def error(self, t: float, q: Array) -> Array:
        """Return what takes the tip at q (n,) to its path at t [s], in the rows, (m,) [m, rad]."""
        actual = self.chain.place(q)
        twist = self.task.twist_error(self.path.pose(t), actual)
        return self.task.select(twist[:, None], actual.rotation)[:, 0]

    def miss(self, pose: SE3, q: Array) -> tuple[float, float]:
        """Return how far the tip at q (n,) is from a pose in the rows, (m, rad)."""
        return self.task.miss(pose, self.chain.place(q))
