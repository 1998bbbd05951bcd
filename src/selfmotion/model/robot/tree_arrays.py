"""Joints that follow others, and trees and chains as arrays for compiled kinematics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, Flags, Ints, RobotError
from selfmotion.model.robot.urdf import Urdf

# Joints that mimic others: several joints of a model that are one coordinate of an arm.
#
# A model has N joints, an arm n ≤ N coordinates: q_model = C q + c, with a row of C for each
# joint of the model, in which one number is not 0 (``<mimic joint="…" multiplier="…"
# offset="…"/>``).


@dataclass(frozen=True, eq=False)
class Coupling:
    """Which coordinate moves each joint of a model, and how far.

    Attributes
    ----------
    coordinates : (N,)
        The coordinate of each joint.
    scales, offsets : (N,)
        A joint is at its scale times its coordinate, plus its offset [rad or m].
    """

    coordinates: Ints
    scales: Array
    offsets: Array

    @classmethod
    def plain(cls, count: int) -> Coupling:
        """Return that of a model whose joints are the coordinates."""
        return cls(np.arange(count, dtype=np.int64), np.ones(count), np.zeros(count))

    @cached_property
    def is_plain(self) -> bool:
        """Whether the joints are the coordinates."""
        count = len(self.coordinates)
        own = np.array_equal(self.coordinates, np.arange(count))
        return own and bool((self.scales == 1.0).all() and (self.offsets == 0.0).all())

    @cached_property
    def dof(self) -> int:
        """Number n of coordinates."""
        return int(self.coordinates.max()) + 1 if len(self.coordinates) else 0

    @cached_property
    def matrix(self) -> Array:
        """C, (N, n)."""
        found = np.zeros((len(self.coordinates), self.dof))
        found[np.arange(len(found)), self.coordinates] = self.scales
        return found

    @cached_property
    def masters(self) -> Ints:
        """The joint of the model that each coordinate is the position of, (n,)."""
        own = np.flatnonzero((self.scales == 1.0) & (self.offsets == 0.0))
        firsts = [own[self.coordinates[own] == k][0] for k in range(self.dof)]
        return np.array(firsts, dtype=np.int64)

    @cached_property
    def shared(self) -> Ints:
        """The joints of the model that have their coordinate together with others."""
        joints = np.bincount(self.coordinates, minlength=self.dof)
        return np.flatnonzero(joints[self.coordinates] > 1)

    def spread(self, q: Array) -> Array:
        """Return the positions of the model's joints (…, N) at q (…, n)."""
        if self.is_plain:
            return q
        return np.asarray(self.scales * q[..., self.coordinates] + self.offsets)

    def rates(self, qd: Array) -> Array:
        """Return the velocities, or accelerations, of the model's joints (…, N)."""
        return qd if self.is_plain else np.asarray(self.scales * qd[..., self.coordinates])

    def columns_by_coordinate(self, columns: Array) -> Array:
        """Return columns by the model's joints (…, N) as those by coordinates (…, n): ∂/∂q."""
        return columns if self.is_plain else np.asarray(columns @ self.matrix)

    def bounds(self, columns: Array) -> Array:
        """Return bounds on rates by the model's joints (…, N) as bounds by coordinates (…, n)."""
        return columns if self.is_plain else np.asarray(columns @ np.abs(self.matrix))


@dataclass(frozen=True)
class Mimic:
    """The joint that moves a joint, and how.

    Attributes
    ----------
    joint : str
        A joint that mimics none; the joint itself where it mimics none.
    scale, offset : float
        Its position is scale times that joint's, plus offset [rad or m].
    """

    joint: str
    scale: float = 1.0
    offset: float = 0.0


def mimic_of(urdf: Urdf, name: str) -> Mimic:
    """Return the joint that finally moves a joint, through joints that mimic each other."""
    scale, offset, joint = 1.0, 0.0, urdf.joints[name]
    while joint.mimics is not None:
        # x = a y + b of y = m z + d.
        offset += scale * joint.offset
        scale *= joint.multiplier
        joint = urdf.joints[joint.mimics]
    return Mimic(joint.name, scale, offset)


def coupling_of(names: Sequence[str], mimics: Mapping[str, Mimic]) -> Coupling:
    """Return the coupling of a model's joints, by their mimics."""
    masters = [name for name in names if mimics[name].joint == name]
    each = [mimics[name] for name in names]
    return Coupling(
        np.array([masters.index(item.joint) for item in each], dtype=np.int64),
        np.array([item.scale for item in each]),
        np.array([item.offset for item in each]),
    )


def tighter_limits(
    coupling: Coupling, lower: Array, upper: Array, names: Sequence[str], source: str
) -> tuple[Array, Array]:
    """Return limits (n,) of the coordinates that keep those of all their joints (N,).

    Raises
    ------
    RobotError
        Nothing is within all of them.
    """
    with np.errstate(invalid="ignore"):
        ends = (np.stack([lower, upper]) - coupling.offsets) / coupling.scales
    low, high = ends.min(axis=0), ends.max(axis=0)
    found = np.full((2, coupling.dof), np.inf)
    found[0] = -np.inf
    np.maximum.at(found[0], coupling.coordinates, low)
    np.minimum.at(found[1], coupling.coordinates, high)
    empty = np.flatnonzero(found[0] > found[1])
    if empty.size:
        k = int(empty[0])
        own = names[coupling.masters[k]]
        joints = [name for name, c in zip(names, coupling.coordinates, strict=True) if c == k]
        raise RobotError(
            f"{source}: joint '{own}' has no position within the limits of all that mimic it: "
            f"{', '.join(joints)}; mend their limits"
        )
    return found[0], found[1]


