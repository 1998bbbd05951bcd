"""Task frames with tolerances: virtual joints lead from the tool to its path."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags
from selfmotion.model.follow.coordinates import Coordinates
from selfmotion.model.follow.follow import BoundTaskFrame, Follows
from selfmotion.model.follow.table_chain import TableChain
from selfmotion.model.follow.virtual_joints import VirtualJoints
from selfmotion.model.path import Dwell, Path
from selfmotion.model.robot import mean_lever
from selfmotion.model.task import SE3, Relaxation, Task

# Share of a band that a motion put back into it uses.
_INSIDE = 0.999


@dataclass(frozen=True, eq=False)
class RelaxedFrames(Follows):
    """Task frames whose first one has tolerances: the tip of its virtual joints is on the path.

    Attributes
    ----------
    virtual : VirtualJoints
    """

    virtual: VirtualJoints = field(kw_only=True)

    @classmethod
    def with_tolerances(
        cls, follows: Follows, relaxations: Sequence[Relaxation]
    ) -> "RelaxedFrames":
        """Return the task frames of an arm with rows of its first path relaxed."""
        arm, (first, *others) = follows.robot, follows.items
        virtual = VirtualJoints(first.task, relaxations, follows.duration, mean_lever(arm))
        n = arm.dof
        dof = n + len(virtual.each)

        def bound(item: BoundTaskFrame, table: Array, task: Task) -> BoundTaskFrame:
            return BoundTaskFrame(TableChain(item.chain.tip_name, table, dof), item.path, task)

        items = [bound(first, virtual.table(first.chain, n), virtual.task)]
        items += [bound(item, item.chain.table, item.task) for item in others]
        alike = virtual.alike(n)
        if alike is not None:
            at_rest = Dwell(SE3.Identity(), follows.duration)
            items.append(BoundTaskFrame(TableChain("", alike, dof), at_rest, cast(Task, _Alike())))
        return cls(arm, tuple(items), virtual=virtual)

    @cached_property
    @override
    def coordinates(self) -> Coordinates:
        return Coordinates.of(self.robot, self.virtual)

    @override
    def within(self, lower: Array, upper: Array) -> "RelaxedFrames":
        found = copy(self)
        found.__dict__["coordinates"] = self.coordinates.within(lower, upper)
        return found

    @override
    def completed(self, t: Array, q: Array) -> Array:
        return completed_along(self, self.items[0].path, t, q)

    @property
    @override
    def with_windows_shut(self) -> "RelaxedFrames":
        none = np.zeros(self.robot.dof, dtype=np.bool_)
        held = np.append(none, self.virtual.windowed)

        def shut(item: BoundTaskFrame) -> BoundTaskFrame:
            own = item.chain
            return BoundTaskFrame(
                TableChain(own.tip_name, own.table, self.dof, held), item.path, item.task
            )

        return replace(self, items=tuple(shut(item) for item in self.items))

    def limits_within(self, item: Relaxation, band: float = np.inf) -> Array:
        """Return limits of |q| (n,) beyond which a relaxation's rows are off their path too far.

        By more than a band, or by more than the relaxations let each of them be at any time.
        """
        found = np.full(self.dof, np.inf)
        first = self.robot.dof
        for k, joint in enumerate(self.virtual.each):
            if joint.row in item.indices:
                # The first hinge of a tilt turns by half of it.
                halved = self.virtual.swing is not None and k == self.virtual.swing[0]
                share = 0.5 if halved else 1.0
                most = min(band, self.virtual.widest([joint.row]))
                found[first + k] = share * most / joint.scale
        return found

    @override
    def within_bands(self, q: Array) -> Array:
        found, first = np.full_like(q, np.inf), self.robot.dof
        for item in self.virtual.relaxations:
            band = self.virtual.widest(item.indices)
            if len(item.rows) == 1 or not np.isfinite(band):
                continue
            size = np.linalg.norm(deviation_of(self, item, q), axis=1)
            beyond = size > band
            share = _INSIDE * band / np.where(beyond, size, 1.0)
            for k, joint in enumerate(self.virtual.each, first):
                if joint.row in item.indices:
                    found[beyond, k] = share[beyond] * np.abs(q[beyond, k])
        return found

    @property
    @override
    def is_plain(self) -> bool:
        return False

    @property
    @override
    def names(self) -> str:
        return " and ".join(
            f"'{item.chain.tip_name}'" for item in self.items if item.chain.tip_name
        )

    @override
    def held(self, t: Array) -> Flags:
        none = np.zeros((len(t), self.robot.dof), dtype=np.bool_)
        return np.hstack([none, self.virtual.held(t)])

    @property
    @override
    def holds(self) -> bool:
        return bool(self.virtual.windowed.any())

    @property
    @override
    def edges(self) -> tuple[float, ...]:
        ends = {x for item in self.virtual.relaxations for x in item.window(self.duration)}
        return tuple(sorted(ends - {0.0, self.duration}))


def completed_along(follows: RelaxedFrames, path: Path, t: Array, q: Array) -> Array:
    """Return q (K, n) with the virtual joints that lead to a path at its times t (K,)."""
    _, turns, places = follows.robot.chain.along(q)
    wanted = path.samples(np.minimum(t, path.duration))
    found = follows.virtual.coordinates((turns, places), (wanted.rotation, wanted.translation))
    held = follows.virtual.held(t * (follows.duration / path.duration))
    found[held] = 0.0
    return np.hstack([q, found])


def deviation_of(follows: RelaxedFrames, item: Relaxation, q: Array) -> Array:
    """Return the deviations of a relaxation's rows at q (K, n), (K, k) [m, rad]."""
    return follows.virtual.rows_of(item, q[:, follows.robot.dof :])[0]


class _Alike:
    """The one row in which two hinges of a tilt turn alike; see `Task`."""

    rows = np.zeros(1, dtype=np.intp)
    dimension, tool_axes, angular, row_names = 1, False, False, ("tilt",)

    def select(self, twists: Array, rotation: Array) -> Array:
        """See `Task.select`."""
        return twists[:1]

    def select_along(self, twists: Array, rotations: Array) -> Array:
        """See `Task.select_along`."""
        return np.ascontiguousarray(twists[:, :1])

    def twist_error(self, target: Any, actual: Any) -> Array:
        """See `Task.twist_error`."""
        return np.concatenate([target.translation - actual.translation, np.zeros(3)])

    def miss(self, target: Any, actual: Any) -> tuple[float, float]:
        """See `Task.miss`."""
        return float(abs(target.translation[0] - actual.translation[0])), 0.0
