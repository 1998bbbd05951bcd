"""All pairs of all samples: distances of capsules, and the pullback to joint space."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, kernel
from selfmotion.collision.segments import (
    Contact,
    Vector,
    blend,
    cross,
    segment_box,
    segment_cylinder,
    segment_segment,
)

Ints = npt.NDArray[np.int64]

# Cores of the obstacles: `dimensions` holds half lengths, a radius first for a cylinder.
SEGMENT, BOX, CYLINDER = 0, 1, 2


@kernel
def _turn(rotation: Array, v: Vector) -> Vector:
    return (
        rotation[0, 0] * v[0] + rotation[0, 1] * v[1] + rotation[0, 2] * v[2],
        rotation[1, 0] * v[0] + rotation[1, 1] * v[1] + rotation[1, 2] * v[2],
        rotation[2, 0] * v[0] + rotation[2, 1] * v[1] + rotation[2, 2] * v[2],
    )


@kernel
def _vector(row: Array) -> Vector:
    return (row[0], row[1], row[2])


@kernel
def _against_obstacle(
    c: Vector, e: Vector, kind: int, rotation: Array, position: Array, size: Array
) -> Contact:
    """Return `segments`' answer for the segment c ± e and an obstacle's core, in world axes."""
    place = _vector(position)
    if kind == SEGMENT:
        half = (rotation[0, 2] * size[2], rotation[1, 2] * size[2], rotation[2, 2] * size[2])
        return segment_segment(c, e, place, half)
    inverse = rotation.T
    local, half = _turn(inverse, blend(c, -1.0, place)), _turn(inverse, e)
    if kind == BOX:
        distance, normal, point = segment_box(local, half, _vector(size))
    else:
        distance, normal, point = segment_cylinder(local, half, size[0], size[2])
    return distance, _turn(rotation, normal), blend(place, 1.0, _turn(rotation, point))


@kernel
def evaluate(
    rotations: Array,
    positions: Array,
    joints: Ints,
    middles: Array,
    halves: Array,
    radii: Array,
    self_pairs: Ints,
    world_pairs: Ints,
    kinds: Ints,
    obstacle_rotations: Array,
    obstacle_positions: Array,
    obstacle_sizes: Array,
    obstacle_radii: Array,
) -> tuple[Array, Array]:
    """Return the distances (K, P) [m] and their wrenches (K, P, 6).

    A wrench holds the normal n and the moment p × n about the world origin: a twist [v, ω] of the
    first body, given at that origin, changes the distance by their scalar product. The second
    body feels the opposite.

    Parameters
    ----------
    rotations, positions : (K, J, 3, 3), (K, J, 3)
        Placements of the joints in world axes, the world itself first.
    joints, middles, halves, radii : (C,), (C, 3), (C, 3), (C,)
        The capsules in their joints' axes.
    self_pairs : (S, 2)
        Capsule and capsule.
    world_pairs : (W, 2)
        Capsule and obstacle; P = S + W, in this order.
    kinds, obstacle_rotations, obstacle_positions, obstacle_sizes, obstacle_radii
        The obstacles: a core in world axes, and how far the solid reaches beyond it.
    """
    count, own = len(rotations), len(self_pairs)
    pairs = own + len(world_pairs)
    values, wrenches = np.empty((count, pairs)), np.empty((count, pairs, 6))
    c, e = np.empty((len(joints), 3)), np.empty((len(joints), 3))
    for k in range(count):
        for i in range(len(joints)):
            rotation = rotations[k, joints[i]]
            place = _vector(positions[k, joints[i]])
            c[i, 0], c[i, 1], c[i, 2] = blend(place, 1.0, _turn(rotation, _vector(middles[i])))
            e[i, 0], e[i, 1], e[i, 2] = _turn(rotation, _vector(halves[i]))
        for pair in range(pairs):
            if pair < own:
                i, j = self_pairs[pair]
                reach = radii[i] + radii[j]
                distance, n, point = segment_segment(
                    _vector(c[i]), _vector(e[i]), _vector(c[j]), _vector(e[j])
                )
            else:
                i, j = world_pairs[pair - own]
                reach = radii[i] + obstacle_radii[j]
                distance, n, point = _against_obstacle(
                    _vector(c[i]),
                    _vector(e[i]),
                    kinds[j],
                    obstacle_rotations[j],
                    obstacle_positions[j],
                    obstacle_sizes[j],
                )
            values[k, pair] = distance - reach
            moment = cross(point, n)
            for a in range(3):
                wrenches[k, pair, a] = n[a]
                wrenches[k, pair, 3 + a] = moment[a]
    return values, wrenches


@kernel
def nearest(values: Array, wrenches: Array, group: Ints, count: int) -> tuple[Array, Array]:
    """Return the smallest of the distances of each group, (K, count), and its wrench.

    Parameters
    ----------
    values, wrenches : (K, P), (K, P, 6)
        What `evaluate` returned.
    group : (P,)
        The group of each pair, below `count`.
    """
    least = np.full((len(values), count), np.inf)
    wrench = np.zeros((len(values), count, 6))
    for k in range(len(values)):
        for pair in range(len(group)):
            if values[k, pair] < least[k, group[pair]]:
                least[k, group[pair]] = values[k, pair]
                wrench[k, group[pair]] = wrenches[k, pair]
    return least, wrench


@kernel
def pull_back(
    weights: Array, wrenches: Array, pair_joints: Ints, jacobians: Array, parents: Ints
) -> Array:
    """Return Σ_p w_kp ∂d_kp/∂q_k, (K, n).

    The wrenches on each joint's body are summed from the tool to the base, as joint torques are.

    Parameters
    ----------
    weights, wrenches : (K, P), (K, P, 6)
        The cotangent, and what `evaluate` returned.
    pair_joints : (P, 2)
        Joints of the first and the second body; 0 is the world.
    jacobians : (K, 6, n)
        Columns: twist of everything beyond a joint per unit of its speed, at the world origin.
    parents : (n + 1,)
        Parent of each joint.
    """
    count, n = len(jacobians), jacobians.shape[2]
    gradient, load = np.zeros((count, n)), np.empty((n + 1, 6))
    for k in range(count):
        load[:] = 0.0
        for pair in range(len(pair_joints)):
            weight = weights[k, pair]
            if weight != 0.0:
                first, second = pair_joints[pair]
                for a in range(6):
                    load[first, a] += weight * wrenches[k, pair, a]
                    load[second, a] -= weight * wrenches[k, pair, a]
        for joint in range(n, 0, -1):
            for a in range(6):
                gradient[k, joint - 1] += jacobians[k, a, joint - 1] * load[joint, a]
                load[parents[joint], a] += load[joint, a]
    return gradient
