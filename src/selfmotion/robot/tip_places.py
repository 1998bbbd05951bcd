"""Where tips are, compiled: for many configurations at once, of which Python would ask singly."""

import numpy as np

from selfmotion.basics import Array, called, inlined, kernel
from selfmotion.robot.placements import compose, moved
from selfmotion.robot.tree_arrays import AXIS, JOINT, POSITION, ROTATION


@kernel
def place_along(
    q: Array, chains: Array, jacobians: Array, rotations: Array, positions: Array
) -> None:
    """Set tips' Jacobians (K, F, 6, n) and places (K, F, 3, 3), (K, F, 3) at each of q (K, n)."""
    n = q.shape[1]
    r, p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
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
    `r` (n + 1, 3, 3) and `p` (n + 1, 3) are to work in.
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
    for j in range(joints):
        column, axis = int(chain[j, JOINT, 0]), chain[j, AXIS]
        size = chain[j, JOINT, 2]
        u, v, w = size * axis[0], size * axis[1], size * axis[2]
        x = r[j + 1, 0, 0] * u + r[j + 1, 0, 1] * v + r[j + 1, 0, 2] * w
        y = r[j + 1, 1, 0] * u + r[j + 1, 1, 1] * v + r[j + 1, 1, 2] * w
        z = r[j + 1, 2, 0] * u + r[j + 1, 2, 1] * v + r[j + 1, 2, 2] * w
        if chain[j, JOINT, 1] > 0.0:
            a, b, c = tip[0] - p[j + 1, 0], tip[1] - p[j + 1, 1], tip[2] - p[j + 1, 2]
            jacobian[0, column] = y * c - z * b
            jacobian[1, column] = z * a - x * c
            jacobian[2, column] = x * b - y * a
            jacobian[3, column], jacobian[4, column], jacobian[5, column] = x, y, z
        else:
            jacobian[0, column], jacobian[1, column], jacobian[2, column] = x, y, z
            jacobian[3, column], jacobian[4, column], jacobian[5, column] = 0.0, 0.0, 0.0
