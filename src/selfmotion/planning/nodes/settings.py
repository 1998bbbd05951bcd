"""Settings of Newton's method on nodes, by the names of the literature where it has them.

Sources: [WB] A. Wächter, L. Biegler, "On the implementation of an interior-point filter line-search
algorithm for large-scale nonlinear programming", Math. Program. 106, 2006; [NW] J. Nocedal, S.
Wright, "Numerical Optimization", 2nd ed. Numbers without a source were chosen on the project's
benchmarks; `make bench NAME=numbers` doubles and halves each and shows what changes.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class NewtonSettings:
    """Settings of the interior-point method and of its linear system.

    Symbols are those of `newton`: rows h, slacks s, elastic variables e, multipliers λ, their upper
    bound ρ, barrier parameter μ. Units of rows are those of h, F is the cost.
    """

    # --- termination
    # A step that predicts a smaller decrease, relative to F, is the last: without active rows.
    cost_tolerance: float = 1e-8
    # The same with active rows.
    cost_tolerance_with_rows: float = 1e-6
    # Largest residual of active rows at an optimum [units of h].
    row_tolerance: float = 1e-7
    # Largest residual of conditions on the ends [rad, rad/s].
    end_tolerance: float = 1e-9
    # Largest |s λ - μ| at an optimum, in multiples of μ.
    complementarity: float = 30.0
    # Largest change of the multipliers by the last step, relative to their sum: between stiff rows
    # a step predicts a small decrease whatever the multipliers are.
    multiplier_tolerance: float = 1e-2
    # The sum of multipliers counts as no less than this share of F.
    multiplier_floor: float = 1e-3
    # A row whose residual times multiplier is below this share of μ may have any residual: on very
    # short intervals rates are known to few digits.
    inactive_share: float = 1e-2
    # All tolerances above are this many times larger where a rough optimum is enough.
    rough_factor: float = 100.0
    # After a full step that predicted less than this share of F, the next predicted decrease is
    # taken to be its square (quadratic convergence), without a system being solved.
    quadratic_share: float = 1e-5
    # Iterations; about 15 are usual, 40 where limits bind everywhere.
    max_iterations: int = 80
    # This number of steps in a row that are shorter than this share of Newton's lead nowhere.
    short_steps: int = 4
    short_length: float = 1e-3
    # Iterations in which the largest violation has to fall below `stall_factor` times what it was.
    stall_iterations: int = 12
    stall_factor: float = 0.97

    # --- barrier
    # First μ, relative to F divided by the number of rows.
    mu_first: float = 1e-1
    # The same where rows are still violated after many iterations: slacks and elastic variables are
    # far from the central path of a smaller μ, and steps end at their bounds.
    mu_again: float = 1.0
    # Last μ, in the same unit.
    mu_last: float = 1e-6
    # First μ of a warm start, and last μ of others where a rough optimum is enough, in the same
    # unit.
    mu_warm: float = 1e-5
    # The barrier problem counts as solved at residuals of κ_ε μ [WB eq. 7].
    kappa_epsilon: float = 10.0
    # Next μ: max(last μ, min(κ_μ μ, μ^θ_μ)) [WB eq. 7].
    kappa_mu: float = 0.2
    theta_mu: float = 1.5
    # Largest residual of active rows where μ may fall [units of h].
    barrier_row_tolerance: float = 1e-2

    # --- step length
    # Fraction to the boundary: slacks, elastic variables and multipliers keep 1 - τ of their
    # distance to 0 in one step [WB eq. 15; NW 19.9].
    tau: float = 0.995
    # Share of the predicted decrease that the merit function has to fall by [NW 3.4: c₁].
    armijo: float = 1e-4
    # Factor by which a rejected step is cut …
    backtracking: float = 0.5
    # … this often; after that by what a parabola says, between these factors [NW 3.5].
    halvings: int = 2
    backtracking_least: float = 0.1
    # Shortest step that is tried, as a share of Newton's.
    min_length: float = 1e-7
    # Largest change of a node's coordinate in one step [rad or m].
    max_change: float = 0.5
    # Where no step is accepted and the predicted decrease is below this share of F, rounding is the
    # reason; above it the gradient is wrong, or rows contradict each other.
    rounding: float = 1e-5
    # A change of the merit function above this share of it is none of rounding: where the shortest
    # step with one raises it by half of the predicted decrease or more, the gradient is wrong.
    visible: float = 1e-10

    # --- rows: slacks and elastic variables
    # Smallest first slack [units of h]: of a row that becomes active, and in a warm start.
    min_slack: float = 1e-1
    min_slack_warm: float = 1e-3
    # First elastic variable of a row that becomes active [units of h].
    first_elastic: float = 1e-3
    # First ρ, in multiples of F for a unit of h.
    rho: float = 10.0
    # ρ grows by this factor where rows are violated by more than `violated` [units of h] at
    # multipliers above `saturated` times ρ, at most `max_rho_updates` times.
    rho_factor: float = 100.0
    violated: float = 1e-6
    saturated: float = 0.9
    max_rho_updates: int = 4
    # Smallest penalty of residuals in the merit function, as a share of ρ: without one, a step
    # could open for nothing a residual that is 0.
    min_merit_penalty: float = 3e-3

    # --- linear system
    # Rows violated by more than this [units of h] have no second derivatives (Gauss-Newton), and
    # their multipliers no part in the curvature.
    gauss_newton_violation: float = 1e-2
    # Added to the diagonal, as a share of its median entry over the square of the number of nodes:
    # above what differences leave there for a motion that costs nothing, below what slow motions
    # cost.
    flat_share: float = 1.25e-5
    # The same is this many times larger where the matrix is not positive definite.
    flat_factor: float = 16.0
    # Inertia correction [WB algorithm IC]: first δ, as a share of each coordinate's curvature
    # without rows (one δ for all would stop some: with costs of jerks they differ by 1e9) …
    delta_first: float = 1e-6
    # … its factor from one system to the next, and within one …
    kappa_minus: float = 1.0 / 3.0
    kappa_plus: float = 8.0
    # … the largest δ, and the smallest in units of the largest entry of the matrix.
    delta_max: float = 1e6
    delta_floor: float = 1e-18
    # A step of a node beyond this [rad or m] says that the matrix is nearly singular.
    max_trusted: float = 5.0


SETTINGS = NewtonSettings()
