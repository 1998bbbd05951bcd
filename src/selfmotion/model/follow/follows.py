"""All task frames of an arm: stacked kinematics, targets and rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from selfmotion.basics import Array, Flags, Ints, ProblemError
from selfmotion.basics.layout import Layout, layout_of
from selfmotion.model.follow.coordinates import Coordinates, generic_values
from selfmotion.model.follow.follow import BoundTaskFrame, Follow
from selfmotion.model.follow.virtual_joints import NO_VIRTUAL_JOINTS, VirtualJoints
from selfmotion.model.path import Path
from selfmotion.model.robot import Chain, RobotModel, null_space
from selfmotion.model.task import Task


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
