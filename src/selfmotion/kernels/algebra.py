"""Small dense algebra, compiled: cross products, Cholesky, pose errors, Jacobian contractions."""

import numpy as np
import numpy.typing as npt

from selfmotion.basics import Array, kernel

Rows = npt.NDArray[np.intp]

# How a task measures its angular error.
NO_ANGLE, LOGARITHM, POINTING = 0, 1, 2


def angle_kind(rows: Rows, tool_axes: bool) -> int:
    """Return how a task with these rows of [v, ω] measures its angular error."""
    if tool_axes:
        return POINTING
    return LOGARITHM if np.any(rows >= 3) else NO_ANGLE


# Below this angle the closed forms in sin θ lose digits and their series serve.
_SMALL = 1e-3


@kernel
def add_cross(ax: float, ay: float, az: float, b: Array, out: Array) -> None:
    """Add a × b to `out`."""
    out[0] += ay * b[2] - az * b[1]
    out[1] += az * b[0] - ax * b[2]
    out[2] += ax * b[1] - ay * b[0]


@kernel
def cross(a: Array, b: Array, out: Array) -> None:
    """Set `out` to a × b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def cholesky(a: Array) -> bool:
    """Replace the lower triangle of `a` by its Cholesky factor; False where it is not positive."""
    for i in range(a.shape[0]):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            if i == j:
                # NaN fails this comparison, too.
                if not total > 1e-13 * a[i, i]:
                    return False
                a[i, i] = np.sqrt(total)
            else:
                a[i, j] = total / a[j, j]
    return True


@kernel
def solve_cholesky(factor: Array, b: Array) -> None:
    """Replace `b` by A⁻¹b, given the lower Cholesky factor of A."""
    m = b.shape[0]
    for i in range(m):
        total = b[i]
        for k in range(i):
            total -= factor[i, k] * b[k]
        b[i] = total / factor[i, i]
    for i in range(m - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, m):
            total -= factor[k, i] * b[k]
        b[i] = total / factor[i, i]


@kernel
def damp(gram: Array, threshold: float, strength: float, out: Array) -> None:
    """Add λ²I to JJᵀ (its lower triangle `gram`) near singular poses; set `out` (3 + m,).

    λ² = λ0² f with f = (1 - σ²/σ0²)² where the smallest singular value σ of J is below the
    threshold σ0, exactly 0 elsewhere. `out` is λ0², f, df/dσ² and the unit vector v of
    σ² = vᵀJJᵀv, all 0 where there is no damping.
    """
    m = gram.shape[0]
    out[:] = 0.0
    square = threshold * threshold
    full = np.empty((m, m))
    for i in range(m):
        for j in range(i + 1):
            full[i, j] = full[j, i] = gram[i, j]
    shifted = full - square * np.eye(m)
    # Mostly σ > σ0, which a Cholesky factor tells at a tenth of the price of eigenvalues. NaN is
    # left to the factor of `gram` itself.
    if cholesky(shifted) or not np.isfinite(full.sum()):
        return
    values, vectors = np.linalg.eigh(full)
    rest = 1.0 - max(values[0], 0.0) / square
    if rest <= 0.0:
        return
    out[0] = strength * strength
    out[1] = rest * rest
    out[2] = -2.0 * rest / square
    out[3:] = vectors[:, 0]
    for i in range(m):
        gram[i, i] += out[0] * out[1]


@kernel
def rotation_error(target: Array, actual: Array, out: Array) -> None:
    """Set `out` to log(R_target Rᵀ), the rotation vector from actual to target, world axes."""
    r = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            r[i, j] = (
                target[i, 0] * actual[j, 0]
                + target[i, 1] * actual[j, 1]
                + target[i, 2] * actual[j, 2]
            )
    out[0] = 0.5 * (r[2, 1] - r[1, 2])
    out[1] = 0.5 * (r[0, 2] - r[2, 0])
    out[2] = 0.5 * (r[1, 0] - r[0, 1])
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = 0.5 * (r[0, 0] + r[1, 1] + r[2, 2] - 1.0)
    angle = np.arctan2(sine, cosine)
    scale = angle / sine if sine > 1e-12 else 1.0
    for i in range(3):
        out[i] *= scale


@kernel
def pointing_error(target: Array, actual: Array, out: Array) -> None:
    """Set `out` to the shortest rotation vector that aligns the z axes, world axes."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = actual[j, 2] * target[k, 2] - actual[k, 2] * target[j, 2]
    sine = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    cosine = actual[0, 2] * target[0, 2] + actual[1, 2] * target[1, 2] + actual[2, 2] * target[2, 2]
    angle = np.arctan2(sine, cosine)
    scale = angle / sine if sine > 1e-12 else 1.0
    for i in range(3):
        out[i] *= scale


