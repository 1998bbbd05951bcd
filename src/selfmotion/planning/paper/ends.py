"""Conditions on the ends of the motion, eliminated: the remaining minimisation is unconstrained.

With LᵀML = I, where xᵀMx = |z|² + ∫ |ε|² dt of a decision vector, and the right singular vectors of
∂c/∂x L at a reference x̂ split into U, those that the conditions c change along, and V, the others,

    x = x̂ + L (V y + U w),   c(x) = 0,

where Newton's method finds w for a given y. Any optimiser takes the unknowns y: by the implicit
function theorem, with C = ∂c/∂x at x,

    dx/dy = L (V - U (C L U)⁻¹ C L V).

Conditions may follow from others (rest at both ends, and a closed path). On a grid they do so but
for its error: only independent combinations of them are then met to rounding.
"""

import numpy as np

from selfmotion.basics import Array
from selfmotion.planning.optimise import inverse_metric
from selfmotion.planning.paper.objective import Objective, residual_tangents, residuals

# Residual at which conditions are met [rad, rad/s, rad/s²] …
_CLOSED = 1e-11
# … and which counts as rounding on a fine grid.
_MET = 1e-9
# Largest number of Newton steps.
_STEPS = 20
# Halvings of a step where a motion is to be brought to the ends.
_HALVINGS = 10
# Restarts along other combinations there.
_ROUNDS = 3
# Steps above which the reference is far.
_NEAR = 4
# Relative size below which functions of the null motion are dependent.
_FLAT = 1e-12
# Relative change below which combinations of conditions follow from others.
_DEPENDENT = 1e-4


def closed(objective: Objective, x: Array) -> Array:
    """Return a point near `x` that meets the ends, or the nearest to that.

    It is about the nearest one in the metric M, so that it hardly costs more.

    Parameters
    ----------
    objective : Objective
    x : (size,)
        Its cost is finite.
    """
    for _ in range(_ROUNDS):
        x, residual_size, _ = newton(Eliminated(objective, x), x, _HALVINGS)
        if residual_size < _MET:
            break
    return x


class Eliminated:
    """The cost by the unknowns y that conditions on the ends leave; a `Function`.

    It is infinite where Newton's method does not arrive.

    Parameters
    ----------
    objective : Objective
    reference : (size,)
        x̂; its cost is finite.
    """

    def __init__(self, objective: Objective, reference: Array) -> None:
        self._objective, self._reference = objective, reference
        values, vectors = np.linalg.eigh(inverse_metric(_metric(objective), _FLAT))
        root, inward = vectors * np.sqrt(values), (vectors / np.sqrt(values)).T
        rows = residual_tangents(objective, reference) @ root
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        sizes[sizes == 0.0] = 1.0
        left, singular, right = np.linalg.svd(rows / sizes)
        rank = int(np.sum(singular > _DEPENDENT * singular.max(initial=0.0)))
        self._across, self._along = root @ right[:rank].T, root @ right[rank:].T
        self._inward = right[rank:] @ inward
        # Matrix from conditions to independent combinations.
        self._counted = sizes * (left[:, :rank] @ left[:, :rank].T) / sizes.T
        # The last y, its x, residual, and number of steps.
        self._at: Array | None = None
        self._x, self._residual_size, self._taken = reference, np.inf, 0

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self._along.shape[1])

    @property
    def evaluations(self) -> int:
        """See `Function.evaluations`: those of Newton's method are among them."""
        return self._objective.evaluations

    def point(self, y: Array) -> Array:
        """Return x at y, (size of x,), or the nearest to it that Newton's method came to."""
        if self._at is None or not np.array_equal(self._at, y):
            self._at = None
            self._x, self._residual_size, self._taken = newton(
                self, self._reference + self._along @ y
            )
            self._at = y.copy()
        return self._x

    def is_met(self, y: Array) -> bool:
        """Return whether Newton's method converged."""
        self.point(y)
        return self._residual_size < _MET

    def where(self, y: Array) -> tuple[Array, bool]:
        """Return x at y, and whether another reference would be better from there."""
        return self.point(y), self._taken > _NEAR

    def value(self, y: Array) -> float:
        """See `Function.value`."""
        return self._objective.value(self.point(y)) if self.is_met(y) else np.inf

    def gradient(self, y: Array) -> Array:
        """See `Function.gradient`: exact; NaN where the value is infinite."""
        if not self.is_met(y):
            return np.full(len(y), np.nan)
        return np.asarray(self._objective.gradient(self.point(y)) @ self.tangent(y))

    def slope(self, y: Array, direction: Array) -> float:
        """See `Function.slope`."""
        return float(self.gradient(y) @ direction)

    def metric(self, y: Array) -> Array:
        """See `Function.metric`."""
        tangent = self.tangent(y)
        return np.asarray(tangent.T @ self._objective.metric(self.point(y)) @ tangent)

    def tangent(self, y: Array) -> Array:
        """Return dx/dy, (size of x, size)."""
        rows = _rows(self, self.point(y))
        responses = np.linalg.lstsq(rows @ self._across, rows @ self._along)[0]
        return np.asarray(self._along - self._across @ responses)


def to_unknowns(function: Eliminated, inverse_hessian: Array) -> Array:
    """Return an inverse Hessian by x as one by y, near the reference."""
    return np.asarray(function._inward @ inverse_hessian @ function._inward.T)


def from_unknowns(function: Eliminated, y: Array, inverse_hessian: Array) -> Array:
    """Return an inverse Hessian by y as one by x, of the directions that meet the ends."""
    tangent = function.tangent(y)
    return np.asarray(tangent @ inverse_hessian @ tangent.T)


def newton(function: Eliminated, x: Array, halvings: int = 1) -> tuple[Array, float, int]:
    """Return the result of Newton's method along U, its residual, and the number of steps.

    The residual is infinite where there is no motion.
    """
    residual, taken = _residual(function, x), 0
    while taken < _STEPS and _CLOSED <= _size(residual) < np.inf:
        # A motion near breakdown has derivatives that overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            table = _rows(function, x) @ function._across
        if not np.all(np.isfinite(table)):
            break
        step = -function._across @ np.linalg.lstsq(table, residual)[0]
        for halving in range(halvings):
            nearer = x + 0.5**halving * step
            left = _residual(function, nearer)
            # Slow convergence counts as failure.
            if _size(left) < (1.0 - 0.5 ** (halving + 1)) * _size(residual):
                break
        else:
            break
        x, residual, taken = nearer, left, taken + 1
    return x, _size(residual), taken


def _residual(function: Eliminated, x: Array) -> Array:
    count = len(function._counted)
    if not np.isfinite(function._objective.value(x)):
        return np.full(count, np.inf)
    return np.asarray(function._counted @ residuals(function._objective, x))


def _rows(function: Eliminated, x: Array) -> Array:
    return np.asarray(function._counted @ residual_tangents(function._objective, x))


def _metric(objective: Objective) -> Array:
    """Return M, (size, size); null motions are given in orthonormal bases."""
    functions, first = objective.null_motion.functions, objective.start.size
    inner = functions.T @ (objective.grid.weights[:, None] * functions)
    metric = np.eye(objective.size)
    metric[first:, first:] = np.kron(np.eye(objective.null_motion.rows), inner)
    return metric


def _size(residual: Array) -> float:
    return float(np.max(np.abs(residual), initial=0.0))
