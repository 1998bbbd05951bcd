"""Compiled: the small dense algebra around Pinocchio's Jacobians.

Notation, per stage: J6 (6, n) a tip's Jacobian [v; ω] in the axes of its chain's base, S the
selection of its task's rows, J = S J6 (m, n) the rows of all tips, one below the other, ε the null
motion, u = S(ẋ_d + K e) the commanded rows with pose errors e, A = JJᵀ + λ²I = LLᵀ (λ = 0 except
near singular poses, with damping), y = A⁻¹(u - Jε), and eq. 4 in the form that needs one solve:

    q̇ = Jᵀy + ε = J⁺u + (I - J⁺J) ε.

Python calls `advance`, `pullback`, `sensitivities`, `contract_task` and `transport`. Each consists
of small kernels, which LLVM inlines, and is compiled for the types of its arguments: problems
without damping, or with a fixed path, do not wait for these.
"""

from selfmotion.model.kernels.algebra import (
    Vector as Vector,
    add_angular as add_angular,
    angular as angular,
    angular_part as angular_part,
    carried as carried,
    cholesky as cholesky,
    clear_held as clear_held,
    cross as cross,
    dot as dot,
    factor_damped as factor_damped,
    finite as finite,
    gram as gram,
    gram_determinants as gram_determinants,
    linear as linear,
    log_determinant_slopes as log_determinant_slopes,
    plus as plus,
    respond as respond,
    solve_cholesky as solve_cholesky,
    transport as transport,
)
from selfmotion.model.kernels.stages import (
    Law as Law,
    advance as advance,
    at_tip as at_tip,
    evaluate_motion as evaluate_motion,
    pullback as pullback,
    sensitivities as sensitivities,
    space_size as space_size,
)
from selfmotion.model.kernels.start import start_step as start_step
from selfmotion.model.kernels.table import (
    Stage as Stage,
    Tip as Tip,
    columns as columns,
    path_of as path_of,
    rates_of as rates_of,
    stage_of as stage_of,
    tip_of as tip_of,
    view as view,
)
from selfmotion.model.kernels.tool import (
    Every as Every,
    contract_task as contract_task,
    errors_and_rows as errors_and_rows,
    pose_error as pose_error,
    rows_of as rows_of,
    select as select,
    task_rows as task_rows,
)