# Trees and chains as arrays, for compiled kinematics.

# Rows of a chain's table for a joint, (6, 3). Its coordinate, or -1 for the tip, whether it is
# revolute, and its motion [rad or m] per unit of the coordinate.
JOINT = 0
# Its axis.
AXIS = 1
# Its position in the frame of the joint before.
POSITION = 2
# First row of its orientation there.
ROTATION = 3


class TreeArrays(NamedTuple):
    """Arrays of c joints for compiled kinematics; see `placements`.

    Attributes
    ----------
    joints : (c,)
        Their coordinates.
    parents : (c,)
        The row that each is placed in: 0 the base, j + 1 that of joint j.
    rotations, positions : (c, 3, 3), (c, 3)
        Of each joint at q = 0 in the frame of the row before [m].
    axes : (c, 3)
        In the joints' own frames; turned round where a joint is passed from its far side.
    is_revolute : (c,)
    scales : (c,)
        By how much each turns or goes where its coordinate is 1 [rad or m].
    """

    joints: Ints
    parents: Ints
    rotations: Array
    positions: Array
    axes: Array
    is_revolute: Flags
    scales: Array


class ChainArrays(NamedTuple):
    """A chain's joints and its tip.

    Attributes
    ----------
    tree : TreeArrays
        Its joints from base to tip, each placed in the one before.
    tip_rotation, tip_position : (3, 3), (3,)
        Of the tip in the frame of the last joint [m].
    """

    tree: TreeArrays
    tip_rotation: Array
    tip_position: Array

    @property
    def table(self) -> Array:
        """Table of each joint, then of the tip, for compiled kinematics: (c + 1, 6, 3)."""
        tree, count = self.tree, len(self.tree.joints)
        found = np.zeros((count + 1, 6, 3))
        found[:, JOINT, 0] = [*tree.joints, -1.0]
        found[:count, JOINT, 1] = tree.is_revolute
        found[:count, JOINT, 2] = tree.scales
        found[:count, AXIS] = tree.axes
        found[:, POSITION] = [*tree.positions, self.tip_position]
        found[:, ROTATION:] = [*tree.rotations, self.tip_rotation]
        return found

    @property
    def link_lengths(self) -> Array:
        """Distance of each joint from the one before, and of the tip, (c + 1,) [m]."""
        return np.asarray(np.linalg.norm([*self.tree.positions, self.tip_position], axis=1))


def tree_arrays(model: Any, coupling: Coupling) -> TreeArrays:
    """Return the arrays of all joints of a model for compiled kinematics, in the world."""
    joints, places = np.arange(model.nv, dtype=np.int64), list(model.jointPlacements)[1:]
    parents = list(model.parents)[1:]
    return serial_arrays(model, coupling, joints, parents, places, np.ones(model.nv))


def serial_arrays(
    model: Any,
    coupling: Coupling,
    joints: Ints,
    parents: npt.ArrayLike,
    places: Sequence[pin.SE3],
    signs: Array,
) -> TreeArrays:
    """Return the arrays of some joints with their parents and places; -1 turns an axis round.

    Where a joint is when its coordinate is 0 is part of its place.
    """
    data = model.createData()
    # Columns [v, ω] at the world's origin; of one joint Pinocchio returns a vector.
    columns = pin.computeJointJacobians(model, data, pin.neutral(model)).reshape(6, -1).T
    twists = [data.oMi[int(j) + 1].actInv(pin.Motion(columns[j])) for j in joints]
    is_revolute = [bool(np.any(twist.angular)) for twist in twists]
    axes = [
        signs[j] * np.array(twist.angular if turns else twist.linear)
        for j, twist, turns in zip(joints, twists, is_revolute, strict=True)
    ]
    places = [
        place if offset == 0.0 else place * _moved(axis, turns, offset)
        for place, axis, turns, offset in zip(
            places, axes, is_revolute, coupling.offsets[joints], strict=True
        )
    ]
    return TreeArrays(
        np.array(coupling.coordinates[joints], dtype=np.int64),
        np.array(parents, dtype=np.int64),
        np.array([place.rotation for place in places]).reshape(-1, 3, 3),
        np.array([place.translation for place in places]).reshape(-1, 3),
        np.array(axes).reshape(-1, 3),
        np.array(is_revolute, dtype=np.bool_),
        np.array(coupling.scales[joints], dtype=np.float64),
    )


def _moved(axis: Array, turns: bool, by: float) -> pin.SE3:
    """Return the placement by a joint's motion."""
    if turns:
        return pin.SE3(pin.exp3(by * axis), np.zeros(3))
    return pin.SE3(np.eye(3), by * axis)
