"""Constraints as terms of an unconstrained problem: the augmented Lagrangian.

For h ≤ 0 with multipliers λ ≥ 0 and penalty ρ, each condition at a node adds

    w/(2ρ) (max(0, λ + ρ h)² - λ²)

and each equality h = 0 adds λ h + ρ/2 h²; after every inner minimisation λ ← max(0, λ + ρ h) or
λ + ρ h, and ρ grows where h did not fall enough (J. Nocedal and S. J. Wright, Numerical
Optimization, 2nd ed., chapter 17). w is the node's share of time, so that the terms are integrals
and keep their meaning when the grid is refined.
"""

from collections.abc import Sequence

import numpy as np

from selfmotion.basics import Array
from selfmotion.constraints import BoundConstraint, NodePartials, NodeTangents
from selfmotion.costs import Samples
from selfmotion.motion import Grid

# A constraint that has not fallen to this share of its last violation gets a larger penalty.
_FALL, _GROWTH, _LARGEST = 0.25, 10.0, 1e8


class _Term:
    """One constraint with its multipliers."""

    def __init__(self, constraint: BoundConstraint) -> None:
        self.constraint = constraint
        self.multipliers: Array | None = None
        self.penalty = 0.0
        self.violation = np.inf

    def shifted(self, h: Array) -> Array:
        """Return λ + ρ h, cut off at 0 for an inequality."""
        multipliers = np.zeros_like(h) if self.multipliers is None else self.multipliers
        shifted = multipliers + self.penalty * h
        return shifted if self.constraint.equality else np.maximum(shifted, 0.0)

    def excess(self, h: Array) -> float:
        """Return the largest violation."""
        return float(np.max(np.abs(h) if self.constraint.equality else h, initial=0.0))


class AugmentedLagrangian:
    """The constraints' part of the function that is minimised.

    Parameters
    ----------
    constraints : sequence of BoundConstraint
    grid : Grid
        Whose nodes the conditions hold at.
    """

    def __init__(self, constraints: Sequence[BoundConstraint], grid: Grid) -> None:
        self._terms = [_Term(constraint) for constraint in constraints]
        self._grid = grid

    def refined(self, grid: Grid) -> "AugmentedLagrangian":
        """Return the same terms on another grid, multipliers interpolated in time."""
        finer = AugmentedLagrangian([term.constraint for term in self._terms], grid)
        for old, new in zip(self._terms, finer._terms, strict=True):
            new.penalty, new.violation = old.penalty, old.violation
            if old.multipliers is not None and len(old.multipliers) > 1:
                new.multipliers = np.stack(
                    [np.interp(grid.nodes, self._grid.nodes, m) for m in old.multipliers.T], axis=1
                )
            else:
                new.multipliers = old.multipliers
        return finer

    def start(self, samples: Samples, cost: float) -> None:
        """Set penalties so that what is violated now weighs ten times the cost."""
        for term in self._terms:
            if term.penalty == 0.0:
                h = term.constraint.residual(samples)
                bad = h if term.constraint.equality else np.maximum(h, 0.0)
                amount = float(np.sum(self._weights(h)[:, None] * bad**2))
                scale = max(abs(cost), 1e-3)
                term.penalty = float(np.clip(20.0 * scale / max(amount, 1e-12), scale, 1e4 * scale))

    def value(self, samples: Samples) -> float:
        """Return what the constraints add to the cost."""
        total = 0.0
        for term in self._terms:
            h = term.constraint.residual(samples)
            multipliers = 0.0 if term.multipliers is None else term.multipliers
            square = term.shifted(h) ** 2 - np.square(multipliers)
            total += float(np.sum(self._weights(h)[:, None] * square)) / (2.0 * term.penalty)
        return total

    def gradient(self, samples: Samples) -> list[NodePartials]:
        """Return the derivatives of `value` at the nodes, one part per active constraint."""
        parts = []
        for term in self._terms:
            h = term.constraint.residual(samples)
            weights = self._weights(h)[:, None] * term.shifted(h)
            if np.any(weights):
                parts.append(term.constraint.pullback(samples, weights))
        return parts

    def curvature(self, samples: Samples, motion: NodeTangents) -> Array:
        """Return the Gauss-Newton matrix Σ w ρ ∂hᵀ∂h over the active conditions, (d, d)."""
        size = motion.q.shape[2]
        total = np.zeros((size, size))
        for term in self._terms:
            h = term.constraint.residual(samples)
            active = term.shifted(h) != 0.0
            if np.any(active):
                rows = term.constraint.tangents(samples, motion)[active]
                weights = np.broadcast_to(self._weights(h)[:, None], h.shape)[active]
                total += term.penalty * (rows.T * weights) @ rows
        return total

    def update(self, samples: Samples) -> bool:
        """Renew multipliers and penalties from the present motion; return whether all is kept."""
        kept = True
        for term in self._terms:
            h = term.constraint.residual(samples)
            excess = term.excess(h)
            if excess <= term.constraint.tolerance:
                term.violation = excess
                continue
            kept = False
            term.multipliers = term.shifted(h)
            if excess > _FALL * term.violation:
                term.penalty = min(_GROWTH * term.penalty, _LARGEST)
            term.violation = excess
        return kept

    @property
    def worst(self) -> float:
        """Largest violation at the last `update`, as a multiple of its tolerance."""
        return max((term.violation / term.constraint.tolerance for term in self._terms), default=0)

    def equalities(self, samples: Samples, motion: NodeTangents) -> tuple[Array, Array]:
        """Return the residuals of all equalities, (C,), and their derivatives, (C, d)."""
        terms = [term.constraint for term in self._terms if term.constraint.equality]
        residuals = [term.residual(samples).ravel() for term in terms]
        size = motion.q.shape[2]
        rows = [term.tangents(samples, motion).reshape(-1, size) for term in terms]
        return np.concatenate([np.zeros(0), *residuals]), np.vstack([np.zeros((0, size)), *rows])

    @property
    def has_equalities(self) -> bool:
        """Whether a constraint is an equality."""
        return any(term.constraint.equality for term in self._terms)

    def violated(self, samples: Samples) -> tuple[str, ...]:
        """Return a message for each constraint that is not kept, on its worst place."""
        messages = []
        for term in self._terms:
            h = term.constraint.residual(samples)
            if term.excess(h) > term.constraint.tolerance:
                size = np.abs(h) if term.constraint.equality else h
                row, column = np.unravel_index(int(np.argmax(size)), h.shape)
                text = term.constraint.describe(samples, int(row), int(column))
                messages.append(f"{term.constraint.name}: {text}")
        return tuple(messages)

    def _weights(self, h: Array) -> Array:
        """Return the nodes' shares of time [s]; 1 for a condition on the whole."""
        if len(h) == 1:
            return np.ones(1)
        steps = np.diff(self._grid.nodes)
        return np.asarray(0.5 * (np.append(steps, 0.0) + np.append(0.0, steps)))
