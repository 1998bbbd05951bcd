"""A chain of a tree: from a base frame to a tip frame, the one place that places the tip.

In Pinocchio's world Jacobian of all joints, column j is the twist [v0, ω] of all that joint j
moves, v0 at the world's origin. Relative to a base frame that joints move as well,

    J_j = s_j Rᵀ [v0_j + ω_j × p; ω_j],

with R the base frame's orientation, p the tip's position, and s_j = 1 where joint j moves the tip,
-1 where it moves the base; joints that move both or none drop out.
"""

import threading
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from selfmotion.basics import Array, Ints
from selfmotion.model.robot.mimic import Coupling
from selfmotion.model.robot.placements import place_along, rebase
from selfmotion.model.robot.tree_arrays import JOINT, ChainArrays, serial_arrays

# Number of the world's frame.
WORLD = 0
_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class Kinematics:
    """A chain's Jacobian and pose by Pinocchio, with data of its own.

    The one class with these calls: another library would be one class like it. Two of them may be
    used by two threads at once; one may not.

    Parameters
    ----------
    chain : Chain
    data : pinocchio.Data, optional
        Those of another chain of the tree, to be shared.

    Attributes
    ----------
    jacobian : (6, n)
        [v, ω] of the tip's body at the base's origin, in its axes.
    rotation, translation : (3, 3), (3,)
        The tip's pose in the base frame at the last configuration: views of memory that each call
        of `at` refreshes.
    """

    __slots__ = (
        *("_base", "_every", "_tip", "_world"),
        *("chain", "data", "jacobian", "rotation", "translation"),
    )

    def __init__(self, chain: "Chain", data: Any = None) -> None:
        self.chain, self.data = chain, data or chain.model.createData()
        tip, base = self.data.oMf[chain.tip], self.data.oMf[chain.base]
        self._tip, self._base = (tip.rotation, tip.translation), (base.rotation, base.translation)
        # Views of Pinocchio's own memory; of a single joint it comes as a vector.
        self._world: Array = self.data.J.reshape(6, -1)
        if chain.is_rooted:
            self.jacobian: Array = self._world
            self.rotation, self.translation = self._tip
        else:
            self.jacobian = np.zeros((6, chain.dof), order="F")
            self.rotation, self.translation = np.zeros((3, 3), order="F"), np.zeros(3)
        # Columns of all joints of the model, of which some may mimic others.
        is_plain = chain.coupling.is_plain
        self._every = self.jacobian if is_plain else np.zeros((6, chain.model.nv), order="F")

    def refresh(self, q: Array) -> None:
        """Set the tip's pose at q (n,), and `jacobian` (6, n), [v, ω] at the base's origin."""
        pin.computeJointJacobians(self.chain.model, self.data, self.chain.coupling.spread(q))
        self.place_frames()

    def place_frames(self) -> None:
        """Do the rest of `refresh` where the joints' Jacobians are known already."""
        chain = self.chain
        pin.updateFramePlacement(chain.model, self.data, chain.tip)
        if not chain.is_rooted:
            pin.updateFramePlacement(chain.model, self.data, chain.base)
            rebase(
                self._world,
                *self._base,
                *self._tip,
                chain.signs,
                self._every,
                self.rotation,
                self.translation,
            )
            if not chain.coupling.is_plain:
                self.jacobian[:] = chain.coupling.columns_by_coordinate(self._every)

    def march(
        self,
        q: Array,
        step: Callable[..., bool],
        *arguments: Any,
        beside: Sequence["Kinematics"] = (),
    ) -> int | None:
        """Place tips at each of q (S, n), call ``step(s, f, jacobian, rotation, translation, …)``.

        For this tip and those `beside` it, f = 0, 1, …, which share its data; the last step may set
        the next row of q. Returns the first s at which a step returned False.
        """
        chain, data, others = self.chain, self.data, list(enumerate(beside, 1))
        jacobian, rotation, translation = self.jacobian, self.rotation, self.translation
        # Written out: in this loop the engine spends its time.
        model, tip, is_rooted = chain.model, chain.tip, chain.is_rooted
        jacobians, place = pin.computeJointJacobians, pin.updateFramePlacement
        coupling = None if chain.coupling.is_plain else chain.coupling
        for s, configuration in enumerate(q):
            at = configuration if coupling is None else coupling.spread(configuration)
            jacobians(model, data, at)
            if is_rooted:
                place(model, data, tip)
            else:
                self.place_frames()
            if not step(s, 0, jacobian, rotation, translation, *arguments):
                return s
            for f, own in others:
                own.place_frames()
                if not step(s, f, own.jacobian, own.rotation, own.translation, *arguments):
                    return s
        return None

    def at(self, q: Array) -> Array:
        """Return the Jacobian at q (n,), (6, n): rows [v, ω] of the tip in the base's axes."""
        pin.computeJointJacobians(self.chain.model, self.data, self.chain.coupling.spread(q))
        return self.beside()

    def beside(self) -> Array:
        """Return the same for data that are of the configuration already."""
        self.place_frames()
        chain = self.chain
        if chain.is_rooted:
            jacobian: Array = pin.getFrameJacobian(chain.model, self.data, chain.tip, _AXES)
            # Of a single joint it comes as a vector.
            return jacobian.reshape(6, -1)
        jacobian = self.jacobian.copy()
        jacobian[:3] += np.cross(jacobian[3:].T, self.translation).T
        return jacobian

    def place(self, q: Array) -> pin.SE3:
        """Return the tip's pose at q (n,), a copy; cheaper than with its Jacobian."""
        chain = self.chain
        pin.forwardKinematics(chain.model, self.data, chain.coupling.spread(q))
        tip = pin.updateFramePlacement(chain.model, self.data, chain.tip)
        if chain.is_rooted:
            return pin.SE3(tip)
        base = pin.updateFramePlacement(chain.model, self.data, chain.base)
        return base.actInv(tip)


