"""What numba compiles: the small dense algebra around Pinocchio's Jacobians.

Notation, per stage: J6 (6, n) the tool's Jacobian [v; ω] in world axes, S the selection of the
task's rows, J = S J6 (m, n), ε the null motion, u = S(ẋ_d + K e) the commanded rows with pose
error e, A = JJᵀ + λ²I = LLᵀ (λ = 0 except near singular poses, where damping is asked for),
y = A⁻¹(u - Jε), and eq. 4 in the form that needs one solve:

    q̇ = Jᵀy + ε = J⁺u + (I - J⁺J) ε.

Column k of J6 is [v_k; ω_k]. On a chain, with ω = 0 for prismatic joints,

    ∂J6_i/∂q_k = [ω_k × v_i; ω_k × ω_i]  for k ≤ i,   [ω_i × v_k; 0]  for k > i,

so that ⟨M, ∂J6/∂q_k⟩ needs two running sums of cross products over the columns of M and J6.
"""

from selfmotion.kernels.algebra import (
    LOGARITHM,
    POINTING,
    angle_kind,
    cholesky,
    contract_task,
    pointing_error,
    rotation_error,
    select,
    solve_cholesky,
)
from selfmotion.kernels.backward import pullback, sensitivities
from selfmotion.kernels.forward import advance, evaluate, newton_step
from selfmotion.kernels.table import layout

__all__ = [
    "LOGARITHM",
    "POINTING",
    "advance",
    "angle_kind",
    "cholesky",
    "contract_task",
    "evaluate",
    "layout",
    "newton_step",
    "pointing_error",
    "pullback",
    "rotation_error",
    "select",
    "sensitivities",
    "solve_cholesky",
]
