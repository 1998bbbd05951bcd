"""The chain of an arm with virtual joints under it and behind its tool."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from typing_extensions import override

from selfmotion.basics import Array, Flags, Ints, kernel
from selfmotion.model.robot import JOINT, Chain, Kinematics, place_tips
from selfmotion.model.task import SE3


class ExtendedChain(Chain):
    """An arm's chain with joints that no URDF has; see `Chain`.

    Parameters
    ----------
    chain : Chain
        The arm's own.
    table : (c + 1, 6, 3)
        All joints, as in `ChainArrays.table`.
    dof : int
        Number of all coordinates, n.
    held : (n,) of bool, optional
        Coordinates that do not move the tip where motions are integrated; by default none.
    """

    def __init__(self, chain: Chain, table: Array, dof: int, held: Flags | None = None) -> None:
        super().__init__(chain.model, chain.tip, chain.base, chain.coupling)
        self._chain, self._table, self._dof = chain, table, dof
        self._held = np.zeros(dof, dtype=np.bool_) if held is None else held

    def __getstate__(self) -> Any:
        return self._chain, self._table, self._dof, self._held

    def with_held(self, held: Flags) -> "ExtendedChain":
        """Return the same with some coordinates held where motions are integrated, (n,)."""
        return ExtendedChain(self._chain, self._table, self._dof, held)

    @property
    @override
    def dof(self) -> int:
        return self._dof

    @property
    @override
    def table(self) -> Array:
        return self._table

    @property
    @override
    def joints(self) -> Ints:
        return np.array(list(dict.fromkeys(self._coordinates.tolist())), dtype=np.int64)

    @property
    def _coordinates(self) -> Ints:
        """Number of the coordinate of each joint of the chain."""
        return self._table[:-1, JOINT, 0].astype(np.int64)

    @override
    def kinematics(self, data: Any = None) -> Kinematics:
        table = self._table.copy()
        table[:-1, JOINT, 2] *= ~self._held[self._coordinates]
        return ExtendedKinematics(ExtendedChain(self._chain, table, self._dof), data)

    @override
    def place(self, q: Array) -> SE3:
        _, rotation, translation = self.at(q)
        return SE3(rotation, translation)

    @override
    def at(self, q: Array) -> tuple[Array, Array, Array]:
        jacobians, rotations, translations = self.along(q[None])
        return jacobians[0], rotations[0], translations[0]


class ExtendedKinematics(Kinematics):
    """`Kinematics` of an extended chain; its data are the configuration."""

    __slots__ = ("_at_tip", "_table")

    def __init__(self, chain: ExtendedChain, data: Any = None) -> None:
        n = chain.dof
        self.chain, self.data = chain, np.zeros(n) if data is None else data
        self.jacobian = np.zeros((6, n), order="F")
        self.rotation, self.translation = np.zeros((3, 3), order="F"), np.zeros(3)
        self._table = np.array(chain.table)[None]
        self._at_tip = np.zeros((1, 6, n)), np.empty((1, 3, 3)), np.empty((1, 3))

    @override
    def refresh(self, q: Array) -> None:
        self.data[:] = q
        self.place_frames()

    @override
    def place_frames(self) -> None:
        _place(self.data, self._table, *self._at_tip)
        _at_base(*self._at_tip, self.jacobian, self.rotation, self.translation)

    @override
    def march(
        self,
        q: Array,
        step: Callable[..., bool],
        *arguments: Any,
        beside: Sequence[Kinematics] = (),
    ) -> int | None:
        each = [self, *beside]
        for s, configuration in enumerate(q):
            self.data[:] = configuration
            for f, own in enumerate(each):
                own.place_frames()
                if not step(s, f, own.jacobian, own.rotation, own.translation, *arguments):
                    return s
        return None

    @override
    def at(self, q: Array) -> Array:
        self.data[:] = q
        return self.beside()

    @override
    def beside(self) -> Array:
        self.place_frames()
        return np.array(self._at_tip[0][0])


@kernel
def _place(q: Array, table: Array, jacobian: Array, rotation: Array, translation: Array) -> None:
    """Set where a tip is, (1, 3, 3) and (1, 3), and its Jacobian (1, 6, n), at q (n,)."""
    # Of all joints on the chain: those that mimic others share a coordinate.
    r, p = np.empty((table.shape[1], 3, 3)), np.empty((table.shape[1], 3))
    place_tips(q, table, r, p, rotation, translation, jacobian)


@kernel
def _at_base(
    at_tip: Array, turn: Array, place: Array, jacobian: Array, rotation: Array, translation: Array
) -> None:
    """Set the Jacobian (6, n) at the base's origin for that at the tip's, and where that is."""
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        translation[a] = place[0, a]
        for i in range(3):
            rotation[a, i] = turn[0, a, i]
        for k in range(at_tip.shape[2]):
            moved = at_tip[0, 3 + b, k] * place[0, c] - at_tip[0, 3 + c, k] * place[0, b]
            jacobian[a, k], jacobian[3 + a, k] = at_tip[0, a, k] - moved, at_tip[0, 3 + a, k]
