"""Where joints are, compiled: for many configurations at once, of which Python would ask singly."""

import math

import numpy as np

from selfmotion.basics import Array, Flags, Ints, inlined, kernel


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
    # for seconds what NumPy says of shapes that differ.
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
