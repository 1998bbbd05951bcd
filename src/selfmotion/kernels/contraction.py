"""Contractions with the kinematic Hessian ∂J/∂q, compiled: O(n), without the tensor.

Column k of J6 is [v_k; ω_k]. On a chain, with ω = 0 for prismatic joints,

    ∂J6_i/∂q_k = [ω_k × v_i; ω_k × ω_i]  for k ≤ i,   [ω_i × v_k; 0]  for k > i.
"""

import numpy as np

from selfmotion.basics import Array, Ints, inlined, kernel
from selfmotion.basics.layout import KIND, ORDER, POINTING, Layout
from selfmotion.kernels.algebra import (
    add_angular,
    angular,
    angular_part,
    cross,
    dot,
    linear,
    plus,
)
from selfmotion.kernels.tool import unselect

# Where joints mimic others on a chain, the columns of all its joints have to be known: those of
# samples and tips, (S, F, 6, W), each times its scale, and (F + 1, W): their order along the chain
# of each tip, and last the coordinate of each.
Every = tuple[Array, Ints]


@inlined
def contract(
    layout: Layout, f: int, jacobian: Array, weights: Array, twist: Array, out: Array
) -> None:
    """Add ⟨M, ∂J6/∂q_k⟩ + twist·J6_k to out[k], for M = `weights` (6, n) and `twist` (6,).

    Two running sums of cross products along the chain of tip f, which start from what acts on all
    columns alike.
    """
    n = jacobian.shape[1]
    # Σ_{i ≥ k} v_i × M_v,i + ω_i × M_ω,i
    outer = angular_part(twist)
    for i in range(n - 1, -1, -1):
        k = layout[f, ORDER + i]
        v, w = linear(jacobian, k), angular(jacobian, k)
        outer = plus(outer, 1.0, cross(v, linear(weights, k)))
        outer = plus(outer, 1.0, cross(w, angular(weights, k)))
        out[k] += dot(w, outer)
    # Σ_{i < k} M_v,i × ω_i
    inner = (twist[0], twist[1], twist[2])
    for i in range(n):
        k = layout[f, ORDER + i]
        out[k] += dot(linear(jacobian, k), inner)
        inner = plus(inner, 1.0, cross(linear(weights, k), angular(jacobian, k)))


@inlined
def contract_every(
    members: Ints, f: int, own: Array, weights: Array, twist: Array, out: Array
) -> None:
    """Do the same for the columns `own` (6, W) of all joints, of which some share a coordinate."""
    count, last = own.shape[1], members.shape[0] - 1
    outer = angular_part(twist)
    for i in range(count - 1, -1, -1):
        j = members[f, i]
        k = members[last, j]
        v, w = linear(own, j), angular(own, j)
        outer = plus(outer, 1.0, cross(v, linear(weights, k)))
        outer = plus(outer, 1.0, cross(w, angular(weights, k)))
        out[k] += dot(w, outer)
    inner = (twist[0], twist[1], twist[2])
    for i in range(count):
        j = members[f, i]
        k = members[last, j]
        out[k] += dot(linear(own, j), inner)
        inner = plus(inner, 1.0, cross(linear(weights, k), angular(own, j)))


@kernel
def contract_task(
    jacobian: Array,
    rotation: Array,
    weights: Array,
    layout: Layout,
    f: int,
    every: Every | None = None,
) -> Array:
    """Return ⟨M, ∂J/∂q_k⟩ of tip f's task Jacobian for S samples: M = `weights` (S, m, n) → (S, n).

    Where S depends on q (rows in tool axes), ∂S adds ω_k · Σ_i (SᵀM)_ω,i × ω_i.
    """
    samples, m, n = weights.shape
    out = np.zeros((samples, n))
    here, full = np.empty((6, n)), np.empty((6, n))
    turn, values, moment, twist = np.empty((3, 3)), np.empty(m), np.empty(6), np.empty(6)
    for s in range(samples):
        # Copies: whatever the caller's arrays look like in memory, the rest is compiled once.
        for i in range(3):
            twist[i] = twist[3 + i] = 0.0
            for j in range(3):
                turn[i, j] = rotation[s, i, j]
        for k in range(n):
            for i in range(m):
                values[i] = weights[s, i, k]
            unselect(layout, f, turn, values, moment)
            for i in range(6):
                here[i, k], full[i, k] = jacobian[s, i, k], moment[i]
            if layout[f, KIND] == POINTING:
                turning = cross(angular_part(moment), angular(here, k))
                add_angular(twist, 1.0, turning)
        if every is None:
            contract(layout, f, here, full, twist, out[s])
        else:
            contract_every(every[1], f, every[0][s, f], full, twist, out[s])
    return out
