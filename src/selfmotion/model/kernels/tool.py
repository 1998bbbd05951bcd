"""Tips, compiled: their pose errors, the rows of their tasks, and contractions with ∂J/∂q."""

from math import atan2, sqrt, tan

import numpy as np

from selfmotion.basics import Array, Ints, called, inlined, kernel
from selfmotion.basics.layout import COUNT, FIRST, KIND, LOGARITHM, ORDER, POINTING, ROWS, Layout
from selfmotion.model.kernels.algebra import (
    Vector,
    add_angular,
    angular,
    angular_part,
    cross,
    dot,
    linear,
    plus,
)
from selfmotion.model.kernels.table import view

# Angle below which closed forms in sin θ lose digits, and series are used: to 1e-15 there.
_SMALL = 0.05


@called
def pose_error(
    angle_kind: int,
    target_translation: Array,
    target_rotation: Array,
    translation: Array,
    rotation: Array,
    out: Array,
) -> None:
    """Set `out` (6,) to the pose error e: difference of positions, then the rotation vector.

    The angular part, in world axes, is as `angle_kind` says: none, `rotation_error` or
    `pointing_error`.
    """
    for i in range(3):
        out[i] = target_translation[i] - translation[i]
    if angle_kind == LOGARITHM:
        out[3], out[4], out[5] = rotation_error(target_rotation, rotation)
    elif angle_kind == POINTING:
        out[3], out[4], out[5] = pointing_error(target_rotation, rotation)


@inlined
def rotation_error(target: Array, actual: Array) -> Vector:
    """Return log(R_target Rᵀ), the rotation vector from actual to target, world axes."""
    # R_target Rᵀ = Σ_i t_i a_iᵀ over the columns; its antisymmetric part is ½ Σ a_i × t_i.
    double, trace = (0.0, 0.0, 0.0), 0.0
    for i in range(3):
        a, b = linear(actual, i), linear(target, i)
        double = plus(double, 1.0, cross(a, b))
        trace += dot(a, b)
    return _scaled(double, 0.5, 0.5 * (trace - 1.0))


@inlined
def pointing_error(target: Array, actual: Array) -> Vector:
    """Return the shortest rotation vector that aligns the z axes, world axes."""
    a, b = z_axis(actual), z_axis(target)
    return _scaled(cross(a, b), 1.0, dot(a, b))


@inlined
def z_axis(rotation: Array) -> Vector:
    """Return the z axis of a frame."""
    return rotation[0, 2], rotation[1, 2], rotation[2, 2]


@inlined
def _scaled(normal: Vector, scale: float, cosine: float) -> Vector:
    """Return the rotation vector along `normal`, of length sin θ by `scale`, with cos θ."""
    sine = scale * sqrt(dot(normal, normal))
    if sine > 1e-12:
        scale *= atan2(sine, cosine) / sine
    return scale * normal[0], scale * normal[1], scale * normal[2]


@inlined
def pull_error(
    angle_kind: int,
    error: Array,
    rotation: Array,
    target_rotation: Array,
    z: Array,
    out: Array,
) -> None:
    """Set `out` (6,) to the cotangent of the tool's twist that z (6,) on the pose error e leaves.

    ∂e_v = -v. With φ = log(R_d Rᵀ): ∂φ = -Jr⁻¹(φ) ω. With e = θ (a × b)/sin θ for axes a (tool)
    and b (target): ∂a = ω × a.
    """
    for i in range(3):
        out[i] = -z[i]
        out[3 + i] = 0.0
    w = angular_part(z)
    if angle_kind == LOGARITHM:
        phi = angular_part(error)
        once = cross(phi, w)
        twice = cross(phi, once)
        c = logarithm_coefficient(sqrt(dot(phi, phi)))
        for i in range(3):
            out[3 + i] = -(w[i] - 0.5 * once[i] + c * twice[i])
    elif angle_kind == POINTING:
        a, b = z_axis(rotation), z_axis(target_rotation)
        normal, cosine = cross(a, b), dot(a, b)
        f, slope = pointing_coefficients(sqrt(dot(normal, normal)), cosine)
        turned, along = cross(b, w), slope * dot(w, normal)
        moment = plus((f * turned[0], f * turned[1], f * turned[2]), along, b)
        out[3], out[4], out[5] = cross(a, moment)


@inlined
def logarithm_coefficient(angle: float) -> float:
    """Return c of Jr⁻¹(φ) = I + ½ [φ] + c [φ]²: (1 - (θ/2) cot(θ/2)) / θ²."""
    if angle < _SMALL:
        square = angle * angle
        return 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    return (1.0 - 0.5 * angle / tan(0.5 * angle)) / (angle * angle)


