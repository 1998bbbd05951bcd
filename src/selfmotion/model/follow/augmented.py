"""The arm with virtual joints, and its task frames."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, cast

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, read_only
from selfmotion.model.follow.follow import BoundTaskFrame, Follows
from selfmotion.model.follow.table_chain import TableChain
from selfmotion.model.follow.virtual_joints import VirtualJoints
from selfmotion.model.path import Dwell
from selfmotion.model.robot import RobotModel, mean_lever
from selfmotion.model.task import SE3, Relaxation, Task

# Share of a band that a motion put back into it uses.
_INSIDE = 0.999


@dataclass(frozen=True, eq=False, kw_only=True)
class AugmentedArm(RobotModel):
    """An arm with virtual joints after its own, which move nothing of it.

    Its model, links and chains are the arm's.

    Attributes
    ----------
    arm : RobotModel
    virtual : VirtualJoints
    """

    arm: RobotModel = field(repr=False)
    virtual: VirtualJoints = field(repr=False)

    @classmethod
    def of(cls, arm: RobotModel, virtual: VirtualJoints) -> "AugmentedArm":
        """Return an arm with virtual joints."""
        own = {one.name: getattr(arm, one.name) for one in fields(RobotModel)}
        limits = np.array([joint.limit for joint in virtual.each])
        free = np.full(len(limits), np.inf)
        more = {"lower": -limits, "upper": limits}
        for name in ("velocity_limit", "effort_limit", "acceleration_limit", "jerk_limit"):
            more[name] = free
        for name, values in more.items():
            own[name] = read_only(np.concatenate([own[name], values]))
        own["joint_names"] = (*arm.joint_names, *(joint.name for joint in virtual.each))
        return cls(**own, arm=arm, virtual=virtual)

    @property
    def is_revolute(self) -> Flags:
        """See `RobotModel`: of virtual joints, those that are back after a turn of 2π."""
        turns = [
            joint.turns and joint.scale == 1.0 and not joint.name.startswith("tilt")
            for joint in self.virtual.each
        ]
        return np.concatenate([self.arm.is_revolute, turns])

    @property
    @override
    def coordinate_sizes(self) -> Array:
        return np.append(self.arm.coordinate_sizes, [one.scale for one in self.virtual.each])

    @override
    def is_prismatic(self, joint: str) -> bool:
        own = {one.name: not one.turns for one in self.virtual.each}
        return own[joint] if joint in own else self.arm.is_prismatic(joint)

    def label(self, k: int) -> str:
        """See `RobotModel.label`: of virtual joints, the deviation that they allow."""
        number = k - self.arm.dof
        return self.arm.label(k) if number < 0 else self.virtual.label(number)

    @property
    def joint_weights(self) -> Array:
        """See `RobotModel.joint_weights`: a virtual metre or radian counts as one of the arm."""
        return np.concatenate(
            [self.arm.joint_weights, self.virtual.weights(1.0 / mean_lever(self.arm))]
        )

    def dexterous_configuration(self, task: Task | str = Task.POSE) -> Array:
        """See `RobotModel`: of the arm, with the virtual joints at 0."""
        none = np.zeros(len(self.virtual.each))
        return np.concatenate([self.arm.dexterous_configuration(task), none])


@dataclass(frozen=True, eq=False)
class AugmentedTaskFrames(Follows):
    """Task frames with virtual joints: their tip is on the path of the first tool.

    Attributes
    ----------
    virtual : VirtualJoints
    """

    virtual: VirtualJoints = field(kw_only=True)

    @classmethod
    def with_tolerances(
        cls, follows: Follows, relaxations: Sequence[Relaxation]
    ) -> "AugmentedTaskFrames":
        """Return the task frames of an arm with rows of its first path relaxed."""
        arm, (first, *others) = follows.robot, follows.items
        virtual = VirtualJoints(first.task, relaxations, follows.duration, mean_lever(arm))
        robot = AugmentedArm.of(arm, virtual)
        n, dof = arm.dof, robot.dof

        def bound(item: BoundTaskFrame, table: Array, task: Task) -> BoundTaskFrame:
            return BoundTaskFrame(TableChain(item.chain.tip_name, table, dof), item.path, task)

        items = [bound(first, virtual.table(first.chain, n), virtual.task)]
        items += [bound(item, item.chain.table, item.task) for item in others]
        alike = virtual.alike(n)
        if alike is not None:
            at_rest = Dwell(SE3.Identity(), follows.duration)
            items.append(BoundTaskFrame(TableChain("", alike, dof), at_rest, cast(Task, _Alike())))
        return cls(robot, tuple(items), virtual=virtual)

    @property
    def with_windows_shut(self) -> "AugmentedTaskFrames":
        """The same with joints of windows held at 0 at all times, for integrated motions."""
        none = np.zeros(self.robot.dof - len(self.virtual.each), dtype=np.bool_)
        held = np.append(none, self.virtual.windowed)

        def shut(item: BoundTaskFrame) -> BoundTaskFrame:
            own = item.chain
            return BoundTaskFrame(
                TableChain(own.tip_name, own.table, self.robot.dof, held), item.path, item.task
            )

        return replace(self, items=tuple(shut(item) for item in self.items))

    def deviation(self, item: Relaxation, q: Array) -> Array:
        """Return the deviations of a relaxation's rows at q (K, n), (K, k) [m, rad]."""
        return self.virtual.rows_of(item, q[:, self.robot.dof - len(self.virtual.each) :])[0]

    def limits_within(self, item: Relaxation, band: float = np.inf) -> Array:
        """Return limits of |q| (n,) beyond which a relaxation's rows are off their path too far.

        By more than a band, or by more than the relaxations let each of them be at any time.
        """
        found = np.full(self.robot.dof, np.inf)
        first = self.robot.dof - len(self.virtual.each)
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
        found, first = np.full_like(q, np.inf), self.robot.dof - len(self.virtual.each)
        for item in self.virtual.relaxations:
            band = self.virtual.widest(item.indices)
            if len(item.rows) == 1 or not np.isfinite(band):
                continue
            size = np.linalg.norm(self.deviation(item, q), axis=1)
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
        none = np.zeros((len(t), self.robot.dof - len(self.virtual.each)), dtype=np.bool_)
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
