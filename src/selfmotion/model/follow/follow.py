"""Task frames on their paths: the prescribed rows of all of them, stacked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self, TypeVar

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, Flags, Ints, ProblemError, shown
from selfmotion.basics.layout import Layout, layout_of
from selfmotion.model.follow.coordinates import Coordinates, generic_values
from selfmotion.model.follow.virtual_joints import NO_VIRTUAL_JOINTS, VirtualJoints
from selfmotion.model.path import Dwell, Path, PathSamples, twist_rates
from selfmotion.model.robot import Chain, RobotModel, null_space
from selfmotion.model.task import SE3, Task, as_pose

# Grids of times whose samples of a path are cached.
_GRIDS = 4
_Value = TypeVar("_Value")
_Recent = list[tuple[Array, _Value]]


def _recent(known: _Recent[_Value], t: Array, evaluate: Callable[[Array], _Value]) -> _Value:
    """Return a function's value at times (K,), one of the last few where it is known."""
    for times, value in known:
        if np.array_equal(times, t):
            return value
    found = evaluate(t)
    known.insert(0, (np.array(t), found))
    del known[_GRIDS:]
    return found


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

    def on(self, robot: RobotModel, duration: float) -> BoundTaskFrame:
        """Return the same bound to an arm, for a duration [s].

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
    _targets: _Recent[PathSamples] = field(default_factory=list, init=False, repr=False)
    _rates: _Recent[Array] = field(default_factory=list, init=False, repr=False)

    def target(self, t: Array) -> PathSamples:
        """Return the prescribed pose and twist of the tip at times t (K,).

        The last few times are cached: many motions are evaluated on the same grids.
        """
        return _recent(self._targets, t, self.path.samples)

    def twist_rates(self, t: Array) -> Array:
        """Return the rates of the path's twists at times t (K,), (K, 6); cached as targets are."""
        return _recent(self._rates, t, partial(twist_rates, self.path))

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


# Stacked kinematics, targets and rows of all tips.


class TipKinematics:
    """Kinematics of all tips in one call, with data of their own.

    Parameters
    ----------
    chains : sequence of Chain
        Of one tree.

    Attributes
    ----------
    each : list of Kinematics
        They share their data.
    """

    def __init__(self, chains: Sequence[Chain]) -> None:
        first = chains[0].kinematics()
        self.each = [first, *(chain.kinematics(first.data) for chain in chains[1:])]
        count, dof = len(chains), chains[0].dof
        self._jacobians = np.zeros((count, 6, dof))
        self._rotations, self._translations = np.zeros((count, 3, 3)), np.zeros((count, 3))

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobians (F, 6, n), rotations (F, 3, 3) and translations (F, 3) at q (n,).

        Valid until the next call.
        """
        for f, tip in enumerate(self.each):
            self._jacobians[f] = tip.at(q) if f == 0 else tip.beside()
            self._rotations[f], self._translations[f] = tip.rotation, tip.translation
        return self._jacobians, self._rotations, self._translations


@dataclass(frozen=True, eq=False)
class Follows:
    """All task frames of an arm: the input of planners, costs and constraints.

    Attributes
    ----------
    robot : RobotModel
        The arm.
    items : tuple of BoundTaskFrame
        Each a tip on its path; their rows are stacked in this order. They last equally long.
    virtual : VirtualJoints
        Those of tolerances of the first path, whose tip is then on it; mostly none.
    """

    robot: RobotModel
    items: tuple[BoundTaskFrame, ...]
    virtual: VirtualJoints = NO_VIRTUAL_JOINTS

    @classmethod
    def of(
        cls, robot: RobotModel, path: Path, task: Task | str, also: Sequence[Follow] = ()
    ) -> Self:
        """Return that an arm's tool follows a path, and other frames theirs."""
        first = BoundTaskFrame(robot.chain, path, Task.of(task))
        return cls(robot, (first, *(item.on(robot, path.duration) for item in also)))

    @cached_property
    def coordinates(self) -> Coordinates:
        """Coordinates of motions."""
        return Coordinates.of(self.robot, self.virtual if self.virtual.each else None)

    @property
    def dof(self) -> int:
        """Number n of coordinates."""
        return self.coordinates.dof

    @property
    def dimension(self) -> int:
        """Number m of prescribed rows."""
        return sum(item.task.dimension for item in self.items)

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.items[0].path.duration

    @cached_property
    def redundancy(self) -> int:
        """Number n - m of directions of self-motion at generic configurations."""
        jacobians = [self.jacobian(q) for q in generic_values(self.coordinates)]
        return self.dof - max(map(_rank, jacobians))

    def targets(self, t: Array) -> Array:
        """Return the prescribed poses of the tips at times t (W,), rotations as rows, (W, 12 F)."""
        parts = []
        for item in self.items:
            samples = item.target(t)
            parts += [samples.translation, samples.rotation.reshape(len(samples.t), 9)]
        return np.ascontiguousarray(np.hstack(parts))

    @cached_property
    def layout(self) -> Layout:
        """Layout of the rows for compiled kernels."""
        return layout_of(
            [(f.task.rows, f.task.tool_axes, f.chain.joints) for f in self.items], self.dof
        )

    def twists(self, t: Array) -> Array:
        """Return the prescribed rows of the paths' twists at times t (K,), (K, m) [m/s, rad/s]."""
        return np.concatenate([item.twists(t) for item in self.items], axis=1)

    def jacobian(self, q: Array) -> Array:
        """Return the prescribed rows of all Jacobians at q (n,), (m, n); q is not checked."""
        return np.concatenate([item.jacobian(q) for item in self.items])

    def jacobians(self, q: Array) -> Array:
        """Return the stacked Jacobians at configurations (K, n), (K, m, n)."""
        rows = []
        for item in self.items:
            jacobian, rotation, _ = item.chain.along(q)
            rows.append(item.task.select_along(jacobian, rotation))
        return np.concatenate(rows, axis=1)

    def held(self, t: Array) -> Flags:
        """Return the mask of coordinates that are held at 0 at times t (K,), (K, n)."""
        none = np.zeros((len(t), self.robot.dof), dtype=np.bool_)
        return np.hstack([none, self.virtual.held(t)]) if self.virtual.each else none


