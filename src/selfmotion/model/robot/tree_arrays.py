"""Trees and chains as arrays, for compiled kinematics."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from selfmotion.basics import Array, Flags, Ints
from selfmotion.model.robot.mimic import Coupling

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
