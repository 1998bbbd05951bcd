"""A task frame that follows a path, and the rows that are prescribed of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, ProblemError, shown
from selfmotion.model.path import Dwell, Path, PathSamples, twist_rates
from selfmotion.model.robot import Chain, RobotModel
from selfmotion.model.task import SE3, Task, as_pose

# Grids of times whose samples of a path are cached.
_GRIDS = 4
_Value = TypeVar("_Value")
_Cache = list[tuple[Array, _Value]]


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
            link = getattr(self, name)
            if not isinstance(link, str | None):
                raise ProblemError(f"follow: {name} is {shown(link)}, expected the name of a link")

    def on(self, robot: RobotModel, duration: float) -> BoundTaskFrame:
        """Return the task frame on an arm, for a duration [s].

        Raises
        ------
        RobotError
            The arm has no such link.
        ProblemError
            The path has another duration.
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
        return BoundTaskFrame(chain, path, Task.of(self.task))

    def along(self, path: Path) -> Follow:
        """Return the same with another path."""
        return replace(self, path=path)


@dataclass(frozen=True, eq=False)
class BoundTaskFrame:
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
    _targets: _Cache[PathSamples] = field(default_factory=list, init=False, repr=False)
    _rates: _Cache[Array] = field(default_factory=list, init=False, repr=False)

    def target(self, t: Array) -> PathSamples:
        """Return the prescribed pose and twist of the tip at times t (K,).

        The last few times are cached: many motions are evaluated on the same grids.
        """
        return _cached(self._targets, t, self.path.samples)

    def twist_rates(self, t: Array) -> Array:
        """Return the rates of the path's twists at times t (K,), (K, 6); cached as targets are."""
        return _cached(self._rates, t, partial(twist_rates, self.path))

    def jacobian(self, q: Array) -> Array:
        """Return the prescribed rows of the Jacobian at q (n,), (m, n); q is not checked."""
        jacobian, rotation, _ = self.chain.at(q)
        return self.task.select(jacobian, rotation)

    def twists(self, t: Array) -> Array:
        """Return the prescribed rows of the path's twists at times t (K,), (K, m) [m/s, rad/s]."""
        target = self.target(t)
        return self.task.select_along(target.twist[:, :, None], target.rotation)[:, :, 0]

    def error(self, t: float, q: Array) -> Array:
        """Return the tip's error from its path at q (n,) and t [s], in the rows, (m,) [m, rad]."""
        actual = self.chain.place(q)
        twist = self.task.twist_error(self.path.pose(t), actual)
        return self.task.select(twist[:, None], actual.rotation)[:, 0]

    def miss(self, pose: SE3, q: Array) -> tuple[float, float]:
        """Return the distance of the tip at q (n,) from a pose in the rows, (m, rad)."""
        return self.task.miss(pose, self.chain.place(q))


def _cached(cache: _Cache[_Value], t: Array, evaluate: Callable[[Array], _Value]) -> _Value:
    """Return a function's value at times t (K,), from the last few that are cached if possible."""
    for times, value in cache:
        if np.array_equal(times, t):
            return value
    value = evaluate(t)
    cache.insert(0, (np.array(t), value))
    del cache[_GRIDS:]
    return value
