"""Chains that are given by their tables alone: joints that no URDF has are on them."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from selfmotion.basics import Array, Flags, Ints
from selfmotion.robot import Chain, Kinematics, place_tips
from selfmotion.robot.tree_arrays import JOINT
from selfmotion.task import SE3


class TableChain(Chain):
    """The joints of a table, from a base to a tip; see `Chain`.

    Parameters
    ----------
    name : str
        Of the tip.
    table : (c + 1, 6, 3)
        See `ChainArrays.table`.
    dof : int
        Number of all coordinates, n.
    held : (n,) of bool, optional
        Coordinates that do not move the tip where motions are integrated; by default none.
    """

    def __init__(self, name: str, table: Array, dof: int, held: Flags | None = None) -> None:
        super().__init__(None, 0)
        self._name, self._table, self._dof = name, table, dof
        self._held = np.zeros(dof, dtype=np.bool_) if held is None else held

    def __getstate__(self) -> Any:
        return self._name, self._table, self._dof, self._held

    @property
    def dof(self) -> int:
        """See `Chain.dof`."""
        return self._dof

    @property
    def tip_name(self) -> str:
        """See `Chain.tip_name`."""
        return self._name

    @property
    def table(self) -> Array:
        """See `Chain.table`."""
        return self._table

    @property
    def joints(self) -> Ints:  # type: ignore[override]  # what is cached there is cheap here
        """See `Chain.joints`."""
        return self._table[:-1, JOINT, 0].astype(np.int64)

    def kinematics(self, data: Any = None) -> Kinematics:
        """See `Chain.kinematics`: with `held` coordinates at rest."""
        table = self._table.copy()
        table[:-1, JOINT, 2] *= ~self._held[self.joints]
        return TableKinematics(TableChain(self._name, table, self._dof), data)

    def place(self, q: Array) -> SE3:
        """See `Chain.place`."""
        _, rotation, translation = self.at(q)
        return SE3(rotation, translation)

    def at(self, q: Array) -> tuple[Array, Array, Array]:
        """See `Chain.at`."""
        jacobians, rotations, translations = self.along(q[None])
        return jacobians[0], rotations[0], translations[0]


class TableKinematics(Kinematics):
    """What `Kinematics` are to other chains; its data are the configuration."""

    __slots__ = ("_places", "_tip_jacobian", "_turns")

    def __init__(self, chain: TableChain, data: Any = None) -> None:
        n = chain.dof
        self.chain, self.data = chain, np.zeros(n) if data is None else data
        self.jacobian = np.zeros((6, n), order="F")
        self.rotation, self.translation = np.zeros((3, 3), order="F"), np.zeros(3)
        self._tip_jacobian = np.zeros((1, 6, n))
        self._turns, self._places = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))

    def refresh(self, q: Array) -> None:
        """See `Kinematics.refresh`."""
        self.data[:] = q
        self.place_frames()

    def place_frames(self) -> None:
        """See `Kinematics.place_frames`."""
        rotation, translation = np.empty((1, 3, 3)), np.empty((1, 3))
        table = self.chain.table[None]
        given = self._turns, self._places, rotation, translation, self._tip_jacobian
        place_tips(self.data, table, *given)
        self.rotation[:], self.translation[:] = rotation[0], translation[0]
        own = self._tip_jacobian[0]
        self.jacobian[:3] = own[:3] - np.cross(own[3:].T, translation[0]).T
        self.jacobian[3:] = own[3:]

    def march(
        self,
        q: Array,
        step: Callable[..., bool],
        *arguments: Any,
        beside: Sequence[Kinematics] = (),
    ) -> int | None:
        """See `Kinematics.march`."""
        each = [self, *beside]
        for s, configuration in enumerate(q):
            self.data[:] = configuration
            for f, own in enumerate(each):
                own.place_frames()
                if not step(s, f, own.jacobian, own.rotation, own.translation, *arguments):
                    return s
        return None

    def at(self, q: Array) -> Array:
        """See `Kinematics.at`."""
        self.data[:] = q
        return self.beside()

    def beside(self) -> Array:
        """See `Kinematics.beside`."""
        self.place_frames()
        return self._tip_jacobian[0].copy()