@inlined
def pointing_coefficients(sine: float, cosine: float) -> tuple[float, float]:
    """Return f = θ / sin θ and df/d(cos θ) = (θ cos θ - sin θ) / sin³θ."""
    angle = atan2(sine, cosine)
    if angle < _SMALL:
        square = angle * angle
        f = 1.0 + square * (1.0 / 6.0 + square * (7.0 / 360.0 + square * 31.0 / 15120.0))
        slope = 1.0 / 3.0 + square * (2.0 / 15.0 + square * (2.0 / 63.0 + square * 4.0 / 675.0))
        return f, -slope
    return angle / sine, (angle * cosine - sine) / (sine * sine * sine)


@inlined
def errors_and_rows(
    layout: Layout,
    target: Array,
    jacobians: Array,
    rotations: Array,
    translations: Array,
    values: Array,
    out: Array,
) -> None:
    """Set the first m `values` to all tips' errors S e, and the first m rows of `out` to J = S J6.

    Tips are where the last evaluation had them, (F, 6, n), (F, 3, 3) and (F, 3); `target` (12 F,)
    is as `Follows.targets` has it.
    """
    error = np.zeros(6)
    for f in range(layout.shape[0]):
        place, turn = view(target, 12 * f, (3,)), view(target, 12 * f + 3, (3, 3))
        pose_error(layout[f, KIND], place, turn, translations[f], rotations[f], error)
        select(layout, f, rotations[f], error, values)
        task_rows(layout, f, rotations[f], jacobians[f], out)


@inlined
def task_rows(layout: Layout, f: int, rotation: Array, jacobian: Array, out: Array) -> None:
    """Set the rows of tip f in `out` (m, n) to S J6; angular ones in tool axes where pointing."""
    first = layout[f, FIRST]
    for i in range(layout[f, COUNT]):
        row = layout[f, ROWS + i]
        if layout[f, KIND] == POINTING and row >= 3:
            axis = linear(rotation, row - 3)
            for k in range(jacobian.shape[1]):
                out[first + i, k] = dot(axis, angular(jacobian, k))
        else:
            for k in range(jacobian.shape[1]):
                out[first + i, k] = jacobian[row, k]


@inlined
def select(layout: Layout, f: int, rotation: Array, twist: Array, out: Array) -> None:
    """Set the rows of tip f in `out` (m,) to S·twist (6,)."""
    first = layout[f, FIRST]
    for i in range(layout[f, COUNT]):
        row = layout[f, ROWS + i]
        if layout[f, KIND] == POINTING and row >= 3:
            out[first + i] = dot(linear(rotation, row - 3), angular_part(twist))
        else:
            out[first + i] = twist[row]


@inlined
def unselect(layout: Layout, f: int, rotation: Array, values: Array, out: Array) -> None:
    """Set `out` (6,) to Sᵀ·values (m,) of tip f."""
    for i in range(6):
        out[i] = 0.0
    first = layout[f, FIRST]
    for i in range(layout[f, COUNT]):
        row = layout[f, ROWS + i]
        if layout[f, KIND] == POINTING and row >= 3:
            add_angular(out, values[first + i], linear(rotation, row - 3))
        else:
            out[row] += values[first + i]


@inlined
def rows_of(layout: Layout) -> int:
    """Return the number m of rows of all tips."""
    last = layout.shape[0] - 1
    return int(layout[last, FIRST] + layout[last, COUNT])


# Contractions with the kinematic Hessian ∂J/∂q, compiled: O(n), without the tensor.
#
# Column k of J6 is [v_k; ω_k]. On a chain, with ω = 0 for prismatic joints,
#
#     ∂J6_i/∂q_k = [ω_k × v_i; ω_k × ω_i]  for k ≤ i,   [ω_i × v_k; 0]  for k > i.

# Columns of all joints of a chain, needed where joints mimic others: those of samples and tips, (S,
# F, 6, W), each times its scale, and (F + 1, W): their order along the chain of each tip, and last
# the coordinate of each.
Every = tuple[Array, Ints]


@inlined
def contract(
    layout: Layout, f: int, jacobian: Array, weights: Array, twist: Array, out: Array
) -> None:
    """Add ⟨M, ∂J6/∂q_k⟩ + twist·J6_k to out[k], for M = `weights` (6, n) and `twist` (6,).

    Two running sums of cross products along the chain of tip f, which start from the weights common
    to all columns.
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
        # Copies: the memory layout of the caller's arrays is independent of the compiled types.
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