class Chain:
    """The joints between a base frame and a tip frame of a tree.

    Poses and Jacobians are those of the tip in the base frame, in its axes. A value: threads may
    share it.

    Parameters
    ----------
    model : pinocchio.Model
        The tree, one coordinate for each joint.
    tip, base : int
        Frames of the model.
    coupling : Coupling, optional
        Which joints mimic others; by default none.
    """

    def __init__(
        self, model: Any, tip: int, base: int = WORLD, coupling: Coupling | None = None
    ) -> None:
        self.model, self.tip, self.base = model, tip, base
        self.coupling = Coupling.plain(model.nv if model else 0) if coupling is None else coupling
        self._per_thread = threading.local()

    def __getstate__(self) -> tuple[Any, int, int, Coupling]:
        return self.model, self.tip, self.base, self.coupling

    def __setstate__(self, state: tuple[Any, int, int, Coupling]) -> None:
        # Data of a thread are not sent to another process.
        self.__init__(*state)  # type: ignore[misc]

    @property
    def dof(self) -> int:
        """Number n of the tree's coordinates: the length of configurations."""
        return self.coupling.dof

    @property
    def is_rooted(self) -> bool:
        """Whether the base is the world, all joints are on the chain, and none mimics one."""
        return self.base == WORLD and self.coupling.is_plain and len(self.joints) == self.dof

    def to_base(self) -> "Chain":
        """Return the chain from the world to the base frame."""
        return Chain(self.model, self.base, WORLD, self.coupling)

    @property
    def carrier(self) -> int:
        """The joint of the model that carries the base frame, from 0 on; -1 for the world."""
        return int(self.model.frames[self.base].parentJoint) - 1

    @property
    def base_placement(self) -> pin.SE3:
        """The base frame in that of the joint that carries it."""
        return pin.SE3(self.model.frames[self.base].placement)

    @property
    def tip_name(self) -> str:
        """Name of the tip's frame."""
        return str(self.model.frames[self.tip].name)

    def kinematics(self, data: Any = None) -> Kinematics:
        """Return the chain's kinematics, for repeated calls.

        With data of their own, or those of another chain of the tree.
        """
        return Kinematics(self, data)

    @property
    def own(self) -> Kinematics:
        """The kinematics of this thread alone."""
        found: Kinematics | None = getattr(self._per_thread, "kinematics", None)
        if found is None:
            found = self._per_thread.kinematics = self.kinematics()
        return found

    def place(self, q: Array) -> pin.SE3:
        """Return the tip's pose at q (n,), which is not checked."""
        return self.own.place(q)

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """Return Jacobian (6, n), rotation (3, 3) and translation (3,) at q (n,), unchecked."""
        own = self.own
        return own.at(q), np.array(own.rotation), np.array(own.translation)

    def along(self, q: Array) -> tuple[Array, Array, Array]:
        """Return the same at configurations (K, n): (K, 6, n), (K, 3, 3) and (K, 3)."""
        jacobians = np.zeros((len(q), 1, 6, self.dof))
        rotations, translations = np.empty((len(q), 1, 3, 3)), np.empty((len(q), 1, 3))
        # A copy: kernels would be compiled again for read-only arrays.
        place_along(np.array(q), self.table[None], jacobians, rotations, translations)
        return jacobians[:, 0], rotations[:, 0], translations[:, 0]

    def rooted(self) -> tuple[Any, int]:
        """Return a model in which the base is the world, and the tip's frame there.

        Its joints are those of `model_joints`, in this order.
        """
        if self.base == WORLD and len(self.model_joints) == self.model.nv:
            return self.model, self.tip
        # Offsets of joints that mimic are in their positions, not in their places.
        model, (tree, rotation, position) = pin.Model(), self._arrays(plain=True)
        parent = 0
        for j in range(len(tree.joints)):
            kind = (
                pin.JointModelRevoluteUnaligned
                if tree.is_revolute[j]
                else (pin.JointModelPrismaticUnaligned)
            )
            place = pin.SE3(tree.rotations[j], tree.positions[j])
            parent = model.addJoint(parent, kind(tree.axes[j]), place, str(j))
        place = pin.SE3(rotation, position)
        return model, model.addFrame(pin.Frame("tip", parent, 0, place, pin.FrameType.OP_FRAME))

    @cached_property
    def joints(self) -> Ints:
        """Coordinates of the chain's joints, from base to tip, each once."""
        passed = self.coupling.coordinates[self.model_joints].tolist()
        return np.array(list(dict.fromkeys(passed)), dtype=np.int64)

    @cached_property
    def model_joints(self) -> Ints:
        """The chain's joints among those of the model, from base to tip, (c,)."""
        return np.array([joint - 1 for joint, _ in self._passed], dtype=np.int64)

    @cached_property
    def is_coupled(self) -> bool:
        """Whether joints of the chain share a coordinate."""
        return len(self.joints) < len(self.table) - 1

    @cached_property
    def coordinates(self) -> Ints:
        """The coordinate of each joint of the chain, (c,)."""
        return self.table[:-1, JOINT, 0].astype(np.int64)

    def every_along(self, q: Array) -> Array:
        """Return the tip's Jacobian by each joint of the chain at q (K, n), (K, 6, c).

        Each times its scale, so that those of a coordinate add up to its column.
        """
        count = len(self.coordinates)
        jacobians = np.zeros((len(q), 1, 6, count))
        rotations, translations = np.empty((len(q), 1, 3, 3)), np.empty((len(q), 1, 3))
        own = np.ascontiguousarray(q[:, self.coordinates])
        place_along(own, self._uncoupled, jacobians, rotations, translations)
        return jacobians[:, 0]

    @cached_property
    def _uncoupled(self) -> Array:
        """Its table where each joint has a coordinate of its own, (1, c + 1, 6, 3)."""
        table = self.table.copy()
        table[:-1, JOINT, 0] = np.arange(len(table) - 1)
        return table[None]

    @cached_property
    def signs(self) -> Array:
        """1 for joints that move the tip, -1 for those that move the base, 0 for both or none.

        Of all joints of the model, (N,).
        """
        signs = np.zeros(self.model.nv)
        for joint, sign in self._passed:
            signs[joint - 1] = sign
        return signs

    @cached_property
    def _passed(self) -> list[tuple[int, int]]:
        """Joints from base to tip, -1 where one is passed from its far side."""
        frames, supports = self.model.frames, self.model.supports
        up, down = (list(supports[frames[frame].parentJoint]) for frame in (self.base, self.tip))
        both = sum(1 for a, b in zip(up, down, strict=False) if a == b) - 1
        return [(joint, -1) for joint in up[:both:-1]] + [(joint, 1) for joint in down[both + 1 :]]

    @cached_property
    def table(self) -> Array:
        """Table of its joints and tip for compiled kinematics, (c + 1, 6, 3)."""
        return self.arrays.table

    @cached_property
    def arrays(self) -> ChainArrays:
        """Its joints and its tip as arrays."""
        return self._arrays()

    def _arrays(self, plain: bool = False) -> ChainArrays:
        """Return them, or those of the model's joints where `plain`."""
        coupling = Coupling.plain(self.model.nv) if plain else self.coupling
        model, frames = self.model, self.model.frames
        place = frames[self.base].placement.inverse()
        places = []
        for joint, sign in self._passed:
            if sign > 0:
                place = place * model.jointPlacements[joint]
            places.append(place)
            place = pin.SE3.Identity() if sign > 0 else model.jointPlacements[joint].inverse()
        place = place * frames[self.tip].placement
        return ChainArrays(
            serial_arrays(
                model,
                coupling,
                self.model_joints,
                np.arange(len(self.model_joints)),
                places,
                self.signs,
            ),
            np.array(place.rotation),
            np.array(place.translation),
        )


def null_space(jacobians: Array) -> Array:
    """Return orthonormal null-space bases of matrices (…, m, n) of rank m ≤ n, (…, n, n - m).

    The last right singular vectors; their signs and order are arbitrary.
    """
    rows = jacobians.shape[-2]
    _, _, right = np.linalg.svd(jacobians)
    return np.asarray(np.swapaxes(right[..., rows:, :], -1, -2))
