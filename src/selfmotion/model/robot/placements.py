"""Compiled kinematics: poses of joints and tips at many configurations at once."""

import math

import numpy as np

from selfmotion.basics import Array, Flags, Ints, called, inlined, kernel
from selfmotion.model.robot.tree_arrays import AXIS, JOINT, POSITION, ROTATION


@inlined
def moved(axis: Array, x: float, turns: bool, r: Array, p: Array) -> None:
    """Turn a placement by x about a unit vector in its own axes (Rodrigues' formula), or shift it.

    Numbers, no arrays to work in: making one takes as long as all of this.
    """
    u, v, w = axis[0], axis[1], axis[2]
    s, c = math.sin(x), math.cos(x)
    for a in range(3):
        first, second, third = r[a, 0], r[a, 1], r[a, 2]
        along = first * u + second * v + third * w
        if turns:
            rest = (1.0 - c) * along
            r[a, 0] = c * first + rest * u + s * (second * w - third * v)
            r[a, 1] = c * second + rest * v + s * (third * u - first * w)
            r[a, 2] = c * third + rest * w + s * (first * v - second * u)
        else:
            p[a] += x * along


@inlined
def compose(first: Array, at: Array, second: Array, there: Array, r: Array, p: Array) -> None:
    """Write the product of two placements."""
    for a in range(3):
        x, y, z = first[a, 0], first[a, 1], first[a, 2]
        p[a] = at[a] + x * there[0] + y * there[1] + z * there[2]
        for b in range(3):
            r[a, b] = x * second[0, b] + y * second[1, b] + z * second[2, b]


@inlined
def placements(
    q: Array,
    joints: Ints,
    parents: Ints,
    rotations: Array,
    positions: Array,
    axes: Array,
    is_revolute: Flags,
    scales: Array,
    r: Array,
    p: Array,
) -> None:
    """Write where q (n,) places the joints of a tree: (c + 1, 3, 3) and (c + 1, 3).

    Row 0 is the base. Each joint has a coordinate, `joints` (c,), times its scale, a place in the
    frame of another row, `parents` (c,), which is (c, 3, 3) and (c, 3), and an axis in its own,
    (c, 3).
    """
    # Loops, here and in all kernels: for an array assigned to a slice of another, numba compiles
    # NumPy's message about different shapes, which takes seconds.
    for a in range(3):
        p[0, a] = 0.0
        for b in range(3):
            r[0, a, b] = 1.0 if a == b else 0.0
    for j in range(len(joints)):
        before = parents[j]
        compose(r[before], p[before], rotations[j], positions[j], r[j + 1], p[j + 1])
        moved(axes[j], q[joints[j]] * scales[j], is_revolute[j], r[j + 1], p[j + 1])


@kernel
def rebase(
    world: Array,
    base_rotation: Array,
    base: Array,
    tip_rotation: Array,
    tip: Array,
    signs: Array,
    jacobian: Array,
    rotation: Array,
    translation: Array,
) -> None:
    """Set a tip's Jacobian at a base frame's origin, and its pose, in the base frame's axes.

    From the Jacobian `world` (6, n) of all joints at the world's origin, both frames' places in the
    world, and which joints move which of them; see `Chain`.
    """
    for i in range(3):
        translation[i] = 0.0
        for a in range(3):
            translation[i] += base_rotation[a, i] * (tip[a] - base[a])
            rotation[i, a] = 0.0
            for b in range(3):
                rotation[i, a] += base_rotation[b, i] * tip_rotation[b, a]
    moving = np.empty(3)
    for k in range(world.shape[1]):
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            moving[a] = world[a, k] + world[3 + b, k] * base[c] - world[3 + c, k] * base[b]
        for i in range(3):
            linear, angular = 0.0, 0.0
            for a in range(3):
                linear += base_rotation[a, i] * moving[a]
                angular += base_rotation[a, i] * world[3 + a, k]
            jacobian[i, k], jacobian[3 + i, k] = signs[k] * linear, signs[k] * angular


@kernel
def place_along(
    q: Array, chains: Array, jacobians: Array, rotations: Array, positions: Array
) -> None:
    """Set tips' Jacobians (K, F, 6, n) and places (K, F, 3, 3), (K, F, 3) at each of q (K, n)."""
    r, p = np.empty((chains.shape[1], 3, 3)), np.empty((chains.shape[1], 3))
    for k in range(len(q)):
        place_tips(q[k], chains, r, p, rotations[k], positions[k], jacobians[k])


@called
def place_tips(
    q: Array,
    chains: Array,
    r: Array,
    p: Array,
    rotations: Array,
    positions: Array,
    jacobians: Array,
) -> None:
    """Set the places of all tips, (F, 3, 3) and (F, 3), and their Jacobians (F, 6, n), at q (n,).

    Poses are in the tips' bases, Jacobians [v, ω] at the tips' origins; columns of joints that are
    not on a chain stay as they are. `chains` (F, c + 1, 6, 3) are as `ChainArrays.table` has them;
    `r` (c + 1, 3, 3) and `p` (c + 1, 3) are to work in.
    """
    for f in range(len(chains)):
        for a in range(3):
            p[0, a] = 0.0
            for b in range(3):
                r[0, a, b] = 1.0 if a == b else 0.0
        last = 0
        while chains[f, last, JOINT, 0] >= 0.0:
            own = chains[f, last]
            compose(r[last], p[last], own[ROTATION:], own[POSITION], r[last + 1], p[last + 1])
            last += 1
            x, turns = q[int(own[JOINT, 0])] * own[JOINT, 2], own[JOINT, 1] > 0.0
            moved(own[AXIS], x, turns, r[last], p[last])
        own = chains[f, last]
        compose(r[last], p[last], own[ROTATION:], own[POSITION], rotations[f], positions[f])
        _jacobian(r, p, chains[f], last, positions[f], jacobians[f])


@inlined
def _jacobian(r: Array, p: Array, chain: Array, joints: int, tip: Array, jacobian: Array) -> None:
    """Write the columns of a tip's Jacobian [v, ω] (6, n) at its origin, in the base's axes."""
    # Joints that mimic each other share a column.
    for j in range(joints):
        column = int(chain[j, JOINT, 0])
        for a in range(6):
            jacobian[a, column] = 0.0
    for j in range(joints):
        column, axis = int(chain[j, JOINT, 0]), chain[j, AXIS]
        size = chain[j, JOINT, 2]
        u, v, w = size * axis[0], size * axis[1], size * axis[2]
        x = r[j + 1, 0, 0] * u + r[j + 1, 0, 1] * v + r[j + 1, 0, 2] * w
        y = r[j + 1, 1, 0] * u + r[j + 1, 1, 1] * v + r[j + 1, 1, 2] * w
        z = r[j + 1, 2, 0] * u + r[j + 1, 2, 1] * v + r[j + 1, 2, 2] * w
        if chain[j, JOINT, 1] > 0.0:
            a, b, c = tip[0] - p[j + 1, 0], tip[1] - p[j + 1, 1], tip[2] - p[j + 1, 2]
            jacobian[0, column] += y * c - z * b
            jacobian[1, column] += z * a - x * c
            jacobian[2, column] += x * b - y * a
            jacobian[3, column] += x
            jacobian[4, column] += y
            jacobian[5, column] += z
        else:
            jacobian[0, column] += x
            jacobian[1, column] += y
            jacobian[2, column] += z
