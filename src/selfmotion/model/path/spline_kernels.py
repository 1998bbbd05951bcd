"""Cubic splines of positions and of orientations at many times, compiled."""

from selfmotion.basics import Array, inlined, interval_of, kernel
from selfmotion.model.task import exponential_coefficients


@kernel
def cubics_at(x: Array, c: Array, t: Array, values: Array, rates: Array) -> None:
    """Set the values and rates (K, 3) of a cubic spline at times t (K,).

    Its breaks are x (N,), its coefficients c (4, N - 1, 3), the highest first.
    """
    for k in range(len(t)):
        piece = interval_of(x, t[k])
        s = t[k] - x[piece]
        for i in range(3):
            values[k, i], rates[k, i] = _cubic(c, piece, i, s)


@kernel
def turns_at(x: Array, c: Array, first: Array, t: Array, rotations: Array, angular: Array) -> None:
    """Set orientations (K, 3, 3) and angular velocities (K, 3) at times t (K,), world axes.

    From each orientation `first` (N - 1, 3, 3) on by exp of a cubic rotation vector δ, see
    `cubics_at`: R = R₀ exp([δ]×), and the angular velocity is R₀ Jl(δ) δ̇, with the left Jacobian
    Jl(δ) = I + a [δ]× + b [δ]×² of SO(3).
    """
    for k in range(len(t)):
        piece = interval_of(x, t[k])
        s = t[k] - x[piece]
        d0, r0 = _cubic(c, piece, 0, s)
        d1, r1 = _cubic(c, piece, 1, s)
        d2, r2 = _cubic(c, piece, 2, s)
        square = d0 * d0 + d1 * d1 + d2 * d2
        a, b = exponential_coefficients(square)
        sine, cosine = 1.0 - b * square, 1.0 - a * square
        cross0, cross1, cross2 = d1 * r2 - d2 * r1, d2 * r0 - d0 * r2, d0 * r1 - d1 * r0
        inner = d0 * r0 + d1 * r1 + d2 * r2
        # δ × (δ × δ̇) = δ (δ·δ̇) - δ̇ θ².
        rate0 = r0 + a * cross0 + b * (d0 * inner - r0 * square)
        rate1 = r1 + a * cross1 + b * (d1 * inner - r1 * square)
        rate2 = r2 + a * cross2 + b * (d2 * inner - r2 * square)
        for i in range(3):
            f0, f1, f2 = first[piece, i, 0], first[piece, i, 1], first[piece, i, 2]
            # Row i of R₀ times exp([δ]×) = cos θ I + sin θ/θ [δ]× + a δδᵀ.
            inside = a * (f0 * d0 + f1 * d1 + f2 * d2)
            rotations[k, i, 0] = cosine * f0 + sine * (f1 * d2 - f2 * d1) + inside * d0
            rotations[k, i, 1] = cosine * f1 + sine * (f2 * d0 - f0 * d2) + inside * d1
            rotations[k, i, 2] = cosine * f2 + sine * (f0 * d1 - f1 * d0) + inside * d2
            angular[k, i] = f0 * rate0 + f1 * rate1 + f2 * rate2


@inlined
def _cubic(c: Array, piece: int, i: int, s: float) -> tuple[float, float]:
    """Return value and rate of a coordinate."""
    cubic, square, slope = c[0, piece, i], c[1, piece, i], c[2, piece, i]
    value = ((cubic * s + square) * s + slope) * s + c[3, piece, i]
    return value, (3.0 * cubic * s + 2.0 * square) * s + slope
