"""Where tips are, compiled: for many configurations at once, of which Python would ask singly."""

import numpy as np

from selfmotion.basics import Array, inlined, kernel
from selfmotion.robot.placements import compose, placements
from selfmotion.robot.tree_arrays import ChainArrays, TreeArrays


@kernel
def place_along(
    q: Array, chain: ChainArrays, jacobians: Array, rotations: Array, positions: Array
) -> None:
    """Set a tip's Jacobians (K, 6, n) and places (K, 3, 3), (K, 3) at each of q (K, n)."""
    n = q.shape[1]
    r, p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    for k in range(len(q)):
        place_tip(q[k], chain, r, p, rotations[k], positions[k], jacobians[k])


@inlined
def place_tips(
    q: Array,
    chains: tuple[ChainArrays, ...],
    r: Array,
    p: Array,
    rotations: Array,
    positions: Array,
    jacobians: Array,
) -> None:
    """Set the places of all tips, (F, 3, 3) and (F, 3), and their Jacobians (F, 6, n), at q (n,).

    `r` (n + 1, 3, 3) and `p` (n + 1, 3) are to work in.
    """
    for f in range(len(chains)):
        place_tip(q, chains[f], r, p, rotations[f], positions[f], jacobians[f])


@kernel
def place_tip(
    q: Array,
    chain: ChainArrays,
    r: Array,
    p: Array,
    rotation: Array,
    position: Array,
    jacobian: Array,
) -> None:
    """Set a tip's place in its base, and its Jacobian [v, ω] (6, n) at its origin, at q (n,).

    Columns of joints that are not on the chain stay as they are.
    """
    tree, tip_rotation, tip_position = chain
    placements(
        q,
        tree.joints,
        tree.parents,
        tree.rotations,
        tree.positions,
        tree.axes,
        tree.is_revolute,
        r,
        p,
    )
    last = len(tree.joints)
    compose(r[last], p[last], tip_rotation, tip_position, rotation, position)
    _jacobian(r, p, tree, position, jacobian)


@inlined
def _jacobian(r: Array, p: Array, tree: TreeArrays, tip: Array, jacobian: Array) -> None:
    """Write the columns of a tip's Jacobian [v, ω] (6, n) at its origin, in the base's axes."""
    for j in range(len(tree.joints)):
        column = tree.joints[j]
        u, v, w = tree.axes[j, 0], tree.axes[j, 1], tree.axes[j, 2]
        x = r[j + 1, 0, 0] * u + r[j + 1, 0, 1] * v + r[j + 1, 0, 2] * w
        y = r[j + 1, 1, 0] * u + r[j + 1, 1, 1] * v + r[j + 1, 1, 2] * w
        z = r[j + 1, 2, 0] * u + r[j + 1, 2, 1] * v + r[j + 1, 2, 2] * w
        if tree.is_revolute[j]:
            a, b, c = tip[0] - p[j + 1, 0], tip[1] - p[j + 1, 1], tip[2] - p[j + 1, 2]
            jacobian[0, column] = y * c - z * b
            jacobian[1, column] = z * a - x * c
            jacobian[2, column] = x * b - y * a
            jacobian[3, column], jacobian[4, column], jacobian[5, column] = x, y, z
        else:
            jacobian[0, column], jacobian[1, column], jacobian[2, column] = x, y, z
            jacobian[3, column], jacobian[4, column], jacobian[5, column] = 0.0, 0.0, 0.0
