"""Task frames of an arm with their paths: stacked Jacobians, targets and prescribed rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from selfmotion.basics import Array, Flags
from selfmotion.basics.layout import Layout, layout_of
from selfmotion.model.follow.coordinates import Coordinates, generic_values
from selfmotion.model.follow.follow import BoundTaskFrame, Follow
from selfmotion.model.follow.virtual_joints import NO_VIRTUAL_JOINTS, VirtualJoints
from selfmotion.model.path import Path
from selfmotion.model.robot import RobotModel
from selfmotion.model.task import Task

# Singular value below which a direction counts as lost, at generic configurations [m or 1].
_RANK_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Follows:
    """All task frames of an arm: the input of planners, costs and constraints.

    Attributes
    ----------
    robot : RobotModel
        The arm.
    items : tuple of BoundTaskFrame
        Tips with their paths, all of the same duration. Rows are stacked in this order.
    virtual : VirtualJoints
        Virtual joints of the relaxed rows of the first path; usually none.
    """

    robot: RobotModel
    items: tuple[BoundTaskFrame, ...]
    virtual: VirtualJoints = NO_VIRTUAL_JOINTS

    @classmethod
    def of(
        cls, robot: RobotModel, path: Path, task: Task | str, also: Sequence[Follow] = ()
    ) -> Self:
        """Return the task frames of the tool, which follows `path`, and of further frames."""
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
        """Return the mask of virtual joints that are locked at 0 at times t (K,), (K, n)."""
        unlocked = np.zeros((len(t), self.robot.dof), dtype=np.bool_)
        return np.hstack([unlocked, self.virtual.held(t)]) if self.virtual.each else unlocked


def _rank(jacobian: Array) -> int:
    return int(np.linalg.matrix_rank(jacobian, tol=_RANK_TOLERANCE))
