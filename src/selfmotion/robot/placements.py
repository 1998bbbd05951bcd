"""Where joints are, compiled: for many configurations at once, of which Python would ask singly."""

import math

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel


@inlined
def turned(axis: Array, angle: float, rotation: Array) -> None:
    """Write the rotation by an angle about a unit vector (Rodrigues' formula)."""
    s, c = math.sin(angle), math.cos(angle)
    x, y, z, rest = axis[0], axis[1], axis[2], 1.0 - c
    for a in range(3):
        for b in range(3):
            rotation[a, b] = axis[a] * axis[b] * rest
        rotation[a, a] += c
    rotation[0, 1] -= z * s
    rotation[1, 0] += z * s
    rotation[0, 2] += y * s
    rotation[2, 0] -= y * s
    rotation[1, 2] -= x * s
    rotation[2, 1] += x * s


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
    r: Array,
    p: Array,
) -> None:
    """Write where q (n,) places the joints of a tree: (c + 1, 3, 3) and (c + 1, 3).

    Row 0 is the base. Each joint has a coordinate, `joints` (c,), a place in the frame of another
    row, `parents` (c,), which is (c, 3, 3) and (c, 3), and an axis in its own, (c, 3).
    """
    # Loops, here and in all kernels: for an array assigned to a slice of another, numba compiles
    # for seconds what NumPy says of shapes that differ.
    turn, middle, shift, slide = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    for a in range(3):
        p[0, a] = 0.0
        for b in range(3):
            r[0, a, b] = 1.0 if a == b else 0.0
    for j in range(len(joints)):
        x, before = q[joints[j]], parents[j]
        compose(r[before], p[before], rotations[j], positions[j], middle, shift)
        turned(axes[j], x if is_revolute[j] else 0.0, turn)
        for a in range(3):
            slide[a] = 0.0 if is_revolute[j] else x * axes[j, a]
        compose(middle, shift, turn, slide, r[j + 1], p[j + 1])


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