@kernel
def select(rows: Rows, pointing: bool, rotation: Array, vector: Array, out: Array) -> None:
    """Set `out` (m,) to S·vector (6,)."""
    for i in range(rows.shape[0]):
        row = rows[i]
        if pointing and row >= 3:
            a = row - 3
            out[i] = (
                rotation[0, a] * vector[3] + rotation[1, a] * vector[4] + rotation[2, a] * vector[5]
            )
        else:
            out[i] = vector[row]


@kernel
def unselect(rows: Rows, pointing: bool, rotation: Array, vector: Array, out: Array) -> None:
    """Set `out` (6,) to Sᵀ·vector (m,)."""
    out[:] = 0.0
    for i in range(rows.shape[0]):
        row = rows[i]
        if pointing and row >= 3:
            for k in range(3):
                out[3 + k] += rotation[k, row - 3] * vector[i]
        else:
            out[row] += vector[i]


@kernel
def contract(jacobian: Array, weights: Array, out: Array) -> None:
    """Add ⟨M, ∂J6/∂q_k⟩ to out[k], for M = `weights` (6, n)."""
    n = jacobian.shape[1]
    outer, inner = np.zeros(3), np.zeros(3)
    for k in range(n - 1, -1, -1):
        # Σ_{i ≥ k} v_i × M_v,i + ω_i × M_ω,i
        add_cross(jacobian[0, k], jacobian[1, k], jacobian[2, k], weights[:3, k], outer)
        add_cross(jacobian[3, k], jacobian[4, k], jacobian[5, k], weights[3:, k], outer)
        for i in range(3):
            out[k] += jacobian[3 + i, k] * outer[i]
    for k in range(n):
        for i in range(3):
            out[k] += jacobian[i, k] * inner[i]
        # Σ_{i < k} M_v,i × ω_i
        add_cross(weights[0, k], weights[1, k], weights[2, k], jacobian[3:, k], inner)


@kernel
def contract_task(
    jacobian: Array, rotation: Array, weights: Array, rows: Rows, pointing: bool
) -> Array:
    """Return ⟨M, ∂J/∂q_k⟩ of the task Jacobian for S samples: M = `weights` (S, m, n) → (S, n).

    Where S depends on q (rows in tool axes), ∂S adds ω_k · Σ_i (SᵀM)_ω,i × ω_i.
    """
    samples, _, n = weights.shape
    out = np.zeros((samples, n))
    full, twist = np.empty((6, n)), np.empty(3)
    for s in range(samples):
        for k in range(n):
            unselect(rows, pointing, rotation[s], weights[s, :, k], full[:, k])
        contract(jacobian[s], full, out[s])
        if pointing:
            twist[:] = 0.0
            for k in range(n):
                add_cross(full[3, k], full[4, k], full[5, k], jacobian[s, 3:, k], twist)
            for k in range(n):
                for i in range(3):
                    out[s, k] += jacobian[s, 3 + i, k] * twist[i]
    return out


@kernel
def pull_error(
    angle_kind: int,
    error: Array,
    rotation: Array,
    target_rotation: Array,
    z: Array,
    out: Array,
) -> None:
    """Add the cotangent of the tool's twist that z (6,) on the pose error e leaves, to `out` (6,).

    ∂e_v = -v. With φ = log(R_d Rᵀ): ∂φ = -Jr⁻¹(φ) ω. With e = θ (a × b)/sin θ for axes a (tool)
    and b (target): ∂a = ω × a.
    """
    for i in range(3):
        out[i] -= z[i]
    if angle_kind == LOGARITHM:
        phi, w = error[3:], z[3:]
        once, twice = np.empty(3), np.empty(3)
        cross(phi, w, once)
        cross(phi, once, twice)
        square = phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2
        angle = np.sqrt(square)
        if angle < _SMALL:
            c = 1.0 / 12.0 + square / 720.0
        else:
            c = 1.0 / square - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
        for i in range(3):
            out[3 + i] -= w[i] - 0.5 * once[i] + c * twice[i]
    elif angle_kind == POINTING:
        a, b, w = rotation[:, 2], target_rotation[:, 2], z[3:]
        normal, bw, moment = np.empty(3), np.empty(3), np.empty(3)
        cross(a, b, normal)
        cross(b, w, bw)
        sine = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
        cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        angle = np.arctan2(sine, cosine)
        if angle < _SMALL:
            f, slope = 1.0 + angle**2 / 6.0, -1.0 / 3.0 - 2.0 * angle**2 / 15.0
        else:
            f = angle / sine
            slope = -(sine - angle * cosine) / sine**3
        along = slope * (w[0] * normal[0] + w[1] * normal[1] + w[2] * normal[2])
        for i in range(3):
            bw[i] = f * bw[i] + along * b[i]
        cross(a, bw, moment)
        for i in range(3):
            out[3 + i] += moment[i]