def only_tip(follows: Follows) -> BoundTaskFrame:
    """Return the one tip that is followed.

    Raises
    ------
    ProblemError
        There are several.
    """
    if len(follows.items) > 1:
        raise ProblemError(
            f"{follows.robot.name}: {len(follows.items)} frames follow paths of their own, which "
            f"is not supported here, only one"
        )
    return follows.items[0]


def linear_rows(follows: Follows) -> Array:
    """1 for rows in metres, 0 for those in radians, (m,)."""
    return np.concatenate([item.task.rows < 3 for item in follows.items]).astype(np.float64)


def kinematics_of(follows: Follows) -> TipKinematics:
    """Return the kinematics of all tips with own data, for repeated calls."""
    return TipKinematics([item.chain for item in follows.items])


def chain_tables(follows: Follows) -> Array:
    """Tables of the chains for compiled kernels, padded, (F, c + 1, 6, 3)."""
    tables = [item.chain.table for item in follows.items]
    found = np.zeros((len(tables), max(map(len, tables)), *tables[0].shape[1:]))
    for own, table in zip(found, tables, strict=True):
        own[: len(table)] = table
    return found


def every_column(follows: Follows, q: Array) -> tuple[Array, Ints] | None:
    """Return the columns of all joints at q (S, n), (S, F, 6, W), and their order (F + 1, W).

    None where no joint on a chain mimics another one: then those of coordinates will do.
    Derivatives of Jacobians need them, see `selfmotion.model.kernels.tool`.
    """
    if not any(item.chain.is_coupled for item in follows.items):
        return None
    if len(follows.items) == 1:
        chain = follows.items[0].chain
        return chain.every_along(q)[:, None], np.array(
            [np.arange(len(chain.coordinates)), chain.coordinates]
        )
    coordinates = [item.chain.coordinates for item in follows.items]
    ends = np.cumsum([0, *map(len, coordinates)])
    columns = np.zeros((len(q), len(follows.items), 6, int(ends[-1])))
    orders = []
    for f, item in enumerate(follows.items):
        own = slice(int(ends[f]), int(ends[f + 1]))
        columns[:, f, :, own] = item.chain.every_along(q)
        others = np.delete(np.arange(ends[-1]), own)
        orders.append(np.append(np.arange(ends[-1])[own], others))
    return columns, np.array([*orders, np.concatenate(coordinates)])


def row_names_of(follows: Follows) -> tuple[str, ...]:
    """Names of the rows, (m)."""
    return tuple(name for item in follows.items for name in item.task.row_names)


def null_basis_at(follows: Follows, q: Array) -> Array:
    """Return an orthonormal basis of the self-motion's directions at q (n,), (n, r)."""
    return null_space(follows.jacobian(q))


def _rank(jacobian: Array) -> int:
    return int(np.linalg.matrix_rank(jacobian, tol=1e-6))
