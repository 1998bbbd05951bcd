"""Arithmetic of the unknowns of elastic rows, compiled; see `newton` for the symbols."""

from math import log

from selfmotion.basics import Array, kernel


@kernel
def row_residuals(
    h: Array,
    slacks: Array,
    elastics: Array,
    multipliers: Array,
    rho: float,
    barrier: float,
    matters: float,
) -> tuple[float, float]:
    """Return the primal residual and that of complementarity.

    The largest |h + s - e| of rows whose multiplier times it is above `matters`, and the largest
    |s λ - μ| and |e (ρ - λ) - μ|.
    """
    primal, complementary = 0.0, 0.0
    for k in range(len(h)):
        gap = abs(h[k] + slacks[k] - elastics[k])
        if multipliers[k] * gap > matters:
            primal = max(primal, gap)
        complementary = max(complementary, abs(slacks[k] * multipliers[k] - barrier))
        room = elastics[k] * (rho - multipliers[k])
        complementary = max(complementary, abs(room - barrier))
    return primal, complementary


@kernel
def eliminate(
    h: Array,
    slacks: Array,
    elastics: Array,
    multipliers: Array,
    rho: float,
    stiff: Array,
    pulls: Array,
) -> None:
    """Set ∂λ/∂h once steps of s and e are eliminated, (K,), and the pulls of rows, (2, K).

    Pulls are λ + ∂λ/∂h h, and ∂λ/∂h (1/λ - 1/(ρ - λ)), which is for each unit of μ.
    """
    for k in range(len(h)):
        left = rho - multipliers[k]
        stiff[k] = 1.0 / (slacks[k] / multipliers[k] + elastics[k] / left)
        pulls[0, k] = multipliers[k] + stiff[k] * h[k]
        pulls[1, k] = stiff[k] * (1.0 / multipliers[k] - 1.0 / left)


@kernel
def step_rows(
    h: Array,
    slacks: Array,
    elastics: Array,
    multipliers: Array,
    rho: float,
    barrier: float,
    stiff: Array,
    along: Array,
    steps: Array,
) -> None:
    """Set the steps of s, e and λ (3, K) for a change of h `along` the step of the nodes, (K,)."""
    for k in range(len(h)):
        left = rho - multipliers[k]
        by_slack, by_left = barrier / multipliers[k], barrier / left
        change = stiff[k] * (along[k] + h[k] + by_slack - by_left)
        steps[0, k] = by_slack - slacks[k] - slacks[k] / multipliers[k] * change
        steps[1, k] = by_left - elastics[k] + elastics[k] / left * change
        steps[2, k] = change


@kernel
def move_rows(
    h: Array,
    slacks: Array,
    elastics: Array,
    by_slacks: Array,
    by_elastics: Array,
    length: float,
    moved: Array,
) -> None:
    """Set s and e (2, K) after a share of their steps, where rows are h.

    A gap below 0 closes for nothing; one above costs the penalty, not ρ: else the rows' curvature
    stops the steps.
    """
    for k in range(len(h)):
        moved[1, k] = elastics[k] + length * by_elastics[k]
        moved[0, k] = max(slacks[k] + length * by_slacks[k], moved[1, k] - h[k])


@kernel
def merit_of_rows(
    h: Array, slacks: Array, elastics: Array, rho: float, barrier: float, penalty: float
) -> float:
    """Return ρ Σ e - μ Σ (ln s + ln e) + penalty Σ |h + s - e|."""
    total = 0.0
    for k in range(len(h)):
        total += rho * elastics[k] - barrier * (log(slacks[k]) + log(elastics[k]))
        total += penalty * abs(h[k] + slacks[k] - elastics[k])
    return total


@kernel
def slope_of_rows(
    h: Array,
    slacks: Array,
    elastics: Array,
    by_slacks: Array,
    by_elastics: Array,
    rho: float,
    barrier: float,
) -> tuple[float, float]:
    """Return the derivative of ρ Σ e - μ Σ (ln s + ln e) along a step, and Σ |h + s - e|."""
    slope, gap = 0.0, 0.0
    for k in range(len(h)):
        slope += (rho - barrier / elastics[k]) * by_elastics[k]
        slope -= barrier / slacks[k] * by_slacks[k]
        gap += abs(h[k] + slacks[k] - elastics[k])
    return slope, gap


@kernel
def largest_share(values: Array, step: Array, tau: float) -> float:
    """Return the largest share of a step, at most 1, by the fraction-to-the-boundary rule."""
    share = 1.0
    for k in range(len(values)):
        if step[k] < 0.0:
            share = min(share, -tau * values[k] / step[k])
    return share
